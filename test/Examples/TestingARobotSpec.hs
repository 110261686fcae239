-- |
-- The tutorial "Testing a robot": the code and the output that it shows are real.
module Examples.TestingARobotSpec (spec) where

import Control.Exception (throwIO, try)
import Control.Monad (unless, (>=>))
import Data.Foldable (for_)
import Data.List (isInfixOf, isPrefixOf, tails)
import Test.Hspec

import Behavior.Sim
import Rover
import RoverTrial
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "The rover" rover
  describe "The first version" $ do
    it "holds when nothing happens at the same time" $
      for_ [3, 7, 12] $ \moment ->
        trial (mission goHomeAtFirst) [(0, False), (moment, True)] (simulate >=> well)
    it "fails under random schedules, as the page says" $
      wholeMission goHomeAtFirst (randomly 1000) `failsAs` 1
    it "fails under some schedule of the way home, as the page says" $
      wayHome goHomeAtFirst (exhaustively 1) `failsAs` 2
    it "fails again under the schedule that the page shows" $ do
      found <- try (wayHome goHomeAtFirst (exhaustively 1))
      again <- try (wayHome goHomeAtFirst (replaying (either failingSchedule (const NonPreemptive) found)))
      either (show . failingException) show again `shouldBe` either (show . failingException) show found
      either (length . failingSteps) (const 0) again `shouldBe` either (length . failingSteps) (const (-1)) found
  describe "A failed expectation of hspec" $ do
    it "is shown as by hspec, as the page says" $
      charged 20 (exhaustively 0) `failsAs` 5
    it "has fewer steps if they are narrowed, as the page says" $
      charged 20 motorOnly `failsAs` 6
    it "of any kind is shown as by hspec" $ do
      let shown expectation = either asHspec (const "it held") <$> try expectation
      shown ((1 :: Int) `shouldBe` 2) `shouldReturn` "expected: 2\n but got: 1"
      shown (expectationFailure "no") `shouldReturn` "no"
      shown (throwIO (userError "x") :: Expectation) `shouldReturn` "user error (x)"
  describe "The page" $ do
    it "shows the text of the modules" $ do
      modules <- traverse (fmap lines . readFile) sources
      shown <- blocks "haskell"
      length shown `shouldSatisfy` (>= 5)
      for_ shown $ \block -> block `shouldSatisfy` \text -> any (text `isInfixOf`) modules
    it "shows the reports for the corrected version" $ do
      said <- traverse (fmap show) [wholeMission goHome (randomly 1000), wayHome goHome (exhaustively 2)]
      shown <- take 2 . drop 2 <$> blocks "text"
      concat shown `shouldBe` said
 where
  sources =
    [ "examples/testing-a-robot/Rover.hs"
    , "examples/testing-a-robot/RoverTrial.hs"
    , "test/Examples/TestingARobotSpec.hs"
    ]

rover :: Spec
rover = do
  it "stops its motor, whenever the button is pressed" $
    for_ [3, 7, 12] $ \moment ->
      trial (mission goHome) [(0, False), (moment, True)] (simulate >=> well)

  it "stops its motor, whichever thread is quicker" $ do
    tried <- wholeMission goHome (randomly 1000)
    tried `shouldSatisfy` reportComplete

  it "stops its motor on the way home, under every schedule with two pre-emptions" $ do
    tried <- wayHome goHome (exhaustively 2)
    tried `shouldSatisfy` reportComplete
    reportStarted tried `shouldContain` ["drive home"]

  it "stops its motor in reality" $
    trial (\robot -> untilButton robot (goHome robot)) [(0, True)] id

-- | The exploration fails, and its output is the page's text block with this number.
failsAs :: IO Report -> Int -> Expectation
failsAs exploration n = do
  said <- either show (("nothing fails: " ++) . show) <$> (try exploration :: IO (Either Counterexample Report))
  shown <- blocks "text"
  for_ (take 1 (drop (n - 1) shown ++ [[]])) $ \text ->
    unless (pieces text `inOrder` lines said) (said `shouldBe` unlines text)

-- | The parts of a text. A line of three dots on the page stands for omitted lines.
pieces :: [String] -> [[String]]
pieces text = case break (== "...") text of
  (piece, _ : more) -> piece : pieces more
  (piece, []) -> [piece]

-- | Whether the text consists of these pieces, with any lines in between.
inOrder :: [[String]] -> [String] -> Bool
inOrder [] text = null text
inOrder [piece] text = piece == text
inOrder (piece : more) text =
  piece `isPrefixOf` text && any (inOrder more) (tails (drop (length piece) text))

-- | The code blocks of the page in this language.
blocks :: String -> IO [[String]]
blocks language = go . lines <$> readFile "docs/testing-a-robot.md"
 where
  go text = case dropWhile (/= ("```" ++ language)) text of
    [] -> []
    _ : inside -> let (block, rest) = break (== "```") inside in block : go rest
