{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Going on after an interruption where it was.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Resumable (resumable) where

import Control.Concurrent.STM (TVar, modifyTVar, readTVar)
import Control.Exception (mask)

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Runtime (atomically)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM
-- >>> import qualified Behavior.Signal as Signal

-- | Runs a behaviour for each element of the list in a variable, and removes the element when the
-- behaviour has returned. After an interruption, call it again with the same variable: it goes on
-- with the element that it was at.
--
-- > resumable left act  =  readTVarIO left >>= \\xs -> for_ xs act >> atomically (writeTVar left [])
-- >   -- if nothing interrupts it
--
-- A behaviour that has returned is not run again for its element; one that was interrupted is, from
-- its beginning. (With @act x >> atomically (modifyTVar left tail)@ an interruption can come in
-- between, and the work is done twice.) An operator that is interrupted between the end of its
-- branch and its own return has not returned.
--
-- [Result] None, when the list is empty. For a patrol without an end, fill it again:
--   @forever (resumable left visit >> atomically (writeTVar left waypoints))@.
-- [Failure, fault] Of the behaviour: thrown; the element stays in the list.
-- [Cancellation] Passes through; the element stays in the list. The behaviour runs in the caller's
--   thread and masking state.
--
-- An effect outside of variables (a report that is sent) which must not be repeated, is the last step,
-- does not block after its effect, and is masked, so that nothing comes between it and the commit:
--
-- > mask $ \restore -> resumable left (\x -> restore (driveTo x) >> report x)
--
-- Other threads may add elements behind the first one. It runs in constant space.
--
-- >>> left <- newTVarIO ["north", "east", "south"]
-- >>> low <- newTVarIO True
-- >>> let recharge = putStrLn "recharge" >> atomically (writeTVar low False)
-- >>> let visit place = putStrLn place >> if place == "east" then failWith "blocked" else pure ()
-- >>> Signal.monitor (Signal.watching (readTVar low)) recharge (resumable left visit) ? putStrLn "clear the way"
-- recharge
-- north
-- east
-- clear the way
-- >>> resumable left putStrLn
-- east
-- south
--
-- @since 0.1.0.0
resumable :: TVar [a] -> (a -> Behavior ()) -> Behavior ()
resumable left act =
  atomically (readTVar left) >>= \case
    [] -> pure ()
    next : _ -> do
      -- Masked, so that nothing comes between its return and the commit, which forces nothing.
      mask $ \restore -> restore (act next) >> atomically (modifyTVar left (drop 1))
      resumable left act
