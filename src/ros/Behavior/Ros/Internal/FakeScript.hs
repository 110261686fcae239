{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What a fake robot is to do, and what it has done.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.FakeScript
  ( -- * What it is to do
    GoalScript (..)
  , GoalEnd (..)
  , succeeding
  , ServiceScript (..)
  , answering

    -- * What it has done
  , Seen (..)
  ) where

import Data.Aeson (Value, object)

import Behavior (Seconds)

-- | What the server of an action does with a goal.
--
-- @since 0.1.0.0
data GoalScript = GoalScript
  { acceptedAfter :: Seconds
  -- ^ When it accepts the goal. A cancel that comes before that is dropped; the bridge complains about it.
  , endsAfter :: Seconds
  -- ^ How long after that it works on the goal, unless it is cancelled.
  , endsWith :: GoalEnd
  -- ^ How that ends.
  , confirmsAfter :: Seconds
  -- ^ How long after a cancel the goal has stopped; infinite if a cancel has no effect.
  , confirmsWith :: GoalEnd
  -- ^ How that ends.
  , feedbacks :: [(Seconds, Value)]
  -- ^ Its feedback, with the pause before each.
  }

-- | How a goal ends on the robot.
--
-- @since 0.1.0.0
data GoalEnd
  = -- | With this result.
    Succeeds Value
  | -- | The server gives up, with this result: an object. (Text is what a bridge says of a goal that was rejected.)
    Aborts Value
  | -- | It has stopped because it was cancelled.
    Cancels
  | -- | The server does not accept the goal.
    Refuses

-- | Accepts at once, takes a second, and succeeds with an empty result; a cancel is confirmed at once.
--
-- >>> endsAfter succeeding {endsAfter = 60}
-- 60.0
--
-- @since 0.1.0.0
succeeding :: GoalScript
succeeding =
  GoalScript
    { acceptedAfter = 0
    , endsAfter = 1
    , endsWith = Succeeds (object [])
    , confirmsAfter = 0
    , confirmsWith = Cancels
    , feedbacks = []
    }

-- | What a service does with a request.
--
-- @since 0.1.0.0
data ServiceScript = ServiceScript
  { answersAfter :: Seconds
  -- ^ How long it takes; infinite if it never answers.
  , answersWith :: Either Value Value
  -- ^ Its answer, or (on the left) why it could not.
  }

-- | Answers every request with an empty message, after that time.
--
-- @since 0.1.0.0
answering :: Seconds -> Value -> ServiceScript
answering time _ = ServiceScript time (Right (object []))

-- | What the robot has seen and done: an independent record of what the program has made it do. Goals are numbered
-- from 1, in the order in which they came.
--
-- @since 0.1.0.0
data Seen
  = -- | A program has connected.
    Connected
  | -- | It has subscribed to this topic.
    Subscribed String
  | -- | The program will publish on this topic.
    Advertised String
  | -- | It no longer will.
    Unadvertised String
  | -- | It has published this message.
    Published String Value
  | -- | It has called this service.
    Called String Value
  | -- | The goal with this number came for this action: what is to be done.
    GoalCame Int String Value
  | -- | A cancel of it came; whether it could have an effect.
    CancelCame Int Bool
  | -- | It has ended on the robot, with this status.
    GoalEnded Int Int
  deriving (Eq, Show)
