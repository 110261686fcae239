{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Why a behaviour was stopped.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Cause
  ( Cause (..)
  , Change (..)
  ) where

import Behavior.Internal.Core.Seconds (Seconds)

-- | Why a span was stopped.
--
-- @since 0.1.0.0
data Cause
  = -- | A signal changed: the number of the reaction, and the values.
    SignalChanged !Int [Change]
  | -- | This branch of the same operator finished.
    SiblingFinished String
  | -- | This branch of the same operator failed or faulted, or a sensor with this name did.
    SiblingFailed String
  | -- | A time limit of that many seconds.
    TimeLimit !Seconds
  | -- | Cancelled from outside: the text of the exception.
    FromOutside String
  | -- | It was abandoned ('Behavior.Time.abandoning'), and may still run.
    WasAbandoned
  deriving (Eq, Ord, Show, Read)

-- | A value of a signal that has a name, before and after a change.
--
-- @since 0.1.0.0
data Change = Change
  { changeSignal :: String
  , changeBefore :: !(Maybe String)
  -- ^ The value when the operator last reacted, if it has before.
  , changeAfter :: String
  }
  deriving (Eq, Ord, Show, Read)
