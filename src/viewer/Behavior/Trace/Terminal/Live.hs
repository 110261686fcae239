{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What is known while events still come: what runs, and a little of what has ended. It takes
-- bounded memory, however many events come.
module Behavior.Trace.Terminal.Live
  ( Live (..)
  , Active (..)
  , Done (..)
  , FailedSpan (..)
  , Interruption (..)
  , nothingYet
  , watch
  ) where

import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.Maybe (mapMaybe)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Terminal.Clip

-- | What is known after some events.
--
-- @since 0.1.0.0
data Live = Live
  { liveActive :: !(IntMap Active)
  -- ^ The spans that run, by number.
  , liveDone :: ![Done]
  -- ^ Spans in no other that ended: the last ones, the latest first.
  , liveDoneCount :: !Int
  , liveFailed :: ![FailedSpan]
  -- ^ The last failures and faults, the latest first.
  , liveInterruption :: !(Maybe Interruption)
  -- ^ The last one.
  , liveStopped :: !(IntMap [Stopped])
  -- ^ The named spans that a reaction stopped which is still to come, by its number. Of those in each
  -- other, the outermost.
  , liveLost :: !Int
  , liveTime :: !(Maybe Seconds)
  -- ^ The time of the latest event.
  }
  deriving (Eq, Show)

-- | A span that runs.
data Active = Active
  { activeSpan :: !Span
  , activeDone :: ![Done]
  -- ^ The last spans in it that ended, the latest first.
  , activeDoneCount :: !Int
  }
  deriving (Eq, Show)

-- | A span that ended.
data Done = Done
  { doneNumber :: !Int
  , doneName :: !String
  , doneTook :: !Seconds
  , doneEnd :: !End
  , doneInside :: ![Done]
  , doneCount :: !Int
  -- ^ How many ended in it.
  }
  deriving (Eq, Show)

-- | A failure or a fault: in which span, when, and how. Of one that came out of several spans, only
-- the innermost is kept.
data FailedSpan = FailedSpan
  { failedPath :: ![(Int, String)]
  -- ^ The span and those that it ran in, the innermost first.
  , failedAt :: !Seconds
  , failedHow :: !End
  }
  deriving (Eq, Show)

-- | A reaction that stopped something, the spans that it stopped (the name of each, and when it began), and
-- the name of the first one that it started, if they are known.
data Interruption = Interruption
  { interruptedBy :: !Reaction
  , interruptedSpans :: ![(String, Seconds)]
  , startedSpan :: !(Maybe String)
  }
  deriving (Eq, Show)

-- | The name of a span, when it began, and the numbers of those that it ran in.
data Stopped = Stopped
  { stoppedSpan :: !String
  , stoppedBegan :: !Seconds
  , stoppedIn :: ![Int]
  }
  deriving (Eq, Show)

-- | Before the first event.
--
-- @since 0.1.0.0
nothingYet :: Live
nothingYet =
  Live
    { liveActive = IntMap.empty
    , liveDone = []
    , liveDoneCount = 0
    , liveFailed = []
    , liveInterruption = Nothing
    , liveStopped = IntMap.empty
    , liveLost = 0
    , liveTime = Nothing
    }

-- The greatest numbers of what is kept.
maxDone, maxInside, maxFailed, maxActive, maxPath, maxReactions, maxStopped :: Int
maxDone = 5
maxInside = 30
maxFailed = 3
maxActive = 1000
maxPath = 50
maxReactions = 10
maxStopped = 10

-- | What is known after one more event.
--
-- @since 0.1.0.0
watch :: Live -> Event -> Live
watch live event = case event of
  Began s ->
    (at (spanBegan s))
      { liveActive = few (IntMap.insert (spanNumber s) (Active (clipSpan s) [] 0) (liveActive live))
      , liveInterruption = case liveInterruption live of
          Just i -> Just $! begun (liveActive live) s i
          Nothing -> Nothing
      }
  Ended s t end -> ended (clipSpan s) t (clipEnd end) (at t)
  Reacted r
    | Just _ <- reactionStopped r ->
        (at (reactionTime r))
          { liveInterruption =
              Just
                $! Interruption
                  (clipReaction r)
                  (map nameAndBegin (IntMap.findWithDefault [] (reactionNumber r) (liveStopped live)))
                  Nothing
          , liveStopped = IntMap.delete (reactionNumber r) (liveStopped live)
          }
    | otherwise -> at (reactionTime r)
  Lost n -> live {liveLost = liveLost live + n}
 where
  nameAndBegin s = (stoppedSpan s, stoppedBegan s)
  at t = live {liveTime = Just $! maybe t (max t) (liveTime live)}

-- The first named span that the last interruption started.
begun :: IntMap Active -> Span -> Interruption -> Interruption
begun active s i
  | Nothing <- startedSpan i
  , spanKind s == Named
  , take 1 startedBy == [reactionNumber (interruptedBy i)] =
      i {startedSpan = Just $! clip (spanName s)}
  | otherwise = i
 where
  -- In a detailed trace the branch was started by it.
  startedBy = mapMaybe spanReaction (s : takeWhile ((/= Named) . spanKind) (ancestors active s))

ended :: Span -> Seconds -> End -> Live -> Live
ended s t end live = case spanParent s of
  Inside p
    | Just a <- IntMap.lookup p others ->
        let more = a {activeDone = latest (activeDone a), activeDoneCount = activeDoneCount a + 1}
         in after {liveActive = IntMap.insert p more others}
  _ -> after {liveActive = others, liveDone = latest (liveDone live), liveDoneCount = liveDoneCount live + 1}
 where
  number = spanNumber s
  self = IntMap.lookup number (liveActive live)
  -- After a loss there may be spans in it whose end was lost. They began later.
  others
    | liveLost live > 0 = IntMap.union earlier (IntMap.filter (not . inside number (liveActive live)) later)
    | otherwise = IntMap.delete number (liveActive live)
  (earlier, later) = IntMap.split number (liveActive live)
  latest known = keep maxDone (done : known)
  done =
    Done
      { doneNumber = number
      , doneName = spanName s
      , doneTook = t - spanBegan s
      , doneEnd = end
      , doneInside = maybe [] (shallow . activeDone) self
      , doneCount = maybe 0 activeDoneCount self
      }
  after = noted {liveStopped = stoppedToo}
  stoppedToo
    | StoppedBy (SignalChanged n _) <- end
    , spanKind s == Named =
        lastOnes (IntMap.alter (Just . outermost) n (liveStopped live))
    | otherwise = liveStopped live
  outermost known =
    keep
      maxStopped
      ( Stopped (spanName s) (spanBegan s) (keep maxPath (map spanNumber (ancestors (liveActive live) s)))
          : filter (notElem number . stoppedIn) (concat known)
      )
  -- The reactions of some may be lost.
  lastOnes known = if IntMap.size known > maxReactions then IntMap.deleteMin known else known
  noted
    | isFailure end, not alreadyKnown = live {liveFailed = keep maxFailed (FailedSpan path t end : liveFailed live)}
    | otherwise = live
  path = keep maxPath ((number, spanName s) : [(spanNumber o, spanName o) | o <- ancestors (liveActive live) s])
  alreadyKnown = case liveFailed live of
    f : _ -> number `elem` map fst (failedPath f) && failedHow f == end
    [] -> False

isFailure :: End -> Bool
isFailure (FailedWith _) = True
isFailure (FaultedWith _) = True
isFailure _ = False

-- All that is in these, or these alone if that is too much.
shallow :: [Done] -> [Done]
shallow inner
  | sum (map size inner) <= maxInside = inner
  | otherwise = keep maxDone [d {doneInside = []} | d <- inner]
 where
  size d = 1 + sum (map size (doneInside d)) :: Int

inside :: Int -> IntMap Active -> Active -> Bool
inside number active = any ((== number) . spanNumber) . take maxPath . parents . activeSpan
 where
  parents s = case spanParent s of
    Inside p | p == number -> [s {spanNumber = number}]
    _ -> ancestors active s

-- Those that it runs in, the nearest first.
ancestors :: IntMap Active -> Span -> [Span]
ancestors active s = case spanParent s of
  Inside p | p < spanNumber s, Just a <- IntMap.lookup p active -> activeSpan a : ancestors active (activeSpan a)
  _ -> []

-- If there are too many, those that began first and those that began last.
few :: IntMap Active -> IntMap Active
few active
  | IntMap.size active <= 2 * maxActive = active
  | otherwise = IntMap.fromDistinctAscList (take half known ++ drop (length known - half) known)
 where
  known = IntMap.toAscList active
  half = maxActive `div` 2
