{-# LANGUAGE LambdaCase #-}

-- |
-- Small programs of gates, transactions and operators, without durations.
module Reality.Program
  ( Program (..)
  , size
  , observed
  ) where

import Control.Concurrent.STM (STM, TVar, check, modifyTVar', newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (replicateM, void)

import Behavior (Behavior, (?))
import Behavior.Internal.Runtime (atomically, checkpoint)
import Behavior.Parallel (allOf, await, both, firstOf, fork, parallel, scoped)
import Behavior.Signal (Signal, watching)
import qualified Behavior.Signal as Signal
import Support (Failure (..), Fault (..), ending)

-- | A program returns a letter. A gate is also a condition, which holds while it is open.
data Program
  = -- | Adds its letter to the log, and returns it.
    Note Char
  | Open Int
  | Close Int
  | Await Int
  | Fails Char
  | Faults Char
  | -- | A pending exception is raised here, if masked.
    Allow
  | Then Program Program
  | Else Program Program
  | Masked Program
  | Uninterruptible Program
  | Finally Program Program
  | OnException Program Program
  | Parallel Program Program
  | Both Program Program
  | FirstOf [Program]
  | AllOf [Program]
  | -- | The first is forked; the body runs the second, awaits the first, and runs the third.
    Forking Program Program Program
  | RSelect Int Program Program
  | Switch Int Program Program
  | Monitor Int Program Program
  | WhileHolding Int Program
  deriving (Eq, Show)

-- | The approximate number of operations.
size :: Program -> Int
size = \case
  Then p q -> size p + size q
  Else p q -> size p + size q
  Masked p -> 2 + size p
  Uninterruptible p -> 2 + size p
  Finally p q -> 3 + size p + size q
  OnException p q -> 3 + size p + size q
  Parallel p q -> 4 + size p + size q
  Both p q -> 4 + size p + size q
  FirstOf ps -> 2 + sum (map ((+ 1) . size) ps)
  AllOf ps -> 2 + sum (map ((+ 1) . size) ps)
  Forking p q r -> 6 + sum (map size [p, q, r])
  RSelect _ p q -> 4 + size p + size q
  Switch _ p q -> 4 + size p + size q
  Monitor _ p q -> 4 + size p + size q
  WhileHolding _ p -> 4 + size p
  _ -> 1

-- | Whether its last operation is an unmask (if its caller is not masked). In reality an
-- exception may arrive after that, but one that is raised by the unmask has the same outcome.
unmasksLast :: Program -> Bool
unmasksLast = \case
  Masked _ -> True
  Uninterruptible _ -> True
  Finally _ _ -> True
  OnException p _ -> unmasksLast p
  Then _ q -> unmasksLast q
  Else p q -> unmasksLast p && unmasksLast q
  _ -> False

-- | Two gates, which are shut at first, and the log.
data World = World
  { gates :: [TVar Bool]
  , logged :: TVar String
  }

-- | The outcome of a run of the program: the log, and how the program ended. The first action
-- runs at each place where the timing matters; it must have no effect.
observed :: IO () -> Program -> IO String
observed jitter program = do
  world <- World <$> replicateM 2 (newTVarIO False) <*> newTVarIO ""
  end <- ending (run jitter world program)
  line <- readTVarIO (logged world)
  pure (reverse line ++ ": " ++ show end)

-- | A simulated run has a scheduling point before each operation. There is one more before each
-- change of the masking state or of the handlers, so that exceptions cannot arrive in reality
-- where they cannot arrive in a simulation.
run :: IO () -> World -> Program -> Behavior Char
run jitter world = go
 where
  go = \case
    Note c -> c <$ does (modifyTVar' (logged world) (c :))
    Open g -> 'o' <$ does (writeTVar (gate g) True)
    Close g -> 'c' <$ does (writeTVar (gate g) False)
    Await g -> 'w' <$ does (readTVar (gate g) >>= check)
    Fails c -> edge >> throwIO (Failure [c])
    Faults c -> edge >> throwIO (Fault [c])
    Allow -> 'i' <$ (edge >> allowInterrupt)
    Then p q -> go p >> go q
    Else p q -> go p ? go q
    Masked p -> edge >> mask_ (inner p)
    Uninterruptible p -> edge >> uninterruptibleMask_ (inner p)
    Finally p q -> edge >> inner p `finally` inner q
    OnException p q -> edge >> inner p `onException` inner q
    Parallel p q -> 'p' <$ parallel (go p) (go q)
    Both p q -> 'b' <$ both (go p) (go q)
    FirstOf ps -> firstOf (map go ps)
    AllOf ps -> last . ('a' :) <$> allOf (map go ps)
    Forking p q r -> scoped $ \nursery -> do
      result <- fork nursery (go p)
      void (go q)
      c <- atomically (await result)
      c <$ go r
    RSelect g p q -> Signal.rSelect (condition g) (go p) (go q)
    Switch g p q -> Signal.switch (condition g) (\holds -> if holds then go p else go q)
    Monitor g p q -> Signal.monitor (condition g) (void (go p)) (go q)
    WhileHolding g p -> Signal.whileHolding (condition g) (go p)
  inner p
    | unmasksLast p = go p
    | otherwise = go p <* edge
  edge = jitter >> checkpoint
  does :: STM () -> IO ()
  does transaction = jitter >> atomically transaction >> jitter
  gate g = gates world !! g
  condition :: Int -> Signal Bool
  condition g = watching (readTVar (gate g))
