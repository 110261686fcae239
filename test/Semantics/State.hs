{-# LANGUAGE LambdaCase #-}

-- |
-- The states that a program goes through.
module Semantics.State
  ( -- * States
    State (..)
  , Now (..)
  , Running (..)
  , Operator (..)
  , Thread (..)
  , Life (..)
  , Phase (..)
  , Moment (..)
  , Reaction (..)

    -- * What a signal is made of
  , Source (..)
  , Poller (..)
  , Poll (..)
  , module Semantics.Filter

    -- * Threads
  , ask
  , asOutcome
  , endOf
  , over
  , completed
  , faultOf
  , threadsOf

    -- * Time
  , moments
  , afterwards
  ) where

import Data.Map.Strict (Map)
import Data.Maybe (isJust)
import Data.Set (Set)

import Semantics.Filter
import Semantics.Program

data State = State
  { running :: Running
  , now :: Now
  }
  deriving (Eq, Ord, Show)

-- | What all that runs has in common.
data Now = Now
  { clock :: Ticks
  , levels :: Map Condition Level
  , calls :: Map Name Int
  -- ^ How often an action was called; those to come all follow the last script.
  , shared :: [Source]
  -- ^ Those that are shared around the part which takes a step, the nearest first.
  , answers :: Map Int (Maybe Result)
  -- ^ How the children have ended for which somebody waits, or will.
  , retracted :: Set Int
  -- ^ Those of them that are to be stopped, which their nursery has yet to find.
  }
  deriving (Eq, Ord, Show)

-- | How far a thread has come.
data Running
  = -- | It has not begun.
    Starting Program
  | -- | It is about to look at what is shared.
    Opening Program
  | -- | It is about to call an action.
    Calling Name [Script]
  | -- | The action does what it does until that moment.
    Acting Name Ticks Script
  | -- | It was asked to stop, and is busy with that until that moment. (Nothing: then it
    -- has stopped.)
    Cleaning Name Ticks (Maybe Ending)
  | -- | Likewise, but it can hear another request.
    Tidying Name Ticks
  | Running `AndThen` Program
  | Running `OrElse` Program
  | -- | The operator waits for its branches.
    Looking Operator [Thread]
  | -- | The operator follows its signal.
    Reacting Program Source View Phase
  | -- | The source is there for as long as the body runs.
    Sharing Source Thread
  | -- | The operator has come to a verdict, and waits for those whom it has asked to stop.
    Concluding Operator Result Source [Thread]
  | -- | It is about to fork the one. If it then waits for the result, it runs the other
    -- before; and it is said whether the one is asked to stop then.
    Forking Program (Maybe (Bool, Program))
  | -- | What it forks has started.
    Forked (Maybe (Int, Bool, Program))
  | -- | When this is over, it asks that child to stop, and then waits for it.
    Retracting Int Running
  | -- | When this is over, it waits for that child.
    Obtaining Int Running
  | -- | It is that child.
    Answering Int Running
  | -- | The environment, with the changes to come.
    Changing [Change] Ticks
  | -- | The program of a stranger, who asks it to stop at those times.
    Called Request Running [Change] [Ticks]
  | -- | It has done all that it does, and can still be stopped.
    Returning Result
  | Over Result
  deriving (Eq, Ord, Show)

data Operator
  = Race
  | Gather
  | Nursery
  | Share
  | React
  deriving (Eq, Ord, Show)

-- | A branch of an operator.
data Thread = Thread Label Life
  deriving (Eq, Ord, Show)

data Life
  = Living Request Running
  | -- | It has ended, but that is not yet known.
    Finished Result
  | -- | Likewise, and it is the child of this number.
    FinishedChild Int Result
  | Ended Result
  deriving (Eq, Ord, Show)

-- | Where a reactive operator is.
data Phase
  = -- | Nothing runs: what the signal says now decides.
    Choosing Moment
  | -- | The reaction to this value is to wait for another.
    Idling Int
  | -- | The branch for this value runs.
    Following Int Thread
  | -- | The branch was asked to stop, so that this can come next.
    Preempting Reaction Thread
  | -- | The recovery runs, and nothing else matters. Before it, perhaps, a branch ended
    -- wrongly.
    Recovering (Maybe Thread) Thread
  | -- | The recovery has ended; the sensors have to before they start afresh.
    Resting
  | -- | They are about to.
    Beginning
  deriving (Eq, Ord, Show)

data Moment
  = First
  | Later
  deriving (Eq, Ord, Show)

data Reaction
  = Run Program
  | RunToEnd Program
  | Idle
  | Conclude Result
  deriving (Eq, Ord, Show)

-- | What a signal is made of, for one run of an operator.
data Source
  = Watching Condition
  | Deadline Ticks
  | Polling Poller
  | Joined Join [Source]
  | Remembering Memory Source
  | Settling Debouncer Source
  | Guarding Watchdog Source
  | -- | The nearest of those that are 'shared'.
    Borrowed
  deriving (Eq, Ord, Show)

data Poller = Poller
  { period :: Ticks
  , sensor :: Program
  , slot :: Ticks
  -- ^ No reading starts before.
  , readings :: Int
  -- ^ How many were started.
  , newest :: Maybe (Int, Result)
  -- ^ Which of them, and what it was.
  , underWay :: Maybe Ticks
  -- ^ Since when.
  , asked :: Request
  , poll :: Poll
  }
  deriving (Eq, Ord, Show)

data Poll
  = Sleeping Ticks
  | Reading Running
  | -- | It is there, but not yet known.
    Read Result
  | -- | Likewise of the end.
    Leaving Result
  | Rested Result
  deriving (Eq, Ord, Show)

-- * Threads

-- | To ask one that was asked before, or has ended, changes nothing.
ask :: Thread -> Thread
ask = \case
  Thread label (Living asks r) | asks `elem` [Unborn, Unasked] -> Thread label (Living Asked r)
  other -> other

-- | Whoever asked for the stop takes out the fault that was met on the way.
asOutcome :: Result -> Result
asOutcome = \case
  Stopped (Just fault) -> Faulted fault
  other -> other

-- | How a thread ended, if that is known.
endOf :: Thread -> Maybe Result
endOf = \case
  Thread _ (Ended result) -> Just result
  _ -> Nothing

over, completed :: Thread -> Bool
over = isJust . endOf
completed thread' = case endOf thread' of
  Just (Succeeded _) -> True
  _ -> False

faultOf :: Thread -> [String]
faultOf thread' = [fault | Just (Faulted fault) <- [endOf thread']]

