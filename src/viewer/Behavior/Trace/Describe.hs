-- |
-- The words for what a trace contains: times, ends, causes and reactions, each on one line.
--
-- Names, values and the texts of failures may contain anything. Here they become harmless ('inert').
module Behavior.Trace.Describe
  ( -- * Texts of others
    inert
  , inertUpTo
  , nameText
  , quotedText

    -- * Times
  , secondsText
  , millisecondsText

    -- * What ended, and why
  , outcomeText
  , outcomeName
  , endText
  , howText
  , causeText
  , changesText
  , changedOnly
  , reactionText
  , reactionParts
  , stoppedText
  , startedText
  , startsText
  , lostText
  , lostRemark
  ) where

import Behavior.Internal.Tracing.Text
import Behavior.Trace

-- | How a span ended, and why.
--
-- >>> putStrLn (outcomeText (Just (FailedWith "locked")))
-- failed: locked
--
-- @since 0.1.0.0
outcomeText :: Maybe End -> String
outcomeText = maybe (outcomeName Nothing) howText

-- | How a span ended, in a word or two.
--
-- @since 0.1.0.0
outcomeName :: Maybe End -> String
outcomeName end = case end of
  Nothing -> "not ended"
  Just Succeeded -> "succeeded"
  Just (FailedWith _) -> "failed"
  Just (FaultedWith _) -> "faulted"
  Just (StoppedBy _) -> "stopped"

-- | The remark about lost events.
--
-- >>> lostRemark 3
-- "3 events were lost: what is shown is incomplete."
--
-- @since 0.1.0.0
lostRemark :: Int -> String
lostRemark n = lostText n ++ ": what is shown is incomplete."
