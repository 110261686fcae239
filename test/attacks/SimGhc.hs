{-# LANGUAGE ScopedTypeVariables #-}

-- | Attacks: what the simulator says of masks and several stops. Must come out: what many real runs of
-- the same program show is among what its schedules show; what GHC fixes is one and the same.
module SimGhc (attack) where

import Control.Concurrent.STM (check, newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (forM, forM_)
import Data.List (nub, sort)

import Attack
import Behavior
import Behavior.Parallel (await, firstOf, fork, requestStop, scoped, tryAwait)
import Behavior.Sim
import Behavior.Time (atomically, timeout)

attack :: IO ()
attack = forM_ programs $ \(name, fixed, program) -> do
  simulated <- sort . nub <$> forM [1 .. 2000] (\seed -> simulateWith defaults {scheduled = Seeded seed} program >>= run . explained)
  real <- sort . nub <$> forM [1 .. 300 :: Int] (\_ -> inThread 5000 name program >>= run)
  putStrLn (name ++ ": " ++ show simulated ++ " and really " ++ show real)
  promise (name ++ ": really " ++ show real ++ ", and simulated " ++ show simulated) (all (`elem` simulated) real)
  promise (name ++ ": simulated " ++ show simulated ++ ", and really " ++ show real) (not fixed || simulated == real)
 where
  run = pure . either (\e -> "threw " ++ takeWhile (/= '\n') (show (e :: SomeException))) id
  explained r = case outcome r of
    Returned a -> Right a
    Failing e -> Left e
    Faulting e -> Left e
    Cancelled e -> Left e
    other -> Right (explain other)

-- | Each with whether GHC fixes what comes out.
programs :: [(String, Bool, IO String)]
programs =
  [ ("a stop at the unmask", False, logged $ \say -> do
      gate <- newTVarIO False
      parallel
        (mask_ (atomically (writeTVar gate True) >> say "m") >> say "never")
        (atomically (readTVar gate >>= check))
    )
  , ("a stop in a masked wait that is there", False, logged $ \say -> do
      v <- newTVarIO False
      parallel
        (mask_ ((atomically (readTVar v >>= check) >> say "got") `catch` \e -> say "stop" >> throwIO (e :: SomeException)))
        (atomically (writeTVar v True)))
  , ("a child that is stopped before it starts", False, logged $ \say ->
      scoped $ \n -> do
        c <- fork n (say "began" >> sleep 100)
        requestStop c
        atomically (tryAwait c >>= maybe (check False) (const (pure ())))
        say "over")
  , ("a child that completes all the same", True, logged $ \say ->
      scoped $ \n -> do
        started <- newTVarIO False
        c <- fork n (mask_ (atomically (writeTVar started True) >> (sleep 100 `catch` \(_ :: SomeException) -> pure ()) >> pure "done"))
        atomically (readTVar started >>= check)
        requestStop c
        atomically (await c) >>= say)
  , ("two stops: of the timeout, and of the operator", False, logged $ \say -> do
      r <- firstOf [(timeout 0.002 (hangs say) >> pure "?") ? pure "timed out", sleep 0.002 >> pure "second"]
      say r)
  , ("a cleanup that fails, and one that faults", True, logged $ \say -> do
      started <- newTVarIO (0 :: Int)
      let inside = atomically (readTVar started >>= writeTVar started . (+ 1)) >> sleep 100
      parallel (atomically (readTVar started >>= check . (== 2))) (both (inside `finally` failed) (inside `finally` throwIO (Boom 1)))
      say "?")
  ]
 where
  hangs say = sleep 100 `finally` say "c"
  logged body = do
    book <- newTVarIO []
    let say w = atomically (readTVar book >>= writeTVar book . (w :))
    end <- try (body say)
    ws <- reverse <$> readTVarIO book
    pure (unwords ws ++ either (\e -> " threw " ++ show (e :: SomeException)) (const "") end)
