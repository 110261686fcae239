{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Going on after an interruption where it was.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Resumable
  ( resumable
  , resumableFor
  ) where

import Control.Concurrent.STM (STM, TVar, modifyTVar, readTVar)
import Control.Exception (mask)
import Data.Map.Lazy (Map)
import qualified Data.Map.Lazy as Map

import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Seam.Runtime (atomically)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.STM
-- >>> import Behavior.Message
-- >>> import qualified Behavior.Signal as Signal
-- >>> import qualified Data.Map as Map

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
-- branch and its own return has not returned. A behaviour that swallows its cancellation and returns
-- has returned, and the next element follows, as in every loop.
--
-- [Result] None, when the list is empty. For a patrol without an end, fill it again:
--   @forever (resumable left visit >> atomically (writeTVar left waypoints))@.
-- [Failure, fault] Of the behaviour: thrown; the element stays in the list.
-- [Cancellation] Passes through; the element stays in the list. The behaviour runs in the caller's
--   thread and masking state.
--
-- If an effect outside of variables (a report that is sent) must not be repeated, make it the last step, and
-- mask it; it must not block once it has happened. Then nothing comes between it and the commit:
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
resumable left = goOn (readTVar left) (modifyTVar left (drop 1))

-- | 'resumable' with the progress kept by key: of each order, say, the steps that are left.
--
-- > resumableFor progress key steps act
-- >   -- as resumable on a variable that holds steps at first, and that is found by its key
--
-- A key that is not in the map has all the steps left, and is added with them; one that is there goes on
-- where it was, whichever robot works on it now, and whatever came in between: an interruption, a failure
-- and a retry. A key stays in the map, also when nothing is left for it, until the transaction that is
-- returned has removed it. Commit that together with what says that the whole is done: then neither is
-- repeated, whatever interrupts it in between. Of an order that is given up, nothing else removes the key (of
-- a message that was begun, and then dropped by a full inbox): do it with @modifyTVar progress (Map.delete key)@.
--
-- > handleNext orders (\order -> resumableFor progress (number order) (steps order) carryOut)
-- > resumableFor progress key steps act >>= atomically     -- if nothing else says so
--
-- [Result] A transaction that removes the key.
-- [Failure, fault, cancellation] As in 'resumable', which also says how to have an effect only once.
--
-- Two behaviours must not work on one key at the same time. The steps that are given are looked at
-- only when the key is not in the map: an order goes on with the steps with which it began. It runs in
-- constant space.
--
-- >>> progress <- newTVarIO (Map.empty :: Map.Map Int [String])
-- >>> tries <- newTVarIO (0 :: Int)
-- >>> let jammed = atomically (modifyTVar' tries (+ 1) >> (< 2) <$> readTVar tries)
-- >>> let lift = jammed >>= \is -> if is then failed else pure ()
-- >>> let step name = putStrLn name >> if name == "lift" then lift else pure ()
-- >>> let orders deliver = pure () <$ deliver 7
-- >>> let carryOut order = resumableFor progress order ["fetch", "lift", "bring"] step
-- >>> withInbox 5 orders $ \inbox -> attempt 2 (handleNext inbox carryOut)
-- fetch
-- lift
-- lift
-- bring
-- >>> Map.null <$> readTVarIO progress
-- True
--
-- @since 0.1.0.0
resumableFor :: Ord k => TVar (Map k [a]) -> k -> [a] -> (a -> Behavior ()) -> Behavior (STM ())
resumableFor progress key steps act = do
  -- From here on only the map holds the steps: each can be collected when it is done.
  atomically (modifyTVar progress (`Map.union` Map.singleton key steps))
  goOn (Map.findWithDefault [] key <$> readTVar progress) (modifyTVar progress (Map.adjust (drop 1) key)) act
  pure (modifyTVar progress (Map.delete key))

-- | Runs the behaviour for each element that is left, and removes it. The transactions read what is
-- left, and remove the first element.
goOn :: STM [a] -> STM () -> (a -> Behavior ()) -> Behavior ()
goOn left removeFirst act = again
 where
  again =
    atomically left >>= \case
      [] -> pure ()
      next : _ -> do
        -- Masked, so that nothing comes between its return and the commit, which forces nothing.
        mask $ \restore -> restore (act next) >> atomically removeFirst
        again
