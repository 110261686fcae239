{-# LANGUAGE ScopedTypeVariables #-}

-- | Attacks: what the simulator says of reactive operators, of children and of faults. Must come out:
-- what many real runs of the same program show is among what its schedules show.
module SimReality (attack) where

import Control.Exception
import Control.Monad (forM, forM_, void)
import Data.List (nub, sort)

import Attack
import Behavior
import Behavior.Parallel
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.STM

attack :: IO ()
attack = forM_ programs $ \(name, program) -> do
  simulated <- fmap (sort . nub) . forM [1 .. 2000] $ \seed ->
    simulateWith defaults {scheduled = Seeded seed} program >>= run . explained
  real <- sort . nub <$> forM [1 .. 500 :: Int] (\_ -> inThread 5000 name program >>= run)
  promise (name ++ ": really " ++ show real ++ ", and simulated " ++ show simulated) (all (`elem` simulated) real)
 where
  run = pure . either (\e -> "threw " ++ takeWhile (/= '\n') (show (e :: SomeException))) id
  explained r = case outcome r of
    Returned a -> Right a
    Failing e -> Left e
    Faulting e -> Left e
    Cancelled e -> Left e
    other -> Right (explain other)

programs :: [(String, IO String)]
programs =
  [ ("watched monitor and a failing task", logged $ \say -> do
      low <- newTVarIO False
      parallel
        (Signal.monitor (Signal.watching (readTVar low)) (say "r" >> atomically (writeTVar low False)) ((atomically (readTVar low >>= check) >> failed) `finally` say "t"))
        (atomically (writeTVar low True) >> atomically (readTVar low >>= check . not)))
  , ("whileHolding, masked caller, two flags", logged $ \say -> do
      f <- newTVarIO True
      g <- newTVarIO False
      void (firstOf [ mask_ (Signal.whileHolding (Signal.watching (readTVar f)) ((atomically (readTVar g >>= check) >> say "w") `finally` say "c")) ? say "lost"
              , atomically (writeTVar f False) >> atomically (writeTVar g True) >> say "x" ]))
  , ("fork, stop, await by two", logged $ \say -> scoped $ \n -> do
      v <- newTVarIO False
      c <- fork n (mask_ (atomically (readTVar v >>= check) `catch` \(e :: SomeException) -> say "s" >> throwIO e) >> say "d")
      d <- fork n (requestStop c >> (atomically (await c) ? say "stopped"))
      atomically (writeTVar v True)
      atomically (await d))
  , ("withShared, closed by its end", logged $ \say -> do
      v <- newTVarIO (0 :: Int)
      Signal.withShared (Signal.watching (readTVar v)) $ \s ->
        parallel (Signal.switch s (\k -> say (show k) >> if k == 2 then pure () else atomically (readTVar v >>= check . (/= k)) >> say "b"))
          (atomically (writeTVar v 1) >> atomically (writeTVar v 2) >> say "w"))
  , ("a fault while stopped by both sides", logged $ \say -> do
      g <- newTVarIO False
      both (both (atomically (readTVar g >>= check) >> failed) (atomically (readTVar g >>= check) `finally` say "f"))
           ((atomically (writeTVar g True) >> throwIO (Boom 3)) `finally` say "h"))
  , ("teleo rules flip", logged $ \say -> do
      v <- newTVarIO (0 :: Int)
      parallel
        (Signal.teleoReactive [((== 1) <$> Signal.watching (readTVar v), say "one" `finally` say "1"), (pure True, (atomically (readTVar v >>= check . (== 3)) >> say "three") `finally` say "z")])
        (forM_ [1, 2, 3] (atomically . writeTVar v) >> atomically (check False)))
  , ("hysteresis flips", logged $ \say -> do
      v <- newTVarIO (0 :: Int)
      Signal.withShared (Signal.hysteresis False 2 5 (Signal.watching (readTVar v))) $ \s ->
        parallel (Signal.waitUntil s >> say "up" >> Signal.waitUntil (not <$> s) >> say "down")
          (forM_ [6, 3, 1] (\k -> atomically (writeTVar v k) >> say (show k)) >> say "end"))
  ]
 where
  logged body = do
    book <- newTVarIO []
    let say w = atomically (readTVar book >>= writeTVar book . (w :))
    end <- try (body say)
    ws <- reverse <$> readTVarIO book
    pure (unwords ws ++ either (\e -> " threw " ++ show (e :: SomeException)) (const "") end)
