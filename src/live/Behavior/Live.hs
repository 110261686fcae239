-- |
-- The live page: what a robot does, in a browser, while it does it.
--
-- > main = runBehavior (viewing defaultViewing {livePage = Just loopback {robot = "Ann"}} mission)
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

import Control.Concurrent.Async (withAsync, wait)
import Control.Exception (IOException, bracket, displayException, finally, try)
import Control.Monad (mfilter, void)
import qualified Data.ByteString.Char8 as Char8
import Data.Maybe (isNothing)
import qualified Data.Text as Text
import Data.Text.Encoding (encodeUtf8)
import Data.Time.Clock (NominalDiffTime, getCurrentTime)
import Data.Time.Clock.POSIX (getPOSIXTime)
import GHC.Clock (getMonotonicTime)
import Network.HTTP.Types (urlEncode)
import Network.Socket
import Network.Wai.Handler.Warp (defaultSettings, runSettingsSocket, setOnException)
import Numeric (showHex)
import System.IO (hPutStrLn, stderr)
import System.Timeout (timeout)

import Behavior (Behavior)
import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Loopback (isLoopback)
import Behavior.Live.Internal.History (defaultLimits)
import Behavior.Live.Internal.Protocol (Run (..))
import Behavior.Live.Internal.Server
import Behavior.Trace (Event, Sink (Batches), withTrace)
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

-- | Where the page is, and what it says.
--
-- @since 0.1.0.0
data LivePage = LivePage
  { robot :: String
  -- ^ The robot's name, for the page's title.
  , pageHost :: String
  -- ^ The address at which it is served.
  , pagePort :: Int
  -- ^ The port, from 1 to 65535; if another program has it, one of the nine after it. With 0, any.
  , pageToken :: Maybe String
  -- ^ What a reader must know. (It is part of the address that is printed.)
  }
  deriving (Eq, Show)

-- | A page for this machine, at port 8420. (From another one it is reached by a tunnel: @ssh -L 8420:127.0.0.1:8420@.)
--
-- @since 0.1.0.0
loopback :: LivePage
loopback = LivePage {robot = "robot", pageHost = "127.0.0.1", pagePort = 8420, pageToken = Nothing}

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
withLive page use
  | pagePort page < 0 || pagePort page > 65535 = without ("pagePort: allowed: 0 to 65535; not " ++ show (pagePort page))
  | not (isLoopback (pageHost page)), isNothing secret =
      without "other machines reach it there, so it needs a token (pageToken), which it has not"
  | otherwise = bracket (try (listening page)) closing (either (without . displayException) served)
 where
  without why = say ("no page: " ++ why) >> use (const (pure ()))
  -- (Where it cannot be printed, the action runs nevertheless.)
  say text = void (try (hPutStrLn stderr ("live page: " ++ text)) :: IO (Either IOException ()))
  secret = mfilter (not . null) (pageToken page)
  closing :: Either IOException Socket -> IO ()
  closing = either (const (pure ())) close
  served listener = do
    thisRun <- Run (robot page) <$> newName <*> getCurrentTime
    begun <- Seconds <$> getMonotonicTime
    shown <- newShown defaultLimits thisRun begun (Text.pack <$> secret) (isLoopback (pageHost page))
    socketPort listener >>= say . ("see " ++) . address
    withAsync (publishing shown) $ \publisher ->
      withAsync (runSettingsSocket (quietly defaultSettings) listener (application shown)) $ \_ ->
        use (receive shown) `finally` (finish shown >> wait publisher >> timeout 1000000 (allHaveRead shown))
  newName = (`showHex` "") . (round :: NominalDiffTime -> Integer) . (* 1000000) <$> getPOSIXTime
  quietly = setOnException (\_ _ -> pure ())
  address port = "http://" ++ host ++ ":" ++ show port ++ "/" ++ maybe "" (('#' :) . inAddress) secret
  host = if ':' `elem` bare (pageHost page) then "[" ++ bare (pageHost page) ++ "]" else pageHost page
  inAddress = Char8.unpack . urlEncode True . encodeUtf8 . Text.pack

-- An address of IPv6 may be in brackets.
bare :: String -> String
bare = filter (`notElem` "[]")

-- | A socket at its address, at the first port that is free.
listening :: LivePage -> IO Socket
listening page = go (if pagePort page == 0 then [0] else takeWhile (<= 65535) (take 10 [pagePort page ..]))
 where
  go ports = case ports of
    [] -> ioError (userError "no port")
    [port] -> open port
    port : others -> (try (open port) :: IO (Either IOException Socket)) >>= either (const (go others)) pure
  open port = do
    found <- getAddrInfo (Just hints) (Just (bare (pageHost page))) (Just (show port))
    let there = head found
    new <- socket (addrFamily there) Stream defaultProtocol
    setSocketOption new ReuseAddr 1
    r <- try (bind new (addrAddress there) >> listen new 64)
    either (\e -> close new >> ioError (e :: IOException)) (const (pure new)) r
  hints = defaultHints {addrSocketType = Stream}
