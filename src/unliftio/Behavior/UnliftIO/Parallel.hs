-- |
-- "Behavior.Parallel" in a monad of your own ("Behavior.UnliftIO").
--
-- > run (op a b)  =  Behavior.Parallel.op (run a) (run b)
--
-- (The two sides are the same for every way to run the monad in 'IO'.) See "Behavior.Parallel" for what each operator
-- does; what is not a behaviour is that module's own.
module Behavior.UnliftIO.Parallel
  ( -- * Two
    parallel
  , (|||)
  , both

    -- * Any number
  , firstOf
  , allOf
  , decide
  , agreeing

    -- * Starting more while a behaviour runs
  , scoped
  , fork
  , Nursery

    -- * Which processor they run on
  , pinned
  , unpinned

    -- * The forked behaviour
  , Child
  , await
  , tryAwait
  , requestStop
  , ChildStopped (..)
  ) where

import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)

import Behavior (BehaviorFailed)
import Behavior.Parallel (Child, ChildStopped (..), Nursery, await, tryAwait)
import qualified Behavior.Parallel as IO
import Behavior.UnliftIO (both, parallel, (|||))

-- | 'Behavior.Parallel.firstOf'.
--
-- > run (firstOf as)  =  Behavior.Parallel.firstOf (map run as)
--
-- @since 0.1.0.0
firstOf :: MonadUnliftIO m => [m a] -> m a
firstOf acts = withRunInIO $ \run -> IO.firstOf (map run acts)

-- | 'Behavior.Parallel.allOf'.
--
-- > run (allOf as)  =  Behavior.Parallel.allOf (fmap run as)
--
-- @since 0.1.0.0
allOf :: (Traversable t, MonadUnliftIO m) => t (m a) -> m (t a)
allOf acts = withRunInIO $ \run -> IO.allOf (fmap run acts)

-- | 'Behavior.Parallel.decide'.
--
-- > run (decide f as)  =  Behavior.Parallel.decide (fmap run . f) (map run as)
--
-- @since 0.1.0.0
decide :: MonadUnliftIO m => ([Maybe (Either BehaviorFailed a)] -> Maybe (m b)) -> [m a] -> m b
decide rule acts = withRunInIO $ \run -> IO.decide (fmap run . rule) (map run acts)

-- | 'Behavior.Parallel.agreeing'.
--
-- > run (agreeing m f as)  =  Behavior.Parallel.agreeing m f (map run as)
--
-- @since 0.1.0.0
agreeing :: MonadUnliftIO m => Int -> (a -> a -> Bool) -> [m a] -> m [a]
agreeing m agree acts = withRunInIO $ \run -> IO.agreeing m agree (map run acts)

-- | 'Behavior.Parallel.scoped'.
--
-- > run (scoped f)  =  Behavior.Parallel.scoped (run . f)
--
-- @since 0.1.0.0
scoped :: MonadUnliftIO m => (Nursery -> m a) -> m a
scoped body = withRunInIO $ \run -> IO.scoped (run . body)

-- | 'Behavior.Parallel.fork'.
--
-- > run (fork n a)  =  Behavior.Parallel.fork n (run a)
--
-- @since 0.1.0.0
fork :: MonadUnliftIO m => Nursery -> m a -> m (Child a)
fork nursery act = withRunInIO $ \run -> IO.fork nursery (run act)

-- | 'Behavior.Parallel.requestStop'.
--
-- > run (requestStop c)  =  Behavior.Parallel.requestStop c
--
-- @since 0.1.0.0
requestStop :: MonadIO m => Child a -> m ()
requestStop = liftIO . IO.requestStop

-- | 'Behavior.Parallel.pinned'.
--
-- > run (pinned a)  =  Behavior.Parallel.pinned (run a)
--
-- @since 0.1.0.0
pinned :: MonadUnliftIO m => m a -> m a
pinned act = withRunInIO $ \run -> IO.pinned (run act)

-- | 'Behavior.Parallel.unpinned'.
--
-- > run (unpinned a)  =  Behavior.Parallel.unpinned (run a)
--
-- @since 0.1.0.0
unpinned :: MonadUnliftIO m => m a -> m a
unpinned act = withRunInIO $ \run -> IO.unpinned (run act)
