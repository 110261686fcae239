{-# OPTIONS_HADDOCK not-home #-}

-- |
-- How an operator requests the stop of a branch, and what the exception that ends a behaviour says
-- about why it was stopped.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Stop
  ( Stop (..)
  , isStopOf
  , causeOf
  , displayed
  , atPath
  ) where

import Control.Concurrent (ThreadId)
import Control.Exception
  ( Exception (..)
  , SomeException (..)
  , asyncExceptionFromException
  , asyncExceptionToException
  )

import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure (BehaviorFailed (..), StoppedWithFault (..))
import Behavior.Internal.Core.SafeText (settledText)

-- | The exception by which an operator requests the stop of a branch, and why it does. It names
-- the branch's thread: a request that reaches another thread is not taken for that thread's own.
data Stop = Stop !ThreadId Cause

instance Show Stop where
  show (Stop _ _) = "Stop: requested by the operator that started this behaviour"

instance Exception Stop where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

-- | Whether it is the stop request of that thread.
isStopOf :: ThreadId -> SomeException -> Bool
isStopOf thread e = case fromException e of
  Just (Stop target _) -> target == thread
  Nothing -> False

-- | Why a behaviour was stopped, given the exception that ended it.
causeOf :: SomeException -> Cause
causeOf e
  | Just (Stop _ cause) <- fromException e = cause
  | Just (StoppedWithFault cause _) <- fromException e = causeOf cause
  | otherwise = FromOutside (displayed e)

-- | The text of an exception that a trace shows.
displayed :: SomeException -> String
displayed (SomeException e) = displayException e

-- | The exception; with this path, if it is a failure that has none yet. (The names are users' texts, and
-- the exception will be shown.)
atPath :: [String] -> SomeException -> SomeException
atPath path e = case fromException e of
  Just (BehaviorFailed [] failure) -> toException (BehaviorFailed (map settledText path) failure)
  _ -> e
