{-# OPTIONS_HADDOCK not-home #-}

-- |
-- How an operator requests the stop of a branch, and what the exception that ends a behaviour says
-- about why it ended.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Stop
  ( Stop (..)
  , isStopOf
  , causeOf
  , endOf
  , atPath
  ) where

import Control.Concurrent (ThreadId)
import Control.Exception
  ( Exception (..)
  , SomeException (..)
  , asyncExceptionFromException
  , asyncExceptionToException
  , evaluate
  , try
  )

import Behavior.Internal.Failure (BehaviorFailed (..), StoppedWithFault (..), isCancellation)
import Behavior.Internal.SafeText (settledText)
import Behavior.Internal.Trace.Event (Cause (..), End (..))

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

-- | Why what was ended by this exception was stopped.
causeOf :: SomeException -> Cause
causeOf e
  | Just (Stop _ cause) <- fromException e = cause
  | Just (StoppedWithFault cause _) <- fromException e = causeOf cause
  | otherwise = FromOutside (displayed e)

-- | How a behaviour ended that returned or threw.
endOf :: Either SomeException a -> IO End
endOf = either (\e -> try (evaluate (kind e)) >>= either undefinedException pure) (\_ -> pure Succeeded)
 where
  kind e
    | Just (BehaviorFailed _ failure) <- fromException e = FailedWith (displayException failure)
    | Just (StoppedWithFault _ fault) <- fromException e = FaultedWith (displayed fault)
    | isCancellation e = StoppedBy $! causeOf e
    | otherwise = FaultedWith (displayed e)
  undefinedException e = pure (FaultedWith (displayed e))

displayed :: SomeException -> String
displayed (SomeException e) = displayException e

-- | The exception; with this path, if it is a failure that has none yet. (The names are users' texts, and
-- the exception will be shown.)
atPath :: [String] -> SomeException -> SomeException
atPath path e = case fromException e of
  Just (BehaviorFailed [] failure) -> toException (BehaviorFailed (map settledText path) failure)
  _ -> e
