{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- What carries frames to a bridge and back. The link knows only this, so that the same code runs over a websocket
-- and, in a simulation, over a fake.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Transport
  ( Transport (..)
  , Connection (..)
  ) where

import Control.Concurrent.STM (STM)
import Data.ByteString.Lazy (ByteString)
import Data.Text (Text)

import Behavior (Behavior)

-- | The way to a robot: made by 'Behavior.Ros.rosbridge', or by 'Behavior.Ros.Fake.fakeRos' for tests.
--
-- @since 0.1.0.0
data Transport = Transport
  { address :: String
  -- ^ For the texts of errors.
  , refusal :: Maybe String
  -- ^ Why this way is never taken, if so.
  , newSuffix :: IO Text
  -- ^ What the names of a link's goals and calls end with: another each time. (There are bridges which confuse goals of
  -- the same name, also those of different clients.)
  , connecting :: forall a. Int -> Behavior () -> (Connection -> Behavior a) -> Behavior a
  -- ^ Connects, and runs the behaviour while it is connected. It is given how many bytes a frame has at most, and
  -- what to call when something was received that is no frame (the answer to a ping).
  }

-- | A connection. Each behaviour of these throws when it is lost.
data Connection = Connection
  { receiveFrame :: Behavior ByteString
  , bytesCame :: STM Int
  -- ^ How many bytes have come, also those of a frame that has not come to its end.
  , sendFrame :: ByteString -> Behavior ()
  , sendPing :: Behavior ()
  , sendClose :: Behavior ()
  -- ^ Says that nothing more will be sent. Then 'receiveFrame' throws when the other end has received it all.
  }
