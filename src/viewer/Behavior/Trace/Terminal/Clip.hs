-- |
-- What is kept of an event while others come: it takes bounded memory, whatever its texts are.
module Behavior.Trace.Terminal.Clip
  ( clip
  , clipSpan
  , clipEnd
  , clipReaction
  , keep
  ) where

import Behavior.Trace
import Behavior.Trace.Describe

-- | The first ones, evaluated: so that what is forgotten is not kept in memory.
keep :: Int -> [a] -> [a]
keep n values = foldr seq kept kept
 where
  kept = take n values

-- | A text without anything that a terminal acts on, and not too long.
clip :: String -> String
clip text = keep 200 (inertUpTo 200 text)

-- | The span, with such a name.
clipSpan :: Span -> Span
clipSpan s = name `seq` s {spanName = name}
 where
  name = clip (spanName s)

-- | The end, with such texts.
clipEnd :: End -> End
clipEnd end = case end of
  Succeeded -> end
  FailedWith why -> FailedWith $! clip why
  FaultedWith why -> FaultedWith $! clip why
  StoppedBy cause -> StoppedBy $! case cause of
    SignalChanged n changes -> SignalChanged n $! keep 8 (map clipChange changes)
    SiblingFinished name -> SiblingFinished $! clip name
    SiblingFailed name -> SiblingFailed $! clip name
    TimeLimit _ -> cause
    FromOutside why -> FromOutside $! clip why
    WasAbandoned -> cause

clipChange :: Change -> Change
clipChange (Change signal before after) = name `seq` after' `seq` Change name before' after'
 where
  name = clip signal
  after' = clip after
  before' = case before of
    Nothing -> Nothing
    Just b -> Just $! clip b

-- | The reaction, with such texts, and not too many of them.
clipReaction :: Reaction -> Reaction
clipReaction r =
  operator `seq` changes `seq` starts `seq`
    r {reactionOperator = operator, reactionChanges = changes, reactionStopped = stopped, reactionStarts = starts}
 where
  operator = clip (reactionOperator r)
  changes = keep 8 (map clipChange (reactionChanges r))
  starts = case reactionStarts r of
    Nothing -> Nothing
    Just name -> Just $! clip name
  stopped = case reactionStopped r of
    Nothing -> Nothing
    Just b
      | name <- clip (stoppedName b) ->
          Just $! (name `seq` b {stoppedName = name, stoppedEnd = clipEnd (stoppedEnd b)})
