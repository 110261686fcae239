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
-- If the behaviour has returned, it is not run again for that element; if it was interrupted, it is run
-- again, from its beginning. (With @act x >> atomically (modifyTVar left tail)@ an interruption can come in
-- between, and the work is done twice.) If the behaviour is an operator that is interrupted after its
-- branch has ended, but before it has itself returned, then it has not returned. If the behaviour swallows
-- its cancellation and returns, the next element follows, as in every loop.
--
-- [Result] None, when the list is empty. For a patrol without an end, fill it again:
--   @forever (resumable left visit >> atomically (writeTVar left waypoints))@.
-- [Failure, fault] Of the behaviour: thrown; the element stays in the list.
-- [Cancellation] Passes through; the element stays in the list. The behaviour runs in the caller's
--   thread and masking state.
--
-- If an effect outside of variables (a report that is sent) must not be repeated, make it the last step, mask
-- it, and do nothing that blocks after it. Then nothing comes between the effect and the removal of the element:
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

-- | 'resumable' with the progress kept by key: for each order, say, the steps that are left.
--
-- > resumableFor progress key steps act
-- >   -- as resumable on a variable that holds steps at first, and that is found by its key
--
-- A key that is not in the map is added, with all the steps; the work for a key that is there goes on
-- where it was, whichever robot does it now, and whatever came in between: an interruption, a failure
-- and a retry. A key stays in the map, even when no step is left, until the transaction that is
-- returned has removed it. Commit that transaction together with the one that marks the whole as done: then
-- no step is repeated, whatever interrupts the work. Nothing else removes the key of an order that is given up
-- (a message that was begun, and then dropped by a full inbox): do that with
-- @modifyTVar progress (Map.delete key)@.
--
-- > handleNext orders (\order -> resumableFor progress (number order) (steps order) carryOut)
-- > resumableFor progress key steps act >>= atomically     -- if nothing else says so
--
-- [Result] A transaction that removes the key.
-- [Failure, fault, cancellation] As in 'resumable', which also says how to have an effect only once.
--
-- Two behaviours must not work on one key at the same time. The given steps are used only when the key is
-- not in the map: an order goes on with the steps with which it began. It runs in constant space.
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

-- | Runs the behaviour for each element that is left, and removes the element. The first transaction reads
-- what is left, the second removes the first element.
goOn :: STM [a] -> STM () -> (a -> Behavior ()) -> Behavior ()
goOn left removeFirst act = again
 where
  again =
    atomically left >>= \case
      [] -> pure ()
      next : _ -> do
        -- Masked, so that nothing comes between the return and the removal. (That evaluates no element.)
        mask $ \restore -> restore (act next) >> atomically removeFirst
        again
