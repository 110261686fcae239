-- |
-- 'agreeing': M of N whose results agree. (It is made of 'Behavior.Parallel.decide', for which the rest
-- is tested.)
module Behavior.AgreeingSpec (spec) where

import Control.Exception (onException, throwIO)
import Control.Monad (void)
import Data.Foldable (for_)
import Data.List (sort, subsequences)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (Fun, applyFun2, choose, forAll, ioProperty, vectorOf, (===))

import Behavior
import Behavior.Parallel (agreeing)
import Behavior.Sim (Outcome (..), Run (outcome), exhaustively, explain, explore, simulate)
import Behavior.Time (now)
import Support

spec :: Spec
spec = guarded . describe "agreeing" $ do
  it "gives the first that agree, in the order of their behaviours, and stops the rest" $ do
    entries <- newLog
    let sensor (seconds, value) = (sleep seconds >> pure value) `onException` note entries seconds
    found <- timed (agreeing 2 (==) (map sensor [(3, 'a'), (1, 'b'), (2, 'a'), (9, 'a')]))
    found `shouldBe` (3, Right "aa")
    notes entries `shouldReturn` [9]

  it "ends as soon as there are enough, or cannot be any more" $
    -- Each sensor answers a second after the one before.
    for_
      [ (2, "abab", 3, Right "aa")
      , (2, "abcd", 4, Left "FailedBecause \"no 2 of 4 agree\"")
      , (3, "abca", 3, Left "FailedBecause \"no 3 of 4 agree\"")
      , (3, "ab??", 3, Left "FailedBecause \"no 3 of 4 agree\"")
      , (3, "?a?a", 3, Left "FailedBecause \"no 3 of 4 agree\"")
      , (1, "?a", 2, Right "a")
      ]
      $ \(m, answers, seconds, end) -> do
        found <- timed . agreeing m (==) $
          [sleep n >> if answer == '?' then failed else pure answer | (n, answer) <- zip [1 ..] answers]
        (m, answers, found) `shouldBe` (m, answers, (seconds, end))

  prop "is its definition, with any relation" $ \relation ->
    forAll (choose (-1, 4)) $ \m -> forAll (choose (0, 6) >>= (`vectorOf` choose (0, 5))) $ \values -> ioProperty $ do
      let agree a b = applyFun2 (relation :: Fun (Int, Int) Bool) (min a b) (max a b)
      found <- timed (agreeing m agree [sleep n >> pure v | (n, v) <- zip [1 ..] values])
      pure (found === defined m agree values)

  it "gives no results of which two do not agree" $ do
    let near a b = abs (a - b) <= (1 :: Int)
    ending (agreeing 3 near (map pure [2, 1, 3])) `shouldReturn` FailedWith "FailedBecause \"no 3 of 3 agree\""

  it "starts nothing when the answer is certain" $ do
    entries <- newLog
    let sensor = note entries 'a'
    agreeing 0 (==) [sensor] `shouldReturn` []
    ending (agreeing 2 (==) [sensor]) `shouldReturn` FailedWith "FailedBecause \"no 2 of 1 agree\""
    notes entries `shouldReturn` ""

  it "throws a fault of a behaviour, and of the function" $ do
    ending (agreeing 2 (==) [pure 'a', throwIO (Fault "lidar"), hang]) `shouldReturn` FaultedWith (show (Fault "lidar"))
    ending (agreeing 2 (\_ _ -> errorWithoutStackTrace "no scale") (map pure "ab"))
      `shouldReturn` FaultedWith "no scale"

  it "of 200 sensors that agree in groups" $
    for_ [(11, 20), (51, 4)] $ \(m, groups) ->
      timed (agreeing m (==) [pure (n `mod` groups) | n <- [1 .. 200 :: Int]])
        `shouldReturn` (0, Left ("FailedBecause \"no " ++ show m ++ " of 200 agree\""))

  it "gives results that agree under all schedules of sensors that answer at the same time"
    . void . explore (exhaustively 1) $ \simulated ->
      (simulated (agreeing 2 (==) [pure 'a', pure 'b', pure 'a']) >>= returned) `shouldReturn` "aa"

-- | What 'agreeing' gives, and when, if each behaviour answers a second after the one before.
defined :: Int -> (a -> a -> Bool) -> [a] -> (Seconds, Either String [a])
defined m agree values = head (concatMap at [0 .. n])
 where
  n = length values
  at k = case (choices m k, choices (m - (n - k)) k) of
    (c : _, _) -> [(fromIntegral k, Right c)]
    ([], []) -> [(fromIntegral k, Left ("FailedBecause \"no " ++ show m ++ " of " ++ show n ++ " agree\""))]
    _ -> []
  -- The choices of that size among the first k results, by their positions, the leftmost first.
  choices size k =
    [ map (values !!) positions
    | positions <- sort (subsequences [0 .. k - 1])
    , length positions == max 0 size
    , and [agree (values !! i) (values !! j) | i <- positions, j <- positions, i < j]
    ]

-- | In a simulation: when it ended, and what it returned or how it failed.
timed :: Behavior a -> IO (Seconds, Either String a)
timed act = simulate (((Right <$> act) `fallbackWith` (pure . Left . show)) >>= \end -> (\t -> (t, end)) <$> now)
  >>= returned

returned :: Run a -> IO a
returned run = case outcome run of
  Returned a -> pure a
  other -> fail (explain other)
