{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Making a trace.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Tracing.Tracing
  ( withTrace
  , withTraceOptions
  , TraceOptions (..)
  , defaultTraceOptions
  , adopt
  ) where

import Control.Exception (SomeException, evaluate, mask, throwIO, try, uninterruptibleMask_)
import Data.IORef (readIORef)
import Data.Traversable (for)
import GHC.Clock (getMonotonicTime)

import Behavior.Internal.Core.Backend (Simulator (lookAtClock))
import Behavior.Internal.Core.Dispatch (inSimulation)
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Core.Seconds (Seconds (..), duration)
import Behavior.Internal.Spans.Place
import Behavior.Internal.Tracing.Sink (Sink)
import qualified Behavior.Internal.Tracing.Sink as Sink

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Trace

-- | Runs a behaviour, and passes what happens in it to the sinks: which of its named parts ran, how
-- each ended, and why it was interrupted.
--
-- > withTrace  =  withTraceOptions defaultTraceOptions
--
-- Emitting an event never blocks: each sink has a thread and a queue of its own. A sink that does not
-- keep up loses the newest events, and receives the number of those ('Lost'). At the end the sinks are
-- awaited for at most a second ('waitAtEnd').
--
-- [Result, failure, fault, cancellation] Those of the behaviour, which runs in the caller's thread and
--   masking state. In a trace, also in one without sinks, a failure contains the path of names
--   where it was thrown ('Behavior.failurePath').
-- [Sinks] One that throws receives nothing more, and one that is still blocked when the trace has
--   ended is /left behind/: its thread remains. Both are reported as a 'Sink.SinkProblem' to GHC's handler
--   for uncaught exceptions, which prints it to @stderr@.
--
-- What happens in a trace inside another one is in both. In a simulation the times are virtual, and the sinks run
-- outside of the simulation.
--
-- >>> withTrace [] (named "wave" (pure "done"))
-- "done"
--
-- @since 0.1.0.0
withTrace :: [Sink] -> Behavior a -> Behavior a
withTrace = withTraceOptions defaultTraceOptions

-- | How to make a trace.
--
-- @since 0.1.0.0
data TraceOptions = TraceOptions
  { withOperators :: !Bool
  -- ^ Whether operators and their branches are spans too; by default 'False'.
  , queueLimit :: !Int
  -- ^ How many events the queue of a sink has room for; 100,000 by default.
  , waitAtEnd :: !Seconds
  -- ^ How long the sinks are awaited at the end, zero or more; a second by default.
  }

-- | The defaults that are documented for each field of 'TraceOptions'.
--
-- @since 0.1.0.0
defaultTraceOptions :: TraceOptions
defaultTraceOptions = TraceOptions {withOperators = False, queueLimit = 100000, waitAtEnd = 1}

-- | 'withTrace' with the given options. (A negative time, or NaN, is refused with an
-- 'Control.Exception.ErrorCall'.)
--
-- @since 0.1.0.0
withTraceOptions :: TraceOptions -> [Sink] -> Behavior a -> Behavior a
withTraceOptions options sinks act = do
  limit <- duration "withTrace: waitAtEnd" (waitAtEnd options)
  _ <- evaluate (length sinks) -- if the list throws, that must come before any sink has been started
  outside <- myPlace
  outer <- case outside of
    Nothing -> inSimulation (pure (Seconds <$> getMonotonicTime)) (pure . lookAtClock) >>= newTrace
    Just place -> pure (trace place)
  before <- readIORef (lastNumber outer)
  mask $ \restore -> do
    running <- for (zip [1 ..] sinks) (uncurry Sink.start)
    let receiver r =
          Receiver
            { firstNumber = before + 1
            , needsDetail = withOperators options
            , receiveEvent = Sink.emit (queueLimit options) r
            }
        whole = foldr (withReceiver . receiver) outer running
        here = maybe (placeIn [] whole) (\place -> place {trace = whole}) outside
        inTrace = inPlace (Just here) (restore act)
    end <- try (inSimulation (withLiveTrace whole inTrace) (const inTrace))
    uninterruptibleMask_ (Sink.end limit running)
    either (\e -> throwIO (e :: SomeException)) pure end

-- | Gives a function that runs a behaviour in the caller's place in the tree of spans, in any thread: for
-- threads that this library does not start.
--
-- > adopt >>= \here -> forkIO (here act)
--
-- Without it, the spans in such a thread are in the trace that began last, with an unknown parent. The
-- thread should end before the span around it does.
--
-- @since 0.1.0.0
adopt :: Behavior (Behavior a -> Behavior a)
adopt =
  myPlace >>= \case
    Nothing -> pure id
    here -> pure (\act -> mask (\restore -> inPlace here (restore act)))
