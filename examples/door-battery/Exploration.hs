-- |
-- Many simulated missions, and the worst of them.
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

-- | Simulates so many missions. Each has a number, which is both its seed and its
-- schedule; with it stands what came of it, if it came to an end.
explored :: Int -> Options -> IO [(Integer, Maybe Mission)]
explored n o =
  for (take n [fromMaybe 1 (seed o) ..]) $ \k ->
    (,) k . snd <$> simulated o {seed = Just k} (Seeded (fromInteger k))

endOf :: Maybe Mission -> End
endOf = maybe NotOver end

-- | How the worst of them ended.
worst :: [(Integer, Maybe Mission)] -> End
worst = maximum . map (endOf . snd)

-- | A report, which says how to see the worst again.
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
  -- Of what went well there is no need to see one.
  first how ks = if how == TaskDone then "" else foldMap replay (take 1 ks)
  replay k = ": --simulate --seed " ++ show k ++ " --schedule " ++ show k
  fixed :: Double -> String
  fixed x = showFFloat (Just 1) x ""
  column width text = replicate (width - length text) ' ' ++ text
