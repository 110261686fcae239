{-# LANGUAGE LambdaCase #-}

-- |
-- The table of what was promised of speed, what was measured, and whether it is met.
--
-- It reads the rounds: lines of a name, a tab and a number. A line of a name, a tab and
-- anything else says why there are no measurements whose names begin so. It shows the
-- table; and with @keep FILE@ it writes down the ratios, with @check FILE@ it tells which
-- of them have become worse by more than a third.
--
-- A machine's mood may last for some rounds, and meet only one of two. What has become slower
-- is so by the medians, by the shortest rounds, and by itself, beside nothing else. (So keep
-- the ratios anew on a machine that is much faster.)
module Main (main) where

import Data.Either (fromLeft)
import Data.Foldable (for_)
import Data.List (find, intercalate, isPrefixOf)
import qualified Data.Map.Strict as Map
import Numeric (showFFloat)
import System.Environment (getArgs)
import System.Exit (die, exitFailure)
import System.IO (readFile')
import Text.Read (readMaybe)

import Promises
import Row

main :: IO ()
main = do
  measured <- heard . lines <$> getContents
  putStrLn (spread ["", "ours", "", "theirs", "ratio", "target", ""])
  for_ promises $ \group -> do
    putStrLn ("\n-- " ++ heading group ++ " (" ++ options group ++ ")")
    mapM_ (putStrLn . spread . cells measured) (rows group)
  getArgs >>= \case
    [] -> pure ()
    ["keep", file] -> keep file (ratiosOf measured)
    ["check", file] -> check file (ratiosOf measured)
    _ -> die "usage: table [keep FILE | check FILE]"

-- What was measured.

-- | The rounds of each measurement, and whose measurements there are not, and why.
data Heard = Heard (Map.Map String [Double]) [(String, String)]

heard :: [String] -> Heard
heard report =
  Heard
    (Map.fromListWith (++) [(name, [number]) | (name, Right number) <- said])
    [(name, why) | (name, Left why) <- said]
 where
  said = map (fmap (meaning . drop 1) . break (== '\t')) report
  meaning text = maybe (Left text) Right (readMaybe text)

-- | Its rounds, or why there are none.
roundsOf :: Heard -> Figure -> Either String (Figure, [Double])
roundsOf (Heard rounds absences) figure = case Map.lookup (named figure) rounds of
  Just numbers -> Right (figure, numbers)
  Nothing -> Left (maybe "absent: not measured" snd (find ((`isPrefixOf` named figure) . fst) absences))

valueOf :: Heard -> Figure -> Either String Double
valueOf measured figure = uncurry comesTo <$> roundsOf measured figure

ratioOf :: Heard -> Figure -> Figure -> Either String Double
ratioOf measured mine theirs = over <$> roundsOf measured mine <*> roundsOf measured theirs

-- The table.

cells :: Heard -> Row -> [String]
cells measured (Row mine promise) =
  [label mine, shown value] ++ case promise of
    Times bound theirs -> than theirs ++ ["<= " ++ significant bound, verdict (<= bound) (ratioOf measured mine theirs)]
    Beside theirs -> than theirs ++ ["", fromLeft "" (ratioOf measured mine theirs)]
    AtMost bound -> ["", "", "", "<= " ++ significant bound, verdict (<= bound) value]
    AtLeast bound -> ["", "", "", ">= " ++ significant bound, verdict (>= bound) value]
    NoPromise -> ["", "", "", "", fromLeft "" value]
 where
  value = valueOf measured mine
  than theirs = [label theirs, shown (valueOf measured theirs), shown (ratioOf measured mine theirs)]
  shown = either (const "-") significant
  verdict meets = either id (\number -> if meets number then "met" else "NOT MET")

label :: Figure -> String
label figure
  | fold figure == 1 = named figure
  | otherwise = show (round (fold figure) :: Int) ++ " x " ++ named figure

-- | In columns: words to the left, numbers to the right.
spread :: [String] -> String
spread = unwords . zipWith ($) [left 40, right 10, left 40, right 10, right 10, right 11, id]
 where
  left n text = text ++ replicate (n - length text) ' '
  right n text = replicate (n - length text) ' ' ++ text

-- | Three significant digits, and all those before the point.
significant :: Double -> String
significant number = showFFloat (Just (if number == 0 then 0 else max 0 (2 - magnitude))) number ""
 where
  magnitude = floor (logBase 10 (abs number))

-- The ratios that are kept, a line for each.

type Pair = (String, String)

-- | That in the table, that of the shortest rounds, and the shortest round of ours.
type Ratios = [Double]

ratiosOf :: Heard -> Map.Map Pair Ratios
ratiosOf measured =
  Map.fromList
    [ (pairOf mine theirs, ratios)
    | Row mine (Times _ theirs) <- concatMap rows promises
    , Right ratios <-
        [ sequence
            [ ratioOf measured mine theirs
            , ratioOf measured (shortest mine) (shortest theirs)
            , valueOf measured (shortest mine)
            ]
        ]
    ]

pairOf :: Figure -> Figure -> Pair
pairOf mine theirs = (label mine, label theirs)

kept :: FilePath -> IO (Map.Map Pair Ratios)
kept file = Map.fromList . map (entry . split) . lines <$> readFile' file
 where
  split text = case break (== '\t') text of
    (word, '\t' : others) -> word : split others
    (word, _) -> [word]
  entry (mine : theirs : numbers) | Just ratios@[_, _, _] <- traverse readMaybe numbers = ((mine, theirs), ratios)
  entry other = error (file ++ ": not two names and three numbers: " ++ show other)

-- | In the order of the table. What was not measured this time stays as it was.
keep :: FilePath -> Map.Map Pair Ratios -> IO ()
keep file ratios = do
  before <- kept file
  writeFile file . unlines $
    [ intercalate "\t" (label mine : label theirs : map significant numbers)
    | Row mine (Times _ theirs) <- concatMap rows promises
    , Just numbers <- [Map.lookup (pairOf mine theirs) (Map.union ratios before)]
    ]

check :: FilePath -> Map.Map Pair Ratios -> IO ()
check file ratios = do
  before <- kept file
  putStrLn ("\n-- Beside the ratios in " ++ file)
  for_ (Map.toList (before Map.\\ ratios)) $ \(pair, _) -> putStrLn (both pair ++ ": not measured")
  let worse = Map.filter (uncurry exceed) (Map.intersectionWith (,) ratios before)
      (slower, moods) = Map.partition (and . uncurry (zipWith exceeds)) worse
  told' moods "not in its shortest round, or only because theirs is faster"
  told' slower "SLOWER"
  if null slower then putStrLn "none is slower by more than a third" else exitFailure
 where
  both (mine, theirs) = mine ++ " / " ++ theirs
  told' found how =
    for_ (Map.toList found) $ \(pair, (are, were)) ->
      putStrLn (both pair ++ ": " ++ inTable are ++ " where it was " ++ inTable were ++ ": " ++ how)
  inTable = concatMap significant . take 1
  exceed are were = or (take 1 (zipWith exceeds are were))
  ratio `exceeds` was = ratio > was * 4 / 3
