{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What a trace shows of a reactive operator. The engine calls its observer at each step; the observer reports
-- each reaction to a change of the signal: the values, what was stopped, and what starts.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Spans.Observer
  ( -- * Observers
    Observer
  , newObserver
  , ending

    -- * The named values of a signal
  , Values
  , Reading (..)
  , observed

    -- * The steps of an operator
  , decides
  , hasStopped
  , rereads
  , starts
  , waits

    -- * What is no operator's
  , noticed
  ) where

import Control.Exception (SomeException, finally, mask_)
import Data.Foldable (for_, traverse_)
import Data.IORef (IORef, newIORef, readIORef, writeIORef)
import Data.List (mapAccumL, nub)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, isNothing)

import Behavior.Internal.Core.SafeText (settledText)
import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Spans.Event
import Behavior.Internal.Spans.Place
import Behavior.Internal.Spans.Span (endOf, newNumber, parentFor, reportEach)

-- | The observer of one running operator.
data Observer
  = -- | There is no trace: nothing is observed.
    Silent
  | -- | The place of the operator in the trace, its name, and what the observer knows of it.
    Observer !Place String !(IORef Seen)

-- | What an observer knows of its operator.
data Seen = Seen
  { lastValues :: !(Maybe Values)
  -- ^ The values that the operator read last; nothing before the first reading.
  , running :: !(Maybe (String, Seconds))
  -- ^ The branch that began last, and when.
  , reaction :: !(Maybe Reaction)
  -- ^ The last reaction; nothing if the operator has not reacted to a change.
  , isReported :: !Bool
  }

