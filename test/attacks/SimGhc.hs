{-# LANGUAGE ScopedTypeVariables #-}

-- | The simulator's results for masks and several stops. Expected: the outcomes of many real
-- runs of a program are among the outcomes of its schedules; where GHC fixes the outcome, both
-- sets are equal.
module SimGhc (attack) where

import Control.Concurrent.STM (check, newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (forM, forM_)
import Data.List (nub, sort)

import Attack
import Behavior
import Behavior.Parallel (await, firstOf, fork, requestStop, scoped, tryAwait)
import Behavior.STM (atomically)
import Behavior.Sim
import Behavior.Time (timeout)

attack :: IO ()
attack = forM_ programs $ \(name, fixed, program) -> do
  let once seed = simulateWith defaultSimOptions {scheduled = Seeded seed} program >>= run . explained
  simulated <- sort . nub <$> forM [1 .. 2000] once
  real <- sort . nub <$> forM [1 .. 300 :: Int] (\_ -> inThread 5000 name program >>= run)
  putStrLn (name ++ ": " ++ show simulated ++ " and really " ++ show real)
  promise (name ++ ": really " ++ show real ++ ", and simulated " ++ show simulated) (all (`elem` simulated) real)
  promise (name ++ ": simulated " ++ show simulated ++ ", and really " ++ show real) (not fixed || simulated == real)
 where
  run = pure . either (\e -> "threw " ++ takeWhile (/= '\n') (show (e :: SomeException))) id
  explained r = case outcome r of
    Returned a -> Right a
    Threw e -> Left e
    other -> Right (explain other)

-- | Each with whether GHC fixes the outcome.
programs :: [(String, Bool, IO String)]
programs =
  [ ("a stop at the unmask", False, logged $ \write -> do
      gate <- newTVarIO False
      parallel
        (mask_ (atomically (writeTVar gate True) >> write "m") >> write "never")
        (atomically (readTVar gate >>= check))
    )
  , ("a stop in a masked wait that is there", False, logged $ \write -> do
      v <- newTVarIO False
      parallel
        ( mask_ $
            (atomically (readTVar v >>= check) >> write "got")
              `catch` \e -> write "stop" >> throwIO (e :: SomeException)
        )
        (atomically (writeTVar v True)))
  , ("a child that is stopped before it starts", False, logged $ \write ->
      scoped $ \n -> do
        c <- fork n (write "began" >> sleep 100)
        requestStop c
        atomically (tryAwait c >>= maybe (check False) (const (pure ())))
        write "over")
  , ("a child that nevertheless completes", True, logged $ \write ->
      scoped $ \n -> do
        started <- newTVarIO False
        c <- fork n . mask_ $ do
          atomically (writeTVar started True)
          sleep 100 `catch` \(_ :: SomeException) -> pure ()
          pure "done"
        atomically (readTVar started >>= check)
        requestStop c
        atomically (await c) >>= write)
  , ("two stops: of the timeout, and of the operator", False, logged $ \write -> do
      r <- firstOf [(timeout 0.002 (hangs write) >> pure "?") ? pure "timed out", sleep 0.002 >> pure "second"]
      write r)
  , ("a cleanup that fails, and one that faults", True, logged $ \write -> do
      started <- newTVarIO (0 :: Int)
      let inside = atomically (readTVar started >>= writeTVar started . (+ 1)) >> sleep 100
      parallel
        (atomically (readTVar started >>= check . (== 2)))
        (both (inside `finally` failed) (inside `finally` throwIO (Boom 1)))
      write "?")
  ]
 where
  hangs write = sleep 100 `finally` write "c"
  logged body = do
    book <- newTVarIO []
    let write w = atomically (readTVar book >>= writeTVar book . (w :))
    end <- try (body write)
    ws <- reverse <$> readTVarIO book
    pure (unwords ws ++ either (\e -> " threw " ++ show (e :: SomeException)) (const "") end)
