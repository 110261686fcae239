-- |
-- The command line of @door-battery@, and its simulated missions. (How its real runs end
-- is checked on the program itself.)
module Examples.DoorBatterySpec (spec) where

import Data.Foldable (for_)
import Data.List (isSuffixOf, nub, stripPrefix)
import Data.Maybe (mapMaybe)
import Options.Applicative (ParserResult (..), renderFailure)
import System.Exit (ExitCode (..))
import Test.Hspec

import Behavior.Sim (Schedule (..))
import Exploration
import Mission
import Options
import Support (guarded)
import World (DoorState (..))

spec :: Spec
spec = do
  describe "Its command line" commandLine
  describe "A simulated mission" (guarded simulation)
  describe "Many of them" (guarded exploration)

-- | Each mission takes milliseconds, in which minutes pass.
simulation :: Spec
simulation = do
  it "prints its timeline with the times of the world" $ do
    (timeline, m) <- simulated (given []) NonPreemptive
    end <$> m `shouldBe` Just TaskDone
    take 5 timeline
      `shouldBe` [ "    0.0 s   13 %  open front door ..."
                 , "    0.5 s   11 %  open front door: failed, the front door is locked"
                 , "    0.5 s   11 %  open back door ..."
                 , "    0.8 s    9 %  open back door: interrupted, motors off"
                 , "    0.8 s    9 %  recharge ..."
                 ]
    last timeline `shouldSatisfy` isSuffixOf "the task is done"

  for_ endings $ \(arguments, expected, exit, line) ->
    it ("ends like a real one: " ++ unwords arguments) $ do
      (timeline, m) <- simulated (given arguments) NonPreemptive
      let how = maybe NotOver end m
      (how, status how) `shouldBe` (expected, exit)
      last timeline `shouldSatisfy` isSuffixOf line

  it "reports the lowest level of the battery" $ do
    -- Read every 10 ms, at 4 % per second, the battery is low just below 10 %.
    (_, m) <- simulated (given []) NonPreemptive
    lowest <$> m `shouldSatisfy` maybe False (\level -> level > 9.8 && level < 10)
    (_, n) <- simulated (given ["--drain", "0"]) NonPreemptive
    lowest <$> n `shouldBe` Just 13

  it "without an end is given up" $ do
    -- The battery is above the threshold for less than a second, and the task takes several.
    (timeline, m) <- simulated (given ["--threshold", "95", "--speed", "0.1"]) NonPreemptive
    m `shouldBe` Nothing
    status NotOver `shouldBe` ExitFailure 4
    last timeline `shouldContain` "given up"

  it "is the same for the same seed and schedule, and different for another seed" $ do
    let run k n = simulated (given ["--seed", show (k :: Int)]) (Seeded n)
    first <- run 1 2
    run 1 2 `shouldReturn` first
    run 2 2 >>= (`shouldNotBe` first)

exploration :: Spec
exploration = do
  it "have the given number, and are different" $ do
    missions <- explored 20 (given [])
    map fst missions `shouldBe` [1 .. 20]
    worst missions `shouldBe` TaskDone
    length (nub (map (fmap lasted . snd) missions)) `shouldSatisfy` (> 10)

  it "start from the given seed" $
    map fst <$> explored 3 (given ["--seed", "41"]) `shouldReturn` [41, 42, 43]

  it "are reported with the options that run the worst one again" $ do
    missions <- explored 50 (given tight)
    let report = reported missions
        level = minimum (mapMaybe (fmap lowest . snd) missions)
        longest = maximum (mapMaybe (fmap lasted . snd) missions)
    again "lowest battery: " report >>= (`shouldBe` Just level) . fmap lowest
    again "longest mission: " report >>= (`shouldBe` Just longest) . fmap lasted

  it "end with the status of the worst" $ do
    missions <- explored 3 (given ["--front", "sealed", "--back", "sealed"])
    status (worst missions) `shouldBe` ExitFailure 1
    reported missions `shouldContain` ["      3  the robot failed: --simulate --seed 1 --schedule 1"]

  it "are reported when some do not end" $ do
    report <- reported <$> explored 1 (given ["--threshold", "95", "--action", "60", "--charge", "1"])
    report !! 5 `shouldContain` "      1  not over"
 where
  -- The battery gets low in some of the missions.
  tight = ["--battery", "31", "--action", "0.9"]
  -- The mission with the options in the report's line.
  again title report = case mapMaybe (stripPrefix title) report of
    [text] -> case parse (tight ++ words (drop 2 (dropWhile (/= ':') text))) of
      Success o | Simulated (Just n) <- mode o -> snd <$> simulated o (Seeded (fromInteger n))
      _ -> fail ("no options: " ++ text)
    _ -> fail ("not one line " ++ title)

