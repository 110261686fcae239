{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Messages from drivers: a bounded queue, and how a message interrupts a task.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Reactive.Inbox
  ( Inbox
  , withInbox
  , namedInbox
  , namedInboxWith
  , onMessage
  , messageRule
  , handleNext
  , deliver
  , receive
  , unhandled
  , dropped
  ) where

import Control.Concurrent.STM (STM, TVar, check, modifyTVar', newTVarIO, readTVar, retry, writeTVar)
import Control.Exception (ErrorCall (..), bracket, finally, mask, onException, throwIO)
import Control.Monad (forever, unless, when)
import Data.Foldable (for_, traverse_)
import Data.List.NonEmpty (NonEmpty (..))
import qualified Data.List.NonEmpty as NonEmpty
import Data.Sequence (Seq, ViewL (..), viewl, (<|), (|>))
import qualified Data.Sequence as Seq

import Behavior.Internal.Concurrent.Scope (branch, endedBy, outcome, structured)
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Reactive.Engine (Next (..), Response (..), react)
import Behavior.Internal.Seam.Runtime (atomically, simulatedRun)
import Behavior.Internal.Signal.Source (Signal, named, watching)
import qualified Behavior.Internal.Spans.Span as Span

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.STM (STM, newTVarIO, modifyTVar', readTVarIO)
-- >>> import Control.Concurrent (forkIO)
-- >>> import Data.Foldable (for_)

-- | The messages that a driver has delivered and that nothing has taken yet, oldest first. When more
-- wait than its capacity, the oldest is dropped, and counted.
--
-- @since 0.1.0.0
data Inbox e = Inbox
  { capacity :: !Int
  , queue :: !(TVar (Seq (Message e)))
  -- ^ At most 'capacity' messages; their numbers increase.
  , handling :: !(NonEmpty (TVar Int))
  -- ^ How many messages that were taken through this handle of the inbox are being handled; then the same
  -- for the handles that this one was made from.
  , nextNumber :: !(TVar Int)
  , droppedCount :: !(TVar Int)
  , isOpen :: !(TVar Bool)
  , openedIn :: !(Maybe Int)
  -- ^ The number of the simulation that it was opened in; 'Nothing' in reality.
  , called :: !(Maybe (String, e -> String))
  -- ^ For traces: its name, and the text of a message.
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
--   is refused with an 'ErrorCall' (a fault). So is handling a message in a simulation that runs inside of the
--   behaviour.
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
  messages <- newTVarIO Seq.empty
  inbox <-
    Inbox size messages
      <$> (pure <$> newTVarIO 0)
      <*> newTVarIO 0
      <*> newTVarIO 0
      <*> newTVarIO True
      <*> thisRun
      <*> pure Nothing
  let close = atomically (writeTVar (isOpen inbox) False)
  bracket (subscribe (atomically . deliver inbox)) (close `finally`) (\_ -> behavior inbox)

-- | Gives the inbox a name. In a trace ("Behavior.Trace"), the handling of each message is a span: from when the
-- message is taken to its commit, with the name of the inbox and the text of the message.
--
-- > namedInbox name  =  namedInboxWith name show
--
-- >>> import Behavior.Trace (withTrace)
-- >>> let orders deliver = pure () <$ deliver "tea"
-- >>> withTrace [] . withInbox 10 orders $ \inbox -> handleNext (namedInbox "order" inbox) (\_ -> failWith "spilt")
-- *** Exception: order: "tea": FailedBecause "spilt"
--
-- @since 0.1.0.0
namedInbox :: Show e => String -> Inbox e -> Inbox e
namedInbox name = namedInboxWith name show

-- | 'namedInbox', with a function for the text of a message. What is said of texts at
-- 'Behavior.Signal.namedWith' holds here too.
--
-- >>> let camera deliver = pure () <$ deliver ("cat", [0x89, 0x50 :: Int])
-- >>> withInbox 10 camera $ \inbox -> handleNext (namedInboxWith "seen" fst inbox) (pure . pure . fst)
-- "cat"
--
-- @since 0.1.0.0
namedInboxWith :: String -> (e -> String) -> Inbox e -> Inbox e
namedInboxWith name render inbox = inbox {called = Just (name, render)}

-- | Runs the task; whenever a message waits, stops the task, handles the message, and begins again.
--
-- > onMessage inbox handle task  =  monitor ((> 0) <$> watching (unhandled inbox)) (handleNext inbox handle) task
-- >   -- if nothing else takes messages from the inbox
--
-- The handler does the part that takes time, in 'IO', and returns a transaction. That transaction and
-- the removal of the message are one step. So each message's transaction is committed /exactly once/
-- (unless the message is dropped), and the handler's 'IO' runs /at least once/, whatever interrupts it.
-- If the handler was interrupted, failed or faulted, the message waits again, in its old place. (If the
-- inbox has become full meanwhile, the message is dropped, as the oldest.) While a message is handled
-- it does not count towards the inbox's capacity.
--
-- As with 'Behavior.Signal.monitor' the task is stopped first, and restarts from its beginning. (To go
-- on where it was, use 'Behavior.resumable' in the task.) Only the caller can interrupt the
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
onMessage inbox handle task = do
  reachable "onMessage" inbox
  react "onMessage" [False, True] someWait $ \case
    True -> RunToEnd "handler" (BeginAgain <$ handleIfAny)
    False -> Run "task" task
 where
  someWait = (> 0) <$> counting "waiting" inbox (queued inbox)
  -- (Something else may have taken it meanwhile.)
  handleIfAny = mask $ \restore -> atomically (tryTake inbox) >>= traverse_ (handleTaken inbox (restore . handle))

-- | The handling of messages as one of the ordered rules of 'Behavior.Signal.teleoReactive':
--
-- > rule <- messageRule inbox handle
-- > teleoReactive [(danger, flee), rule, (pure True, patrol)]
--
-- Its condition holds while a message waits or is being handled by this rule. Its behaviour handles one
-- message after the other, and does not return. What is said of the handler at 'onMessage' holds here too:
-- even if an earlier rule interrupts this one, each message's transaction is committed exactly once. A later
-- rule runs when all messages have been handled, or are being handled elsewhere.
--
-- >>> danger <- newTVarIO True
-- >>> let orders deliver = pure () <$ for_ ["tea", "milk"] deliver
-- >>> let flee = putStrLn "flee" >> atomically (writeTVar danger False) >> forever (sleep 1)
-- >>> let serve order = putStrLn ("serve " ++ order) >> pure (pure ())
-- >>> :{
-- withInbox 10 orders $ \inbox -> do
--   rule <- messageRule inbox serve
--   Signal.teleoReactive [(Signal.watching (readTVar danger), flee), rule, (pure True, putStrLn "patrol")]
-- :}
-- flee
-- serve tea
-- serve milk
-- patrol
--
-- (A rule that you make of 'unhandled' and 'handleNext' returns when a message has been handled, and so ends
-- 'Behavior.Signal.teleoReactive', as every rule that returns does.)
--
-- @since 0.1.0.0
messageRule :: Inbox e -> (e -> Behavior (STM ())) -> Behavior (Signal Bool, Behavior a)
messageRule inbox handle = do
  reachable "messageRule" inbox
  here <- newTVarIO 0
  let ours = inbox {handling = here :| NonEmpty.toList (handling inbox)}
  pure ((> 0) <$> counting "unhandled" inbox (unhandled ours), forever (someWaits >> inBranch (handleNext ours handle)))
 where
  someWaits = atomically (queued inbox >>= check . (> 0))
  -- A handler that completes although its stop was requested does not keep the rule from being stopped.
  inBranch act = structured "messageRule" $ \scope ->
    branch scope "handler" act >>= fmap (endedBy "handler") . atomically . outcome

-- | Waits for a message, and handles it: one message, once.
--
-- > handleNext inbox handle  ~  atomically (receive inbox) >>= handle >>= atomically
-- >   -- but only the last of these transactions takes the message away for good
--
-- [Result] That of the transaction.
-- [Failure, fault] Of the handler or the transaction: thrown; the message waits again.
-- [Cancellation] Passes through; the message waits again. The handler runs in the caller's thread
--   and masking state; the transaction is committed masked, and can be interrupted while it retries.
--
-- If an effect outside of variables must not be repeated, make it the last step of the handler, mask it, and
-- do nothing that blocks after it. Then nothing comes between the effect and the commit:
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
handleNext inbox handle = mask $ \restore -> do
  reachable "handleNext" inbox
  atomically (tryTake inbox >>= maybe retry pure) >>= handleTaken inbox (restore . handle)

-- | Refuses an inbox that was opened in another run. (Around a simulation its driver delivers in real time: in virtual
-- time nothing would come, and a test of that would pass.)
reachable :: String -> Inbox e -> IO ()
reachable operator inbox = do
  here <- thisRun
  unless (here == openedIn inbox) . throwIO . ErrorCall $
    operator ++ ": this inbox was opened in another run, so its driver does not deliver in this one; open it inside of \
    \the simulation: simulate (withInbox ...)"

-- | The number of the simulation that the thread is part of.
thisRun :: IO (Maybe Int)
thisRun = fmap fst <$> simulatedRun

-- | Handles a message that was taken. Call it masked: nothing may come between the taking and
-- this, or between the handler's end and the commit.
handleTaken :: Inbox e -> (e -> Behavior (STM a)) -> Message e -> Behavior a
handleTaken inbox handle message@(Message _ e) =
  maybe id (\(name, render) -> Span.named (name ++ ": " ++ render e)) (called inbox) $
    (handle e >>= \commit -> atomically (commit <* isHandled))
      `onException` atomically (isHandled >> putBack inbox message)
 where
  isHandled = for_ (handling inbox) (`modifyTVar'` subtract 1)

-- | Takes the oldest message; retries while there is none.
--
-- If the behaviour is interrupted after this, the message is lost; with 'handleNext' and 'onMessage' it is not.
-- So do not use it in the rules of a 'Behavior.Signal.teleoReactive': when the last message has been taken, the
-- rule's condition no longer holds.
--
-- @since 0.1.0.0
receive :: Inbox e -> STM e
receive inbox = takeOldest inbox >>= maybe retry (\(Message _ e) -> pure e)

-- | How many messages are not handled yet: those that wait, and those that are being handled until their
-- transaction is committed. (What was taken by 'receive', or dropped, does not count.)
--
-- > waitUntil ((== 0) <$> watching (unhandled inbox))     -- all messages have been handled
--
-- >>> let orders deliver = pure () <$ for_ ["tea", "milk"] deliver
-- >>> withInbox 10 orders $ \inbox -> handleNext inbox (\_ -> pure <$> atomically (unhandled inbox))
-- 2
--
-- @since 0.1.0.0
unhandled :: Inbox e -> STM Int
unhandled inbox = (+) <$> queued inbox <*> readTVar (NonEmpty.head (handling inbox))

-- | How many messages wait.
queued :: Inbox e -> STM Int
queued inbox = Seq.length <$> readTVar (queue inbox)

-- | A number of messages as a signal. Its name in a trace is that of the inbox, with a word for which they are.
counting :: String -> Inbox e -> STM Int -> Signal Int
counting which inbox = named (maybe "messages" fst (called inbox) ++ " " ++ which) . watching

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

-- | Puts back a message that was taken: behind those that are older.
putBack :: Inbox e -> Message e -> STM ()
putBack inbox message@(Message number _) = do
  modifyTVar' (queue inbox) $ \messages ->
    let (older, newer) = Seq.spanl (\(Message n _) -> n < number) messages
     in older <> (message <| newer)
  dropOldest inbox

-- | Drops the oldest message if there are more than the inbox has room for.
dropOldest :: Inbox e -> STM ()
dropOldest inbox = do
  n <- queued inbox
  when (n > capacity inbox) $ do
    modifyTVar' (queue inbox) (Seq.drop 1)
    modifyTVar' (droppedCount inbox) (+ 1)

-- | Takes the oldest message, if there is one, in order to handle it.
tryTake :: Inbox e -> STM (Maybe (Message e))
tryTake inbox = takeOldest inbox >>= traverse (\message -> message <$ for_ (handling inbox) (`modifyTVar'` (+ 1)))

-- | Takes the oldest message, if there is one.
takeOldest :: Inbox e -> STM (Maybe (Message e))
takeOldest inbox =
  readTVar (queue inbox) >>= \messages -> case viewl messages of
    EmptyL -> pure Nothing
    message :< newer -> Just message <$ writeTVar (queue inbox) newer
