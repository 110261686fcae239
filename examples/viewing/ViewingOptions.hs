-- |
-- The options of a program that can show what it does.
module ViewingOptions
  ( viewingOptions
  ) where

import Behavior.Live (LivePage (pageRobot), Viewing (..), loopback)
import Options.Applicative

-- | Of the robot with this name.
viewingOptions :: String -> Parser Viewing
viewingOptions name =
  Viewing
    <$> file "trace" "write the events of the run to this file; behavior-trace shows it"
    <*> file "timeline" "draw the run as an SVG file"
    <*> switch (long "tree" <> help "show what runs as a tree, below the lines that are printed")
    <*> optional (flag' loopback {pageRobot = name} (long "live" <> help "serve a page that shows it in a browser"))
 where
  file this what = optional (strOption (long this <> metavar "FILE" <> help what))
