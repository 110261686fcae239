{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- What can go wrong with a robot.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Error
  ( RosFailure (..)
  , RosFault (..)
  ) where

import Control.Exception (Exception (..))

import Behavior (Seconds, behaviorFailedFromException, behaviorFailedToException)

-- | The robot could not do it. These are failures: 'Behavior.?' catches them.
--
-- @since 0.1.0.0
data RosFailure
  = -- | There was no link to this address within 'Behavior.Ros.noServerAfter', and why the latest attempt has failed.
    NoServer String String
  | -- | The action's server (or the bridge) did not accept the goal; its reason.
    Rejected String String
  | -- | The action's server has given up the goal; what it said.
    Aborted String String
  | -- | The goal was cancelled, and not by us.
    CancelledByOther String
  | -- | This service could not answer; its reason.
    ServiceFailed String String
  | -- | This service did not answer within that time. What it was asked to do it may still do.
    TooSlow String Seconds
  | -- | A goal of ours may still run on this action: see "Behavior.Ros.Action". Nothing was sent.
    StillMoving String
  deriving (Eq, Show)

instance Exception RosFailure where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException = \case
    NoServer address why -> "no link to " ++ address ++ ": " ++ why
    Rejected action why -> action ++ " rejected the goal: " ++ why
    Aborted action why -> action ++ " aborted the goal: " ++ why
    CancelledByOther action -> "the goal of " ++ action ++ " was cancelled, and not by us"
    ServiceFailed service why -> service ++ " failed: " ++ why
    TooSlow service seconds -> service ++ " has not answered within " ++ show seconds ++ " s"
    StillMoving action -> "a goal of ours may still run on " ++ action ++ ": nothing was sent"

-- | The link or a program of the robot is not as it should be. These are faults: no operator swallows one.
-- ('Behavior.failingOn' makes failures of those that are to be caught.)
--
-- @since 0.1.0.0
data RosFault
  = -- | The link to this address was lost, and why. What the robot was doing it may still be doing.
    LinkLost String String
  | -- | No message came on this topic within its expected silence.
    Silent String Seconds
  | -- | What came from this topic or action is not what the program expects, and why.
    Undecodable String String
  | -- | A number is null or NaN: see 'Behavior.Ros.measured'.
    NotMeasured
  | -- | This action's server has not confirmed within 'Behavior.Ros.patience' that a goal has stopped, and what is
    -- known about that. The robot may still move.
    NotConfirmed String String
  deriving (Eq, Show)

instance Exception RosFault where
  displayException = \case
    LinkLost address why -> "the link to " ++ address ++ " was lost: " ++ why
    Silent topic seconds -> "no message on " ++ topic ++ " within " ++ show seconds ++ " s"
    Undecodable source why -> "what came from " ++ source ++ " is not what was expected: " ++ why
    NotMeasured -> "a number that is null or NaN"
    NotConfirmed action why ->
      action ++ " has not confirmed that the goal has stopped (" ++ why ++ "): the robot may still move"
