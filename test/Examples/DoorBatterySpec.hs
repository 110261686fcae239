-- |
-- The command line of @door-battery@. (How its runs end is checked on the program
-- itself.)
module Examples.DoorBatterySpec (spec) where

import Data.Foldable (for_)
import Options.Applicative (ParserResult (..), renderFailure)
import System.Exit (ExitCode (..))
import Test.Hspec

import Options
import World (DoorState (..))

spec :: Spec
spec = do
  it "takes every state of a door" $
    for_ states $ \(word, state) ->
      accepted ["--front", word, "--back", word] (\o -> (front o, back o)) `shouldBe` Just (state, state)

  it "takes every version of the paper's program" $
    for_ (zip ["1", "2", "3", "4", "intro"] [minBound ..]) $ \(word, chosen) ->
      accepted ["--program", word] program `shouldBe` Just chosen

  describe "refuses, with exit status 2 and what is allowed," $
    for_ refusals $ \(option, word, allowed) ->
      it (option ++ " " ++ word) $ do
        let (message, status) = refused [option, word]
        status `shouldBe` ExitFailure 2
        message `shouldContain` allowed

  it "refuses a threshold for the programs that are printed with one" $
    snd (refused ["--program", "3", "--threshold", "20"]) `shouldBe` ExitFailure 2

  it "has the exit status 0 when it was asked for help" $
    snd (refused ["--help"]) `shouldBe` ExitSuccess
 where
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
    ]

accepted :: [String] -> (Options -> a) -> Maybe a
accepted arguments field = case parse arguments of
  Success o -> Just (field o)
  _ -> Nothing

-- | What is said, and the exit status.
refused :: [String] -> (String, ExitCode)
refused arguments = case parse arguments of
  Failure failure -> renderFailure failure "door-battery"
  _ -> error "it was accepted, or completed"
