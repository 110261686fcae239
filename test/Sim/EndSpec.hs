{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- How a run ends, and what is said of it.
module Sim.EndSpec (spec) where

import Control.Concurrent (forkIO, newEmptyMVar, putMVar, takeMVar)
import Control.Concurrent.Async (cancel, withAsync)
import Control.Concurrent.STM (retry)
import Control.Exception hiding (Deadlock)
import Control.Monad (forM_, forever, void, when)
import Data.List (isInfixOf)
import GHC.Clock (getMonotonicTime)
import GHC.Stats (RTSStats (allocated_bytes), getRTSStats)
import System.IO.Unsafe (unsafePerformIO)
import System.Mem (performMajorGC)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Parallel (allOf)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Sim.Mock
import Behavior.Time (atomically, checkpoint)
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "The record of a mock world ends when the run does" records
  describe "With a finite end" ends
  describe "What went wrong is said" faults'
  describe "A wide program" wide

-- | A motor that is switched on; what follows is to switch it off.
motorOf :: Mock -> IO (Behavior () -> Behavior ())
motorOf mock = do
  motor <- condition mock "motor runs" [(0, False)]
  pure (\act -> (set motor True >> act) `finally` set motor False)

records :: Spec
records = do
  forM_
    [ ("at endAt", \act -> simulateWith defaults {endAt = 10} (act (sleep 100)))
    , ("at endAt, though nothing would ever happen", \act -> simulateWith defaults {endAt = 10} (act (atomically retry)))
    , ("in a deadlock", \act -> simulate (act (atomically retry)))
    , ("in a livelock", \act -> simulateWith defaults {livelockLimit = 1000} (act (forever checkpoint)))
    , ("in a deadlock, in another thread", \act -> simulate (both (act (atomically retry)) (sleep 1)))
    , ("where it waits outside", \act -> simulate (act (newEmptyMVar >>= takeMVar)))
    ]
    $ \(name, running') -> it ("and does not hold what is unwound: " ++ name) $ do
      mock <- newMock
      motor <- motorOf mock
      run <- running' motor
      case outcome run of
        Returned () -> expectationFailure "it returned"
        _ -> pure ()
      mock `shouldRecord` eventually (becoming "motor runs" True)
      (mock `shouldRecord` whenever (becoming "motor runs" True) (eventually (becoming "motor runs" False)))
        `shouldThrow` \(BrokenClaim why) -> "it never came" `isInfixOf` why
  it "and does not hold what is unwound: when whoever simulates is cancelled" $ do
    mock <- newMock
    motor <- motorOf mock
    begun <- newEmptyMVar
    let going = simulateWith defaults {livelockLimit = maxBound} (motor (checkpoint >> putMVar begun () >> forever checkpoint))
    withAsync (void going) $ \caller -> takeMVar begun >> cancel caller
    -- (The cancellation itself finds the behaviour anywhere, but not in its cleanup.)
    count (becoming "motor runs" False) <$> happened mock `shouldReturn` 1
  it "but holds all that was due by then" $ do
    mock <- newMock
    low <- condition mock "low" [(0, False), (50, True), (70, False)]
    _ <- simulateWith defaults {endAt = 60} (begin mock >> Signal.waitUntil (Signal.watching retry))
    mock `shouldRecord` eventually (becoming "low" True)
    count (becoming "low" False) <$> happened mock `shouldReturn` 1
    void (evaluate low)
  it "and a run that returns has all on record that it did" $ do
    mock <- newMock
    motor <- motorOf mock
    _ <- simulate (motor (sleep 3))
    mock `shouldRecord` whenever (becoming "motor runs" True) (withinSeconds 3 (becoming "motor runs" False))

ends :: Spec
ends = do
  it "the time comes to it, though nothing would ever happen" $ do
    run <- simulateWith defaults {endAt = 60} (sleep 5 >> atomically retry :: Behavior ())
    (explain (outcome run), finished run) `shouldBe` ("the virtual time has come to the end that was set", 60)
  it "a run is over that has no end of its own, at once" $ do
    run <- simulateWith defaults {endAt = 60} (forever (sleep 1) :: Behavior ())
    (explain (outcome run), finished run) `shouldBe` ("the virtual time has come to the end that was set", 60)
  it "each run of an exploration has it, by one word" $ do
    report <- explore (randomly 20 `endingAt` 60) $ \run -> do
      made <- run (forever (sleep 1) :: Behavior ())
      when (finished made /= 60) (fail (show (finished made)))
    schedules report `shouldBe` 20
  it "or else a run without an end is cut off, and what is said names endAt, and how far it came" $ do
    -- By default it is over within 10 s.
    realTimeLimit defaults `shouldBe` 9
    begun <- getMonotonicTime
    run <- simulateWith defaults {realTimeLimit = 0.2} (forever (sleep 1) :: Behavior ())
    over <- getMonotonicTime
    case outcome run of
      TooSlow _ came -> do
        came `shouldSatisfy` (> 10)
        came `shouldSatisfy` (<= finished run)
      _ -> expectationFailure (explain (outcome run))
    explain (outcome run) `shouldSatisfy` \said -> all (`isInfixOf` said) ["s of virtual time", "see endAt", "see realTimeLimit"]
    over - begun `shouldSatisfy` (< 8)

faults' :: Spec
faults' = do
  it "of one whose text throws an exception" $ do
    run <- simulate (throwIO Unshowable :: Behavior ())
    explain (outcome run) `shouldBe` "it faulted: it was <its text throws an exception>"
  it "of one that is thrown to another thread, in the steps too" $ do
    run <- simulate (parallel (sleep 1) (sleep 2 `catch` \(e :: SomeException) -> throwIO (if null (show e) then toException e else toException Unshowable)))
    explain (outcome run) `shouldBe` "it faulted: it was <its text throws an exception>"
    length (renderSteps (steps run)) `shouldSatisfy` (> 10)
  it "of one that a scripted action throws, in the record too" $ do
    mock <- newMock
    act <- action mock "act" [throws Unshowable :: Script ()]
    run <- simulate act
    length (renderSteps (steps run)) `shouldSatisfy` (> 10)
    mock `shouldRecord` exactly 1 (faultOf "act")
  it "of a thread that waits for what another computes" $ do
    begun <- newEmptyMVar
    never' <- newEmptyMVar
    let lazy = unsafePerformIO (putMVar begun () >> takeMVar never') :: Int
    _ <- forkIO (void (evaluate lazy))
    takeMVar begun
    run <- simulateWith defaults {realTimeLimit = 0.3} (void (evaluate lazy))
    putMVar never' 1
    case outcome run of
      BlockedOutside thread InThunk -> show thread `shouldBe` "main"
      other -> expectationFailure (explain other)
    explain (outcome run) `shouldSatisfy` ("for a value that another thread is computing" `isInfixOf`)

-- | To show it throws, after a while.
data Unshowable = Unshowable

instance Show Unshowable where
  show Unshowable = "it was " ++ error "no text"

instance Exception Unshowable

wide :: Spec
wide = do
  it "of 10,000 threads costs at most 12 times what one of 1,000 does" $
    costs NonPreemptive fromIntegral
  it "so in a random schedule, when all sleep until one moment" $
    costs (Seeded 7) (const 1)
 where
  costs schedule' moment = do
    few <- allocated schedule' moment 1000
    many <- allocated schedule' moment 10000
    (many `div` 1000, few `div` 1000) `shouldSatisfy` \(m, f) -> m <= 12 * f
  -- What it allocates stands for what it costs, and does not depend on what else the machine does.
  allocated schedule' moment n = do
    performMajorGC
    before' <- allocated_bytes <$> getRTSStats
    run <- simulateWith defaults {scheduled = schedule', realTimeLimit = 60} (allOf [sleep (moment i) | i <- [1 .. n :: Int]])
    explain (outcome run) `shouldBe` "it returned"
    performMajorGC
    after' <- allocated_bytes <$> getRTSStats
    pure (after' - before')
