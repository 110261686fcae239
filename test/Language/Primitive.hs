{-# LANGUAGE LambdaCase #-}

-- |
-- Small programs whose leaves are gates, transactions, masks and handlers, without durations: for the comparison with
-- real threads.
module Language.Primitive
  ( Program (..)
  , size
  , lettered
  , observed
  ) where

import Control.Concurrent.STM (STM, TVar, check, modifyTVar', newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (replicateM)

import Behavior.Internal.Seam.Runtime (checkpoint)
import Behavior.STM (atomically)
import Behavior.Signal (watching)
import Language.Operator
import Support (Failure (..), Fault (..), ending)

-- | A program returns a letter. A gate is also a condition, which holds while it is open.
data Program
  = -- | Adds its letter to the log, and returns it.
    Note Char
  | Open Int
  | Close Int
  | -- | Blocks until the gate is open.
    Pass Int
  | Fails Char
  | Faults Char
  | -- | A pending exception is raised here, if masked.
    Allow
  | Masked Program
  | Uninterruptible Program
  | Finally Program Program
  | OnException Program Program
  | -- | Its conditions are gates.
    Op (Operator Int Program)
  deriving (Eq, Show)

-- | The approximate number of operations.
size :: Program -> Int
size = \case
  Masked p -> 2 + size p
  Uninterruptible p -> 2 + size p
  Finally p q -> 3 + size p + size q
  OnException p q -> 3 + size p + size q
  Op o -> maybe 0 (const 4) (operatorName o) + (if forks o then 2 else 0) + sum (fmap size o)
  _ -> 1

-- | Whether its last operation is an unmask (if its caller is not masked). In reality an
-- exception may arrive after that, but one that is raised by the unmask has the same outcome.
unmasksLast :: Program -> Bool
unmasksLast = \case
  Masked _ -> True
  Uninterruptible _ -> True
  Finally _ _ -> True
  OnException p _ -> unmasksLast p
  Op (Then _ q) -> unmasksLast q
  Op (Else p q) -> unmasksLast p && unmasksLast q
  _ -> False

-- | Gives every part its own letter.
lettered :: Program -> Program
lettered = numbered . go
 where
  go = \case
    Note _ -> letter Note
    Fails _ -> letter Fails
    Faults _ -> letter Faults
    Masked p -> Masked <$> go p
    Uninterruptible p -> Uninterruptible <$> go p
    Finally p q -> Finally <$> go p <*> go q
    OnException p q -> OnException <$> go p <*> go q
    Op o -> Op <$> traverse go o
    other -> pure other
  letter make = Numbered (\n -> (n + 1, make (toEnum (fromEnum 'a' + n - 1))))

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
  end <- ending (runPart (language jitter world) noEnvironment () program)
  line <- readTVarIO (logged world)
  pure (reverse line ++ ": " ++ show end)

-- | A simulated run has a scheduling point before each operation. There is one more before each
-- change of the masking state or of the handlers, so that exceptions cannot arrive in reality
-- where they cannot arrive in a simulation.
language :: IO () -> World -> Language () Int Program Char
language jitter world = this
 where
  this =
    Language
      { runPart = \around () -> go around
      , inBranch = \_ () -> ()
      , signalOf = \_ () g -> fromEnum <$> watching (readTVar (gate g))
      , reactsTo = id
      , tick = 1
      , results = maybe '-' (last . ('a' :))
      }
  go around = \case
    Note c -> c <$ does (modifyTVar' (logged world) (c :))
    Open g -> 'o' <$ does (writeTVar (gate g) True)
    Close g -> 'c' <$ does (writeTVar (gate g) False)
    Pass g -> 'w' <$ does (readTVar (gate g) >>= check)
    Fails c -> edge >> throwIO (Failure [c])
    Faults c -> edge >> throwIO (Fault [c])
    Allow -> 'i' <$ (edge >> allowInterrupt)
    Masked p -> edge >> mask_ (inner p)
    Uninterruptible p -> edge >> uninterruptibleMask_ (inner p)
    Finally p q -> edge >> inner p `finally` inner q
    OnException p q -> edge >> inner p `onException` inner q
    Op o -> run this around () () o
   where
    inner p
      | unmasksLast p = go around p
      | otherwise = go around p <* edge
  edge = jitter >> checkpoint
  does :: STM () -> IO ()
  does transaction = jitter >> atomically transaction >> jitter
  gate g = gates world !! g
