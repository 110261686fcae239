{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- One variable in which several branches publish; what the leftmost of them published counts.
-- So waiting for the first of n branches reads one variable instead of n.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Leftmost
  ( Leftmost
  , newLeftmost
  , publish
  , publishFailure
  , readLeftmost
  , tryReadLeftmost
  ) where

import Control.Concurrent.STM (STM, TVar, newTVarIO, readTVar, readTVarIO, retry, writeTVar)
import Control.Exception (SomeException)

import Behavior.Internal.Concurrent.Outcome (Outcome, result)

-- | What the leftmost branch that has published anything published, and the branch's number.
newtype Leftmost x = Leftmost (TVar (Maybe (Int, x)))

-- | Nothing is published yet.
newLeftmost :: IO (Leftmost x)
newLeftmost = Leftmost <$> newTVarIO Nothing

-- | Publishes, unless a branch further left has.
publish :: Leftmost x -> Int -> x -> STM ()
publish (Leftmost variable) n x =
  readTVar variable >>= \case
    Just (m, _) | m < n -> pure ()
    _ -> writeTVar variable (Just (n, x))

-- | Publishes what a branch threw, if it threw anything.
publishFailure :: Leftmost SomeException -> Int -> Outcome a -> STM ()
publishFailure leftmost n = either (publish leftmost n) (\_ -> pure ()) . result

-- | What was published, and the number of its branch; retries until something was.
readLeftmost :: Leftmost x -> STM (Int, x)
readLeftmost (Leftmost variable) = readTVar variable >>= maybe retry pure

-- | What was published, if anything was. Does not block.
tryReadLeftmost :: Leftmost x -> IO (Maybe (Int, x))
tryReadLeftmost (Leftmost variable) = readTVarIO variable
