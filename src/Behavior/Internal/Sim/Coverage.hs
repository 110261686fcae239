{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What the runs of an exploration have started, and what they have not; and which premises of claims about them never
-- came.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.Coverage
  ( -- * One run
    Reached
  , nothingYet
  , canStart
  , starts

    -- * Many runs
  , Coverage
  , noCoverage
  , withRun
  , started
  , neverStarted
  , neverCame
  ) where

import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (foldl', group)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Set (Set)
import qualified Data.Set as Set

import Behavior.Internal.Core.Backend (Label (..))
import Behavior.Internal.Core.SafeText (settledText)
import Behavior.Internal.Spans.Event
import Behavior.Internal.Spans.Place (Around (..), Place (..), inPath)

-- | What a run can start, for each span with a name, by the span's number (0: outside of all these).
type Reached = IntMap Inner

-- | The names around it, the innermost first; and for each operator, which branches it can start, and whether it
-- has. (Scripted actions count as branches of an operator without a name, outside of all spans: such an action is the
-- same one wherever it runs.)
data Inner = Inner [String] !Operators

type Operators = Map String (Map String Bool)

-- | At the beginning of a run.
nothingYet :: Reached
nothingYet = IntMap.empty

-- | Adds what this operator can start here.
canStart :: String -> [String] -> Maybe Place -> Reached -> Reached
canStart operator branches here reached
  | all (`Map.member` before) branches = reached
  | otherwise = IntMap.insert number (Inner names (Map.insert operator (Map.union before new) inside)) reached
 where
  (number, names) = placeOf operator here
  inside = operatorsIn number reached
  before = Map.findWithDefault Map.empty operator inside
  new = Map.fromList (map (\branch -> (branch, False)) branches)

-- | Marks this branch, which starts here, as started.
starts :: Label -> Maybe Place -> Reached -> Reached
starts (Label operator branch) here reached = case Map.lookup operator inside of
  Just branches
    | Just False <- Map.lookup branch branches ->
        IntMap.insert number (Inner names (Map.insert operator (Map.insert branch True branches) inside)) reached
  _ -> reached
 where
  (number, names) = placeOf operator here
  inside = operatorsIn number reached

operatorsIn :: Int -> Reached -> Operators
operatorsIn number = maybe Map.empty (\(Inner _ inside) -> inside) . IntMap.lookup number

-- | Where this operator is: the number of the innermost span with a name, and the names. (Scripted actions are in
-- no span.)
placeOf :: String -> Maybe Place -> (Int, [String])
placeOf operator here = case here of
  Just Place {around = spans, path = names}
    | n : _ <- [n | InSpan Named n <- spans]
    , not (null operator) ->
        (n, names)
  _ -> (0, [])

-- | What many runs have reached.
data Coverage = Coverage
  { known :: !(Set String)
  -- ^ The names of what was started.
  , could :: !(Map [String] Operators)
  -- ^ What could be started, and whether it was, by the names around it, the outermost first.
  , came :: !(Map String Bool)
  -- ^ The premises of claims, and whether each has come.
  }

-- | That of no run.
noCoverage :: Coverage
noCoverage = Coverage Set.empty Map.empty Map.empty

-- | Adds what a further run has reached.
withRun :: [Event] -> Reached -> Map String Bool -> Coverage -> Coverage
withRun happened reached premises before =
  Coverage
    { known = foldl' add (known before) [spanName s | Began s <- happened, spanKind s /= Operator]
    , could = foldl' join (could before) reached
    , came = Map.unionWith (||) (came before) premises
    }
 where
  -- A name is evaluated, so that it does not keep its run in memory.
  add names name
    | Set.member name names = names
    | otherwise = Set.insert (settledText name) names
  -- (A behaviour that runs itself inside of itself is one.)
  join others (Inner names inside) =
    let outside = map head (group (reverse (map (take 100 . settledText) names)))
        old = Map.findWithDefault Map.empty outside others
     in if Map.isSubmapOfBy (Map.isSubmapOfBy (<=)) inside old
          then others
          else Map.insert outside (Map.unionWith (Map.unionWith (||)) old inside) others

-- | The names of all that was started: behaviours that have a name, scripted actions, and branches.
started :: Coverage -> [String]
started = Set.toAscList . known

-- | The names of what no run has started: scripted actions, with no argument if they have one; and branches,
-- with the names around them.
neverStarted :: Coverage -> [String]
neverStarted covered =
  [ show (if null operator then Label name "" else Label operator name) ++ inPath (reverse names)
  | (names, inside) <- Map.toList (could covered)
  , (operator, branches) <- Map.toList inside
  , (name, False) <- Map.toList branches
  ]

-- | The premises of claims that have come in no run.
neverCame :: Coverage -> [String]
neverCame covered = [what | (what, False) <- Map.toList (came covered)]
