{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What can be set for a link.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Options
  ( RosOptions (..)
  , defaultRosOptions
  ) where

import Behavior (Behavior, Seconds)

-- | What can be set.
--
-- @since 0.1.0.0
data RosOptions = RosOptions
  { noServerAfter :: Seconds
  -- ^ How long what is used waits for a link; 5 s by default.
  , patience :: Seconds
  -- ^ How long a goal that is stopped waits for the robot's confirmation; 2 s by default.
  , tooSlowAfter :: Seconds
  -- ^ How long a call waits for the service's answer; 5 s by default.
  , pingEvery :: Seconds
  -- ^ How often the bridge is asked whether it is there; 1 s by default.
  , pongWithin :: Seconds
  -- ^ How long anything may take to come after that (a part of a frame will do), or the link is lost; 1 s by default.
  , frameBytes :: Int
  -- ^ How many bytes a frame from the bridge has at most, or it is refused; 1 MiB by default. (It takes up to 0.4 s and
  -- 100 MB to read so much, if it is full of the smallest values. For the messages of one topic:
  -- 'Behavior.Ros.upToBytes'.)
  , frameDepth :: Int
  -- ^ How deep the brackets in a frame nest at most, or it is refused; 64 by default.
  , firstPause :: Seconds
  -- ^ The pause before it connects again, which grows to twice as much each time; 0.1 s by default.
  , longestPause :: Seconds
  -- ^ The longest such pause; 1 s by default.
  , onReport :: String -> Behavior ()
  -- ^ What is done with a line about a frame that was refused, or about a complaint of the bridge; nothing by default.
  -- (A line has at most some 250 characters. If this is too slow for them, lines are left out, and the next one says
  -- how many.)
  }

-- | The defaults that are documented for each field of 'RosOptions'.
--
-- @since 0.1.0.0
defaultRosOptions :: RosOptions
defaultRosOptions =
  RosOptions
    { noServerAfter = 5
    , patience = 2
    , tooSlowAfter = 5
    , pingEvery = 1
    , pongWithin = 1
    , frameBytes = 1048576
    , frameDepth = 64
    , firstPause = 0.1
    , longestPause = 1
    , onReport = \_ -> pure ()
    }