endings :: [([String], End, ExitCode, String)]
endings =
  [ (["--front", "open", "--seed", "7"], TaskDone, ExitSuccess, "the task is done")
  , (["--program", "1", "--front", "open"], TaskDoneOutside, ExitSuccess, "the task is done, but not in the room")
  , (["--program", "4", "--front", "jammed:2"], TaskDone, ExitSuccess, "the task is done")
  , (sealed, RobotFailed, ExitFailure 1, "the robot failed at \"smash back door\": the back door is sealed")
  , (["--battery", "5", "--drain", "50", "--threshold", "0"], RanFlat, ExitFailure 3, "the battery is flat")
  , ( ["--speed", "20", "--battery", "60", "--action", "20", "--drain", "0.5"]
    , TaskDone
    , ExitSuccess
    , "the task is done"
    )
  ]
 where
  sealed = ["--front", "sealed", "--back", "sealed"]

commandLine :: Spec
commandLine = do
  it "accepts every state of a door" $
    for_ states $ \(word, state) ->
      accepted ["--front", word, "--back", word] (\o -> (front o, back o)) `shouldBe` Just (state, state)

  it "accepts every version of the paper's program" $
    for_ (zip ["1", "2", "3", "4", "intro", "names"] [minBound ..]) $ \(word, chosen) ->
      accepted ["--program", word] program `shouldBe` Just chosen

  describe "rejects, with exit status 2 and the allowed values," $
    for_ refusals $ \(option, word, allowed) ->
      it (option ++ " " ++ word) $ do
        let (message, exit) = refused (words option ++ [word])
        exit `shouldBe` ExitFailure 2
        message `shouldContain` allowed

  it "rejects a threshold for the programs that have a fixed one" $
    snd (refused ["--program", "3", "--threshold", "20"]) `shouldBe` ExitFailure 2

  it "has the exit status 0 with --help" $
    snd (refused ["--help"]) `shouldBe` ExitSuccess

  it "selects how missions are run" $
    for_ modes $ \(arguments, chosen) -> accepted arguments mode `shouldBe` Just chosen

  it "rejects two modes at once, and a schedule in the wrong mode" $
    for_ [["--simulate", "--explore", "2"], ["--schedule", "1"], ["--explore", "2", "--schedule", "1"]] $
      (`shouldBe` ExitFailure 2) . snd . refused
 where
  modes =
    [ ([], Really)
    , (["--simulate"], Simulated Nothing)
    , (["--simulate", "--schedule", "7"], Simulated (Just 7))
    , (["--explore", "100"], Explored 100)
    ]
  states =
    [ ("open", Open)
    , ("closed", Closed)
    , ("locked", Locked)
    , ("jammed:3", Jammed 3)
    , ("sealed", Sealed)
    ]
  refusals =
    [ ("--front", "ajar", "open, closed, locked")
    , ("--back", "jammed:", "jammed:N")
    , ("--back", "jammed:-1", "jammed:N")
    , ("--battery", "101", "from 0 to 100")
    , ("--battery", "-1", "from 0 to 100")
    , ("--threshold", "ten", "from 0 to 100")
    , ("--drain", "-0.5", "from 0 to")
    , ("--charge", "0", "greater than 0")
    , ("--action", "NaN", "from 0 to")
    , ("--program", "5", "1, 2, 3, 4, intro")
    , ("--speed", "0", "greater than 0")
    , ("--speed", "Infinity", "greater than 0")
    , ("--seed", "-1", "0, 1, 2 and so on")
    , ("--simulate --schedule", "x", "0, 1, 2 and so on")
    , ("--explore", "0", "from 1 to 1000000")
    , ("--explore", "1e3", "from 1 to 1000000")
    ]

given :: [String] -> Options
given arguments = case parse arguments of
  Success o -> o
  _ -> error "no such options"

accepted :: [String] -> (Options -> a) -> Maybe a
accepted arguments field = case parse arguments of
  Success o -> Just (field o)
  _ -> Nothing

-- | The message, and the exit status.
refused :: [String] -> (String, ExitCode)
refused arguments = case parse arguments of
  Failure failure -> renderFailure failure "door-battery"
  _ -> error "it was accepted, or completed"
