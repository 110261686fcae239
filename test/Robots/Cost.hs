{-# LANGUAGE OverloadedStrings #-}

-- |
-- Row 15: what a message there and back takes, a goal, and a cancel, beside another client (roslibpy) of the same
-- bridge; and what a reaction to a topic takes, beside a bare client of the websocket.
module Robots.Cost
  ( costs
  ) where

import Control.Monad (replicateM, replicateM_, void)
import Data.Aeson (Key, Value, decodeStrict, eitherDecodeStrict, object, withObject, (.:), (.=))
import Data.Aeson.Types (parseMaybe)
import qualified Data.ByteString.Char8 as Bytes
import Data.IORef
import Data.Int (Int32)
import Data.Text (Text)
import Network.WebSockets (receiveData, runClient, sendTextData)
import System.Process (readProcess)

import Behavior
import Behavior.Message (receive)
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Messages
import Behavior.STM
import Robots.Campaign
import Robots.Goals

-- | In turn, so that all have the same machine.
costs :: Campaign -> Behavior ()
costs campaign = withLies campaign ["answer"] $ \way -> replicateM_ 5 $ do
  withRos way $ \ros -> do
    awaitBridge ros
    wrote "ours" "message" =<< messages ros
    wrote "ours" "goal" =<< replicateM count (taking (void (plainly ros (fibonacci "/any") 0)))
    wrote "ours" "cancel" =<< replicateM (count `div` 5) (cancelling ros)
    wrote "ours" "reaction to a topic that must not be silent" =<< reactions (topic "/time" (atLeastEvery 2)) ros
  -- (What one of them takes differs by a third from one connection to the next: so there are many.)
  replicateM_ 5 $ do
    wrote "ours" "reaction" =<< withRos way (\ros -> awaitBridge ros >> reactions (topic "/time" latched) ros)
    wrote "bare" "reaction" =<< bareReactions
  theirs <- readProcess (folder campaign ++ "/venv/bin/python3") ["test/robots/client.py", "9099", show count] ""
  either fail (\took -> note campaign 15 ["client" .= ("roslibpy" :: Text), "took" .= (took :: Value)]) $
    eitherDecodeStrict (Bytes.pack theirs)
 where
  wrote :: Text -> Key -> [Double] -> Behavior ()
  wrote client what took = note campaign 15 ["client" .= client, "took" .= object [what .= took]]

count :: Int
count = 200

taking :: Behavior a -> Behavior Double
taking act = do
  begun <- clock
  _ <- act
  ended <- clock
  pure (ended - begun)

-- | The bridge sends back what is published.
messages :: Ros -> Behavior [Double]
messages ros =
  withMessages ros (topic "/heard" latched :: Topic (Std Int32)) 16 $ \inbox ->
    publishing ros (publication "/said") $ \say ->
      replicateM count (taking (say (Std (0 :: Int32)) >> atomically (receive inbox)))

-- | From the request to stop until the goal has ended.
cancelling :: Ros -> Behavior Double
cancelling ros = do
  asked <- newIORef 0
  firstOf [void (plainly ros (fibonacci "/any") 1), sleep 0.001 >> clock >>= writeIORef asked]
  (-) <$> clock <*> readIORef asked

-- | From when the bridge sends the time until a behaviour has it.
reactions :: Topic (Std (Maybe Double)) -> Ros -> Behavior [Double]
reactions time ros = go (count `div` 2) 0
 where
  go 0 _ = pure []
  go n before = do
    sent <- otherThan before (measured unStd (latest ros time))
    now <- clock
    ((now - sent) :) <$> go (n - 1 :: Int) sent

-- | The same of a client that only decodes.
bareReactions :: IO [Double]
bareReactions = runClient "127.0.0.1" 9099 "/" $ \connection -> do
  sendTextData connection ("{\"op\":\"subscribe\",\"topic\":\"/time\"}" :: Text)
  replicateM (count `div` 2) $ do
    frame <- receiveData connection
    let sent = decodeStrict frame >>= parseMaybe (withObject "frame" (\o -> o .: "msg" >>= (.: "data")))
    maybe (fail "this is not the time") (\at -> subtract at <$> clock) sent
