-- |
-- 'resumable' and 'resumableFor' under explored schedules: no step is repeated, whatever interrupts it.
module Behavior.ResumableSimSpec (spec) where

import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef
import Data.List (nub)
import Data.Map (Map)
import qualified Data.Map as Map
import Test.Hspec

import Behavior
import Behavior.Message (handleNext, unhandled, withInbox)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (Plan, exhaustively, explore, randomly)
import Behavior.Time (checkpoint)
import Support hiding (Log)

spec :: Spec
spec = guarded $ do
  describe "A patrol that is interrupted" $ do
    it "visits each place once, under all schedules" $
      visitedTwice (exhaustively 2) resumable `shouldReturn` False
    it "visits each place once, under random schedules" $
      visitedTwice (randomly 500) resumable `shouldReturn` False
    it "visits one twice if its place is stored when an interruption can come in between" $
      visitedTwice (exhaustively 1) storedLater `shouldReturn` True

  describe "by key" $ do
    it "no step of an order is repeated, though robots are interrupted and fail, under all schedules" $
      repeatedStep (exhaustively 2) (\progress n -> resumableFor progress n "abc") `shouldReturn` False
    it "nor under random schedules" $
      repeatedStep (randomly 500) (\progress n -> resumableFor progress n "abc") `shouldReturn` False
    it "one is if the key is removed before the order is done" $ do
      -- (A simulation interrupts only at operations of the library.)
      let tooEarly progress n act = pure () <$ (resumableFor progress n "abc" act >>= atomically >> checkpoint)
      repeatedStep (exhaustively 1) tooEarly `shouldReturn` True

-- | Whether, in one of the schedules, a patrol whose battery becomes low twice has visited a place
-- twice.
visitedTwice :: Plan -> (TVar [Int] -> (Int -> Behavior ()) -> Behavior ()) -> IO Bool
visitedTwice plan resuming = do
  found <- newIORef False
  _ <- explore plan $ \simulated -> do
    left <- newTVarIO [1, 2, 3]
    low <- newTVarIO False
    visited <- newIORef []
    let visit n = sleep 1 >> modifyIORef' visited (n :)
        recharge = atomically (writeTVar low False)
        drains = for_ [2, 4 :: Seconds] $ \_ -> sleep 2 >> atomically (writeTVar low True)
    _ <- simulated (Signal.monitor (Signal.watching (readTVar low)) recharge (resuming left visit) ||| (drains >> hang))
    places <- readIORef visited
    when (length places > length (nub places)) $ writeIORef found True
  readIORef found

-- | Whether, in one of the schedules, a step of an order was done twice: by a robot whose battery
-- becomes low, and which fails once.
repeatedStep :: Plan -> (TVar (Map Int String) -> Int -> (Char -> Behavior ()) -> Behavior (STM ())) -> IO Bool
repeatedStep plan carryingOut = do
  found <- newIORef False
  _ <- explore plan $ \simulated -> do
    progress <- newTVarIO Map.empty
    low <- newTVarIO False
    jammed <- newTVarIO True
    done <- newIORef []
    let step n c = do
          sleep 1
          isJammed <- atomically (swapTVar jammed False)
          if isJammed then failed else modifyIORef' done ((n, c) :)
        recharge = atomically (writeTVar low False)
        drains = for_ [2, 4 :: Seconds] $ \_ -> sleep 2 >> atomically (writeTVar low True)
        orders deliver = pure () <$ for_ [1, 2] deliver
        order inbox = attempt 2 (handleNext inbox (\n -> carryingOut progress n (step n)))
        allOrders inbox =
          atomically (unhandled inbox) >>= \n -> if n == 0 then pure () else order inbox >> allOrders inbox
        robot = withInbox 5 orders (Signal.monitor (Signal.watching (readTVar low)) recharge . allOrders)
    _ <- simulated (robot ||| (drains >> hang))
    steps <- readIORef done
    when (length steps > length (nub steps)) $ writeIORef found True
  readIORef found

-- | The mistake that 'resumable' does not make.
storedLater :: TVar [a] -> (a -> Behavior ()) -> Behavior ()
storedLater left act = do
  remaining <- readTVarIO left
  for_ remaining $ \x -> act x >> atomically (modifyTVar' left (drop 1))
