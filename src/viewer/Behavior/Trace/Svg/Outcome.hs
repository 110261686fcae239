-- |
-- How the spans of a timeline ended.
module Behavior.Trace.Svg.Outcome
  ( Outcome (..)
  , outcomes
  ) where

import qualified Data.IntSet as IntSet
import qualified Data.Map.Strict as Map

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Recording

-- | How a span ended.
data Outcome
  = Success
  | -- | It succeeded, but what it ran in did not; and after that, something of its name ran once more.
    RanAgain
  | Stop
  | Running
  | Failure
  | Fault
  deriving (Eq, Ord, Show, Enum, Bounded)

-- | How each span of the recording ended.
outcomes :: Recording -> Node -> Outcome
outcomes r = outcome
 where
  again = ranAgain r
  outcome n = case snd <$> nodeEnd n of
    Nothing -> Running
    Just Succeeded | IntSet.member (spanNumber (nodeSpan n)) again -> RanAgain
    Just Succeeded -> Success
    Just (FailedWith _) -> Failure
    Just (FaultedWith _) -> Fault
    Just (StoppedBy _) -> Stop

-- The numbers of the spans that succeeded in a span that did not, and of whose name one began after that span's end.
ranAgain :: Recording -> IntSet.IntSet
ranAgain r = IntSet.fromList (foldr (found Nothing) [] (roots r))
 where
  found :: Maybe Seconds -> Node -> [Int] -> [Int]
  found lostAt n rest = [spanNumber s | Just (_, Succeeded) <- [nodeEnd n], Just t <- [lostAt], maybe False (>= t) (Map.lookup (spanName s) lastBegin)] ++ inner
   where
    s = nodeSpan n
    inner = foldr (found (earliest lostAt (lostBy n))) rest (nodeChildren n)
  lostBy n = case nodeEnd n of
    Just (_, Succeeded) -> Nothing
    Just (_, StoppedBy WasAbandoned) -> Nothing
    Just (t, _) -> Just t
    Nothing -> Nothing
  earliest a b = maybe b (\t -> Just (maybe t (min t) b)) a
  lastBegin = Map.fromListWith max [(spanName s, spanBegan s) | s <- map nodeSpan (nodes r)]
