{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Runs the actions of "Language.Script".
module Language.Perform
  ( Acting (..)
  , perform
  , Failure (..)
  , Fault (..)
  ) where

import Control.Exception (Exception (..), SomeException, mask, onException, throwIO, try, uninterruptibleMask_)

import Behavior (Behavior, behaviorFailedFromException, behaviorFailedToException)
import Language.Script

-- | How actions are performed.
data Acting = Acting
  { wait :: Ticks -> Behavior ()
  , isStopRequest :: SomeException -> Bool
  , observe :: Name -> ActionEvent -> IO ()
  , inCleanup :: Behavior () -> Behavior ()
  }

-- | One call of an action.
perform :: Acting -> Name -> Script -> Behavior Value
perform acting name s = do
  emitted Begins
  mask $ \restore ->
    try (inState restore (wait acting (takes s))) >>= \case
      Right () -> finish name (ends s)
      Left e
        | not (isStopRequest acting e) -> throwIO e
        | otherwise -> do
            emitted ReceivesStop
            case onStop s of
              StopsAtOnce -> throwIO e
              StopsAfter n -> uninterruptibleMask_ (clean n) >> emitted Stops >> throwIO e
              CleansUpInterruptibly n -> (clean n `onException` emitted ReceivesStop) >> emitted Stops >> throwIO e
              EndsAfter n how -> uninterruptibleMask_ (clean n) >> finish (cleanupOf name) how
 where
  emitted = observe acting name
  inState restore = case masking s of
    Unmasked -> restore
    Masked -> id
    Uninterruptible -> uninterruptibleMask_
  clean = inCleanup acting . wait acting
  finish :: Name -> Ending -> IO Value
  finish action how = do
    emitted (Ends how)
    case how of
      Succeeds n -> pure (Number n)
      Fails -> throwIO (Failure action)
      Faults -> throwIO (Fault action)

newtype Failure = Failure Name

instance Show Failure where
  show (Failure name) = name

instance Exception Failure where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException

newtype Fault = Fault Name

instance Show Fault where
  show (Fault name) = name

instance Exception Fault
