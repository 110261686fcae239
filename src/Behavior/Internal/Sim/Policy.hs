{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Which thread runs when several are enabled.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Policy
  ( Policy (..)
  , Decision (..)
  , policy
  , preempting
  , fully
  ) where

import Data.Bits (shiftR, xor)
import Data.IORef
import Data.Word (Word64)

import Behavior.Internal.Sim.Types (Schedule (..))

-- | A scheduling point at which several threads are enabled.
data Decision = Decision
  { decisionPoint :: !Int
  , usual :: !Int
  -- ^ The thread that runs in the non-preemptive schedule.
  , canGoOn :: !Bool
  -- ^ Whether that is the thread that ran until now: then any other choice is a pre-emption.
  , candidates :: [Int]
  -- ^ All enabled threads.
  , candidateCount :: !Int
  , candidateAt :: Int -> Int
  -- ^ The same, by their index from 0: fast even among many threads.
  }

-- | How decisions are made.
data Policy = Policy
  { askAt :: IO Int
  -- ^ The number of the next scheduling point at which the policy decides although the thread
  -- that runs can go on. (Where it cannot, the policy always decides.)
  , decide :: Decision -> IO (Either String Int)
  -- ^ Chooses one of the candidates; or the reason why the schedule does not fit.
  , unused :: IO [(Int, Int)]
  -- ^ The rest of the schedule.
  }

-- | The policy that runs a schedule.
policy :: Schedule -> IO Policy
policy NonPreemptive = preempting True []
policy (Preempting exceptions) = preempting True exceptions
policy (Seeded seed) = random seed

-- | The non-preemptive schedule with the given exceptions. An exception that does not fit is
-- refused, or (while the schedule is shrunk) left out.
preempting :: Bool -> [(Int, Int)] -> IO Policy
preempting strictly exceptions = do
  left <- newIORef exceptions
  pure
    Policy
      { askAt = maybe maxBound fst . firstOf <$> readIORef left
      , decide = \d -> do
          due <- readIORef left
          case dropWhile ((< decisionPoint d) . fst) due of
            (p, thread) : later
              | p == decisionPoint d -> do
                  writeIORef left later
                  pure (chosen d thread)
            later -> do
              writeIORef left (if strictly then due else later)
              pure (Right (usual d))
      , unused = if strictly then readIORef left else pure []
      }
 where
  firstOf [] = Nothing
  firstOf (e : _) = Just e
  chosen d thread
    | thread `elem` candidates d = Right thread
    | strictly =
        Left $
          "at point " ++ show (decisionPoint d) ++ " thread " ++ show thread ++ " cannot run; those that can: "
            ++ show (candidates d)
    | otherwise = Right (usual d)

-- | A random schedule. Each has its own rate of pre-emptions, between one in four points and
-- one in five hundred: few pre-emptions find most defects. (The numbers are those of SplitMix; what is added to
-- the seed could be anything, and fixes which schedule a seed has.)
random :: Int -> IO Policy
random seed = do
  state <- newIORef (fromIntegral seed * 0x9e3779b97f4a7c15 + 0x1234567)
  let next = do
        s <- (+ 0x9e3779b97f4a7c15) <$> readIORef state
        writeIORef state s
        pure (mixed s)
      below :: Int -> IO Int
      below n = (\word -> fromIntegral ((word `shiftR` 11) `mod` fromIntegral n)) <$> next
  rate <- (\k -> 2 ^ (k + 2)) <$> below (8 :: Int)
  let gap = below (2 * rate)
  due <- gap >>= newIORef
  pure
    Policy
      { askAt = readIORef due
      , decide = \d -> do
          wanted <- readIORef due
          if decisionPoint d < wanted
            then if canGoOn d then pure (Right (usual d)) else Right <$> among below d
            else do
              further <- gap
              writeIORef due (decisionPoint d + 1 + further)
              Right <$> among below d
      , unused = pure []
      }
 where
  among below d = candidateAt d <$> below (candidateCount d)

-- | The exceptions, then the non-preemptive schedule. Runs the given action for every decision
-- after the last exception.
fully :: [(Int, Int)] -> (Decision -> IO ()) -> IO Policy
fully exceptions onDecision = do
  inner <- preempting True exceptions
  pure
    inner
      { askAt = pure minBound
      , decide = \d -> do
          left <- unused inner
          if null left then onDecision d >> pure (Right (usual d)) else decide inner d
      }

-- | The mixing function of SplitMix.
mixed :: Word64 -> Word64
mixed = folded 31 . (* 0x94d049bb133111eb) . folded 27 . (* 0xbf58476d1ce4e5b9) . folded 30
 where
  folded n word = word `xor` (word `shiftR` n)
