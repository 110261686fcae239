{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Where a live page is, and that it is there while what it shows runs.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Serving
  ( LivePage (..)
  , loopback
  , report

    -- * Serving
  , Listener (..)
  , withListener
  , newRunName
  , showing
  , serve
  ) where

import Control.Concurrent.Async (wait, withAsync)
import Control.Concurrent.STM
import Control.Exception (IOException, bracket, displayException, finally, try)
import Control.Monad (mfilter, void)
import qualified Data.ByteString.Char8 as Char8
import Data.Maybe (isNothing)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Text.Encoding (encodeUtf8)
import Data.Time.Clock (NominalDiffTime)
import Data.Time.Clock.POSIX (getPOSIXTime)
import Network.HTTP.Types (urlEncode)
import Network.Socket
import Network.Wai (Application)
import Network.Wai.Handler.Warp
  ( defaultSettings
  , runSettingsSocket
  , setOnClose
  , setOnException
  , setOnOpen
  , setTimeout
  )
import Numeric (showHex)
import System.IO (hPutStrLn, stderr)
import System.Timeout (timeout)

import Behavior.Internal.Loopback (isLoopback)
import Behavior.Live.Internal.Server (application)
import Behavior.Live.Internal.Shown

-- | Where the page is, and what it says.
--
-- @since 0.1.0.0
data LivePage = LivePage
  { pageRobot :: String
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
loopback = LivePage {pageRobot = "robot", pageHost = "127.0.0.1", pagePort = 8420, pageToken = Nothing}

-- | Prints a line about the page on @stderr@. (Where it cannot be printed, all goes on nevertheless.)
report :: String -> IO ()
report text = void (try (hPutStrLn stderr ("live page: " ++ text)) :: IO (Either IOException ()))

-- | A socket at the page's address, the token, and whether only this machine reaches it.
data Listener = Listener Socket (Maybe Text) Bool

-- | Runs the second action with a socket at the page's address, which is printed on @stderr@; or, if there can be
-- none, the first one, which is given the reason.
withListener :: LivePage -> (String -> IO a) -> (Listener -> IO a) -> IO a
withListener page without use
  | pagePort page < 0 || pagePort page > 65535 = without ("pagePort: allowed: 0 to 65535; not " ++ show (pagePort page))
  | not here, isNothing secret =
      without "other machines reach it there, so it needs a token (pageToken), which it has not"
  | otherwise = bracket (try (listening page)) closing (either (without . displayException) open)
 where
  here = isLoopback (pageHost page)
  secret = mfilter (not . null) (pageToken page)
  closing :: Either IOException Socket -> IO ()
  closing = either (const (pure ())) close
  open listener = do
    socketPort listener >>= report . ("see " ++) . address
    use (Listener listener (Text.pack <$> secret) here)
  address port = "http://" ++ host ++ ":" ++ show port ++ "/" ++ maybe "" (('#' :) . inAddress) secret
  host = if ':' `elem` bare (pageHost page) then "[" ++ bare (pageHost page) ++ "]" else pageHost page
  inAddress = Char8.unpack . urlEncode True . encodeUtf8 . Text.pack

-- | A name that no other run has, of whichever program at this address.
newRunName :: IO String
newRunName = (`showHex` "") . (round :: NominalDiffTime -> Integer) . (* 1000000) <$> getPOSIXTime

-- | Serves one run, which is made for the token and whether only this machine reaches it, while the action runs. After
-- the action, readers have a second to read the end, however it ends.
showing :: Listener -> (Maybe Text -> Bool -> IO Shown) -> (Shown -> IO a) -> IO a
showing listener@(Listener _ secret here) new use = do
  shown <- new secret here
  withAsync (publishing shown) $ \publisher ->
    withAsync (serve listener (application shown)) $ \_ ->
      use shown `finally` (finish shown >> timeout 1000000 (wait publisher >> allHaveRead shown))

-- | Serves the application.
serve :: Listener -> Application -> IO ()
serve (Listener listener _ _) served = do
  connections <- newTVarIO (0 :: Int)
  let opened _ = atomically (stateTVar connections (\n -> (n < mostConnections, n + 1)))
      closed _ = atomically (modifyTVar' connections (subtract 1))
      settings = setOnOpen opened . setOnClose closed . setTimeout 10 $ quietly defaultSettings
  runSettingsSocket settings listener served
 where
  quietly = setOnException (\_ _ -> pure ())

-- | The greatest number of connections at a time, whatever they are for: the mission needs file descriptors, too.
mostConnections :: Int
mostConnections = 64

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
    -- (A program that the mission starts, and that outlasts it, would keep the port.)
    withFdSocket new setCloseOnExecIfNeeded
    r <- try (bind new (addrAddress there) >> listen new 64)
    either (\e -> close new >> ioError (e :: IOException)) (const (pure new)) r
  hints = defaultHints {addrSocketType = Stream}
