{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Holding a semaphore while a behaviour runs.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Semaphore (withTSem) where

import Control.Concurrent.STM.TSem (TSem, signalTSem, waitTSem)
import Control.Exception (bracket_)

import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Seam.Runtime (atomically)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM

-- | Waits for a unit of the semaphore, runs the behaviour, and gives the unit back, however the
-- behaviour ends. A semaphore with one unit is a lock.
--
-- > withTSem semaphore act  =  bracket_ (atomically (waitTSem semaphore)) (atomically (signalTSem semaphore)) act
--
-- [Result, failure, fault] Of the behaviour, which runs in the caller's thread and masking state. The
--   unit is given back after the behaviour has ended, cleanup included.
-- [Cancellation] Passes through. It can come while the caller waits for the unit, even if the caller is
--   masked; then nothing has been taken. Giving the unit back never blocks, and so nothing interrupts it.
--
-- If several wait, any of them may come next. A behaviour that holds the only unit, and waits for another one,
-- waits for ever. To limit the wait for the unit, but not the work, note in the transaction that takes the unit
-- that it was taken. (With @bracket_ (timeout 5 ...)@ a unit that is taken as the robot is cancelled would be
-- lost.)
--
-- > do held <- newTVarIO False
-- >    let obtain = atomically (waitTSem semaphore >> writeTVar held True)
-- >        giveBack = atomically (readTVar held >>= \is -> when is (signalTSem semaphore))
-- >    (timeout 5 obtain >> act) `finally` giveBack
--
-- >>> arm <- atomically (newTSem 1)
-- >>> both (withTSem arm (putStrLn "grip")) (withTSem arm failed) ? putStrLn "drop"
-- grip
-- drop
-- >>> withTSem arm (putStrLn "park")
-- park
--
-- @since 0.1.0.0
withTSem :: TSem -> Behavior a -> Behavior a
withTSem semaphore = bracket_ (atomically (waitTSem semaphore)) (atomically (signalTSem semaphore))
