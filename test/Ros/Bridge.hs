{-# LANGUAGE OverloadedStrings #-}

-- |
-- A fake robot behind a real websocket: its bridge is a server on this machine, in this process or in another one.
module Ros.Bridge
  ( withBridge
  , withBridgeOver
  , Server
  , plainly
  , orBridge
  , withBridgeProcess
  ) where

import Control.Exception (SomeException, bracket, finally)
import Control.Monad (forever, void)
import Data.Aeson (Value)
import Network.Socket (Socket, accept, close, socketPort)
import qualified Network.WebSockets as Websockets
import System.Environment (getEnvironment, getExecutablePath, lookupEnv)
import System.IO
import System.Process

import Behavior
import Behavior.Internal.Concurrent.Service
import Behavior.Parallel (firstOf, fork, scoped)
import Behavior.Ros
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Transport

-- | Runs the behaviour with a way to the robot's bridge. (The bridge is there until the behaviour has ended, cleanup
-- included.)
withBridge :: FakeRobot -> (String -> Behavior a) -> Behavior a
withBridge robot act = withBridgeOver plainly robot (\port -> act ("ws://127.0.0.1:" ++ port))

-- | The same, with the port of such a server.
withBridgeOver :: Server -> FakeRobot -> (String -> Behavior a) -> Behavior a
withBridgeOver server robot act =
  bracket (Websockets.makeListenSocket "127.0.0.1" 0) close $ \listening -> do
    port <- socketPort listening
    servedBy (serving server robot listening) (act (show port))

-- | How a server begins a connection.
type Server = Socket -> Behavior Websockets.PendingConnection

-- | Without encryption.
plainly :: Server
plainly socket = Websockets.makePendingConnection socket Websockets.defaultConnectionOptions

-- | A server that passes on what the fake robot's own bridge says.
serving :: Server -> FakeRobot -> Socket -> Behavior a
serving server robot listening = scoped $ \nursery -> forever $ do
  (socket, _) <- accept listening
  fork nursery (void (tryAny (serve socket)) `finally` close socket)
 where
  serve socket = connecting (fakeRos robot) 1000000 (pure ()) $ \inside -> do
    outside <- server socket >>= Websockets.acceptRequest
    firstOf . map tryAny $
      [ forever (Websockets.receiveData outside >>= sendFrame inside)
      , forever (receiveFrame inside >>= Websockets.sendTextData outside)
      ] :: Behavior (Either SomeException ())

-- | In the process that 'withBridgeProcess' starts: a robot with these actions, until its standard input ends.
-- Elsewhere, the program.
orBridge :: [(String, Value -> GoalScript)] -> IO () -> IO ()
orBridge actions program = lookupEnv variable >>= maybe program (const (withFakeRobot actions robotAndBridge))
 where
  robotAndBridge robot = withBridge robot $ \bridgeAddress -> do
    putStrLn bridgeAddress >> hFlush stdout
    let obey = isEOF >>= \over -> if over then pure () else getLine >>= does >> obey
        does command = (if command == "cut" then loseLink robot else restoreLink robot) >> putStrLn "" >> hFlush stdout
    obey

-- | Runs the behaviour with a way to a robot in another process (this program once more, whose @main@ has 'orBridge'),
-- and what cuts its link and mends it.
withBridgeProcess :: (Transport -> Behavior () -> Behavior () -> Behavior a) -> Behavior a
withBridgeProcess act = do
  program <- getExecutablePath
  environment <- getEnvironment
  let other = (proc program []) {env = Just ((variable, "1") : environment), std_in = CreatePipe, std_out = CreatePipe}
  withCreateProcess other $ \input output _ process -> case (input, output) of
    (Just to, Just from) -> do
      bridgeAddress <- hGetLine from
      let tell command = hPutStrLn to command >> hFlush to >> void (hGetLine from)
      act (rosbridge bridgeAddress) (tell "cut") (tell "mend") <* hClose to <* waitForProcess process
    _ -> fail "no pipes"

variable :: String
variable = "BEHAVIOR_FAKE_BRIDGE"
