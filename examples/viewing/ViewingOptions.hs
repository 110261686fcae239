-- |
-- The options of a program that can show what it does.
module ViewingOptions
  ( viewingOptions
  ) where

import Behavior.Trace.Viewing (Viewing (..))
import Options.Applicative

viewingOptions :: Parser Viewing
viewingOptions =
  Viewing
    <$> file "trace" "write the events of the run to this file; behavior-trace shows it"
    <*> file "timeline" "draw the run as an SVG file"
    <*> switch (long "tree" <> help "show what runs as a tree, below the lines that are printed")
 where
  file name what = optional (strOption (long name <> metavar "FILE" <> help what))
