-- |
-- Exploring the schedules of a behaviour.
module Sim.ExploreSpec (spec) where

import Control.Concurrent.STM (modifyTVar', newTVarIO, readTVar, readTVarIO, retry, writeTVar)
import Control.Exception hiding (Deadlock)
import Control.Monad (unless, void, when)
import Data.IORef
import Data.List (isInfixOf, isPrefixOf, nub, sort)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Seam.Runtime (annotate)
import Behavior.Parallel (allOf)
import Behavior.STM (atomically)
import Behavior.Sim
import Behavior.Time (checkpoint)
import Support

spec :: Spec
spec = guarded $ do
  describe "A random exploration" random
  describe "An exhaustive exploration" exhaustive
  describe "A counterexample" counterexample
  describe "A property" properties

-- | The given number of branches increment a counter, but read and write it in separate
-- transactions.
counting :: Int -> (Behavior () -> IO (Run ())) -> IO ()
counting n simulateIt = do
  counter <- newTVarIO (0 :: Int)
  _ <- simulateIt $ do
    let count = do
          seen <- atomically (readTVar counter)
          annotate ("saw " ++ show seen)
          atomically (writeTVar counter (seen + 1))
        counters = foldr both (pure ()) (replicate n count)
    counters
  counted <- readTVarIO counter
  unless (counted == n) $ throwIO (Fault ("counted " ++ show counted))

random :: Spec
random = do
  it "runs the given number of schedules" $ do
    runs <- newIORef (0 :: Int)
    report <- explore (randomly 123) $ \run -> modifyIORef runs (+ 1) >> void (run (both (sleep 1) (sleep 1)))
    (,) (reportSchedules report) <$> readIORef runs `shouldReturn` (123, 123)
  it "finds a defect that needs one pre-emption" $ do
    found <- tryExplore (randomly 1000) (counting 2)
    either (const "found") show found `shouldBe` "found"
  it "is the same for the same seed, and different for a different seed" $ do
    let from seed = do
          seen <- newIORef []
          _ <- explore (randomly 20) {planSearch = Random 20 seed} $ \run -> do
            made <- run (both (sleep 1) (both (sleep 1) (sleep 1)))
            modifyIORef seen (show (runSchedule made) :)
          readIORef seen
    one <- from 1
    from 1 `shouldReturn` one
    from 2 >>= (`shouldNotBe` one)

exhaustive :: Spec
exhaustive = do
  it "runs every order of steps that do not block" $ do
    -- Three branches of one step each, and all their orders.
    orders <- newIORef []
    report <- explore (exhaustively 2) $ \run -> do
      order <- newTVarIO ""
      let write name = atomically (modifyTVar' order (name :))
      _ <- run (both (both (write 'a') (write 'b')) (write 'c'))
      readTVarIO order >>= \o -> modifyIORef orders (o :)
    reportComplete report `shouldBe` True
    sort . nub <$> readIORef orders `shouldReturn` ["abc", "acb", "bac", "bca", "cab", "cba"]
  it "runs no schedule twice" $ do
    seen <- newIORef []
    _ <- explore (exhaustively 2) $ \run -> do
      made <- run (both (sleep 1 >> checkpoint) (sleep 1))
      modifyIORef seen (show (runSchedule made) :)
    known <- readIORef seen
    length (nub known) `shouldBe` length known
  it "tries the alternatives of the latest decision first, in the order of the thread numbers" $ do
    seen <- newIORef []
    _ <- explore (exhaustively 0) $ \run -> do
      made <- run (void (allOf [checkpoint, checkpoint, checkpoint]))
      modifyIORef seen (runSchedule made :)
    take 6 . reverse <$> readIORef seen
      `shouldReturn` map Preempting [[], [(13, 3)], [(9, 3)], [(8, 2)], [(8, 2), (12, 3)], [(8, 3)]]
  it "finds no defect with fewer pre-emptions than that needs" $ do
    let exploredWith k = either (const False) reportComplete <$> tryExplore (exhaustively k) (counting 2)
    (,) <$> exploredWith 0 <*> exploredWith 1 `shouldReturn` (True, False)
  it "reports that it is incomplete when there are more schedules than the limit" $ do
    report <- explore (exhaustively 3) {planSearch = Exhaustive 3 50} $ \run -> void (run (both (sleep 1) (sleep 1)))
    (reportSchedules report, reportComplete report) `shouldBe` (50, False)

counterexample :: Spec
counterexample = do
  it "is shrunk to the fewest pre-emptions that it needs" $ do
    found <- tryExplore (randomly 1000) (counting 3)
    case found of
      Left c | Preempting s <- failingSchedule c -> length s `shouldBe` 1
      _ -> expectationFailure "it should have been found"
  it "fails again when it is replayed from its text" $ do
    found <- tryExplore (randomly 1000) (counting 3)
    case found of
      Left c -> do
        let text = drop (length "to see it again: explore (replaying (") (last (lines (show c)))
            printed = take (length text - 2) text
        again <- tryExplore (replaying (read printed)) (counting 3)
        either (show . failingException) (const "it held") again `shouldBe` show (failingException c)
      Right _ -> expectationFailure "it should have been found"
  it "shows its steps, with times and threads" $ do
    found <- tryExplore (randomly 1000) (counting 2)
    case found of
      Left c -> do
        show c `shouldContain` "Fault \"counted 1\""
        show c `shouldContain` "shrunk to one pre-emption"
        [words line | line <- lines (show c), "saw" `isInfixOf` line]
          `shouldBe` [ ["0.000", "s", "1", "both:", "left", "saw", "0"]
                     , ["0.000", "s", "3", "both:", "left", "(of", "2)", "saw", "0"]
                     ]
      Right _ -> expectationFailure "it should have been found"
  it "shows the property's exception with the plan's showException" $ do
    found <- tryExplore (randomly 1000) {planShowException = const "not two"} (counting 2)
    take 3 (lines (either show show found))
      `shouldBe` ["schedule 18 fails:", "  not two", "shrunk to one pre-emption, this happens:"]
  it "shows an exception that did not occur again with the plan's showException" $ do
    runs <- newIORef (0 :: Int)
    let asText = maybe "another" (\(Fault text) -> "fault " ++ text) . fromException
    found <- tryExplore (randomly 1) {planShowException = asText} $ \run -> do
      n <- atomicModifyIORef' runs (\n -> (n + 1, n))
      _ <- run (pure ())
      when (n == 0) (throwIO (Fault "once"))
    either (show . failingException) show found
      `shouldSatisfy` ("fault once\nBut when the same schedule was run again" `isPrefixOf`)
  it "shows only the steps that the plan selects, and their number" $ do
    found <- tryExplore (randomly 1000) {planSelectSteps = mentioning ["saw"]} (counting 2)
    (drop 2 . lines <$> either (Just . show) (const Nothing) found)
      `shouldBe` Just
        [ "shrunk to one pre-emption, this happens (2 of 21 steps):"
        , "     0.000 s  1 both: left         saw 0"
        , "     0.000 s  3 both: left (of 2)  saw 0"
        , "to see it again: explore (replaying (Preempting [(5,2)]))"
        ]
  it "can be narrowed to the steps of some threads" $ do
    run <- simulate (both (sleep 1) (both (sleep 1) (sleep 1)))
    map stepThread (ofThreads [1, 3] (steps run)) `shouldBe` [1, 3, 1, 3]
  it "can be narrowed to the steps that mention a name, in the label or in the kind of step" $ do
    run <- simulate (both (annotate "a") (annotate "left"))
    [(stepThread s, stepKind s) | s <- mentioning ["left"] (steps run)]
      `shouldBe` [(1, Starts), (1, Note "a"), (1, Ends), (2, Note "left")]
  it "distinguishes the branches of two operators" $ do
    run <- simulateWith defaultSimOptions {detailedSteps = True}
      (both (parallel (sleep 1) (sleep 2)) (parallel (sleep 3) (sleep 4)))
    lines (renderSteps (mentioning ["starts", "requests"] (steps run)))
      `shouldBe` [ "     0.000 s  1 both: left              starts"
                 , "     0.000 s  2 both: right             starts"
                 , "     0.000 s  3 parallel: left (of 1)   starts"
                 , "     0.000 s  4 parallel: right (of 1)  starts"
                 , "     0.000 s  5 parallel: left (of 2)   starts"
                 , "     0.000 s  6 parallel: right (of 2)  starts"
                 , "     1.000 s  1 both: left              requests the stop of 4 parallel: right"
                 , "     3.000 s  2 both: right             requests the stop of 6 parallel: right"
                 ]
    map stepParent (take 2 (steps run)) `shouldBe` [-1, 0]
  it "is found from a schedule that fails, by schedules with fewer pre-emptions" $ do
    let first = Seeded 18 -- the eighteenth of those that seed 0 tries
    found <- tryExplore (replaying first) {planSearch = Shrink first} (counting 2)
    either failingSchedule (const first) found `shouldBe` Preempting [(5, 2)]
    held <- tryExplore (replaying NonPreemptive) {planSearch = Shrink NonPreemptive} (counting 2)
    either show (show . reportSchedules) held `shouldBe` "1"
  it "of a deadlock names the blocked threads" $ do
    found <- tryExplore (randomly 100) $ \run -> do
      made <- run (both (pure ()) (atomically retry :: Behavior ()))
      case outcome made of
        Returned () -> pure ()
        other -> fail (explain other)
    either show show found `shouldSatisfy` ("both: right waits for a transaction" `isInfixOf`)

  it "reports a failure that did not occur again" $ do
    runs <- newIORef (0 :: Int)
    found <- tryExplore (randomly 100) $ \run -> do
      modifyIORef runs (+ 1)
      n <- readIORef runs
      _ <- run (sleep 1)
      when (n == 5) (fail "the fifth run")
    case found of
      Left c ->
        show c
          `shouldSatisfy` \described -> all (`isInfixOf` described) ["the fifth run", "run again, this did not happen"]
      Right _ -> expectationFailure "it should have been found"

properties :: Spec
properties = do
  it "simulates only once" $ do
    found <- tryExplore (randomly 3) $ \run -> run (pure ()) >> void (run (pure ()))
    either (show . failingException) show found `shouldBe` "explore: a property simulates only once"
  it "fails when a run reaches the limit of real time" $ do
    found <- tryExplore (randomly 1) {planOptions = defaultSimOptions {realTimeLimit = 0.1}} $ \run ->
      void (run (mapM_ (evaluate . length . show) [0 :: Int ..]))
    either (show . failingException) show found `shouldSatisfy` ("limit of real time" `isInfixOf`)
  it "that throws a cancellation ends the exploration" $ do
    end <- ending (reportSchedules <$> explore (randomly 3) (\_ -> throwIO (Cancel "user")))
    end `shouldBe` CancelledBy (show (Cancel "user"))
  it "fails with the reason when the schedule does not fit" $ do
    found <- tryExplore (replaying (Preempting [(2, 9)])) $ \run -> do
      made <- run (both (sleep 1) (sleep 1))
      when (runPoints made < 0) (fail "unreachable")
    either (show . failingException) show found `shouldSatisfy` ("the schedule does not fit" `isInfixOf`)
