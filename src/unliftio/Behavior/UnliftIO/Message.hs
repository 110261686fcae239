-- |
-- "Behavior.Message" in a monad of your own ("Behavior.UnliftIO").
--
-- > run (op a b)  =  Behavior.Message.op (run a) (run b)
--
-- (The two sides are the same for every way to run the monad in 'IO'.) See "Behavior.Message" for what each operator
-- does; what is not a behaviour is that module's own.
module Behavior.UnliftIO.Message
  ( -- * Receiving
    Inbox
  , withInbox
  , namedInbox
  , namedInboxWith

    -- * Handling each message
  , onMessage
  , messageRule
  , handleNext

    -- * In transactions
  , receive
  , unhandled
  , dropped
  ) where

import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)

import Behavior.Message (Inbox, dropped, namedInbox, namedInboxWith, receive, unhandled)
import qualified Behavior.Message as IO
import Behavior.STM (STM)
import Behavior.Signal (Signal)

-- | 'Behavior.Message.withInbox'. The driver's callback is in 'IO'.
--
-- > run (withInbox n f g)  =  Behavior.Message.withInbox n (fmap run . run . f) (run . g)
--
-- @since 0.1.0.0
withInbox :: MonadUnliftIO m => Int -> ((e -> IO ()) -> m (m ())) -> (Inbox e -> m a) -> m a
withInbox size subscribe act = withRunInIO $ \run -> IO.withInbox size (fmap run . run . subscribe) (run . act)

-- | 'Behavior.Message.onMessage'.
--
-- > run (onMessage i f a)  =  Behavior.Message.onMessage i (run . f) (run a)
--
-- @since 0.1.0.0
onMessage :: MonadUnliftIO m => Inbox e -> (e -> m (STM ())) -> m a -> m a
onMessage inbox handle task = withRunInIO $ \run -> IO.onMessage inbox (run . handle) (run task)

-- | 'Behavior.Message.messageRule'.
--
-- > run (messageRule i f)  =  fmap liftIO <$> Behavior.Message.messageRule i (run . f)
--
-- @since 0.1.0.0
messageRule :: MonadUnliftIO m => Inbox e -> (e -> m (STM ())) -> m (Signal Bool, m a)
messageRule inbox handle = withRunInIO $ \run -> fmap liftIO <$> IO.messageRule inbox (run . handle)

-- | 'Behavior.Message.handleNext'.
--
-- > run (handleNext i f)  =  Behavior.Message.handleNext i (run . f)
--
-- @since 0.1.0.0
handleNext :: MonadUnliftIO m => Inbox e -> (e -> m (STM a)) -> m a
handleNext inbox handle = withRunInIO $ \run -> IO.handleNext inbox (run . handle)
