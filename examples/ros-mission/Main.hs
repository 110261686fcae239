-- |
-- The paper's mission on a robot that speaks ROS. (@make robot@ starts a simulated one, and a bridge.)
module Main (main) where

import Options.Applicative
import System.Exit (ExitCode (..), exitWith)
import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Live (viewing)
import Behavior.Ros
import RosMission
import ViewingOptions (viewingOptions)

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  (bridge, view) <- customExecParser defaultPrefs commandLine
  how <- runBehavior (tryAny (viewing view (withRos (rosbridge bridge) mission)))
  let (text, code) = ended how
  putStrLn text
  exitWith (if code == 0 then ExitSuccess else ExitFailure code)
 where
  commandLine =
    info (helper <*> options) $
      fullDesc
        <> failureCode 2
        <> progDesc "A robot must enter a room by one of two doors and do its task there, and never run out of battery."
        <> footer "Exit status: 0 when the task is done, 1 when the robot failed, 2 for bad options, 3 for a fault."
  options = (,) <$> address <*> viewingOptions "ros-mission"
  address =
    strOption $
      long "bridge" <> metavar "ADDRESS" <> value "ws://127.0.0.1:9090" <> showDefault <> help "of a rosbridge"
