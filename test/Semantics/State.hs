{-# OPTIONS_GHC -O1 #-}
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
  , ThreadState (..)
  , Phase (..)
  , ReadMode (..)
  , Response (..)

    -- * The sources of a signal
  , Source (..)
  , Poller (..)
  , Poll (..)
  , module Semantics.Filter

    -- * Threads
  , requestStop
  , asOutcome
  , endOf
  , over
  , completed
  , faultOf
  , threadsOf

    -- * Time
  , dueTimes
  , afterTimePassed
  , threadAfter
  ) where

import Data.Map.Strict (Map)
import Data.Maybe (isJust, maybeToList)
import Data.Ord (comparing)
import Data.Set (Set)

import Language.Same (unlessSame)
import Semantics.Filter
import Semantics.Program

data State = State
  { running :: Running
  , now :: Now
  }
  deriving (Eq, Ord, Show)

-- | The part of the state that all threads share.
data Now = Now
  { clock :: Ticks
  , levels :: Map Condition Level
  , calls :: Map Name Int
  -- ^ How often each action was called, counted up to its last script, which repeats.
  , shared :: [Source]
  -- ^ The sources of the 'WithShared' operators around the part that takes a step, the
  -- innermost first.
  , childResults :: Map Int (Maybe Result)
  -- ^ The results of the forked children that are awaited, or will be; 'Nothing' until the
  -- child has ended.
  , childStopRequests :: Set Int
  -- ^ The children whose stop was requested by their handle, and not yet passed on by their
  -- nursery.
  , abandoned :: [Thread]
  -- ^ Those that have not ended.
  }
  deriving (Eq, Show)

instance Ord Now where
  compare = unlessSame (comparing (\(Now a b c d e f g) -> (a, b, c, d, e, f, g)))

