{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- How a branch ended.
--
-- An exception may itself be undefined, so that evaluating it throws. That must not happen in an operator
-- that still has branches: what a branch threw is evaluated in the branch's own thread.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Outcome
  ( Outcome (..)
  , outcomeToIO
  , result
  , classify
  , defined
  ) where

import Control.Concurrent (myThreadId)
import Control.Exception
  ( Exception (..)
  , SomeAsyncException (..)
  , SomeException (..)
  , throwIO
  )

import Behavior.Internal.Core.Failure (BehaviorFailed (..), StoppedWithFault (..), isFailure, tryEvaluate)
import Behavior.Internal.Core.Stop (isStopOf)

-- | How a branch ended.
data Outcome a
  = -- | It returned, perhaps although its stop was requested.
    Completed a
  | -- | It failed.
    FailedWith SomeException
  | -- | It threw anything else, perhaps while it was being stopped.
    FaultedWith SomeException
  | -- | Its stop was requested, and it stopped.
    Stopped SomeException

-- | The action that returns or throws as the branch did.
outcomeToIO :: Outcome a -> IO a
outcomeToIO = either throwIO pure . result

-- | What a branch returned, or what it threw.
result :: Outcome a -> Either SomeException a
result = \case
  Completed a -> Right a
  FailedWith e -> Left e
  FaultedWith e -> Left e
  Stopped e -> Left e

-- | The outcome of a branch whose action ended like this. If the exception that it threw is undefined, what
-- evaluating it throws is the fault.
classify :: Either SomeException a -> IO (Outcome a)
classify = \case
  Right a -> pure (Completed a)
  Left e -> do
    self <- myThreadId
    tryEvaluate (kind self e) >>= either (fmap FaultedWith . defined) pure
 where
  kind self e
    | isStopOf self e = Stopped e
    | otherwise = kindOfOther self (forced e)
  kindOfOther self e
    | Just (StoppedWithFault cause fault) <- fromException e, isStopOf self cause = FaultedWith $! forced fault
    | isFailure e = FailedWith e
    | otherwise = FaultedWith e

-- | The exception; or if it is itself undefined, what it throws.
defined :: SomeException -> IO SomeException
defined e = tryEvaluate (forced e) >>= either defined pure

-- | The exception; evaluating it also evaluates everything that handlers match on.
forced :: SomeException -> SomeException
forced e@(SomeException inner)
  | Just (BehaviorFailed _ failure) <- fromException e = failure `seq` e
  | Just (SomeAsyncException cancellation) <- fromException e = cancellation `seq` e
  | otherwise = inner `seq` e
