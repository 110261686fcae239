{-# LANGUAGE LambdaCase #-}

-- |
-- The table of the targets, the measurements, and whether each target is met.
--
-- It reads the rounds: lines of a name, a tab and a number. A line of a name, a tab and
-- anything else gives the reason why there are no measurements with that prefix. It prints the
-- table; with @keep FILE@ it also writes the ratios to the file, with @check FILE@ it lists those
-- that have become worse by more than a third.
--
-- Noise may last for some rounds, and affect only one of two programs. So a case counts as slower
-- only if it is so by the medians, by the shortest rounds, and by our own time alone. (So keep the
-- ratios again on a machine that is much faster.)
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
  measured <- parse . lines <$> getContents
  putStrLn (spread ["", "ours", "", "compared with", "ratio", "target", ""])
  for_ promises $ \group -> do
    putStrLn ("\n-- " ++ heading group ++ " (" ++ options group ++ ")")
    mapM_ (putStrLn . spread . cells measured) (rows group)
  getArgs >>= \case
    [] -> pure ()
    ["keep", file] -> keep file (ratiosOf measured)
    ["check", file] -> check file (ratiosOf measured)
    _ -> die "usage: table [keep FILE | check FILE]"

-- What was measured.

-- | The rounds of each measurement; and prefixes of missing measurements, with the reason.
data Measurements = Measurements (Map.Map String [Double]) [(String, String)]

parse :: [String] -> Measurements
parse report =
  Measurements
    (Map.fromListWith (++) [(name, [number]) | (name, Right number) <- entries])
    [(name, why) | (name, Left why) <- entries]
 where
  entries = map (fmap (meaning . drop 1) . break (== '\t')) report
  meaning text = maybe (Left text) Right (readMaybe text)

-- | Its rounds, or why there are none.
roundsOf :: Measurements -> Figure -> Either String (Figure, [Double])
roundsOf (Measurements rounds absences) figure = case Map.lookup (named figure) rounds of
  Just numbers -> Right (figure, numbers)
  Nothing -> Left (maybe "absent: not measured" snd (find ((`isPrefixOf` named figure) . fst) absences))

valueOf :: Measurements -> Figure -> Either String Double
valueOf measured figure = uncurry summarise <$> roundsOf measured figure

ratioOf :: Measurements -> Figure -> Figure -> Either String Double
ratioOf measured mine theirs = over <$> roundsOf measured mine <*> roundsOf measured theirs

-- The table.

cells :: Measurements -> Row -> [String]
cells measured (Row mine bounds) =
  [label mine, shown value] ++ case bounds of
    Times bound theirs -> than theirs ++ ["<= " ++ significant bound, verdict (<= bound) (ratioOf measured mine theirs)]
    Beside theirs -> than theirs ++ ["", fromLeft "" (ratioOf measured mine theirs)]
    AtMost bound -> ["", "", "", "<= " ++ significant bound, verdict (<= bound) value]
    AtLeast bound -> ["", "", "", ">= " ++ significant bound, verdict (>= bound) value]
    NoTarget -> ["", "", "", "", fromLeft "" value]
 where
  value = valueOf measured mine
  than theirs = [label theirs, shown (valueOf measured theirs), shown (ratioOf measured mine theirs)]
  shown = either (const "-") significant
  verdict meets = either id (\number -> if meets number then "met" else "NOT MET")

label :: Figure -> String
label figure
  | fold figure == 1 = named figure
  | otherwise = show (round (fold figure) :: Int) ++ " x " ++ named figure

-- | In columns: words aligned to the left, numbers to the right.
spread :: [String] -> String
spread = unwords . zipWith ($) [left 40, right 10, left 40, right 13, right 10, right 11, id]
 where
  left n text = text ++ replicate (n - length text) ' '
  right n text = replicate (n - length text) ' ' ++ text

-- | Three significant digits, and all those before the point.
significant :: Double -> String
significant number = showFFloat (Just (if number == 0 then 0 else max 0 (2 - magnitude))) number ""
 where
  magnitude = floor (logBase 10 (abs number))

-- The file of kept ratios, with a line for each.

type Pair = (String, String)

-- | The ratio in the table, the ratio of the shortest rounds, and the shortest round of ours.
type Ratios = [Double]

ratiosOf :: Measurements -> Map.Map Pair Ratios
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

-- | In the order of the table. Ratios that were not measured this time are not changed.
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
  putStrLn ("\n-- Compared with the ratios in " ++ file)
  for_ (Map.toList (before Map.\\ ratios)) $ \(pair, _) -> putStrLn (both pair ++ ": not measured")
  let worse = Map.filter (uncurry exceed) (Map.intersectionWith (,) ratios before)
      (slower, noise) = Map.partition (and . uncurry (zipWith exceeds)) worse
  list noise "not in its shortest round, or only because theirs is faster"
  list slower "SLOWER"
  if null slower then putStrLn "none is slower by more than a third" else exitFailure
 where
  both (mine, theirs) = mine ++ " / " ++ theirs
  list found verdict' =
    for_ (Map.toList found) $ \(pair, (are, were)) ->
      putStrLn (both pair ++ ": " ++ inTable are ++ ", before " ++ inTable were ++ ": " ++ verdict')
  inTable = concatMap significant . take 1
  exceed are were = or (take 1 (zipWith exceeds are were))
  ratio `exceeds` was = ratio > was * 4 / 3
