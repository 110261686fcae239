{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The events of a trace.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Spans.Event
  ( -- * Events
    Event (..)

    -- * Spans
  , Span (..)
  , Parent (..)
  , SpanKind (..)
  , End (..)

    -- * Why a span was stopped
  , Cause (..)
  , Reaction (..)
  , StoppedBranch (..)
  , Change (..)

    -- * The texts of an event
  , traverseTexts
  ) where

import Behavior.Internal.Core.Cause (Cause (..), Change (..))
import Behavior.Internal.Core.Seconds (Seconds)

-- | An event of a trace. Times are those of 'Behavior.Time.now'.
--
-- @since 0.1.0.0
data Event
  = Began !Span
  | -- | How a span ended, and when. It contains the whole span again, because the 'Began' of that
    -- span may have been lost.
    Ended !Span !Seconds !End
  | Reacted !Reaction
  | -- | This number of events was lost here: the sink did not keep up.
    Lost !Int
  deriving (Eq, Ord, Show, Read)

-- | What ran: an interval of time, with a name, inside another one.
--
-- @since 0.1.0.0
data Span = Span
  { spanNumber :: !Int
  -- ^ Spans and reactions of one trace are numbered together, from 1.
  , spanParent :: !Parent
  , spanKind :: !SpanKind
  , spanName :: String
  , spanBegan :: !Seconds
  , spanReaction :: !(Maybe Int)
  -- ^ For an outermost span in a branch that a reaction started: the number of that reaction.
  }
  deriving (Eq, Ord, Show, Read)

-- | What a span runs in.
--
-- @since 0.1.0.0
data Parent
  = -- | In no other span of its trace.
    Top
  | -- | In the span with this number.
    Inside !Int
  | -- | It runs in a thread that this library did not start, or after its parent was abandoned.
    UnknownParent
  deriving (Eq, Ord, Show, Read)

-- | What ran: a named behaviour, an operator, or a branch.
--
-- @since 0.1.0.0
data SpanKind
  = -- | A behaviour with a name ('Behavior.Trace.named').
    Named
  | -- | An operator.
    Operator
  | -- | A branch of an operator. Its parent is the operator.
    Branch
  deriving (Eq, Ord, Show, Read, Enum, Bounded)

-- | How a span ended.
--
-- @since 0.1.0.0
data End
  = -- | It returned.
    Succeeded
  | -- | It failed; the text of the failure.
    FailedWith String
  | -- | It faulted, perhaps while it was being stopped; the text of the fault.
    FaultedWith String
  | -- | It was stopped, and why.
    StoppedBy Cause
  deriving (Eq, Ord, Show, Read)

-- | What an operator did when its signal changed.
--
-- @since 0.1.0.0
data Reaction = Reaction
  { reactionNumber :: !Int
  , reactionParent :: !Parent
  -- ^ The span in which the operator runs.
  , reactionOperator :: String
  , reactionTime :: !Seconds
  -- ^ When the operator decided.
  , reactionChanges :: [Change]
  -- ^ The named values of the signal; a value that others are computed from comes before them. All were read in
  -- the transaction that decided. (Of 'Behavior.Signal.teleoReactive', only the values of conditions that have
  -- changed.)
  , reactionStopped :: !(Maybe StoppedBranch)
  -- ^ The branch that was stopped; nothing if the operator was waiting, or was cancelled while it stopped the
  -- branch.
  , reactionStarts :: Maybe String
  -- ^ The branch that starts; nothing if the operator ends or waits.
  }
  deriving (Eq, Ord, Show, Read)

-- | A branch that a reaction stopped.
--
-- @since 0.1.0.0
data StoppedBranch = StoppedBranch
  { stoppedName :: String
  , stoppedAfter :: !Seconds
  -- ^ How long it had run when its stop was requested.
  , stoppingTook :: !Seconds
  -- ^ How long it took until it had ended, cleanup included.
  , stoppedEnd :: !End
  -- ^ How it ended: 'Succeeded' if it completed nevertheless.
  }
  deriving (Eq, Ord, Show, Read)

-- | Applies an action to all texts of an event: names, values and descriptions.
traverseTexts :: Applicative f => (String -> f String) -> Event -> f Event
traverseTexts f = \case
  Began s -> Began <$> inSpan s
  Ended s t end -> (`Ended` t) <$> inSpan s <*> inEnd end
  Reacted r -> Reacted <$> inReaction r
  Lost n -> pure (Lost n)
 where
  inSpan s = (\name -> s {spanName = name}) <$> f (spanName s)
  inEnd = \case
    Succeeded -> pure Succeeded
    FailedWith text -> FailedWith <$> f text
    FaultedWith text -> FaultedWith <$> f text
    StoppedBy cause -> StoppedBy <$> inCause cause
  inCause = \case
    SignalChanged n changes -> SignalChanged n <$> traverse inChange changes
    SiblingFinished name -> SiblingFinished <$> f name
    SiblingFailed name -> SiblingFailed <$> f name
    TimeLimit limit -> pure (TimeLimit limit)
    FromOutside text -> FromOutside <$> f text
    WasAbandoned -> pure WasAbandoned
  inReaction r =
    ( \operator changes stopped starts ->
        r
          { reactionOperator = operator
          , reactionChanges = changes
          , reactionStopped = stopped
          , reactionStarts = starts
          }
    )
      <$> f (reactionOperator r)
      <*> traverse inChange (reactionChanges r)
      <*> traverse inStopped (reactionStopped r)
      <*> traverse f (reactionStarts r)
  inStopped b = (\name end -> b {stoppedName = name, stoppedEnd = end}) <$> f (stoppedName b) <*> inEnd (stoppedEnd b)
  inChange (Change name before after) = Change <$> f name <*> traverse f before <*> f after
