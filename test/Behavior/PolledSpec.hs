{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The paper's 'rSelect' and 'monitor', on a test that is polled. They are the operators
-- of "Behavior.Signal" on such a signal; so here are the laws, the promises once each,
-- and a caller that is cancelled in every phase that there is.
module Behavior.PolledSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (unless, void, when)
import Data.Foldable (for_)
import qualified System.Timeout
import Test.Hspec hiding (after, before)
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Internal.Runtime (Event (..), Label (..), atomically, withSink)
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
          -- The test holds once at most, or it could go on for ever.
          once <- newTVarIO True
          let holds = do
                first <- atomically (readTVar once <* writeTVar once False)
                if first then even <$> play n test else pure False
          monitors holds (void (play n r)) (play n t)
     in with monitor `sameAs` with (Signal.monitor . Signal.polling 0.01)

-- | Either operator, with a test that is true while the first behaviour may run.
either' :: [(String, Behavior Bool -> Behavior () -> Behavior () -> Behavior ())]
either' = [("rSelect", rSelect), ("monitor", \test main other -> monitor (not <$> test) other main)]

common :: Spec
common = for_ either' $ \(name, run) -> do
  it (name ++ " reads its test before anything starts") $ do
    book <- newLog
    entered <- newGate
    release <- newGate
    let test = open entered >> pass release >> note book "read" >> pure True
    launching (run test (note book "main") (note book "other")) $ \caller -> do
      pass entered
      stillRunning caller
      open release
      awaitEnd caller `shouldReturn` Gave ()
    take 2 <$> notes book `shouldReturn` ["read", "main"]

  it (name ++ " reads its test again and again, at least 10 ms apart") $ do
    times <- newLog
    let test = True <$ (now >>= note times)
    since <- now
    launching (run test hang (pure ())) $ \_ -> eventually ((>= 6) . length <$> notes times)
    began <- notes times
    zip [0 ..] began `shouldSatisfy` all (\(n, t) -> t - since >= fromIntegral (n :: Int) * 0.01)

  it (name ++ " never has both behaviours running, and each time what the test says") $ do
    occupancy <- newOccupancyCounter
    condition <- newTVarIO True
    running' <- newTVarIO Nothing
    let branch own = inside occupancy $ atomically (writeTVar running' (Just own)) >> hang
    launching (run (readTVarIO condition) (branch True) (branch False)) $ \_ ->
      -- 'monitor' does not end its recovery for a test that changes.
      for_ (take (if name == "monitor" then 1 else 10) (cycle [False, True])) $ \says' -> do
        atomically (writeTVar condition says')
        atomically (readTVar running' >>= check . (== Just says'))
    mostInside occupancy `shouldReturn` 1

  it (name ++ " keeps the result of a behaviour that completed though asked to stop") $ do
    book <- newLog
    entered <- newGate
    let main = void (onStop Completing "main" (open entered >> hang)) >> note book "main"
    run (not <$> opened entered) main (note book "other")
    notes book `shouldReturn` ["main"]

  for_ [("fails", throwIO Failed, FailedWith "Failed"), ("faults", throwIO (Fault "bug"), FaultedWith (show (Fault "bug")))] $
    \(manner, act, end) ->
      it (name ++ " does not take for false a test that " ++ manner) $ do
        book <- newLog
        entered <- newGate
        let test = opened entered >>= \isEntered -> if isEntered then act else pure True
            main = (open entered >> hang) `onException` note book "main is over"
        ending (run test main (note book "other")) `shouldReturn` end
        notes book `shouldReturn` ["main is over"]

  for_ [("unmasked", id), ("masked", mask_), ("uninterruptible", uninterruptibleMask_)] $
    \(state, masked) ->
      it (name ++ " runs all unmasked for a caller that is " ++ state) $ do
        states <- newLog
        entered <- newGate
        recovered <- newGate
        let noting = getMaskingState >>= note states
            test = noting >> ((||) . not <$> opened entered <*> opened recovered)
            main = noting >> opened entered >>= \again -> unless again (open entered >> hang)
            other = noting >> open recovered
        masked (run test main other)
        notes states >>= (`shouldSatisfy` \all' -> length all' > 3 && all (== Unmasked) all')

  it (name ++ " is no failure, but cancelled, under a failingOn for every exception") $ do
    book <- newLog
    entered <- newGate
    let everything = failingOn (\(_ :: SomeException) -> True)
        act = everything (run (pure True) (open entered >> hang) (pure ())) ? note book "went on"
    cancelling act (pass entered) `shouldReturn` CancelledBy (show (Cancel "the caller"))
    ending (timeout 0.001 (everything (run (pure True) hang (pure ())) ? note book "went on"))
      `shouldReturn` FailedWith "TimedOut 0.001"
    System.Timeout.timeout 1000 (everything (run (pure True) hang (pure ())) ? note book "went on")
      `shouldReturn` Nothing
    notes book `shouldReturn` []

selecting :: Spec
selecting = do
  it "starts what the test says when the old branch has ended, not when it changed" $ do
    book <- newLog
    condition <- newTVarIO True
    let left = do
          again <- (/= []) <$> notes book
          note book "left"
          unless again $
            (atomically (writeTVar condition False) >> hang)
              `onException` atomically (writeTVar condition True)
    rSelect (readTVarIO condition) left (note book "right")
    notes book `shouldReturn` ["left", "left"]

  it "labels its threads" $ do
    condition <- newTVarIO True
    started <- startedBy (rSelect (readTVarIO condition) (atomically (writeTVar condition False) >> hang) (pure ()))
    started `shouldMatchList` map (Label "rSelect") ["polling", "left", "right"]

monitoring :: Spec
monitoring = do
  it "recharges, begins the task from its beginning, and fulfils it" $ do
    book <- newLog
    battery <- newTVarIO (15 :: Int)
    let drive = do
          note book "enter room"
          level <- atomically (modifyTVar' battery (subtract 8) >> readTVar battery)
          -- On low battery the robot gets no further.
          when (level < 10) hang
        recharge = note book "recharge" >> atomically (writeTVar battery 100)
    monitor ((< 10) <$> readTVarIO battery) recharge (drive >> note book "perform task")
    notes book `shouldReturn` ["enter room", "recharge", "enter room", "perform task"]

  it "recovers even if the test is false again when the task has ended" $ do
    book <- newLog
    low <- newTVarIO False
    let task = do
          again <- (/= []) <$> notes book
          note book "task"
          unless again $
            (atomically (writeTVar low True) >> hang)
              `onException` atomically (writeTVar low False)
    monitor (readTVarIO low) (note book "recovery") task
    notes book `shouldReturn` ["task", "recovery", "task"]

  it "does not read its test while it recovers" $ do
    resting <- newGate
    level <- newSensor (pure . (== 1))
    let recovery = do
          -- The thread that reads has ended; it takes a new one to read again.
          pass resting
          earlier <- readings level
          aWhile 0.002
          readings level `shouldReturn` earlier
        watch event = when (event == Ended (Label "monitor" "polling")) (open resting)
    withSink watch (monitor (sensor level) recovery (pure "task")) `shouldReturn` "task"

  it "labels its threads, and starts a new one to read after each recovery" $ do
    recoveries <- newTVarIO (0 :: Int)
    let recovery = atomically (modifyTVar' recoveries (+ 1))
    all' <- startedBy (monitor ((< 2) <$> readTVarIO recoveries) recovery (pure ()))
    -- (If the task has not ended as soon as it has begun, the sensor is read on meanwhile.)
    let (before, after') = splitAt 5 all'
    before `shouldBe` map (Label "monitor") ["polling", "recovery", "polling", "recovery", "polling"]
    after' `shouldContain` [Label "monitor" "task"]

-- | The labels of the threads that an action starts.
startedBy :: IO a -> IO [Label]
startedBy act = do
  events <- newLog
  _ <- withSink (note events) act
  notes events >>= \all' -> pure [label | Started label <- all']

-- | What an operator is doing.
data Phase = Phase String (Probe -> Behavior ())

-- | What runs in a phase, by its name: it tells the test that the phase is reached, and
-- then waits to be stopped; or it is already, and this is its cleanup, which waits until
-- the test lets it end.
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
  for_ phases $ \(Phase when' act) -> do
    it ("while " ++ when' ++ ", is cancelled when that has ended") $ do
      (end, ran) <- cancelledWhile act Cleanly
      end `shouldBe` CancelledBy (show (Cancel "the caller"))
      length ran `shouldBe` 1
    it ("while " ++ when' ++ ", is told of the fault of what was stopped") $ do
      (end, ran) <- cancelledWhile act Faulting
      end `shouldBe` CancelledWithFault (show (Cancel "the caller")) (show (Fault (concat ran)))

-- | How the operator ended, and the names of what had ended by then.
cancelledWhile :: (Probe -> Behavior ()) -> Stopping -> IO (Ending (), [String])
cancelledWhile act how = do
  book <- newLog
  reached <- newGate
  release <- newGate
  let probe =
        Probe
          { runs = \name -> void (onStop how name (open reached >> hang)) `finally` note book name
          , cleansUp = \name -> do
              open reached
              pass release
              note book name
              when (how == Faulting) (throwIO (Fault name))
          }
      -- What has ended when the operator has, not later.
      caller = leavingNothing (act probe) `onException` note book "the operator"
  end <- launching caller $ \thread -> do
    pass reached
    -- It is delivered when this returns: the caller waits where it can be interrupted.
    throwTo (asyncThreadId thread) (Cancel "the caller")
    open release
    awaitEnd thread
  ran <- notes book
  drop (length ran - 1) ran `shouldBe` ["the operator"]
  pure (end, init ran)
