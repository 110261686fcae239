{-# LANGUAGE LambdaCase #-}

-- |
-- The command line of @door-battery@.
module Options
  ( Options (..)
  , Program (..)
  , Mode (..)
  , parse
  ) where

import Control.Monad (mfilter)
import Data.Char (isDigit)
import Data.List (intercalate, stripPrefix)
import Data.Maybe (isJust)
import Options.Applicative
import Text.Read (readMaybe)

import Behavior.Live (Viewing (livePage), defaultViewing)
import ViewingOptions (viewingOptions)
import World (DoorState (..))

data Options = Options
  { front :: DoorState
  , back :: DoorState
  , batteryPercent :: Int
  , drainRate :: Double
  , chargeRate :: Double
  , lowBelow :: Int
  , actionSeconds :: Double
  , program :: Program
  , speedFactor :: Double
  , seed :: Maybe Integer
  , mode :: Mode
  , shown :: Viewing
  }
  deriving (Eq, Show)

-- | The versions of the program in the paper, and one with names.
data Program = First | WithDo | OverDoors | WithAttempts | Introduction | WithNames
  deriving (Eq, Show, Enum, Bounded)

-- | How missions are run, and how many.
data Mode
  = Really
  | -- | Under the random schedule with this number, or under the non-preemptive one.
    Simulated (Maybe Integer)
  | -- | This number of missions.
    Explored Int
  deriving (Eq, Show)

-- | Reads the arguments. If they are wrong, the result has exit code 2 and a message with
-- the allowed values.
parse :: [String] -> ParserResult Options
parse arguments = execParserPure defaultPrefs commandLine arguments >>= checked
 where
  checked o
    | lowBelow o /= printedThreshold && program o `notElem` [First, WithDo] =
        refuse $
          "option --threshold: program " ++ programName (program o) ++ " is written with a \
          \threshold of its own; allowed: " ++ show printedThreshold
    | Explored _ <- mode o
    , shown o /= defaultViewing =
        refuse "options --trace, --timeline, --tree and --live show one mission; allowed: without --explore"
    | Simulated _ <- mode o
    , isJust (livePage (shown o)) =
        refuse "option --live shows a mission while it runs; allowed: without --simulate"
    | otherwise = pure o
  refuse why = Failure (parserFailure defaultPrefs commandLine (ErrorMsg why) [])

commandLine :: ParserInfo Options
commandLine =
  info (helper <*> options) $
    fullDesc
      <> failureCode 2
      <> progDesc
        "A robot must enter a room by one of two doors and do its task there, and never \
        \run out of battery: the example of Biggar and Shames, in a mock world."
      <> footer
        "Exit status: 0 when the task is done, 1 when the robot failed or a file could not be written, \
        \2 for bad options, 3 for a fault of the world (the battery is flat), 4 when a simulated mission was \
        \not over after what would be an hour, 130, 143 or 129 when stopped by SIGINT (Ctrl-C), SIGTERM \
        \or SIGHUP (the terminal was closed). \
        \Of --explore: that of the worst mission."

options :: Parser Options
options =
  Options
    <$> given "front" "STATE" doorState Locked ("the front door: " ++ allowed doorState)
    <*> given "back" "STATE" doorState Locked "the back door, likewise"
    <*> given "battery" "PERCENT" percent 13 "level of the battery at the start"
    <*> given "drain" "PERCENT" amount 4 "what it loses in a second"
    <*> given "charge" "PERCENT" factor 50 "what it gains in a second of charging"
    <*> given "threshold" "PERCENT" percent printedThreshold
      "level below which it is low, for programs 1 and 2 (the others are written with 10)"
    <*> given "action" "SECONDS" amount 0.5 "how long an action takes"
    <*> given "program" "NAME" aProgram WithDo
      ("version of the paper: " ++ allowed aProgram ++ "; 1 is kept as printed: if the front \
       \door is open it opens it, if not it goes on without; names has names for what --timeline shows")
    <*> given "speed" "FACTOR" factor 1
      "how much faster than real time (the battery is read every 10 ms of real time; so it \
       \is in a simulation too, which is over at once whatever the factor)"
    <*> optional
      (option (reader wholeNumber) . mconcat $
        [ long "seed"
        , metavar "N"
        , help "vary the length of every action but recharge by up to 20 %, each N in its own way"
        ])
    <*> (simulation <|> exploration <|> pure Really)
    <*> viewingOptions "door-battery"
 where
  simulation =
    flag' Simulated (long "simulate" <> help "the same in virtual time: the whole report is printed at once")
      <*> optional
        (option (reader wholeNumber) . mconcat $
          [ long "schedule"
          , metavar "N"
          , help "which thread goes first when several can: at random, each N in its own way"
          ])
  exploration =
    option (Explored <$> reader howMany) . mconcat $
      [ long "explore"
      , metavar "N"
      , help
          "simulate N missions, with the seeds and schedules 1, 2 and so on (or from --seed on), \
          \and report only the worst"
      ]
  given name meta kind byDefault what =
    option (reader kind) . mconcat $
      [ long name
      , metavar meta
      , value byDefault
      , showDefaultWith (written kind)
      , help what
      ]

-- | A kind of value that can be given on the command line.
data Kind a = Kind
  { noun :: String
  , allowed :: String
  , recognised :: String -> Maybe a
  , written :: a -> String
  }

reader :: Kind a -> ReadM a
reader kind = eitherReader $ \word -> maybe (Left (wrong word)) Right (recognised kind word)
 where
  wrong word = show word ++ " is not " ++ noun kind ++ "; allowed: " ++ allowed kind

doorState :: Kind DoorState
doorState =
  Kind
    { noun = "a state of a door"
    , allowed =
        "open, closed, locked (opening fails, smashing works), \
        \jammed:N (the first N tries to open fail), sealed (neither works)"
    , recognised = \case
        "open" -> Just Open
        "closed" -> Just Closed
        "locked" -> Just Locked
        "sealed" -> Just Sealed
        word -> stripPrefix "jammed:" word >>= fmap (Jammed . fromInteger) . digits
    , written = \case
        Open -> "open"
        Closed -> "closed"
        Locked -> "locked"
        Jammed n -> "jammed:" ++ show n
        Sealed -> "sealed"
    }

aProgram :: Kind Program
aProgram =
  Kind
    { noun = "a program"
    , allowed = intercalate ", " (map programName [minBound ..])
    , recognised = \word -> lookup word [(programName p, p) | p <- [minBound ..]]
    , written = programName
    }

programName :: Program -> String
programName = \case
  First -> "1"
  WithDo -> "2"
  OverDoors -> "3"
  WithAttempts -> "4"
  Introduction -> "intro"
  WithNames -> "names"

-- | The threshold in the text of programs 3, 4, intro and names.
printedThreshold :: Int
printedThreshold = 10

percent :: Kind Int
percent =
  Kind
    { noun = "a level of a battery"
    , allowed = "a whole number from 0 to 100"
    , recognised = fmap fromInteger . mfilter (<= 100) . digits
    , written = show
    }

wholeNumber :: Kind Integer
wholeNumber =
  Kind
    { noun = "a whole number"
    , allowed = "0, 1, 2 and so on"
    , recognised = digits
    , written = show
    }

howMany :: Kind Int
howMany =
  Kind
    { noun = "a number of missions"
    , allowed = "a whole number from 1 to 1000000"
    , recognised = fmap fromInteger . mfilter (\n -> n >= 1 && n <= 1000000) . digits
    , written = show
    }

amount :: Kind Double
amount =
  Kind
    { noun = "an amount"
    , allowed = "a number from 0 to 1000000"
    , recognised = number (\n -> n >= 0 && n <= 1000000)
    , written = show
    }

factor :: Kind Double
factor =
  Kind
    { noun = "an amount"
    , allowed = "a number greater than 0, up to 1000000"
    , recognised = number (\n -> n > 0 && n <= 1000000)
    , written = show
    }

digits :: String -> Maybe Integer
digits word
  | not (null word) && all isDigit word = readMaybe word
  | otherwise = Nothing

-- | A number that satisfies the condition. NaN never does.
number :: (Double -> Bool) -> String -> Maybe Double
number condition = mfilter condition . readMaybe
