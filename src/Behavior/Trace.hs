-- |
-- Traces: what ran, since when, and why it was interrupted.
--
-- 'named' gives a name to a behaviour, and 'Behavior.Signal.named' to a signal. 'withTrace' passes to
-- /sinks/ what happens: an 'Event' for each begin and end of a named behaviour (a /span/), and one for
-- each 'Reaction' of an operator to a change of its signal.
--
-- >>> import Behavior
-- >>> import Behavior.STM (atomically, newTVarIO, readTVar, writeTVar)
-- >>> import Behavior.Sim (events, simulate)
-- >>> import qualified Behavior.Signal as Signal
--
-- >>> :{
-- mission :: Behavior ()
-- mission = do
--   battery <- newTVarIO (100 :: Int)
--   let low = Signal.named "battery low" ((< 10) <$> Signal.named "battery" (Signal.watching (readTVar battery)))
--       recharge = named "recharge" (sleep 2 >> atomically (writeTVar battery 100))
--       drain = sleep 3 >> atomically (writeTVar battery 9)
--   named "mission" (both drain (Signal.monitor low recharge (named "drive" (sleep 4))))
-- :}
--
-- A simulated run always has its events, also those of operators and their branches:
--
-- >>> run <- simulate mission
-- >>> let isNamed = \e -> case e of { Began s -> spanKind s == Named; Ended s _ _ -> spanKind s == Named; _ -> True }
-- >>> mapM_ (putStrLn . plainLine) (filter isNamed (events run))
-- 0.000 + mission
-- 0.000 + drive
-- 3.000 - drive: stopped after 3 s: battery 9 (was 100) -> battery low True (was False)
-- 3.000 ! battery 9 (was 100) -> battery low True (was False) -> stopped its task after 3 s -> recovery
-- 3.000 + recharge
-- 5.000 - recharge: succeeded after 2 s
-- 5.000 ! battery 100 (was 9) -> battery low False (was True) -> starts task
-- 5.000 + drive
-- 9.000 - drive: succeeded after 4 s
-- 9.000 - mission: succeeded after 9 s
--
-- On a robot, @withTrace [linesTo stderr] mission@ prints the same lines. The page
-- @docs\/seeing-a-robot.md@ shows the pictures, files and texts that the sub-library
-- @behavior-lang:viewer@ makes of events.
module Behavior.Trace
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

import Behavior.Internal.Spans.Event hiding (traverseTexts)
import Behavior.Internal.Spans.Span (named)
import Behavior.Internal.Tracing.Sink (Sink (..), SinkProblem (..), linesTo)
import Behavior.Internal.Tracing.Text (plainLine)
import Behavior.Internal.Tracing.Tracing
