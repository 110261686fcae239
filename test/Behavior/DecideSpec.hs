{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Several behaviours, and a function of their ends that chooses what comes next. (That 'decide'
-- is an operator like the others is tested where all are: see "Places".)
module Behavior.DecideSpec (spec) where

import Control.Concurrent (myThreadId, newEmptyMVar, putMVar, takeMVar)
import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Control.Monad (unless, void)
import Data.Bifunctor (first)
import Data.Foldable (for_)
import Data.IORef
import Data.List (group, isInfixOf, nub, sort)
import Data.Maybe (catMaybes, listToMaybe)
import System.IO.Unsafe (unsafePerformIO)
import Test.Hspec

import Behavior
import Behavior.Parallel (decide, firstOf)
import Behavior.Sim (Report (..), Run (outcome), exhaustively, explore, simulate)
import qualified Behavior.Sim as Sim
import Support

spec :: Spec
spec = guarded . describe "decide" $ do
  describe "asks the function" asking
  describe "runs what the function has chosen" chosen
  describe "ends without a choice" unchosen
  describe "by its function, is" patterns

asking :: Spec
asking = do
  it "before the start: what is certain then starts nothing" $ do
    entries <- newLog
    decide (\_ -> Just (pure 'a')) [note entries "started"] `shouldReturn` 'a'
    decide (\_ -> Just (pure 'a')) [] `shouldReturn` 'a'
    notes entries `shouldReturn` []

  it "after each end, with all ends so far, by position" $ do
    (asked, remember) <- recorder
    let behaviors = [sleep 3 >> pure 'a', sleep 1 >> failWith "b", sleep 2 >> pure 'c']
    let allThree ends = if length (catMaybes ends) == 3 then Just (pure "all") else Nothing
    run <- simulate (decide (\ends -> remember ends (allThree ends)) behaviors)
    returned run "all"
    asked
      `shouldReturn` [ [Nothing, Nothing, Nothing]
                     , [Nothing, Just (Left "FailedBecause \"b\""), Nothing]
                     , [Nothing, Just (Left "FailedBecause \"b\""), Just (Right 'c')]
                     , [Just (Right 'a'), Just (Left "FailedBecause \"b\""), Just (Right 'c')]
                     ]

  it "about more ends each time, and at last about all, under all schedules" $ do
    report <- explore (exhaustively 2) $ \simulated -> do
      (asked, remember) <- recorder
      run <- simulated (decide (\ends -> remember ends (pure () <$ sequence ends)) [pure 'a', pure 'b', pure 'c'])
      returned run ()
      counts <- map (length . catMaybes) <$> asked
      unless (head counts == 0 && last counts == 3 && and (zipWith (<) counts (drop 1 counts))) $ fail (show counts)
    reportComplete report `shouldBe` True

  it "though the thread of the operator is masked" $
    uninterruptibleMask_ (decide firstEnd [hang, pure 'b']) `shouldReturn` 'b'

chosen :: Spec
chosen = do
  it "after the cleanups of all others" $ do
    entries <- newLog
    entered <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    let slow = (open entered >> hang) `uninterruptibly` (open cleaning >> pass mayEnd >> note entries "cleaned up")
    end <- withThread (decide (whenOneEnds (note entries "chosen")) [slow, pass entered]) $ \caller -> do
      pass cleaning
      stillRunning caller
      notes entries `shouldReturn` []
      open mayEnd
      awaitEnd caller
    end `shouldBe` Gave ()
    notes entries `shouldReturn` ["cleaned up", "chosen"]

  it "in the caller's thread and masking state" $
    for_ [id, mask_, uninterruptibleMask_] $ \inState -> do
      (here, there) <- inState $ do
        here <- (,) <$> myThreadId <*> getMaskingState
        there <- decide (whenOneEnds ((,) <$> myThreadId <*> getMaskingState)) [pure (), hang]
        pure (here, there)
      there `shouldBe` here

  it "and gives its result, failure or fault" $ do
    decide (whenOneEnds (pure 'x')) [pure ()] `shouldReturn` 'x'
    ending (decide (whenOneEnds (failWith "chosen")) [pure ()])
      `shouldReturn` (FailedWith "FailedBecause \"chosen\"" :: Ending ())
    ending (decide (whenOneEnds (throwIO (Fault "chosen"))) [pure ()])
      `shouldReturn` (FaultedWith (show (Fault "chosen")) :: Ending ())

  it "but not if the caller is cancelled while the others clean up" $ do
    entries <- newLog
    entered <- newGate
    cleaning <- newGate
    mayEnd <- newGate
    let slow = (open entered >> hang) `uninterruptibly` (open cleaning >> pass mayEnd)
    end <- withThread (decide (whenOneEnds (note entries "chosen")) [slow, pass entered]) $ \caller -> do
      pass cleaning
      throwing (asyncThreadId caller) (Cancel "the caller")
      open mayEnd
      awaitEnd caller
    end `shouldBe` CancelledBy (show (Cancel "the caller"))
    notes entries `shouldReturn` []

unchosen :: Spec
unchosen = do
  it "by the fault of a behaviour, after the cleanups of the others; nothing chosen runs" $ do
    entries <- newLog
    entered <- newGate
    let other = (open entered >> hang) `uninterruptibly` note entries "cleaned up"
    ending (decide (whenOneEnds (note entries "chosen")) [other, pass entered >> throwIO (Fault "lidar")])
      `shouldReturn` FaultedWith (show (Fault "lidar"))
    notes entries `shouldReturn` ["cleaned up"]

  it "by the leftmost of two faults, though the function has chosen" $ do
    entries <- newLog
    entered <- newGate
    let faulty = (open entered >> hang) `onException` throwIO (Fault "cleanup")
    ending (decide (whenOneEnds (note entries "chosen")) [faulty, pass entered])
      `shouldReturn` FaultedWith (show (Fault "cleanup"))
    notes entries `shouldReturn` []

  it "by what the function throws, after the cleanups" $
    for_
      [ (throw (Fault "function"), FaultedWith (show (Fault "function")))
      , (throw (FailedBecause "no quorum"), FailedWith "FailedBecause \"no quorum\"")
      ]
      $ \(bottom, expected) -> do
        entries <- newLog
        entered <- newGate
        let other = (open entered >> hang) `uninterruptibly` note entries "cleaned up"
            choose ends = if null (catMaybes ends) then Nothing else bottom
        ending (decide choose [other, pass entered]) `shouldReturn` (expected :: Ending ())
        notes entries `shouldReturn` ["cleaned up"]

  it "by the fault of a cleanup, though the function has thrown" $ do
    entered <- newGate
    let other = (open entered >> hang) `onException` throwIO (Fault "cleanup")
        choose ends = if null (catMaybes ends) then Nothing else throw (Fault "function")
    ending (decide choose [other, pass entered]) `shouldReturn` (FaultedWith (show (Fault "cleanup")) :: Ending ())

  it "by what the function throws before the start: nothing starts" $ do
    entries <- newLog
    ending (decide (throw (Fault "function")) [note entries "started"])
      `shouldReturn` (FaultedWith (show (Fault "function")) :: Ending ())
    notes entries `shouldReturn` []

  it "by a fault that names decide, if all have ended and nothing is chosen" $
    for_ [[], [pure ()], [pure (), failWith "a", pure ()]] $ \behaviors -> do
      end <- ending (decide (const Nothing) behaviors) :: IO (Ending ())
      end `shouldSatisfy` \case FaultedWith why -> "decide: " `isInfixOf` why; _ -> False

  it "by a cancellation that arrives while the function computes" $ do
    computing <- newEmptyMVar
    let choose ends
          | null (catMaybes ends) = Nothing
          | otherwise = unsafePerformIO (putMVar computing ()) `seq` endless
    end <- cancelling (decide choose [pure ()]) (takeMVar computing)
    end `shouldBe` (CancelledBy (show (Cancel "the caller")) :: Ending ())
 where
  endless = sum [1 :: Integer ..] `seq` Nothing

patterns :: Spec
patterns = do
  it "firstOf: they have the same ends under all schedules" $
    for_ [(a, b) | a <- actions, b <- actions, any ((`elem` ["succeeds", "fails", "faults"]) . fst) [a, b]] $
      \(a, b) -> do
        (one, _) <- allEnds (firstOf [snd a, snd b])
        (other, _) <- allEnds (decide firstEnd [snd a, snd b])
        (fst a, fst b, other) `shouldBe` (fst a, fst b, one)

  it "two of three, with at most twice the schedules of the first of three" $ do
    (_, least) <- allEnds (void (firstOf (replicate 3 (pure ()))))
    (ends, more) <- allEnds (void (decide twoOfThree (replicate 3 (pure ()))))
    ends `shouldBe` ["()"]
    more `shouldSatisfy` (<= 2 * least)
 where
  actions =
    [ ("succeeds", pure "succeeded")
    , ("fails", failWith "failed")
    , ("faults", throwIO (Fault "faulted"))
    , ("hangs", hang `onException` throwIO (Fault "cleanup"))
    , ("completes", hang `catch` \(_ :: SomeAsyncException) -> pure "completed")
    ]
  twoOfThree ends = case catMaybes ends of
    _ : _ : _ -> Just (pure ())
    _ -> Nothing

-- | Chooses the end that is there first; on a tie the leftmost.
firstEnd :: [Maybe (Either BehaviorFailed a)] -> Maybe (Behavior a)
firstEnd ends = listToMaybe [either throwIO pure end | Just end <- ends]

whenOneEnds :: Behavior b -> [Maybe (Either BehaviorFailed a)] -> Maybe (Behavior b)
whenOneEnds act ends = act <$ listToMaybe (catMaybes ends)

-- | What a function was asked, and how it remembers that. (A transaction may run more than once.)
recorder :: Eq a => IO (IO [[Maybe (Either String a)]], [Maybe (Either BehaviorFailed a)] -> b -> b)
recorder = do
  seen <- newIORef []
  let remember ends b = unsafePerformIO (modifyIORef' seen (map (fmap (first show)) ends :)) `seq` b
  pure (map head . group . reverse <$> readIORef seen, remember)

returned :: (Eq a, Show a) => Run a -> a -> IO ()
returned run a = case outcome run of
  Sim.Returned a' -> a' `shouldBe` a
  end -> fail (Sim.explain end)

-- | All the ways in which it can end, and the number of schedules with one pre-emption.
allEnds :: Show a => Behavior a -> IO ([String], Int)
allEnds act = do
  found <- newIORef []
  report <- explore (exhaustively 1) $ \simulated -> do
    run <- simulated act
    modifyIORef' found (endOf (outcome run) :)
  ends <- nub . sort <$> readIORef found
  pure (ends, reportSchedules report)
 where
  endOf = \case
    Sim.Returned a -> show a
    other -> Sim.explain other
