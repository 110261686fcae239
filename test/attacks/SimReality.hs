{-# LANGUAGE ScopedTypeVariables #-}

-- | The simulator's results for reactive operators, for children and for faults. Expected: the
-- outcomes of many real runs of a program are among the outcomes of its schedules.
module SimReality (attack) where

import Control.Exception
import Control.Monad (forM, forM_, unless, void)
import Data.List (nub, sort)

import Attack
import Behavior
import Behavior.Parallel
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim

attack :: IO ()
attack = forM_ programs $ \(name, program) -> do
  simulated <- fmap (sort . nub) . forM [1 .. 40000] $ \seed ->
    simulateWith defaultSimOptions {scheduled = Seeded seed} program >>= run . explained
  real <- sort . nub <$> forM [1 .. 500 :: Int] (\_ -> inThread 5000 name program >>= run)
  promise (name ++ ": really " ++ show real ++ ", and simulated " ++ show simulated) (all (`elem` simulated) real)
 where
  run = pure . either (\e -> "threw " ++ takeWhile (/= '\n') (show (e :: SomeException))) id
  explained r = case outcome r of
    Returned a -> Right a
    Threw e -> Left e
    other -> Right (explain other)

programs :: [(String, IO String)]
programs =
  [ ("watched monitor and a failing task", logged $ \write -> do
      low <- newTVarIO False
      parallel
        ( Signal.monitor
            (Signal.watching (readTVar low))
            (write "r" >> atomically (writeTVar low False))
            ((atomically (readTVar low >>= check) >> failed) `finally` write "t")
        )
        (atomically (writeTVar low True) >> atomically (readTVar low >>= check . not)))
  , ("whileHolding, masked caller, two flags", logged $ \write -> do
      f <- newTVarIO True
      g <- newTVarIO False
      let act = (atomically (readTVar g >>= check) >> write "w") `finally` write "c"
      void $
        firstOf
          [ mask_ (Signal.whileHolding (Signal.watching (readTVar f)) act) ? write "lost"
          , atomically (writeTVar f False) >> atomically (writeTVar g True) >> write "x"
          ])
  , ("fork, stop, await by two", logged $ \write -> scoped $ \n -> do
      v <- newTVarIO False
      let awaiting = atomically (readTVar v >>= check) `catch` \(e :: SomeException) -> write "s" >> throwIO e
      c <- fork n (mask_ awaiting >> write "d")
      d <- fork n (requestStop c >> (atomically (await c) ? write "stopped"))
      atomically (writeTVar v True)
      atomically (await d))
  , ("withShared, closed by its end", logged $ \write -> do
      v <- newTVarIO (0 :: Int)
      let branch k = do
            write (show k)
            unless (k == 2) (atomically (readTVar v >>= check . (/= k)) >> write "b")
      Signal.withShared (Signal.watching (readTVar v)) $ \s ->
        parallel (Signal.switch s branch)
          (atomically (writeTVar v 1) >> atomically (writeTVar v 2) >> write "w"))
  , ("a fault while stopped by both sides", logged $ \write -> do
      g <- newTVarIO False
      both (both (atomically (readTVar g >>= check) >> failed) (atomically (readTVar g >>= check) `finally` write "f"))
           ((atomically (writeTVar g True) >> throwIO (Boom 3)) `finally` write "h"))
  , ("teleo rules flip", logged $ \write -> do
      v <- newTVarIO (0 :: Int)
      parallel
        ( Signal.teleoReactive
            [ ((== 1) <$> Signal.watching (readTVar v), write "one" `finally` write "1")
            , (pure True, (atomically (readTVar v >>= check . (== 3)) >> write "three") `finally` write "z")
            ]
        )
        (forM_ [1, 2, 3] (atomically . writeTVar v) >> atomically (check False)))
  , ("hysteresis flips", logged $ \write -> do
      v <- newTVarIO (0 :: Int)
      Signal.withShared (Signal.hysteresis False 2 5 (Signal.watching (readTVar v))) $ \s ->
        parallel (Signal.waitUntil s >> write "up" >> Signal.waitUntil (not <$> s) >> write "down")
          (forM_ [6, 3, 1] (\k -> atomically (writeTVar v k) >> write (show k)) >> write "end"))
  ]
 where
  logged body = do
    book <- newTVarIO []
    let write w = atomically (readTVar book >>= writeTVar book . (w :))
    end <- try (body write)
    ws <- reverse <$> readTVarIO book
    pure (unwords ws ++ either (\e -> " threw " ++ show (e :: SomeException)) (const "") end)
