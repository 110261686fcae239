{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Runs a program of the specification with the library's operators, in the simulator.
module Semantics.Run
  ( observed
  , allObserved

    -- * Runs of which more is observed
  , Instrument (..)
  , observedWith
  ) where

import Control.Concurrent.STM (STM, TVar, newTVarIO, readTVar, retry, throwSTM, writeTVar)
import Control.Exception
  ( Exception (..)
  , SomeException
  , asyncExceptionFromException
  , asyncExceptionToException
  , evaluate
  , mask_
  , throwIO
  )
import Data.Foldable (for_)
import Data.IORef
import Data.List (isPrefixOf)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust)
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Core.Failure
import Behavior.Internal.Seam.Runtime
import Behavior.Message (withInbox)
import Behavior.Parallel (firstOf)
import Behavior.Signal (debounce, hysteresis, polling, staleAfter, throttle, watching)
import qualified Behavior.Signal as Library
import Behavior.Sim
  ( StepKind (Note)
  , SimOptions (endAt, scheduled, timerSlip, livelockLimit)
  , Plan (..)
  , Report (reportComplete)
  , Run (finished, outcome)
  , Schedule
  , Search (Exhaustive)
  , Step (stepTime, stepKind, stepLabel)
  , defaultSimOptions
  , exhaustively
  , explore
  , simulateWith
  )
import qualified Behavior.Sim as Sim
import Language.Operator (Environment (..), Language (..), environmentWith, noEnvironment, run)
import Language.Perform
import Semantics.Path (End (..), Seen (..))
import Semantics.Program

-- | Simulates the world's program under a schedule, and returns what was observed, or the
-- reason why the run had no proper end.
observed :: Schedule -> World -> IO (Either String Seen)
observed how world = do
  (seen, _) <- observedWith plain how world -- without the run, also before it is needed
  pure seen

-- | Likewise, with an instrument; gives the whole run, too.
observedWith :: Instrument position -> Schedule -> World -> IO (Either String Seen, Run Value)
observedWith instrument how world = observing instrument (simulateWith (limits world) {scheduled = how}) world

-- | What is done around the parts of a program, each of which has a position in it.
data Instrument position = Instrument
  { root :: position
  , branchOf :: String -> position -> position
  -- ^ The position in the branch with this label, of the operator with that position.
  , aroundAll :: Behavior Value -> Behavior Value
  , aroundPart :: position -> Program -> (position -> position -> Behavior Value) -> Behavior Value
  -- ^ What runs is a function of its position, and of that within it, if it is an operator.
  , aroundCleanup :: position -> Behavior () -> Behavior ()
  , whenSet :: Condition -> Level -> IO ()
  -- ^ When a condition has changed.
  , ofSignal :: Maybe Condition -> Library.Signal Int -> Library.Signal Int
  -- ^ For the whole signal of an operator (but of withShared), and for each condition.
  }

-- | Nothing is done around anything.
plain :: Instrument ()
plain =
  Instrument
    { root = ()
    , branchOf = \_ _ -> ()
    , aroundAll = id
    , aroundPart = \_ _ runs -> runs () ()
    , aroundCleanup = const id
    , whenSet = \_ _ -> pure ()
    , ofSignal = const id
    }

-- | Simulates the world's program under all schedules with up to the given number of
-- pre-emptions, but under no more schedules than the second number. Returns all that was
-- observed, and whether those were all the schedules.
allObserved :: Int -> Int -> World -> IO (Set (Either String Seen), Bool)
allObserved preemptions most world = do
  found <- newIORef Set.empty
  let plan = (exhaustively preemptions) {planSearch = Exhaustive preemptions most, planOptions = limits world}
  report <- explore plan $ \simulated ->
    observing plain simulated world >>= \(seen, _) -> modifyIORef' found (Set.insert seen)
  everySeen <- readIORef found
  pure (everySeen, reportComplete report)

