-- |
-- Transactional variables: all of the package stm, with this library's 'atomically'.
--
-- Import this module in place of "Control.Concurrent.STM". The @atomically@ of stm works,
-- too, until the behaviour is simulated ("Behavior.Sim"): the simulator does not see a thread
-- that waits by it.
--
-- >>> door <- newTVarIO False
-- >>> both (atomically (readTVar door >>= check)) (atomically (writeTVar door True))
--
-- What is missing of stm is @registerDelay@, whose time cannot be simulated: use
-- 'Behavior.Time.sleep' or 'Behavior.Time.timeout'. Reading and making a variable outside of
-- a transaction ('readTVarIO', 'newTVarIO') never waits, and is stm's.
module Behavior.STM
  ( atomically
  , module Control.Concurrent.STM
  ) where

import Control.Concurrent.STM hiding (atomically, registerDelay)

import Behavior.Internal.Runtime (atomically)

-- $setup
-- >>> import Behavior (both)
