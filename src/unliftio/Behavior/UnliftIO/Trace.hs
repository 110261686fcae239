-- |
-- "Behavior.Trace" in a monad of your own ("Behavior.UnliftIO").
--
-- > run (op a b)  =  Behavior.Trace.op (run a) (run b)
--
-- (The two sides are the same for every way to run the monad in 'IO'.) See "Behavior.Trace" for what each operator
-- does; what is not a behaviour is that module's own.
module Behavior.UnliftIO.Trace
  ( -- * Giving names
    named

    -- * Making a trace
  , withTrace
  , withTraceOptions
  , TraceOptions (..)
  , defaultTraceOptions
  , adopt

    -- * Sinks
  , Sink (..)
  , linesTo
  , SinkProblem (..)

    -- * Events
  , Event (..)
  , plainLine

    -- ** Spans
  , Span (..)
  , Parent (..)
  , SpanKind (..)
  , End (..)

    -- ** Why something was stopped
  , Cause (..)
  , Reaction (..)
  , StoppedBranch (..)
  , Change (..)
  ) where

import Control.Monad.IO.Unlift (MonadIO (..), MonadUnliftIO, withRunInIO)

import Behavior.Trace hiding (adopt, named, withTrace, withTraceOptions)
import qualified Behavior.Trace as IO

-- | 'Behavior.Trace.named'.
--
-- > run (named n a)  =  Behavior.Trace.named n (run a)
--
-- @since 0.1.0.0
named :: MonadUnliftIO m => String -> m a -> m a
named name act = withRunInIO $ \run -> IO.named name (run act)

-- | 'Behavior.Trace.withTrace'.
--
-- > run (withTrace sinks a)  =  Behavior.Trace.withTrace sinks (run a)
--
-- @since 0.1.0.0
withTrace :: MonadUnliftIO m => [Sink] -> m a -> m a
withTrace sinks act = withRunInIO $ \run -> IO.withTrace sinks (run act)

-- | 'Behavior.Trace.withTraceOptions'.
--
-- > run (withTraceOptions o sinks a)  =  Behavior.Trace.withTraceOptions o sinks (run a)
--
-- @since 0.1.0.0
withTraceOptions :: MonadUnliftIO m => TraceOptions -> [Sink] -> m a -> m a
withTraceOptions options sinks act = withRunInIO $ \run -> IO.withTraceOptions options sinks (run act)

-- | 'Behavior.Trace.adopt'.
--
-- > run adopt  =  (\here a -> withRunInIO (\run' -> here (run' a))) <$> Behavior.Trace.adopt
--
-- (The behaviour runs with the environment of the place where it runs, not of the place that is handed on.)
--
-- @since 0.1.0.0
adopt :: MonadUnliftIO m => m (m a -> m a)
adopt = (\here act -> withRunInIO (\run -> here (run act))) <$> liftIO IO.adopt
