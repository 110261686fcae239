{-# LANGUAGE OverloadedStrings #-}

-- |
-- What the rows have in common: what the program believes is written to a file, in lines of JSON, which
-- @test/robots/judge.py@ compares with what the action servers have recorded; and bridges, which can be killed.
module Robots.Campaign
  ( -- * What the program believes
    Campaign (..)
  , newCampaign
  , Row
  , note
  , clock
  , newOrder

    -- * Bridges
  , Bridge
  , onPort
  , withBridge
  , withLies
  , startBridge
  , awaitBridge
  , signalBridge
  , endBridge

    -- * Numbers and limits
  , somewhere
  , within
  , otherThan
  ) where

import Control.Concurrent.MVar
import Control.Exception (bracket, uninterruptibleMask_)
import Control.Monad (void, (>=>))
import Data.Aeson (encode, object, (.=))
import Data.Aeson.Types (Pair)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.Foldable (traverse_)
import Data.IORef
import GHC.Clock (getMonotonicTime)
import System.Environment (getEnv, lookupEnv)
import System.IO
import System.Posix.Signals (Signal, sigCONT, sigKILL, signalProcess)
import System.Process
import Test.QuickCheck (choose, generate)

import Behavior
import Behavior.Ros
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)

-- | A run of the rows: where everything is written, and how a bridge is started.
data Campaign = Campaign
  { believed :: MVar Handle
  , orders :: IORef Int
  , ports :: Int
  -- ^ Its bridges have those after this one.
  , command :: [String]
  , folder :: FilePath
  , isLong :: Bool
  }

-- | From the environment: @ROBOTS@ is the folder, @ROBOTS_BRIDGE@ the command that starts a bridge, and @LONG@ is set
-- for the long counts. Another program that runs at the same time begins with another row: so its file, its ports and
-- its orders are others.
newCampaign :: Row -> IO Campaign
newCampaign first = do
  place <- getEnv "ROBOTS"
  handle <- openFile (place ++ "/believed-" ++ show first) AppendMode
  hSetBuffering handle LineBuffering
  beliefs <- newMVar handle
  nextOrder <- newIORef (100000 * first)
  Campaign beliefs nextOrder (9000 + 10 * first) . words <$> getEnv "ROBOTS_BRIDGE" <*> pure place <*> longCounts
 where
  longCounts = maybe False (not . null) <$> lookupEnv "LONG"

-- | A row of the table.
type Row = Int

-- | Writes a line: all of it, also in a thread whose stop is requested.
note :: Campaign -> Row -> [Pair] -> IO ()
note campaign row pairs =
  uninterruptibleMask_ . withMVar (believed campaign) $ \h ->
    Bytes.hPutStrLn h (encode (object (("row" .= row) : pairs)))

-- | CLOCK_MONOTONIC, which the servers read, too.
clock :: IO Double
clock = getMonotonicTime

-- | An order that no other goal has.
newOrder :: Campaign -> IO Int
newOrder campaign = atomicModifyIORef' (orders campaign) (\n -> (n + 1, n + 1))

-- | A bridge, which may be killed and started again.
data Bridge = Bridge
  { onPort :: Int
  , running :: IORef (Maybe ProcessHandle)
  }

-- | The n-th bridge, from 1, while the behaviour runs.
withBridge :: Campaign -> Int -> (Bridge -> Transport -> Behavior a) -> Behavior a
withBridge campaign n use =
  bracket (Bridge (ports campaign + n) <$> newIORef Nothing) (endBridge sigKILL) $ \bridge -> do
    startBridge campaign bridge
    use bridge (rosbridge ("ws://127.0.0.1:" ++ show (onPort bridge)))

-- | While the behaviour runs, a bridge that is none, in a process of its own, which reads this one's memory:
-- @test/robots/bridge.py@ with these arguments.
withLies :: Campaign -> [String] -> (Transport -> Behavior a) -> Behavior a
withLies campaign arguments use = do
  output <- openFile (folder campaign ++ "/servers") AppendMode
  let python = proc "python3" (["test/robots/bridge.py", "9099", folder campaign] ++ arguments)
      begin = createProcess python {std_in = NoStream, std_out = UseHandle output, std_err = UseHandle output}
      end (_, _, _, process) = terminateProcess process >> void (waitForProcess process)
  bracket begin end (\_ -> use (rosbridge "ws://127.0.0.1:9099"))

-- | Starts it. (It is there some 0.2 s later.)
startBridge :: Campaign -> Bridge -> IO ()
startBridge campaign bridge = do
  output <- openFile (folder campaign ++ "/bridge-" ++ show (onPort bridge)) AppendMode
  let (program, arguments) = (head (command campaign), tail (command campaign) ++ ["--bind", address])
      address = "127.0.0.1:" ++ show (onPort bridge)
  (_, _, _, process) <-
    createProcess (proc program arguments) {std_in = NoStream, std_out = UseHandle output, std_err = UseHandle output}
  writeIORef (running bridge) (Just process)

-- | Waits until there is a link.
awaitBridge :: Ros -> Behavior ()
awaitBridge ros = within 10 "a link" (linkUp ros)

signalBridge :: Signal -> Bridge -> IO ()
signalBridge signal bridge =
  readIORef (running bridge) >>= traverse_ (getPid >=> traverse_ (signalProcess signal))

-- | Sends it that signal, and waits until it has ended. (One that is stopped goes on.)
endBridge :: Signal -> Bridge -> IO ()
endBridge signal bridge = do
  signalBridge signal bridge
  signalBridge sigCONT bridge
  readIORef (running bridge) >>= traverse_ waitForProcess
  writeIORef (running bridge) Nothing

-- | A random time between two.
somewhere :: Double -> Double -> IO Seconds
somewhere low high = realToFrac <$> generate (choose (low, high))

-- | Waits for what has to come, and does not wait forever.
within :: Seconds -> String -> Signal.Signal Bool -> Behavior ()
within seconds what condition = timeout seconds (Signal.waitUntil condition) ? failWith ("it did not come: " ++ what)

-- | Waits for another value than that.
otherThan :: Eq a => a -> Signal.Signal a -> Behavior a
otherThan before = Signal.waitUntilJust . fmap (\a -> if a == before then Nothing else Just a)
