{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- How a run ends, and how its end is reported.
module Sim.EndSpec (spec) where

import Control.Concurrent (forkIO, newEmptyMVar, putMVar, takeMVar)
import Control.Concurrent.Async (cancel, withAsync)
import Control.Concurrent.STM (check, retry)
import Control.Exception hiding (Deadlock)
import Control.Monad (forM_, forever, void, when)
import Data.Foldable (for_)
import Data.IORef (atomicModifyIORef', newIORef)
import Data.List (isInfixOf, isPrefixOf)
import GHC.Clock (getMonotonicTime)
import GHC.Conc (unsafeIOToSTM)
import System.IO.Unsafe (unsafePerformIO)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (allOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Sim.Mock
import Behavior.Time (checkpoint)
import Behavior.Trace (named)
import Memory (allocatedBy)
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "The record of a mock world ends when the run does" records
  describe "With a finite endAt" ends
  describe "The cause is reported" causes
  describe "A run that is well" wells
  describe "A run with many threads" wide

-- | Runs an action while a motor is switched on; the cleanup switches it off.
motorOf :: Mock -> IO (Behavior () -> Behavior ())
motorOf mock = do
  motor <- condition mock "motor runs" [(0, False)]
  pure (\act -> (set motor True >> act) `finally` set motor False)

records :: Spec
records = do
  forM_
    [ ("at endAt", \act -> simulateWith defaultSimOptions {endAt = 10} (act (sleep 100)))
    , ( "at endAt, when all threads are blocked for ever"
      , \act -> simulateWith defaultSimOptions {endAt = 10} (act (atomically retry))
      )
    , ("in a deadlock", \act -> simulate (act (atomically retry)))
    , ("in a livelock", \act -> simulateWith defaultSimOptions {livelockLimit = 1000} (act (forever checkpoint)))
    , ("in a deadlock, in another thread", \act -> simulate (both (act (atomically retry)) (sleep 1)))
    , ("when it blocks outside of the simulation", \act -> simulate (act (newEmptyMVar >>= takeMVar)))
    ]
    $ \(name, ran) -> it ("and does not contain the unwinding: " ++ name) $ do
      mock <- newMock
      motor <- motorOf mock
      run <- ran motor
      case outcome run of
        Returned () -> expectationFailure "it returned"
        _ -> pure ()
      mock `shouldRecord` eventually (becoming "motor runs" True)
      (mock `shouldRecord` whenever (becoming "motor runs" True) (eventually (becoming "motor runs" False)))
        `shouldThrow` \(BrokenClaim why) -> "it never came" `isInfixOf` why
  it "and does not contain the unwinding: when the caller of the simulation is cancelled" $ do
    mock <- newMock
    motor <- motorOf mock
    begun <- newEmptyMVar
    let going =
          simulateWith
            defaultSimOptions {livelockLimit = maxBound}
            (motor (checkpoint >> putMVar begun () >> forever checkpoint))
    withAsync (void going) $ \caller -> takeMVar begun >> cancel caller
    -- (The cancellation can arrive anywhere in the behaviour, except in its cleanup.)
    countOf (becoming "motor runs" False) <$> happened mock `shouldReturn` 1
  it "but contains all changes that were due by then" $ do
    mock <- newMock
    low <- condition mock "low" [(0, False), (50, True), (70, False)]
    _ <- simulateWith defaultSimOptions {endAt = 60} (begin mock >> Signal.waitUntil (Signal.watching retry))
    mock `shouldRecord` eventually (becoming "low" True)
    countOf (becoming "low" False) <$> happened mock `shouldReturn` 1
    void (evaluate low)
  it "and contains everything that a returning run has done" $ do
    mock <- newMock
    motor <- motorOf mock
    _ <- simulate (motor (sleep 3))
    mock `shouldRecord` whenever (becoming "motor runs" True) (withinSeconds 3 (becoming "motor runs" False))

ends :: Spec
ends = do
  for_
    [ ("for a transaction", atomically retry, "a transaction")
    , ("for the end of an infinite sleep", sleep (1 / 0), "the end of its sleep")
    ]
    $ \(how, forEver, what) ->
        it ("a run that waits for ever is a deadlock, and the time goes on to the end: " ++ how) $ do
        run <- simulateWith defaultSimOptions {endAt = 60} (sleep 5 >> forEver)
        (lines (explain (outcome run)), finished run)
          `shouldBe` ( [ "deadlock: every thread waits, and nothing in the simulation will wake one"
                       , "  main waits for " ++ what
                       ]
                     , 60
                     )
  it "a run that is woken from outside is that, and no deadlock" $ do
    looks <- newIORef (0 :: Int)
    let comesTrue = unsafeIOToSTM (atomicModifyIORef' looks (\n -> (n + 1, n >= 4))) >>= check
    run <- simulateWith defaultSimOptions {endAt = 60} (atomically comesTrue)
    explain (outcome run) `shouldSatisfy` ("something outside of the simulation" `isPrefixOf`)
  it "a run without an end of its own ends then, and the report says who waits for what" $ do
    run <-
      simulateWith
        defaultSimOptions {endAt = 60}
        (both (forever (sleep 7) :: Behavior ()) (named "dock" (atomically retry)) :: Behavior ())
    (lines (explain (outcome run)), finished run)
      `shouldBe` ( [ "the virtual time has come to the end that was set"
                   , "  main waits for a transaction (its branches: both: left, both: right)"
                   , "  both: left waits for the end of its sleep"
                   , "  both: right waits for a transaction (dock)"
                   ]
                 , 60
                 )
  it "each run of an exploration has it, by endingAt" $ do
    report <- explore (randomly 20 `endingAt` 60) $ \run -> do
      made <- run (forever (sleep 1) :: Behavior ())
      when (finished made /= 60) (fail (show (finished made)))
    reportSchedules report `shouldBe` 20
  it "no run reaches realTimeLimit; otherwise the report names endAt, realTimeLimit and the virtual time" $ do
    -- By default the run is over within 10 s.
    realTimeLimit defaultSimOptions `shouldBe` 9
    begun <- getMonotonicTime
    run <- simulateWith defaultSimOptions {realTimeLimit = 0.2} (forever (sleep 1) :: Behavior ())
    over <- getMonotonicTime
    case outcome run of
      TooSlow _ came -> do
        came `shouldSatisfy` (> 10)
        came `shouldSatisfy` (<= finished run)
      _ -> expectationFailure (explain (outcome run))
    explain (outcome run)
      `shouldSatisfy` \said -> all (`isInfixOf` said) ["s of virtual time", "see endAt", "see realTimeLimit"]
    over - begun `shouldSatisfy` (< 8)

wells :: Spec
wells = do
  it "has returned, and its result is given" $
    (simulate (sleep 1 >> pure 'a') >>= well) `shouldReturn` 'a'
  it "has not failed, faulted, or been ended" $ do
    for_
      [ (simulate (failWith "locked"), "it failed: the behaviour failed: locked")
      , (simulate (throwIO (userError "no radio")), "it faulted: user error (no radio)")
      , (simulate (atomically retry), "deadlock")
      , (simulateWith defaultSimOptions {endAt = 1} (sleep 2), "the virtual time has come to the end")
      ]
      $ \(simulated, why) -> (simulated >>= well) `shouldThrow` \(ErrorCall said) -> why `isPrefixOf` said
  it "has left no thread running" $ do
    world <- newMock
    messages <- driver world "messages" [(100, 'x')]
    (simulate (void (messages (const (pure ())))) >>= well)
      `shouldThrow` (== ErrorCall "it returned, but these threads were left running: driver: messages")

causes :: Spec
causes = do
  it "for an exception whose text throws an exception" $ do
    run <- simulate (throwIO Unshowable :: Behavior ())
    explain (outcome run) `shouldBe` "it faulted: it was <its text throws an exception>"
  it "for such an exception that is thrown in a branch, also in the steps" $ do
    let others (e :: SomeException) = throwIO (if null (show e) then toException e else toException Unshowable)
    run <- simulate (parallel (sleep 1) (sleep 2 `catch` others))
    explain (outcome run) `shouldBe` "it faulted: it was <its text throws an exception>"
    length (renderSteps (steps run)) `shouldSatisfy` (> 10)
  it "for such an exception that a scripted action throws, also in the record" $ do
    mock <- newMock
    act <- action mock "act" [throws Unshowable :: Script ()]
    run <- simulate act
    length (renderSteps (steps run)) `shouldSatisfy` (> 10)
    mock `shouldRecord` exactly 1 (faultOf "act")
  it "for a thread that blocks on a value that another thread computes" $ do
    begun <- newEmptyMVar
    neverFilled <- newEmptyMVar
    let lazy = unsafePerformIO (putMVar begun () >> takeMVar neverFilled) :: Int
    _ <- forkIO (void (evaluate lazy))
    takeMVar begun
    run <- simulateWith defaultSimOptions {realTimeLimit = 0.3} (void (evaluate lazy))
    putMVar neverFilled 1
    case outcome run of
      BlockedOutside thread InThunk -> show thread `shouldBe` "main"
      other -> expectationFailure (explain other)
    explain (outcome run) `shouldSatisfy` ("for a value that another thread is computing" `isInfixOf`)

-- | Its 'show' throws, after some characters.
data Unshowable = Unshowable

instance Show Unshowable where
  show Unshowable = "it was " ++ error "no text"

instance Exception Unshowable

wide :: Spec
wide = do
  it "costs at most 12 times as much with 10,000 threads as with 1,000" $
    costs NonPreemptive fromIntegral
  it "does so under a random schedule, too, when all threads sleep until the same time" $
    costs (Seeded 7) (const 1)
 where
  costs schedule moment = do
    few <- allocated schedule moment 1000
    many <- allocated schedule moment 10000
    (many `div` 1000, few `div` 1000) `shouldSatisfy` \(m, f) -> m <= 12 * f
  allocated schedule moment n = allocatedBy $ do
    run <-
      simulateWith
        defaultSimOptions {scheduled = schedule, realTimeLimit = 60}
        (allOf [sleep (moment i) | i <- [1 .. n :: Int]])
    explain (outcome run) `shouldBe` "it returned"