-- | What remains of a program that runs in a thread.
data Running
  = -- | The program has not begun.
    Starting Program
  | -- | An operator is about to open a signal that uses a shared one.
    Opening Program
  | -- | An action is about to be called.
    Calling Name [Script]
  | -- | The action works until the given time.
    Acting Name Ticks Script
  | -- | The action has received a stop request, and its cleanup lasts until the given time.
    -- Then it ends as given ('Nothing': it stops).
    Cleaning Name Ticks (Maybe Ending)
  | -- | A cleanup until the given time, which another stop request interrupts.
    CleaningInterruptibly Name Ticks
  | Running `AndThen` Program
  | Running `OrElse` Program
  | -- | The operator waits for its branches.
    Waiting Operator [Thread]
  | -- | The operator follows its signal.
    Reacting Program Source View Phase
  | -- | The source runs for as long as the body does.
    Sharing Source Thread
  | -- | The operator has its verdict, and waits for the threads whose stop it has requested.
    Concluding Operator Result Source [Thread]
  | -- | The first program is about to be forked. If its result is awaited, the other program
    -- runs before that; the 'Bool' is whether the child's stop is requested in between.
    Forking Program (Maybe (Bool, Program))
  | -- | The child has started. (The arguments are the child's number, and those of 'Forking'.)
    Forked (Maybe (Int, Bool, Program))
  | -- | After this, the stop of the child with that number is requested, and the child awaited.
    StoppingChild Int Running
  | -- | After this, the child with that number is awaited.
    AwaitingChild Int Running
  | -- | The child with that number, whose result is awaited.
    AsChild Int Running
  | -- | Until the given time.
    Sleeping Ticks
  | -- | The run of a program that runs again in each slot: the interval, and the slot of this run.
    InSlot Ticks Ticks Program Running
  | -- | Until that slot.
    AwaitingSlot Ticks Ticks Program
  | -- | What follows masks stop requests; one that is pending is received before.
    Entering Running
  | Uninterruptibly Running
  | Delivering
  | -- | What handles a message that waits is about to begin. Without one: whether it is awaited.
    Taking Bool Program
  | -- | What handles a message, which is put back if it does not succeed.
    Handling Running
  | -- | The rule that has each message handled by the program; and what runs for one, if one has come.
    Serving Program (Maybe Running)
  | -- | After this, the inbox is closed.
    Closing Running
  | -- | A thread whose stop was requested, which is awaited until the given time, and then abandoned.
    GivingUp Ticks Thread
  | -- | The environment, with the changes to come and the time at which it ends.
    Changing [Change] Ticks
  | -- | A program that a plain thread runs, with the changes to come and the times at which
    -- an exception is thrown to that thread.
    Called Request Running [Change] [Ticks]
  | -- | The work is done, and a stop request can still arrive.
    Returning Result
  | Over Result
  deriving (Eq, Ord, Show)

data Operator
  = Race
  | Gather
  | Choose Choice
  | Nursery
  | -- | For how long the branch is awaited when its stop was requested.
    Abandon Ticks
  | Share
  | React
  deriving (Eq, Ord, Show)

-- | A branch of an operator.
data Thread = Thread BranchLabel ThreadState
  deriving (Eq, Show)

-- | (Threads with the same label are the usual ones: it is compared last.)
instance Ord Thread where
  compare = unlessSame (\(Thread a b) (Thread a' b') -> compare b b' <> unlessSame compare a a')

data ThreadState
  = Live Request Running
  | -- | It has ended, but its result is not yet published.
    Finished Result
  | -- | Likewise, for the child with that number.
    FinishedChild Int Result
  | Ended Result
  deriving (Eq, Ord, Show)

-- | The phase of a reactive operator.
data Phase
  = -- | No branch runs: the signal's current value decides what comes next.
    Choosing ReadMode
  | -- | The response to this value is to wait for a different one.
    Idling Int
  | -- | The branch for this value runs.
    Following Int Thread
  | -- | The branch's stop was requested; this response comes next.
    Stopping Response Thread
  | -- | The recovery runs, and the signal is not read. The first thread is the branch that was
    -- stopped for it, if that failed or faulted.
    Recovering (Maybe Thread) Thread
  | -- | The recovery has ended. The sensors must have ended, too, before they are restarted.
    AwaitingSensors
  | -- | The sensors are about to be restarted.
    Restarting
  deriving (Eq, Ord, Show)

data ReadMode
  = FirstRead
  | Reread
  deriving (Eq, Ord, Show)

data Response
  = Run Program
  | RunToEnd Program
  | Idle
  | Conclude Result
  deriving (Eq, Ord, Show)

-- | What runs for a signal during one run of an operator.
data Source
  = Watching Condition
  | Deadline Ticks
  | Polling Poller
  | Joined Join [Source]
  | WithHysteresis HysteresisState Source
  | Debounced Debouncer Source
  | Throttled Throttler Source
  | WithWatchdog Watchdog Source
  | -- | The innermost of the 'shared' sources.
    SharedSource
  deriving (Eq, Ord, Show)

data Poller = Poller
  { period :: Ticks
  , sensor :: Program
  , slot :: Ticks
  -- ^ No reading starts before this time.
  , readings :: Int
  -- ^ How many readings were started.
  , newest :: Maybe (Int, Result)
  -- ^ The number of the newest published reading, and its result.
  , inFlightSince :: Maybe Ticks
  -- ^ When the reading that runs now was started.
  , pollerRequest :: Request
  , poll :: Poll
  }
  deriving (Eq, Ord, Show)

data Poll
  = BetweenSlots Ticks
  | Reading Running
  | -- | The reading has ended, and is not yet published.
    Unpublished Result
  | -- | The poller ends with this, which is not yet published.
    EndingWith Result
  | PollEnded Result
  deriving (Eq, Ord, Show)

-- * Threads

-- | Requests a thread's stop. This has no effect after an earlier request or after its end.
requestStop :: Thread -> Thread
requestStop = \case
  Thread label (Live requests r) | requests `elem` [NotStarted, NoRequest] -> Thread label (Live Requested r)
  other -> other

-- | The result of a branch for the operator that has requested its stop: a fault met while
-- stopping is a fault.
asOutcome :: Result -> Result
asOutcome = \case
  Stopped (Just fault) -> FaultedWith fault
  other -> other

-- | How a thread ended, if that is published.
endOf :: Thread -> Maybe Result
endOf = \case
  Thread _ (Ended result) -> Just result
  _ -> Nothing

over, completed :: Thread -> Bool
over = isJust . endOf
completed child = case endOf child of
  Just (Succeeded _) -> True
  _ -> False

faultOf :: Thread -> [String]
faultOf child = [fault | Just (FaultedWith fault) <- [endOf child]]

threadsOf :: Phase -> [Thread]
threadsOf = \case
  Following _ branch -> [branch]
  Stopping _ branch -> [branch]
  Recovering before recovery -> maybe id (:) before [recovery]
  _ -> []

-- * Time

-- | The times at which something is due.
dueTimes :: Running -> [Ticks]
dueTimes = \case
  Acting _ due _ -> [due]
  Cleaning _ due _ -> [due]
  CleaningInterruptibly _ due -> [due]
  first `AndThen` _ -> dueTimes first
  first `OrElse` _ -> dueTimes first
  Sleeping due -> [due]
  InSlot _ _ _ r -> dueTimes r
  AwaitingSlot _ due _ -> [due]
  Uninterruptibly r -> dueTimes r
  Handling r -> dueTimes r
  Serving _ r -> maybe [] dueTimes r
  Closing r -> dueTimes r
  GivingUp due branch -> due : ofThreads [branch]
  StoppingChild _ r -> dueTimes r
  AwaitingChild _ r -> dueTimes r
  AsChild _ r -> dueTimes r
  Waiting _ threads -> ofThreads threads
  Reacting _ source _ phase -> ofSource source ++ ofThreads (threadsOf phase)
  Sharing source body -> ofSource source ++ ofThreads [body]
  Concluding _ _ source threads -> ofSource source ++ ofThreads threads
  Changing (Change at _ _ : _) _ -> [at]
  Changing [] end -> [end]
  Called _ r (Change at _ _ : _) _ -> at : dueTimes r
  Called _ r [] stopTimes -> take 1 stopTimes ++ dueTimes r
  -- These are due at no time.
  Starting _ -> []
  Opening _ -> []
  Calling _ _ -> []
  Forking _ _ -> []
  Forked _ -> []
  Entering _ -> []
  Delivering -> []
  Taking _ _ -> []
  Returning _ -> []
  Over _ -> []
 where
  ofThreads threads = concat [dueTimes r | Thread _ (Live _ r) <- threads]
  ofSource = \case
    Deadline end -> [end]
    Polling Poller {poll = BetweenSlots due} -> [due]
    Polling Poller {poll = Reading r} -> dueTimes r
    Polling _ -> []
    Joined _ sources -> concatMap ofSource sources
    WithHysteresis _ source -> ofSource source
    Debounced d source -> [since + delay d | Just (_, since) <- [timedChange d]] ++ ofSource source
    Throttled h source -> maybeToList (restsUntil h) ++ ofSource source
    WithWatchdog w source -> [since + limit w | InFlight since <- [watchdogState w]] ++ ofSource source
    Watching _ -> []
    SharedSource -> []

-- | The effect of the passing of time: all threads have started, and every stop request has
-- reached its thread, where it is pending if it cannot be received.
afterTimePassed :: Running -> Running
afterTimePassed = \case
  first `AndThen` second -> afterTimePassed first `AndThen` second
  first `OrElse` second -> afterTimePassed first `OrElse` second
  InSlot interval from p r -> InSlot interval from p (afterTimePassed r)
  Uninterruptibly r -> Uninterruptibly (afterTimePassed r)
  Handling r -> Handling (afterTimePassed r)
  Serving handler r -> Serving handler (afterTimePassed <$> r)
  Closing r -> Closing (afterTimePassed r)
  GivingUp due branch -> GivingUp due (threadAfter branch)
  StoppingChild k r -> StoppingChild k (afterTimePassed r)
  AwaitingChild k r -> AwaitingChild k (afterTimePassed r)
  AsChild k r -> AsChild k (afterTimePassed r)
  Waiting operator threads -> Waiting operator (map threadAfter threads)
  Reacting p source v phase -> Reacting p (ofSource source) v (ofPhase phase)
  Sharing source body -> Sharing (ofSource source) (threadAfter body)
  Concluding operator result source threads -> Concluding operator result (ofSource source) (map threadAfter threads)
  Called requests r coming stopTimes -> Called (requestAfter requests) (afterTimePassed r) coming stopTimes
  -- In these no other thread runs.
  r@(Starting _) -> r
  r@(Opening _) -> r
  r@(Calling _ _) -> r
  r@Acting {} -> r
  r@Cleaning {} -> r
  r@(CleaningInterruptibly _ _) -> r
  r@(Forking _ _) -> r
  r@(Forked _) -> r
  r@(Sleeping _) -> r
  r@AwaitingSlot {} -> r
  r@(Entering _) -> r
  r@Delivering -> r
  r@(Taking _ _) -> r
  r@(Changing _ _) -> r
  r@(Returning _) -> r
  r@(Over _) -> r
 where
  ofPhase = \case
    Following value branch -> Following value (threadAfter branch)
    Stopping next branch -> Stopping next (threadAfter branch)
    Recovering before recovery -> Recovering (threadAfter <$> before) (threadAfter recovery)
    phase -> phase
  ofSource = \case
    Polling s@Poller {poll = Reading r} -> Polling s {poll = Reading (afterTimePassed r)}
    Polling s -> Polling s
    Joined how sources -> Joined how (map ofSource sources)
    WithHysteresis m source -> WithHysteresis m (ofSource source)
    Debounced d source -> Debounced d (ofSource source)
    Throttled h source -> Throttled h (ofSource source)
    WithWatchdog w source -> WithWatchdog w (ofSource source)
    Watching condition -> Watching condition
    Deadline end -> Deadline end
    SharedSource -> SharedSource

-- | The same for a thread, and for the stop requests of one.
threadAfter :: Thread -> Thread
threadAfter = \case
  Thread label (Live requests r) -> Thread label (Live (requestAfter requests) (afterTimePassed r))
  other -> other

requestAfter :: Request -> Request
requestAfter = \case
  NotStarted -> NoRequest
  Requested -> Pending
  RequestedTwice -> PendingTwice
  PendingAndRequested -> PendingTwice
  requests -> requests
