-- |
-- Where something ran: the names of the spans around it.
module Behavior.Trace.Path
  ( Path
  , pathOf
  , innermostFirst
  , inPath
  , renderPath
  ) where

import Data.Function (on)
import Data.List (foldl', intercalate)

import Behavior.Trace.Describe

-- | The names of the spans with a name around a span, and its own. A loop can make a hundred thousand
-- spans one inside the other; so paths share the outer names.
--
-- @since 0.1.0.0
data Path = Path
  { depth :: !Int
  , outermost :: [String]
  -- ^ The first ones, the outermost first.
  , innermostFirst :: [String]
  -- ^ All names.
  }

instance Eq Path where
  (==) = (==) `on` innermostFirst

-- | As a call of 'pathOf'.
instance Show Path where
  showsPrec d p = showParen (d > 10) (showString "pathOf " . shows (reverse (innermostFirst p)))

-- | The path with these names, the outermost first.
--
-- >>> innermostFirst (pathOf ["mission", "survey"])
-- ["survey","mission"]
--
-- @since 0.1.0.0
pathOf :: [String] -> Path
pathOf = foldl' (flip inPath) (Path 0 [] [])

-- | The path of what has this name, in what has that path.
--
-- >>> inPath "survey" (pathOf ["mission"])
-- pathOf ["mission","survey"]
--
-- @since 0.1.0.0
inPath :: String -> Path -> Path
inPath name p =
  Path
    { depth = depth p + 1
    , outermost = if depth p < shownOutermost then outermost p ++ [name] else outermost p
    , innermostFirst = name : innermostFirst p
    }

-- Of a long path, how many names are shown at its beginning and at its end.
shownOutermost, shownInnermost :: Int
shownOutermost = 4
shownInnermost = 8

-- | The path on one line. Of a long one the middle is left out.
--
-- >>> putStrLn (renderPath (pathOf ["mission", "survey"]))
-- mission > survey
--
-- @since 0.1.0.0
renderPath :: Path -> String
renderPath p
  | more > 1 =
      shown (outermost p ++ ["... (" ++ show more ++ " more)"] ++ reverse (take shownInnermost (innermostFirst p)))
  | otherwise = shown (reverse (innermostFirst p))
 where
  more = depth p - shownOutermost - shownInnermost
  shown = intercalate " > " . map nameText
