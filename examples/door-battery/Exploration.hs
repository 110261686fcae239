-- |
-- Many simulated missions, and the worst one.
module Exploration
  ( explored
  , worst
  , reported
  ) where

import Data.Foldable (maximumBy, minimumBy)
import Data.Maybe (fromMaybe)
import Data.Ord (comparing)
import Data.Traversable (for)
import Numeric (showFFloat)

import Behavior.Sim (Schedule (..))
import Mission
import Options

-- | Simulates the given number of missions. Each has a number, which is both its seed and
-- its schedule, and a result, if it ended.
explored :: Int -> Options -> IO [(Integer, Maybe Mission)]
explored n o =
  for (take n [fromMaybe 1 (seed o) ..]) $ \k ->
    (,) k . snd <$> simulated o {seed = Just k} (Seeded (fromInteger k))

endOf :: Maybe Mission -> End
endOf = maybe NotOver end

-- | How the worst mission ended.
worst :: [(Integer, Maybe Mission)] -> End
worst = maximum . map (endOf . snd)

-- | A report, with the options that replay the worst missions.
reported :: [(Integer, Maybe Mission)] -> [String]
reported missions =
  [show (length missions) ++ " missions, each with a schedule and a seed of its own"]
    ++ [column 7 (show (length ks)) ++ "  " ++ inWords how ++ first how ks | how <- [minBound ..], let ks = ending how]
    ++ concat
      [ [ "lowest battery: " ++ fixed (lowest low) ++ " %" ++ replay k
        , "longest mission: " ++ fixed (realToFrac (lasted long)) ++ " s" ++ replay l
        ]
      | not (null ended)
      , let (k, low) = minimumBy (comparing (lowest . snd)) ended
      , let (l, long) = maximumBy (comparing (lasted . snd)) ended
      ]
    ++ ["To see one of them, put these options in the place of --explore, and leave the others as they are."]
 where
  ending how = [k | (k, m) <- missions, endOf m == how]
  ended = [(k, m) | (k, Just m) <- missions]
  -- A mission that went well needs no replay.
  first how ks = if how == TaskDone then "" else foldMap replay (take 1 ks)
  replay k = ": --simulate --seed " ++ show k ++ " --schedule " ++ show k
  fixed :: Double -> String
  fixed x = showFFloat (Just 1) x ""
  column width text = replicate (width - length text) ' ' ++ text
