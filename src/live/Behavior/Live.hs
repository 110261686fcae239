-- |
-- The live page: what a robot does, in a browser, while it does it.
--
-- > main = runBehavior (viewing defaultViewing {livePage = Just loopback {pageRobot = "Ann"}} mission)
--
-- prints the address of a page with the tree of what runs, the timeline, and what was interrupted, and why. It can be
-- opened at any time. The page only shows: a reader can change nothing in the mission. @docs\/live-page.md@
-- says who can read it; @docs\/live-protocol.md@ is for those who write another reader.
module Behavior.Live
  ( -- * One call
    viewing
  , viewEvents
  , Viewing (..)
  , defaultViewing

    -- * The page
  , LivePage (..)
  , loopback
  , withLive
  ) where

import Data.Time.Clock (getCurrentTime)
import GHC.Clock (getMonotonicTime)

import Behavior (Behavior)
import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Live.Internal.History (defaultLimits)
import Behavior.Live.Internal.Protocol (Run (..))
import Behavior.Live.Internal.Serving
import Behavior.Live.Internal.Shown
import Behavior.Trace (Event, Sink (Batches), withTrace)
import Behavior.Trace.File (relativeTo)
import qualified Behavior.Trace.Viewing as Viewer

-- | What is shown of a trace: as 'Behavior.Trace.Viewing.Viewing', and on a live page.
--
-- @since 0.1.0.0
data Viewing = Viewing
  { traceFile :: Maybe FilePath
  -- ^ As in "Behavior.Trace.Viewing", and so are the next two.
  , timelineFile :: Maybe FilePath
  , liveTree :: Bool
  , livePage :: Maybe LivePage
  }
  deriving (Eq, Show)

-- | Shows nothing.
--
-- @since 0.1.0.0
defaultViewing :: Viewing
defaultViewing = Viewing {traceFile = Nothing, timelineFile = Nothing, liveTree = False, livePage = Nothing}

-- | Runs a behaviour in a trace, and shows it: 'Behavior.Trace.Viewing.viewing', with a live page.
--
-- [Result, failure, fault, cancellation] Those of 'Behavior.Trace.Viewing.viewing'.
-- [The page] See 'withLive': the behaviour never waits for it.
--
-- @since 0.1.0.0
viewing :: Viewing -> Behavior a -> Behavior a
viewing v act = case livePage v of
  Nothing -> others
  Just page -> withLive page $ \receiving -> withTrace [Batches receiving] others
 where
  others = Viewer.viewing (withoutPage v) act

-- | 'Behavior.Trace.Viewing.viewEvents': a run that is over has no page.
--
-- @since 0.1.0.0
viewEvents :: Viewing -> [Event] -> IO ()
viewEvents = Viewer.viewEvents . withoutPage

withoutPage :: Viewing -> Viewer.Viewing
withoutPage v =
  Viewer.Viewing
    { Viewer.traceFile = traceFile v
    , Viewer.timelineFile = timelineFile v
    , Viewer.liveTree = liveTree v
    }

-- | Serves the page while the action runs, which is given a function that takes the next events of a trace: a 'Sink'.
--
-- The address is printed on @stderr@. If there is no page (no port is free; or it would be reached from other machines
-- and has no token), one line there says why, and the action runs without one. After the action, readers have a second
-- to read the end, however it ends.
--
-- > withLive loopback (\receiving -> withTrace [Batches receiving] mission)
--
-- It is for real time, and not for a simulation.
--
-- [Result, failure, fault, cancellation] Those of the action.
--
-- @since 0.1.0.0
withLive :: LivePage -> (([Event] -> IO ()) -> IO a) -> IO a
withLive page use = withListener page without $ \listener -> do
  thisRun <- Run (pageRobot page) <$> newRunName <*> getCurrentTime
  begun <- Seconds <$> getMonotonicTime
  showing listener (newShown defaultLimits thisRun (const (subtract begun . Seconds <$> getMonotonicTime))) $ \shown ->
    use (receive shown . map (relativeTo begun))
 where
  without why = report ("no page: " ++ why) >> use (const (pure ()))