-- | A run without an end is cut short.
limits :: World -> SimOptions
limits world = defaultSimOptions {livelockLimit = 20000, endAt = 60, timerSlip = fromIntegral (slippage world)}

observing :: Instrument position -> (Behavior Value -> IO (Run Value)) -> World -> IO (Either String Seen, Run Value)
observing instrument simulated world = do
  emittedRef <- newIORef []
  -- The steps of the run have the times of the transitions.
  let emit transition = modifyIORef' emittedRef (transition :) >> annotate (show transition)
  ran <- simulated (aroundAll instrument (behavior instrument emit world))
  emitted <- reverse <$> readIORef emittedRef
  let record = recorded (Sim.steps ran) emitted
      seen e = Right Seen {timeline = record, end = e}
      returnedWith = seen . Gave (ticks (finished ran))
  fmap (\it -> (it, ran)) . evaluated $ case outcome ran of
    Sim.Returned value -> returnedWith (Succeeded value)
    Sim.Threw e -> returnedWith (thrown e)
    Sim.OutOfTime _ -> seen (Unknown (ticks (finished ran)))
    Sim.Deadlock _ -> seen (Unknown (ticks (finished ran)))
    Sim.Livelock labels _ -> Left ("livelock: " ++ show labels)
    Sim.BlockedOutside thread _ -> Left ("blocked outside: " ++ show thread)
    Sim.ExternalWakeup waiting -> Left ("external wakeup: " ++ show waiting)
    Sim.TooSlow thread _ -> Left ("too slow: " ++ show thread)
    Sim.ScheduleMismatch why -> Left ("schedule mismatch: " ++ why)
 where
  -- Evaluated, so that it does not keep the whole run in memory.
  evaluated whole = whole <$ evaluate (whole == whole)
  ticks = round
  recorded (s : others) transitions = case (stepKind s, transitions) of
    (Note text, transition : later)
      | text == show transition -> (ticks (stepTime s), transition) : recorded others later
    -- The relation has the ends of branches only.
    (Sim.Ends, _)
      | isBranch (stepLabel s) -> (ticks (stepTime s), IsOver (show (stepLabel s))) : recorded others transitions
    _ -> recorded others transitions
  recorded [] _ = []
  isBranch (Label _ name) = name `notElem` ["", "polling", "clock", "watcher"] && name `notElem` filters
  filters = ["staleAfter", "debounce", "debounce clock", "throttle", "hysteresis"]

-- | What a program runs with: the conditions, and the number of calls of each action.
data Context = Context
  { levels :: Map Condition (TVar Level)
  , calls :: IORef (Map Name Int)
  , deliver :: Behavior ()
  }

-- | The world's program and environment. The given action receives each transition; it must
-- not be a scheduling point.
behavior :: Instrument position -> (Transition -> IO ()) -> World -> Behavior Value
behavior instrument emit world = withMessages $ \delivers whole -> do
  context <- Context <$> traverse newTVarIO (Map.fromList (conditions world)) <*> newIORef Map.empty <*> pure delivers
  let running within = runPart (language instrument emit context) whole within (program world)
  case caller world of
    Operator -> aroundPart instrument (root instrument) (FirstOf [program world]) $ \_ within ->
      firstOf [running (branchOf instrument "firstOf: 1" within), timeIsUp <$ environment context]
    PlainThread exceptionKind later -> do
      thread <-
        mask_ (start (Label "plain thread" "") (running (branchOf instrument "plain thread" (root instrument))))
      let interrupting = case exceptionKind of
            Asynchronous -> throwToAll (const Enough) [threadId thread]
            Synchronous -> throwToAll (const EnoughOfThis) [threadId thread]
      environment context
      interrupting
      sleepUntil (fromIntegral (cancelAt world + later))
      interrupting
      atomically (threadEnd thread) >>= either throwIO pure
 where
  environment context = do
    for_ (changes world) $ \(Change when condition level) -> do
      sleepUntil (fromIntegral when)
      for_ (Map.lookup condition (levels context)) $ \var ->
        atomically (writeTVar var level) >> whenSet instrument condition level
      emit (condition `Becomes` level)
    sleepUntil (fromIntegral (cancelAt world))
  -- (To close the inbox is a step.)
  withMessages act
    | usesMessages (program world) = do
        driver <- newIORef (\() -> pure ())
        withInbox roomForMessages (\delivers -> pure () <$ writeIORef driver delivers) $
          act (readIORef driver >>= \delivers -> delivers ()) . environmentWith
    | otherwise = act (pure ()) noEnvironment