-- | An observer of the operator with this name, which begins here.
newObserver :: String -> IO Observer
newObserver operator = myPlace >>= maybe (pure Silent) (observerAt operator)
{-# INLINE newObserver #-}

observerAt :: String -> Place -> IO Observer
observerAt operator here = Observer here operator <$> newIORef (Seen Nothing Nothing Nothing True)
{-# NOINLINE observerAt #-}

-- | Runs the operator. When it ends, or is interrupted, a reaction that was not reported, because it has started
-- nothing yet, is reported.
ending :: Observer -> IO a -> IO a
ending Silent act = act
ending observer act = act `finally` report observer Nothing
{-# INLINE ending #-}

-- | The named values with which an operator decided.
type Values = [Reading]

-- | A value of a signal that has a name.
data Reading = Reading
  { readingName :: String
  , readingText :: String
  , readingRule :: !(Maybe (Int, Bool))
  -- ^ If the condition of an ordered rule is made of the value: the number of that rule, and whether its condition
  -- holds.
  }

-- | The values, which are read only if they are observed.
observed :: Applicative f => Observer -> f Values -> f Values
observed Silent _ = pure []
observed Observer {} values = values
{-# INLINE observed #-}

-- | The operator has decided on these values, which were read in the transaction that decided. The Boolean: whether
-- the decision is a reaction even if these are its first values. Gives the cause for which it stops its branch.
decides :: Observer -> Bool -> Values -> IO Cause
decides Silent _ _ = pure (SignalChanged 0 [])
decides (Observer here operator cell) always after = decidesObserved here operator cell always after
{-# INLINE decides #-}

decidesObserved :: Place -> String -> IORef Seen -> Bool -> Values -> IO Cause
decidesObserved here operator cell always after = do
  seen <- readIORef cell
  if isNothing (lastValues seen) && not always
    then SignalChanged 0 [] <$ writeIORef cell seen {lastValues = Just after}
    else do
      n <- newNumber here
      t <- traceClock (trace here)
      let changes = changesBetween (fromMaybe [] (lastValues seen)) after
          reacted = reactionTo changes operator n t
      writeIORef cell seen {lastValues = Just after, reaction = Just reacted, isReported = False}
      pure (SignalChanged n changes)
{-# NOINLINE decidesObserved #-}

-- | A reaction that has stopped and started nothing yet.
reactionTo :: [Change] -> String -> Int -> Seconds -> Reaction
reactionTo changes operator n t =
  Reaction
    { reactionNumber = n
    , reactionParent = Top -- differs between the receivers
    , reactionOperator = operator
    , reactionTime = t
    , reactionChanges = changes
    , reactionStopped = Nothing
    , reactionStarts = Nothing
    }

-- | What the values were before, and are now. (Several signals may have the same name: then the first of them
-- before belongs to the first of them now, and so on.) Of ordered rules, only the values of conditions that have
-- changed, up to the first rule that holds now: later rules decide nothing. (The texts are users', and compared
-- here: so they are settled first. As the list is lazy, a sink's thread does that.)
changesBetween :: Values -> Values -> [Change]
changesBetween before after =
  nub
    [ Change (readingName r) (readingText <$> Map.lookup key was) (readingText r)
    | (key, r) <- numbered after
    , matters (Map.lookup key was) r
    ]
 where
  was = Map.fromList (numbered before)
  matters old r = maybe True (\(n, _) -> (old >>= readingRule) /= readingRule r && n <= firstHolding) (readingRule r)
  firstHolding = minimum (maxBound : [n | Reading {readingRule = Just (n, True)} <- after])
  numbered = snd . mapAccumL number Map.empty . map settled
  settled r = r {readingName = settledText (readingName r), readingText = settledText (readingText r)}
  number seen r =
    let n = Map.findWithDefault (0 :: Int) (readingName r) seen
     in (Map.insert (readingName r) (n + 1) seen, ((readingName r, n), r))

-- | The branch that the operator was running has stopped, and ended like this.
hasStopped :: Observer -> Either SomeException a -> IO ()
hasStopped Silent _ = pure ()
hasStopped (Observer here _ cell) end = hasStoppedObserved here cell end
{-# INLINE hasStopped #-}

hasStoppedObserved :: Place -> IORef Seen -> Either SomeException a -> IO ()
hasStoppedObserved here cell end = do
  seen <- readIORef cell
  for_ ((,) <$> reaction seen <*> running seen) $ \(reacted, (name, since)) -> do
    how <- endOf end
    t <- traceClock (trace here)
    let at = reactionTime reacted
        branch = StoppedBranch {stoppedName = name, stoppedAfter = at - since, stoppingTook = t - at, stoppedEnd = how}
    writeIORef cell seen {reaction = Just reacted {reactionStopped = Just branch}}
{-# NOINLINE hasStoppedObserved #-}

-- | After the stop of a branch the operator has read these values, and does what they require, as part of the same
-- reaction.
rereads :: Observer -> Values -> IO ()
rereads Silent _ = pure ()
rereads (Observer _ _ cell) values = readIORef cell >>= \seen -> writeIORef cell seen {lastValues = Just values}

-- | Runs an action that starts the branch with this name: the reaction has started the spans in it.
starts :: Observer -> String -> IO a -> IO a
starts Silent _ act = act
starts observer name act = startsObserved observer name act
{-# INLINE starts #-}

startsObserved :: Observer -> String -> IO a -> IO a
startsObserved Silent _ act = act
startsObserved observer@(Observer here _ cell) name act = mask_ $ do
  report observer (Just name)
  t <- traceClock (trace here)
  seen <- readIORef cell
  writeIORef cell seen {running = Just (name, t)}
  case reaction seen of
    Nothing -> act
    Just reacted -> inPlace (Just here {around = InBranchOf (reactionNumber reacted) : around here}) act
{-# NOINLINE startsObserved #-}

-- | The operator waits for another value.
waits :: Observer -> IO ()
waits observer = report observer Nothing

-- | Reports the reaction, and which branch starts, unless that was done. (Masked: a receiver that is interrupted
-- would leave its sink asleep, and the other receivers without the event.)
report :: Observer -> Maybe String -> IO ()
report Silent _ = pure ()
report (Observer here _ cell) next = mask_ $ do
  seen <- readIORef cell
  writeIORef cell seen {isReported = True}
  for_ (if isReported seen then Nothing else reaction seen) $ \reacted ->
    reportEach here $ \receiver -> Reacted reacted {reactionParent = parentFor receiver here, reactionStarts = next}

-- | Reports what something other than an operator has noticed, under its name, as a reaction that stops and starts
-- nothing. Without a trace it does nothing.
noticed :: String -> [Change] -> IO ()
noticed name changes =
  myPlace >>= traverse_ (mask_ . reportNoticed name changes)

reportNoticed :: String -> [Change] -> Place -> IO ()
reportNoticed name changes here = do
  n <- newNumber here
  t <- traceClock (trace here)
  reportEach here $ \receiver -> Reacted (reactionTo changes name n t) {reactionParent = parentFor receiver here}