threadsOf :: Phase -> [Thread]
threadsOf = \case
  Following _ branch -> [branch]
  Preempting _ branch -> [branch]
  Recovering before recovery -> maybe id (:) before [recovery]
  _ -> []

-- * Time

-- | The moments at which something is due.
moments :: Running -> [Ticks]
moments = \case
  Acting _ until' _ -> [until']
  Cleaning _ until' _ -> [until']
  Tidying _ until' -> [until']
  first `AndThen` _ -> moments first
  first `OrElse` _ -> moments first
  Retracting _ r -> moments r
  Obtaining _ r -> moments r
  Answering _ r -> moments r
  Looking _ threads -> ofThreads threads
  Reacting _ source _ phase -> ofSource source ++ ofThreads (threadsOf phase)
  Sharing source body -> ofSource source ++ ofThreads [body]
  Concluding _ _ source threads -> ofSource source ++ ofThreads threads
  Changing (Change at _ _ : _) _ -> [at]
  Changing [] end -> [end]
  Called _ r (Change at _ _ : _) _ -> at : moments r
  Called _ r [] asking -> take 1 asking ++ moments r
  _ -> []
 where
  ofThreads threads = concat [moments r | Thread _ (Living _ r) <- threads]
  ofSource = \case
    Deadline end -> [end]
    Polling Poller {poll = Sleeping until'} -> [until']
    Polling Poller {poll = Reading r} -> moments r
    Joined _ sources -> concatMap ofSource sources
    Remembering _ source -> ofSource source
    Settling d source -> [since + delay d | Just (_, since) <- [timing d]] ++ ofSource source
    Guarding w source -> [since + limit w | Due since <- [guarding w]] ++ ofSource source
    _ -> []

-- | What time does to all that runs: by now all has been started, and every request has come
-- to where it is to be heard.
afterwards :: Running -> Running
afterwards = \case
  first `AndThen` second -> afterwards first `AndThen` second
  first `OrElse` second -> afterwards first `OrElse` second
  Obtaining k r -> Obtaining k (afterwards r)
  Answering k r -> Answering k (afterwards r)
  Looking operator threads -> Looking operator (map ofThread threads)
  Reacting p source v phase -> Reacting p (ofSource source) v (ofPhase phase)
  Sharing source body -> Sharing (ofSource source) (ofThread body)
  Concluding operator result source threads -> Concluding operator result (ofSource source) (map ofThread threads)
  Called asks r coming asking -> Called (ofRequest asks) (afterwards r) coming asking
  r -> r
 where
  ofThread = \case
    Thread label (Living asks r) -> Thread label (Living (ofRequest asks) (afterwards r))
    other -> other
  ofPhase = \case
    Following value branch -> Following value (ofThread branch)
    Preempting next branch -> Preempting next (ofThread branch)
    Recovering before recovery -> Recovering (ofThread <$> before) (ofThread recovery)
    phase -> phase
  ofSource = \case
    Polling s@Poller {poll = Reading r} -> Polling s {poll = Reading (afterwards r)}
    Joined how sources -> Joined how (map ofSource sources)
    Remembering m source -> Remembering m (ofSource source)
    Settling d source -> Settling d (ofSource source)
    Guarding w source -> Guarding w (ofSource source)
    source -> source
  ofRequest = \case
    Unborn -> Unasked
    Asked -> Pending
    AskedTwice -> PendingTwice
    PendingAndAsked -> PendingTwice
    asks -> asks