-- | How the parts of a program run.
language :: Instrument position -> (Transition -> IO ()) -> Context -> Language position Signal Program Value
language instrument emit context = this
 where
  this =
    Language
      { runPart = \around here p -> aroundPart instrument here p (part around p)
      , inBranch = branchOf instrument
      , signalOf = level
      , reactsTo = ofSignal instrument Nothing
      , tick = 1
      , results = maybe Unit Several
      }
  part around p outer own = case p of
    Do name scripts -> do
      checkpoint
      n <- atomicModifyIORef' (calls context) $ \counts ->
        let n = Map.findWithDefault 0 name counts in (Map.insert name (n + 1) counts, n)
      perform (acting outer) name (scripts !! min n (length scripts - 1))
    Pure value -> pure value
    Sleep n -> Unit <$ sleep (fromIntegral n)
    Deliver -> Unit <$ deliver context
    Op o -> run this around outer own o
  acting here =
    Acting
      { -- Zero ticks are a scheduling point, too: other threads can interrupt this one there, or
        -- run before it.
        wait = \n -> if n > 0 then sleep (fromIntegral n) else checkpoint
      , isStopRequest = isStop
      , observe = \name -> emit . Action name
      , inCleanup = aroundCleanup instrument here
      }
  level around sensor = \case
    Watched condition -> ofSignal instrument (Just condition) (watching (reading condition))
    Polled every p -> number <$> polling (fromIntegral every) (runPart this around sensor p)
    And a b -> (\m n -> fromEnum (holds m && holds n)) <$> level around sensor a <*> level around sensor b
    Hysteresis initially low high signal -> fromEnum <$> hysteresis initially low high (level around sensor signal)
    Debounce n signal -> debounce (fromIntegral n) (level around sensor signal)
    Throttle n signal -> throttle (fromIntegral n) (level around sensor signal)
    StaleAfter n signal -> staleAfter (fromIntegral n) (level around sensor signal)
    Shared -> nearest around
  reading :: Condition -> STM Int
  reading condition = case Map.lookup condition (levels context) of
    Nothing -> retry
    Just var ->
      readTVar var >>= \case
        At n -> pure n
        NoValue -> retry
        ThrowsFailure -> throwSTM (Failure condition)
        ThrowsFault -> throwSTM (Fault condition)

-- | An exception that the run ended with, as a result.
thrown :: SomeException -> Result
thrown e
  | Just (StoppedWithFault _ fault) <- fromException e = Stopped (Just (show fault))
  | isStop e = Stopped Nothing
  | Just (BehaviorFailed _ failure) <- fromException e = FailedWith (withoutNames (show failure))
  | otherwise = FaultedWith (show e)

-- | The text of a failure; the relation does not name the signals of a condition.
withoutNames :: String -> String
withoutNames text = if (init doesNotHold ++ ": ") `isPrefixOf` text then doesNotHold else text

-- | Whether the exception stops the program; those of a 'PlainThread' do, of either type.
isStop :: SomeException -> Bool
isStop e = isCancellation e || isJust (fromException e :: Maybe EnoughOfThis)

-- | The exceptions that are thrown to a 'PlainThread', of an asynchronous and a synchronous
-- type.
data Enough = Enough
  deriving (Show)

data EnoughOfThis = EnoughOfThis
  deriving (Show)

instance Exception EnoughOfThis

instance Exception Enough where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException
