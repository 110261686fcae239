{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The paper's 'rSelect' and 'monitor', on a polled test. They are the operators of
-- "Behavior.Signal" on a polled signal; so this spec has the laws, each promise once, and
-- a caller that is cancelled in every phase.
module Behavior.PolledSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (for_)
import Data.List (nub)
import qualified System.Timeout
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Internal.Seam.Runtime (Label (..), atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (now, timeout)
import Support hiding (Failure)
import Watched

spec :: Spec
spec = guarded $ do
  describe "Laws" laws
  describe "rSelect and monitor" common
  describe "rSelect" selecting
  describe "monitor" monitoring
  describe "A caller that is cancelled" cancelled

laws :: Spec
laws = do
  prop "rSelect (pure True) l r is l" $ \l r ->
    (\n -> rSelect (pure True) (play n l) (play n r)) `sameAs` (`play` l)
  prop "rSelect (pure False) l r is r" $ \l r ->
    (\n -> rSelect (pure False) (play n l) (play n r)) `sameAs` (`play` r)
  prop "monitor (pure False) r t is t" $ \r t ->
    (\n -> monitor (pure False) (void (play n r)) (play n t)) `sameAs` (`play` t)
  prop "rSelect is Signal.rSelect on a polled signal" $ \test l r ->
    let with select n = select (even <$> play n test) (play n l) (play n r)
     in with rSelect `sameAs` with (Signal.rSelect . Signal.polling 0.01)
  prop "monitor is Signal.monitor on a polled signal" $ \test r t ->
    let with monitors n = do
          -- The test holds at most once; otherwise this might not end.
          once <- newTVarIO True
          let holds = do
                first <- atomically (readTVar once <* writeTVar once False)
                if first then even <$> play n test else pure False
          monitors holds (void (play n r)) (play n t)
     in with monitor `sameAs` with (Signal.monitor . Signal.polling 0.01)

-- | Either operator, with a test that is true while the first behaviour may run.
eitherOperator :: [(String, Behavior Bool -> Behavior () -> Behavior () -> Behavior ())]
eitherOperator = [("rSelect", rSelect), ("monitor", \test main other -> monitor (not <$> test) other main)]

common :: Spec
common = for_ eitherOperator $ \(name, run) -> do
  it (name ++ " reads its test before anything starts") $ do
    entries <- newLog
    entered <- newGate
    release <- newGate
    let test = open entered >> pass release >> note entries "read" >> pure True
    withThread (run test (note entries "main") (note entries "other")) $ \caller -> do
      pass entered
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    -- (It may be read again before that starts.)
    nub <$> notes entries `shouldReturn` ["read", "main"]

  it (name ++ " reads its test repeatedly, at least 10 ms apart") $ do
    times <- newLog
    let test = True <$ (now >>= note times)
    since <- now
    withThread (run test hang (pure ())) $ \_ -> eventually ((>= 6) . length <$> notes times)
    began <- notes times
    zip [0 ..] began `shouldSatisfy` all (\(n, t) -> t - since >= fromIntegral (n :: Int) * 0.01)

  it (name ++ " never runs both behaviours at the same time, and each time the one that the test selects") $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO True
    runningBranch <- newTVarIO Nothing
    let branch own = inside occupancy $ atomically (writeTVar runningBranch (Just own)) >> hang
    withThread (run (readTVarIO condition) (branch True) (branch False)) $ \_ ->
      -- 'monitor' does not end its recovery for a test that changes.
      for_ (take (if name == "monitor" then 1 else 10) (cycle [False, True])) $ \holds -> do
        atomically (writeTVar condition holds)
        atomically (readTVar runningBranch >>= check . (== Just holds))
    mostInside occupancy `shouldReturn` 1

  it (name ++ " keeps the result of a behaviour that completed although its stop was requested") $ do
    entries <- newLog
    entered <- newGate
    let main = void (onStop Completing "main" (open entered >> hang)) >> note entries "main"
    run (not <$> opened entered) main (note entries "other")
    notes entries `shouldReturn` ["main"]

  for_
    [ ("fails", throwIO Failed, FailedWith "Failed")
    , ("faults", throwIO (Fault "bug"), FaultedWith (show (Fault "bug")))
    ]
    $ \(manner, act, end) ->
        it (name ++ " does not treat as false a test that " ++ manner) $ do
          entries <- newLog
          entered <- newGate
          let test = opened entered >>= \isEntered -> if isEntered then act else pure True
              main = (open entered >> hang) `onException` note entries "main is over"
          ending (run test main (note entries "other")) `shouldReturn` end
          notes entries `shouldReturn` ["main is over"]

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it (name ++ " runs test and behaviours unmasked for a caller that is " ++ state) $ do
        states <- newLog
        entered <- newGate
        recovered <- newGate
        let noting = getMaskingState >>= note states
            test = noting >> ((||) . not <$> opened entered <*> opened recovered)
            main = noting >> opened entered >>= \again -> unless again (open entered >> hang)
            other = noting >> open recovered
        masked (run test main other)
        notes states >>= (`shouldSatisfy` \known -> length known > 3 && all (== Unmasked) known)

  it (name ++ " is cancelled, and does not fail, under a failingOn for every exception") $ do
    entries <- newLog
    entered <- newGate
    let everything = failingOn (\(_ :: SomeException) -> True)
        act = everything (run (pure True) (open entered >> hang) (pure ())) ? note entries "went on"
    cancelling act (pass entered) `shouldReturn` CancelledBy (show (Cancel "the caller"))
    ending (timeout 0.001 (everything (run (pure True) hang (pure ())) ? note entries "went on"))
      `shouldReturn` FailedWith "TimedOut 0.001"
    System.Timeout.timeout 1000 (everything (run (pure True) hang (pure ())) ? note entries "went on")
      `shouldReturn` Nothing
    notes entries `shouldReturn` []

selecting :: Spec
selecting = do
  it "starts the branch that the test selects when the old one has ended, not when the test changed" $ do
    entries <- newLog
    condition <- newTVarIO True
    let left = do
          again <- (/= []) <$> notes entries
          note entries "left"
          unless again $
            (atomically (writeTVar condition False) >> hang)
              `onException` atomically (writeTVar condition True)
    rSelect (readTVarIO condition) left (note entries "right")
    notes entries `shouldReturn` ["left", "left"]

  it "labels its threads" $ do
    condition <- newTVarIO True
    started <- startedBy (rSelect (readTVarIO condition) (atomically (writeTVar condition False) >> hang) (pure ()))
    started `shouldMatchList` map (Label "rSelect") ["polling", "left", "right"]

monitoring :: Spec
monitoring = do
  it "recharges, restarts the task, and completes it" $ do
    entries <- newLog
    battery <- newTVarIO (15 :: Int)
    let drive = do
          note entries "enter room"
          level <- atomically (modifyTVar' battery (subtract 8) >> readTVar battery)
          -- On low battery the robot gets no further.
          when (level < 10) hang
        recharge = note entries "recharge" >> atomically (writeTVar battery 100)
    monitor ((< 10) <$> readTVarIO battery) recharge (drive >> note entries "perform task")
    notes entries `shouldReturn` ["enter room", "recharge", "enter room", "perform task"]

  it "recovers even if the test is false again when the task has ended" $ do
    entries <- newLog
    low <- newTVarIO False
    let task = do
          again <- (/= []) <$> notes entries
          note entries "task"
          unless again $
            (atomically (writeTVar low True) >> hang)
              `onException` atomically (writeTVar low False)
    monitor (readTVarIO low) (note entries "recovery") task
    notes entries `shouldReturn` ["task", "recovery", "task"]

  it "does not read its test while it recovers" $ do
    resting <- newGate
    level <- newSensor (pure . (== 1))
    let recovery = do
          -- The thread that reads has ended; only a new one could read again.
          pass resting
          earlier <- readings level
          aWhile 0.002
          readings level `shouldReturn` earlier
        watch event = when (event == Ended (Label "monitor" "polling")) (open resting)
    watchingThreads watch (monitor (sensor level) recovery (pure "task")) `shouldReturn` "task"

  it "labels its threads, and starts a new one to read after each recovery" $ do
    recoveries <- newTVarIO (0 :: Int)
    let recovery = atomically (modifyTVar' recoveries (+ 1))
    known <- startedBy (monitor ((< 2) <$> readTVarIO recoveries) recovery (pure ()))
    -- (If the task has not ended as soon as it has begun, the sensor is read on meanwhile.)
    let (before, others) = splitAt 5 known
    before `shouldBe` map (Label "monitor") ["polling", "recovery", "polling", "recovery", "polling"]
    others `shouldContain` [Label "monitor" "task"]

-- | The labels of the threads that an action starts.
startedBy :: IO a -> IO [Label]
startedBy act = do
  events <- newLog
  _ <- watchingThreads (note events) act
  notes events >>= \known -> pure [label | Started label <- known]

-- | What an operator is doing.
data Phase = Phase String (Probe -> Behavior ())

-- | What runs in a phase, with its name. 'runs' signals to the test that the phase is
-- reached, and then waits to be stopped. 'cleansUp' is the cleanup of a branch that is
-- being stopped: it also signals that the phase is reached, and then waits until the test
-- lets it end.
data Probe = Probe
  { runs :: String -> Behavior ()
  , cleansUp :: String -> Behavior ()
  }

phases :: [Phase]
phases =
  [ Phase "rSelect reads for the first time" $ \probe ->
      rSelect (True <$ runs probe "test") unexpected unexpected
  , Phase "rSelect's branch runs" $ \probe ->
      rSelect (pure True) (runs probe "left") unexpected
  , Phase "rSelect's branch is stopping" $ \probe -> do
      entered <- newGate
      let left = (open entered >> hang) `onException` cleansUp probe "left"
      rSelect (not <$> opened entered) left unexpected
  , Phase "rSelect reads again" $ \probe -> do
      entered <- newGate
      over <- newGate
      let left = (open entered >> hang) `onException` open over
          test = opened over >>= \isOver -> if isOver then runs probe "test" >> pure True else not <$> opened entered
      rSelect test left unexpected
  , Phase "monitor reads for the first time" $ \probe ->
      monitor (False <$ runs probe "test") unexpected unexpected
  , Phase "monitor's task runs" $ \probe ->
      monitor (pure False) unexpected (runs probe "task")
  , Phase "monitor's task is stopping" $ \probe -> do
      entered <- newGate
      let task = (open entered >> hang) `onException` cleansUp probe "task"
      monitor (opened entered) unexpected task
  , Phase "monitor's recovery runs" $ \probe ->
      monitor (pure True) (runs probe "recovery") unexpected
  , Phase "monitor reads after a recovery" $ \probe -> do
      recovered <- newGate
      let test = opened recovered >>= \isOver -> if isOver then runs probe "test" >> pure False else pure True
      monitor test (open recovered) unexpected
  ]
 where
  unexpected = expectationFailure "this should not have been started"

cancelled :: Spec
cancelled =
  for_ phases $ \(Phase situation act) -> do
    it ("while " ++ situation ++ ", ends as cancelled when what ran has ended") $ do
      (end, ran) <- cancelledWhile act Cleanly
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
      length ran `shouldBe` 1
    it ("while " ++ situation ++ ", ends as cancelled with the fault of what was stopped") $ do
      (end, ran) <- cancelledWhile act Faulting
      end `shouldBe` CancelledWithFault (show (Cancel "the caller")) (show (Fault (concat ran)))

-- | How the operator ended, and the names of what had ended by then.
cancelledWhile :: (Probe -> Behavior ()) -> Stopping -> IO (Ending (), [String])
cancelledWhile act how = do
  entries <- newLog
  reached <- newGate
  release <- newGate
  let probe =
        Probe
          { runs = \name -> void (onStop how name (open reached >> hang)) `finally` note entries name
          , cleansUp = \name -> do
              open reached
              pass release
              note entries name
              when (how == Faulting) (throwIO (Fault name))
          }
      -- The log then shows what had ended when the operator ended, and nothing later.
      caller = leavingNothing (act probe) `onException` note entries "the operator"
  end <- withThread caller $ \thread -> do
    pass reached
    -- The caller has received it when this returns: it blocks where it can be interrupted.
    throwTo (asyncThreadId thread) (Cancel "the caller")
    open release
    awaitEnd thread
  ran <- notes entries
  drop (length ran - 1) ran `shouldBe` ["the operator"]
  pure (end, init ran)
