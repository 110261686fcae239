-- |
-- Robots in processes of their own, which share tasks and resources through PostgreSQL. (@make fleet@ starts a server,
-- an office and twenty robots.)
--
-- It needs a database with the fleet's schema, and the table of @delivered.sql@.
module Main (main) where

import Control.Exception (SomeException, displayException, fromException)
import Options.Applicative
import System.Exit (ExitCode (..), exitWith)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Fleet
import Behavior.Live (LivePage (pageHost, pagePort, pageRobot), Viewing (..), viewing)
import FleetMission
import SimulatedBody
import ViewingOptions (viewingOptions)

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  role <- customExecParser defaultPrefs commandLine
  runBehavior (tryAny role) >>= either failing pure
 where
  failing why = do
    let (text, code) = ended why
    putStrLn text
    exitWith (ExitFailure code)

-- | How it has ended, in words, and the exit code.
ended :: SomeException -> (String, Int)
ended why = case fromException why of
  Just failure -> ("it failed: " ++ displayException (failure :: BehaviorFailed), 1)
  Nothing -> ("fault: " ++ displayException why, 3)

commandLine :: ParserInfo (Behavior ())
commandLine =
  info (helper <*> hsubparser (role "robot" robotRole carries <> role "office" officeRole submits)) $
    fullDesc
      <> failureCode 2
      <> progDesc "Robots carry orders through two doors. All that they share is in a PostgreSQL database."
      <> footer "Exit status: 0 when all orders have ended, 1 for a failure, 2 for bad options, 3 for a fault."
 where
  role name how what = command name (info how (progDesc what <> failureCode 2))
  carries = "Carries orders, until it is interrupted."
  submits = "Submits orders, and waits until all have ended."

-- | The way to the fleet, for a robot.
type InFleet = Robot -> (Fleet -> Behavior ()) -> Behavior ()

inFleet :: Parser (Maybe LivePage -> (String -> Behavior ()) -> InFleet)
inFleet = with <$> address <*> term <*> within
 where
  with database lasts limit page say =
    withFleetOptions
      defaultFleetOptions
        { taskTerm = lasts
        , noDatabaseAfter = limit
        , pageAddress = addressOf <$> page
        , onFleetReport = say
        }
      (postgres database)
  address = strOption $ long "database" <> metavar "ADDRESS" <> value "dbname=fleet" <> showDefault <> help "libpq's"
  term = seconds "term" 10 (0.1, 86400) "when a robot is gone, its order is started again after this time"
  within = seconds "database-within" 60 (0.1, 86400) "how long to wait for the database"
  -- (If another program has this port, the page is at one of the next.)
  addressOf page = "http://" ++ pageHost page ++ ":" ++ show (pagePort page) ++ "/"

robotRole :: Parser (Behavior ())
robotRole = with <$> inFleet <*> name <*> skillsOf <*> speed <*> viewingOptions "" <*> port
 where
  with fleetOf me skilled faster view at = viewing view {livePage = page} $ do
    body <- newBody faster 0.5 say me (inTable me)
    fleetOf page say (Robot me skilled) (`mission` body)
   where
    page = (\it -> it {pageRobot = me, pagePort = at}) <$> livePage view
    say = putStrLn . ((me ++ ": ") ++)
  name = strArgument (metavar "NAME" <> help "no other robot has it")
  skillsOf = many . strOption $ long "skill" <> metavar "SKILL" <> help "what it is capable of: heavy orders need lift"
  speed = option (from 0.1 1000) $ long "speed" <> metavar "FACTOR" <> value 1 <> showDefault <> help "of its time"
  port = option auto $ long "page-port" <> metavar "PORT" <> value 8420 <> showDefault <> help "of its live page"

officeRole :: Parser (Behavior ())
officeRole = with <$> inFleet <*> count
 where
  with fleetOf n = fleetOf Nothing (putStrLn . ("office: " ++)) (Robot "office" []) $ \fleet -> do
    dead <- office fleet [Order it (it `mod` 10 == 0) | it <- [1 .. n]]
    putStrLn (show (n - length dead) ++ " of " ++ show n ++ " orders are delivered")
    mapM_ (putStrLn . uncurry missing) dead
  missing key task =
    key ++ " is not, after " ++ show (taskStarts task) ++ " starts; the last one: " ++ last ("" : taskReasons task)
  count = option auto (long "orders" <> metavar "NUMBER" <> value 500 <> showDefault <> help "how many")

seconds :: String -> Double -> (Double, Double) -> String -> Parser Seconds
seconds name chosen (least, most) what =
  fmap realToFrac . option (from least most) $
    long name <> metavar "SECONDS" <> value chosen <> showDefault <> help what

from :: Double -> Double -> ReadM Double
from least most = do
  n <- auto
  if n >= least && n <= most
    then pure n
    else readerError ("allowed: a number from " ++ show least ++ " to " ++ show most)
