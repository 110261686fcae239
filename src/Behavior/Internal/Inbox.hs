{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Messages from drivers: a bounded queue, and how a message interrupts a task.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Inbox
  ( Inbox
  , withInbox
  , onMessage
  , handleNext
  , receive
  , waiting
  , dropped
  ) where

import Control.Concurrent.STM (STM, TVar, modifyTVar', newTVarIO, readTVar, retry, writeTVar)
import Control.Exception (ErrorCall (..), bracket, finally, mask, onException, throwIO)
import Control.Monad (when)
import Data.Foldable (traverse_)
import Data.Sequence (Seq, ViewL (..), viewl, (<|), (|>))
import qualified Data.Sequence as Seq

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Reactive.Engine (Next (..), Reaction (..), react)
import Behavior.Internal.Runtime (atomically)
import Behavior.Internal.Signal.Source (named, watching)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM (STM, newTVarIO, modifyTVar', readTVarIO)
-- >>> import Control.Concurrent (forkIO)
-- >>> import Data.Foldable (for_)

-- | The messages that a driver has delivered and that nothing has taken yet, oldest first. When
-- there are more than its capacity, the oldest is dropped, and counted.
--
-- @since 0.1.0.0
data Inbox e = Inbox
  { capacity :: !Int
  , queue :: !(TVar (Seq (Message e)))
  -- ^ At most 'capacity' messages; their numbers increase.
  , nextNumber :: !(TVar Int)
  , droppedCount :: !(TVar Int)
  , isOpen :: !(TVar Bool)
  }

-- | A message, and its number in the order of delivery.
data Message e = Message !Int e

-- | Subscribes to a driver that delivers messages by calling back, and runs the behaviour with the
-- inbox in which they arrive.
--
-- > withInbox capacity subscribe behavior
--
-- The driver is given as a function that takes the callback, begins the subscription, and returns
-- the action that ends it (@pure ()@ if nothing can). Callbacks may come from any thread. They never
-- block: when the inbox is full, the oldest message is dropped and counted ('dropped'). With
-- capacity 1 only the latest message is kept.
--
-- [Result] The behaviour's.
-- [Failure, fault] Of the behaviour, the subscription, or its end: thrown. A capacity of less than 1
--   is refused with an 'ErrorCall' (a fault).
-- [Cancellation] Passes through. Whatever happens, the subscription is ended; what the driver
--   delivers from then on is ignored. The subscription begins and ends as in
--   'Control.Exception.bracket': masked.
--
-- >>> let camera deliver = pure () <$ for_ ["door", "person", "cat"] deliver
-- >>> withInbox 2 camera $ \inbox -> atomically ((,,) <$> receive inbox <*> receive inbox <*> dropped inbox)
-- ("person","cat",1)
--
-- @since 0.1.0.0
withInbox :: Int -> ((e -> IO ()) -> IO (IO ())) -> (Inbox e -> Behavior a) -> Behavior a
withInbox size subscribe behavior = do
  when (size < 1) . throwIO . ErrorCall $
    "withInbox: an inbox has room for at least 1 message, not " ++ show size
  inbox <- Inbox size <$> newTVarIO Seq.empty <*> newTVarIO 0 <*> newTVarIO 0 <*> newTVarIO True
  let close = atomically (writeTVar (isOpen inbox) False)
  bracket (subscribe (atomically . deliver inbox)) (close `finally`) (\_ -> behavior inbox)

-- | Runs the task; whenever there is a message, stops the task, has the message handled, and begins
-- again.
--
-- > onMessage inbox handle task  =  monitor ((> 0) <$> watching (waiting inbox)) (handleNext inbox handle) task
-- >   -- if nothing else takes messages from the inbox
--
-- The handler does what takes time, and returns a transaction. That transaction and the removal of
-- the message are one step: whatever interrupts the handler, each message's transaction is committed
-- /exactly once/ (unless the message is dropped), and the handler's 'IO' before it runs /at least
-- once/: a message whose handler was interrupted, failed or faulted waits again, in its old place (in
-- an inbox that has become full it is the oldest, and is dropped). While it is handled it does not
-- count towards the inbox's capacity.
--
-- As with 'Behavior.Signal.monitor' the task is stopped first, and restarts from its beginning
-- (what must go on where it was, uses 'Behavior.STM.resumable'). Only the caller can interrupt the
-- handler: a message waits for the one before it. The handler's result, failure, fault and
-- cancellation are those of the recovery in 'Behavior.Signal.monitor'. The transaction is committed
-- with exceptions masked; while it retries it can be interrupted.
--
-- >>> done <- newTVarIO ([] :: [String])
-- >>> let orders deliver = pure () <$ for_ ["tea", "milk"] deliver
-- >>> let serve order = putStrLn ("serve " ++ order) >> pure (modifyTVar' done (order :))
-- >>> withInbox 10 orders $ \inbox -> onMessage inbox serve (putStrLn "tidy up")
-- serve tea
-- serve milk
-- tidy up
-- >>> readTVarIO done
-- ["milk","tea"]
--
-- @since 0.1.0.0
onMessage :: Inbox e -> (e -> Behavior (STM ())) -> Behavior a -> Behavior a
onMessage inbox handle task = react "onMessage" ((> 0) <$> named "messages waiting" (watching (waiting inbox))) $ \case
  True -> RunToEnd "handler" (BeginAgain <$ handleIfAny)
  False -> Run "task" task
 where
  -- (Something else may have taken it meanwhile.)
  handleIfAny = mask $ \restore -> atomically (tryTake inbox) >>= traverse_ (handling inbox (restore . handle))

-- | Waits for a message, and has it handled: once.
--
-- > handleNext inbox handle  ~  atomically (receive inbox) >>= handle >>= atomically
-- >   -- but the message is taken by the last of these transactions, whatever interrupts it
--
-- [Result] That of the transaction.
-- [Failure, fault] Of the handler or the transaction: thrown; the message waits again.
-- [Cancellation] Passes through; the message waits again. The handler runs in the caller's thread
--   and masking state; the transaction is committed masked, and can be interrupted while it retries.
--
-- An effect outside of variables which must not be repeated, is the last step, does not block after its
-- effect, and is masked, so that nothing comes between it and the commit:
--
-- > mask $ \restore -> handleNext inbox (\order -> restore (carry order) >> handOver order >> pure (pure ()))
--
-- >>> let orders deliver = pure () <$ for_ ["tea", "milk"] deliver
-- >>> let serve order = if order == "tea" then failWith "no tea" else pure (pure order)
-- >>> withInbox 10 orders $ \inbox -> (handleNext inbox serve ? pure "sorry") >> atomically (receive inbox)
-- "tea"
--
-- @since 0.1.0.0
handleNext :: Inbox e -> (e -> Behavior (STM a)) -> Behavior a
handleNext inbox handle = mask $ \restore ->
  atomically (takeOldest inbox) >>= handling inbox (restore . handle)

-- | Has a message handled that was taken. Call it masked: nothing may come between the taking and
-- this, or between the handler's end and the commit.
handling :: Inbox e -> (e -> Behavior (STM a)) -> Message e -> Behavior a
handling inbox handle message@(Message _ e) =
  (handle e >>= atomically) `onException` atomically (putBack inbox message)

-- | Takes the oldest message; retries while there is none.
--
-- A behaviour that is interrupted after this has lost the message: 'handleNext' and 'onMessage' do not.
--
-- @since 0.1.0.0
receive :: Inbox e -> STM e
receive inbox = (\(Message _ e) -> e) <$> takeOldest inbox

-- | How many messages wait: those that are neither taken, nor dropped, nor being handled.
-- @'Behavior.Signal.watching' (waiting inbox)@ is a signal.
--
-- @since 0.1.0.0
waiting :: Inbox e -> STM Int
waiting inbox = Seq.length <$> readTVar (queue inbox)

-- | How many messages were dropped because the inbox was full.
--
-- @since 0.1.0.0
dropped :: Inbox e -> STM Int
dropped = readTVar . droppedCount

-- | Adds a new message, unless the inbox is closed.
deliver :: Inbox e -> e -> STM ()
deliver inbox e = readTVar (isOpen inbox) >>= \open -> when open $ do
  number <- readTVar (nextNumber inbox)
  writeTVar (nextNumber inbox) $! number + 1
  modifyTVar' (queue inbox) (|> Message number e)
  dropOldest inbox

-- | Puts a message back that was taken: behind those that are older.
putBack :: Inbox e -> Message e -> STM ()
putBack inbox message@(Message number _) = do
  modifyTVar' (queue inbox) $ \messages ->
    let (older, newer) = Seq.spanl (\(Message n _) -> n < number) messages
     in older <> (message <| newer)
  dropOldest inbox

-- | Drops the oldest message if there are more than the inbox has room for.
dropOldest :: Inbox e -> STM ()
dropOldest inbox = do
  n <- waiting inbox
  when (n > capacity inbox) $ do
    modifyTVar' (queue inbox) (Seq.drop 1)
    modifyTVar' (droppedCount inbox) (+ 1)

takeOldest :: Inbox e -> STM (Message e)
takeOldest inbox = tryTake inbox >>= maybe retry pure

-- | Takes the oldest message, if there is one.
tryTake :: Inbox e -> STM (Maybe (Message e))
tryTake inbox =
  readTVar (queue inbox) >>= \messages -> case viewl messages of
    EmptyL -> pure Nothing
    message :< newer -> Just message <$ writeTVar (queue inbox) newer
