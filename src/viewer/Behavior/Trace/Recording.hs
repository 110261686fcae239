{-# LANGUAGE LambdaCase #-}

-- |
-- What a list of events says: which spans there were, one inside the other, and how each ended.
-- Everything that shows a trace begins here.
module Behavior.Trace.Recording
  ( Recording (..)
  , Node (..)
  , recording
  , nodes
  , nodeUntil
  , reactionSpans
  , withoutOperators
  ) where

import Control.Applicative ((<|>))
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import qualified Data.IntSet as IntSet
import Data.List (foldl', sortOn)
import Data.Maybe (isNothing)
import Prelude hiding (until)

import Behavior.Time (Seconds)
import Behavior.Trace

-- | The spans and reactions of a trace.
--
-- @since 0.1.0.0
data Recording = Recording
  { roots :: [Node]
  -- ^ The spans that are in no other, in the order of their numbers.
  , reactions :: [Reaction]
  -- ^ In the order of their numbers.
  , lost :: !Int
  -- ^ How many events were lost.
  , from :: !Seconds
  -- ^ The time of the first event.
  , until :: !Seconds
  -- ^ The time of the last event.
  }
  deriving (Eq, Show)

-- | A span, how and when it ended (nothing: it had not ended when the trace did, or that was lost),
-- and the spans in it, in the order of their numbers.
--
-- @since 0.1.0.0
data Node = Node
  { nodeSpan :: !Span
  , nodeEnd :: !(Maybe (Seconds, End))
  , nodeChildren :: [Node]
  }
  deriving (Eq, Show)

-- | The recording of these events. Every list of events has one, also a damaged one: a span whose
-- parent is unknown is in no other.
--
-- @since 0.1.0.0
recording :: [Event] -> Recording
recording events =
  Recording
    { roots = [node s | s <- IntMap.elems spans, isNothing (parentOf s)]
    , reactions = IntMap.elems (IntMap.fromList [(reactionNumber r, r) | Reacted r <- events])
    , lost = sum [n | Lost n <- events]
    , from = if null times then 0 else minimum times
    , until = if null times then 0 else maximum times
    }
 where
  spans = IntMap.fromList (concatMap spanOf events)
  spanOf (Began s) = [(spanNumber s, s)]
  spanOf (Ended s _ _) = [(spanNumber s, s)]
  spanOf _ = []
  ends = IntMap.fromList [(spanNumber s, (t, end)) | Ended s t end <- events]
  children :: IntMap [Span]
  children = foldl' insert IntMap.empty (reverse (IntMap.elems spans))
  insert known s = maybe known (\n -> IntMap.insertWith (++) n [s] known) (parentOf s)
  -- A parent has a smaller number: so no damage makes a cycle.
  parentOf s = case spanParent s of
    Inside n | n < spanNumber s, IntMap.member n spans -> Just n
    _ -> Nothing
  node s =
    Node
      { nodeSpan = s
      , nodeEnd = IntMap.lookup (spanNumber s) ends
      , nodeChildren = map node (IntMap.findWithDefault [] (spanNumber s) children)
      }
  times = concatMap timesOf events
  timesOf (Began s) = [spanBegan s]
  timesOf (Ended s t _) = [spanBegan s, t]
  timesOf (Reacted r) = [reactionTime r]
  timesOf (Lost _) = []

-- | All spans of the recording, each before those in it.
--
-- @since 0.1.0.0
nodes :: Recording -> [Node]
nodes r = foldr below [] (roots r)
 where
  below n rest = n : foldr below rest (nodeChildren n)

-- | When the span ended; or the end of the recording, if it had not.
--
-- @since 0.1.0.0
nodeUntil :: Recording -> Node -> Seconds
nodeUntil r = maybe (until' r) fst . nodeEnd
 where
  until' Recording {until = t} = t

-- | For each reaction, by its number: the outermost named spans that it stopped, and the named spans
-- that it started, each in the order of their numbers. The first one that it started comes first.
--
-- @since 0.1.0.0
reactionSpans :: Recording -> IntMap ([Span], [Span])
reactionSpans r = IntMap.map inOrder (IntMap.fromListWith (<>) (foldr (found IntSet.empty Nothing) [] (roots r)))
 where
  inOrder (stopped, started) = (sortOn spanNumber stopped, sortOn spanNumber started)
  -- Given which reactions stopped the named spans around, and which one started the operators around.
  found outer by n rest = here ++ foldr (found outer' by') rest (nodeChildren n)
   where
    s = nodeSpan n
    isNamed = spanKind s == Named
    started = spanReaction s <|> by
    stopped = case nodeEnd n of
      Just (_, StoppedBy (SignalChanged reaction _)) -> Just reaction
      _ -> Nothing
    here
      | isNamed =
          [(reaction, ([s], [])) | Just reaction <- [stopped], IntSet.notMember reaction outer]
            ++ [(reaction, ([], [s])) | Just reaction <- [started]]
      | otherwise = []
    outer' = if isNamed then maybe id IntSet.insert stopped outer else outer
    by' = if isNamed then Nothing else started

-- | The events of named spans and reactions, each in the innermost named span around it: what a trace
-- without operators would have. (The events of a simulated run have operators.)
--
-- @since 0.1.0.0
withoutOperators :: [Event] -> [Event]
withoutOperators events = concatMap kept events
 where
  kept = \case
    Began s -> [Began (outermost s) | spanKind s == Named]
    Ended s t end -> [Ended (outermost s) t end | spanKind s == Named]
    Reacted r -> [Reacted r {reactionParent = fst (namedAround Nothing (reactionParent r))}]
    Lost n -> [Lost n]
  outermost s = let (parent, reaction) = namedAround (spanReaction s) (spanParent s) in s {spanParent = parent, spanReaction = reaction}
  -- The innermost named span around, and the reaction that started the innermost branch up to it.
  namedAround reaction = \case
    Inside n | Just s <- IntMap.lookup n others -> namedAround (reaction <|> spanReaction s) (spanParent s)
    parent -> (parent, reaction)
  others = IntMap.fromList [(spanNumber s, s) | Began s <- events, spanKind s /= Named]
