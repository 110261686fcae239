{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What an operator reports when its signal has changed: the values, what was stopped, and what starts.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Trace.Decision
  ( Values
  , Reading (..)
  , Ran
  , branchBegins

    -- * Deciding
  , Decision
  , decide
  , begins
  , timeIsUp
  , sensorDied
  , cause
  , decidedOn

    -- * Reporting
  , hasStopped
  , report
  , orReported
  , starting
  ) where

import Control.Exception (SomeException, mask_, onException)
import Data.List (mapAccumL, nub)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe)

import Behavior.Internal.SafeText (settledText)
import Behavior.Internal.Seconds (Seconds)
import Behavior.Internal.Stop (endOf)
import Behavior.Internal.Trace.Event
import Behavior.Internal.Trace.Place
import Behavior.Internal.Trace.Span (newNumber, parentFor, reportEach)

-- | The named values with which an operator decided.
type Values = [Reading]

-- | A value of a signal that has a name.
data Reading = Reading
  { readingName :: String
  , readingText :: String
  , readingRule :: !(Maybe (Int, Bool))
  -- ^ If it is one of ordered rules whose condition is made of the value: the number of the rule, and whether
  -- the condition holds.
  }

-- | A branch, and when it began.
data Ran = Ran String !Seconds

-- | The branch with this name begins now (here in a trace).
branchBegins :: Place -> String -> IO Ran
branchBegins here name = Ran name <$> traceClock (trace here)

-- | An operator's decision, until what follows has been reported.
data Decision = Decision
  { cause :: Cause
  -- ^ Why what is stopped now is stopped.
  , decidedOn :: Values
  -- ^ The values when it decided.
  , unreported :: !(Maybe Unreported)
  -- ^ Nothing without a trace, and if it is no reaction to a change of a signal.
  }

data Unreported = Unreported
  { place :: !Place
  , ran :: !(Maybe Ran)
  , known :: !Reaction
  }

-- | The operator with this name has decided, here: which branch runs, the values when it decided before,
-- and the values now, read in the transaction that decided.
decide :: Place -> String -> Maybe Ran -> Maybe Values -> Values -> IO Decision
decide here operator branch before after = do
  n <- newNumber here
  t <- traceClock (trace here)
  let changes = changesBetween (fromMaybe [] before) after
      reaction =
        Reaction
          { reactionNumber = n
          , reactionParent = Top -- differs between the receivers
          , reactionOperator = operator
          , reactionTime = t
          , reactionChanges = changes
          , reactionStopped = Nothing
          , reactionStarts = Nothing
          }
  pure (Decision (SignalChanged n changes) after (Just (Unreported here branch reaction)))

-- | What the values were before, and are now. (Several signals may have the same name: then the first
-- belongs to the first, and so on.) Of ordered rules, those whose conditions have changed, up to the first rule
-- that holds now: the ones after it decide nothing. (The texts are users', and compared here: so they are settled
-- first. A sink's thread does that.)
changesBetween :: Values -> Values -> [Change]
changesBetween before after =
  nub
    [ Change (readingName r) (readingText <$> Map.lookup key was) (readingText r)
    | (key, r) <- numbered after
    , decides (Map.lookup key was) r
    ]
 where
  was = Map.fromList (numbered before)
  decides old r = maybe True (\(n, _) -> (old >>= readingRule) /= readingRule r && n <= firstHolding) (readingRule r)
  firstHolding = minimum (maxBound : [n | Reading {readingRule = Just (n, True)} <- after])
  numbered = snd . mapAccumL number Map.empty . map settled
  settled r = r {readingName = settledText (readingName r), readingText = settledText (readingText r)}
  number seen r =
    let n = Map.findWithDefault (0 :: Int) (readingName r) seen
     in (Map.insert (readingName r) (n + 1) seen, ((readingName r, n), r))

-- | There is no change to report: the operator begins, or there is no trace.
begins :: Values -> Decision
begins values = Decision (SignalChanged 0 []) values Nothing

-- | The time limit of an operator has passed.
timeIsUp :: Seconds -> Decision
timeIsUp limit = Decision (TimeLimit limit) [] Nothing

-- | A sensor has failed or faulted.
sensorDied :: Decision
sensorDied = Decision (SiblingFailed "sensor") [] Nothing

-- | The branch has ended that was stopped.
hasStopped :: Either SomeException a -> Decision -> IO Decision
hasStopped end decision = maybe (pure decision) stopped (unreported decision)
 where
  stopped what = case ran what of
    Nothing -> pure decision
    Just (Ran name since) -> do
      how <- endOf end
      t <- traceClock (trace (place what))
      let at = reactionTime (known what)
          branch =
            StoppedBranch {stoppedName = name, stoppedAfter = at - since, stoppingTook = t - at, stoppedEnd = how}
      pure decision {unreported = Just what {known = (known what) {reactionStopped = Just branch}}}

-- | Reports the reaction, and which branch starts.
report :: Decision -> Maybe String -> IO ()
report decision starts = mapM_ (`reportReaction` starts) (unreported decision)
{-# INLINE report #-}

-- | Runs an action that belongs to the operator: if it throws, the reaction is reported as it is now.
orReported :: Decision -> IO a -> IO a
orReported decision act = maybe act (\what -> act `onException` reportReaction what Nothing) (unreported decision)
{-# INLINE orReported #-}

-- | Runs an action that starts a branch: the reaction has started the spans in it.
starting :: Decision -> IO a -> IO a
starting decision act = maybe act (`startingAfter` act) (unreported decision)
{-# INLINE starting #-}

-- (Masked: what interrupts a receiver would leave its sink asleep, and the others without the event.)
reportReaction :: Unreported -> Maybe String -> IO ()
reportReaction what starts = mask_ . reportEach (place what) $ \receiver ->
  Reacted (known what) {reactionParent = parentFor receiver (place what), reactionStarts = starts}
{-# NOINLINE reportReaction #-}

startingAfter :: Unreported -> IO a -> IO a
startingAfter Unreported {place = here, known = what} =
  mask_ . inPlace (Just here {amongNamed = after (amongNamed here), amongAll = after (amongAll here)})
 where
  after position = position {startedBy = Just (reactionNumber what)}
{-# NOINLINE startingAfter #-}
