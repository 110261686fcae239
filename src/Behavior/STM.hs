{-# LANGUAGE CPP #-}

-- |
-- Transactional variables: all of the package stm, with this library's 'atomically'; and 'withTSem', which
-- holds a semaphore while a behaviour runs.
--
-- Import this module in place of "Control.Concurrent.STM" and "Control.Concurrent.STM.TSem": it exports
-- everything of those except @registerDelay@, whose time cannot be simulated ('Behavior.Time.sleep' and
-- 'Behavior.Time.timeout' can be). The @atomically@ of stm works, too, unless the behaviour is
-- simulated ("Behavior.Sim"): the simulator cannot see a thread that blocks in it.
--
-- >>> door <- newTVarIO False
-- >>> both (atomically (readTVar door >>= check)) (atomically (writeTVar door True))
--
-- Creating or reading a variable outside of a transaction ('newTVarIO', 'readTVarIO') never
-- blocks.
module Behavior.STM
  ( atomically
  , withTSem
#ifndef __HADDOCK_VERSION__
    -- Haddock would list the whole package here.
  , module Control.Concurrent.STM
  , module Control.Concurrent.STM.TSem
#endif
  ) where

import Control.Concurrent.STM hiding (atomically, registerDelay)
import Control.Concurrent.STM.TSem

import Behavior.Internal.Concurrent.Semaphore
import Behavior.Internal.Seam.Runtime (atomically)

-- $setup
-- >>> import Behavior (both)
