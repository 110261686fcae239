{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- What can go wrong with a fleet.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Error
  ( FleetFailure (..)
  , FleetFault (..)
  , ConnectionLost (..)
  , textOf
  ) where

import Control.Exception (Exception (..), SomeException (..))
import Data.Char (toLower)

import Behavior (Seconds, behaviorFailedFromException, behaviorFailedToException)
import Behavior.Fleet.Internal.Contract (TaskState)

-- | The database could not do it. These are failures: 'Behavior.?' catches them.
--
-- @since 0.1.0.0
data FleetFailure
  = -- | This database did not answer within that time ('Behavior.Fleet.noDatabaseAfter'), and why. What it was asked to
    -- do it may have done.
    NoDatabase String Seconds String
  | -- | The database refuses an argument, and says what is allowed.
    NotAllowed String
  | -- | What a task writes could not be committed, and why.
    NotCommitted String
  | -- | The task whose result is waited for will have none: its state (nothing if it is kept no more), and why its
    -- starts failed.
    NotDone (Maybe TaskState) [String]
  | -- | These resources were not free within that time ('Behavior.Fleet.holdingWithin').
    StillHeld String Seconds
  deriving (Eq, Show)

instance Exception FleetFailure where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException = \case
    NoDatabase name seconds why -> name ++ " has not answered within " ++ show seconds ++ " s: " ++ why
    NotAllowed why -> why
    NotCommitted why -> "what the task writes could not be committed: " ++ why
    NotDone Nothing _ -> "the task is kept no more"
    StillHeld what seconds -> what ++ " was not free within " ++ show seconds ++ " s"
    NotDone (Just how) whys -> "the task is " ++ map toLower (show how) ++ concatMap (": " ++) whys

-- | The fleet is not as it should be. These are faults: no operator swallows one.
--
-- @since 0.1.0.0
data FleetFault
  = -- | The lease of these resources was lost: another robot may hold them.
    LeaseLost String
  | -- | The database was restored from a copy; what is to be done.
    RestoredFromCopy String
  | -- | The schema is missing, or is another one than that of this library, or this user may not use it; what is to be
    -- done.
    WrongSchema String
  | -- | What a task's result should be, and is not.
    UndecodableResult String String
  deriving (Eq, Show)

instance Exception FleetFault where
  displayException = \case
    LeaseLost what -> "the lease of " ++ what ++ " is lost"
    RestoredFromCopy why -> why
    WrongSchema why -> why
    UndecodableResult what why -> what ++ " is not what was expected: " ++ why

-- | A connection is of no use any more, and why. (It never leaves the library.)
data ConnectionLost
  = ConnectionLost {whyLost :: String}
  | -- | The server (of several, each) has not answered in time.
    TooSlow {whyLost :: String}
  deriving (Show)

instance Exception ConnectionLost where
  displayException = whyLost

-- | The text of an exception. (Since GHC 9.10 that of 'SomeException' says also where it was thrown.)
textOf :: SomeException -> String
textOf (SomeException why) = displayException why
