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
  , reactionsInside
  , withoutOperators
  ) where

import Control.Applicative ((<|>))
import qualified Data.IntMap.Lazy as LazyIntMap
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import qualified Data.IntSet as IntSet
import Data.List (foldl', sortOn)
import Data.Maybe (fromMaybe)

import Behavior.Time (Seconds)
import Behavior.Trace

-- | The spans and reactions of a trace.
--
-- @since 0.1.0.0
data Recording = Recording
  { recordingRoots :: [Node]
  -- ^ The spans that are in no other, in the order of their numbers.
  , recordingReactions :: [Reaction]
  -- ^ In the order of their numbers.
  , recordingLost :: !Int
  -- ^ How many events were lost.
  , recordingFrom :: !Seconds
  -- ^ The time of the first event.
  , recordingUntil :: !Seconds
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
-- parent is unknown is in no other. A parent has a smaller number; one that has not is unknown: so no
-- span is its own ancestor.
--
-- @since 0.1.0.0
recording :: [Event] -> Recording
recording events =
  Recording
    { recordingRoots = fst (IntMap.foldrWithKey' place ([], IntMap.empty) (spansSoFar known))
    , recordingReactions = IntMap.elems (reactionsSoFar known)
    , recordingLost = lostSoFar known
    , recordingFrom = fromMaybe 0 (earliest known)
    , recordingUntil = fromMaybe 0 (latest known)
    }
 where
  known = foldl' learn (Known IntMap.empty IntMap.empty 0 Nothing Nothing) events
  -- The last span comes first: then those in a span come before it.
  place n (s, end) (outermost, waiting) = case spanParent s of
    Inside p | p < n, IntMap.member p (spansSoFar known) -> (outermost, IntMap.insertWith (++) p [node] others)
    _ -> (node : outermost, others)
   where
    node = Node s end (IntMap.findWithDefault [] n waiting)
    others = IntMap.delete n waiting

-- What some events say, by the numbers of spans and reactions.
data Known = Known
  { spansSoFar :: !(IntMap (Span, Maybe (Seconds, End)))
  , reactionsSoFar :: !(IntMap Reaction)
  , lostSoFar :: !Int
  , earliest :: !(Maybe Seconds)
  , latest :: !(Maybe Seconds)
  }

learn :: Known -> Event -> Known
learn known = \case
  Began s -> at (spanBegan s) (spanned (IntMap.insertWith began) s Nothing)
  Ended s t end -> at t (at (spanBegan s) (spanned IntMap.insert s (Just (t, end))))
  Reacted r -> at (reactionTime r) known {reactionsSoFar = IntMap.insert (reactionNumber r) r (reactionsSoFar known)}
  -- (An overflow would make it negative.)
  Lost n -> known {lostSoFar = if n > maxBound - lostSoFar known then maxBound else lostSoFar known + max 0 n}
 where
  spanned put s end = known {spansSoFar = put (spanNumber s) (s, end) (spansSoFar known)}
  began (s, _) (_, end) = (s, end)
  at t k
    | t /= t = k
    | otherwise = k {earliest = Just $! maybe t (min t) (earliest k), latest = Just $! maybe t (max t) (latest k)}

-- | All spans of the recording, each before those in it.
--
-- @since 0.1.0.0
nodes :: Recording -> [Node]
nodes r = foldr below [] (recordingRoots r)
 where
  below n rest = n : foldr below rest (nodeChildren n)

-- | When the span ended; or the end of the recording, if it had not.
--
-- @since 0.1.0.0
nodeUntil :: Recording -> Node -> Seconds
nodeUntil r = maybe (recordingUntil r) fst . nodeEnd

-- | For each reaction, by its number: the outermost named spans that it stopped, and the named spans
-- that it started, each in the order of their numbers. The first one that it started comes first.
--
-- @since 0.1.0.0
reactionSpans :: Recording -> IntMap ([Span], [Span])
reactionSpans r =
  IntMap.map inOrder (IntMap.fromListWith (<>) (foldr (found IntSet.empty Nothing) [] (recordingRoots r)))
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
    Reacted r -> [Reacted r {reactionParent = fst (namedAround (reactionNumber r) (reactionParent r))}]
    Lost n -> [Lost n]
  outermost s = let (parent, reaction) = around s in s {spanParent = parent, spanReaction = reaction}
  -- The innermost named span around, and the reaction that started the innermost branch up to it.
  around s = (<|>) (spanReaction s) <$> namedAround (spanNumber s) (spanParent s)
  namedAround n = \case
    Inside p | p < n, Just found <- IntMap.lookup p aroundOthers -> found
    parent -> (parent, Nothing)
  aroundOthers = LazyIntMap.fromList [(spanNumber s, around s) | Began s <- events, spanKind s /= Named]

-- | The reactions whose operators ran in no span that is known, and those in each span, by its number.
--
-- @since 0.1.0.0
reactionsInside :: Recording -> ([Reaction], IntMap [Reaction])
reactionsInside r = ([x | (Nothing, x) <- found], IntMap.fromListWith (++) [(n, [x]) | (Just n, x) <- reverse found])
 where
  found = [(parent (reactionParent x), x) | x <- recordingReactions r]
  parent = \case
    Inside n | IntSet.member n known -> Just n
    _ -> Nothing
  known = IntSet.fromList (map (spanNumber . nodeSpan) (nodes r))
