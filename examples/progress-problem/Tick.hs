{-# LANGUAGE LambdaCase #-}

-- |
-- Classical behaviour trees, as Sections 2 and 3.1 of the paper describe them: a tree
-- is ticked at its root, again and again, and every tick of a node returns a status.
module Tick
  ( -- * Trees
    Status (..)
  , Node (..)
  , sequenceOf
  , sequenceWithMemory

    -- * Actions
  , action
  , ChangeKind (..)

    -- * Ticking
  , Clock
  , newClock
  , journal
  , ticked
  ) where

import Control.Exception (onException)
import Control.Monad (when)
import Data.Foldable (for_, traverse_)
import Data.IORef

import Behavior

data Status = Success | Failure | Running
  deriving (Eq, Show)

data Node = Node
  { tick :: IO Status
  , halt :: IO ()
  -- ^ Stops the actions that it has started, if any are running.
  }

-- | Sequence: on every tick, ticks its children from left to right, from the first one
-- on, until one does not succeed.
sequenceOf :: [Node] -> Node
sequenceOf children = Node {tick = from children, halt = traverse_ halt children}
 where
  from [] = pure Success
  from (child : others) = tick child >>= \case
    Success -> from others
    -- Children further right may still run from an earlier tick: they are halted.
    status -> status <$ traverse_ halt others

-- | Sequence that remembers which of its children have succeeded.
sequenceWithMemory :: [Node] -> IO Node
sequenceWithMemory children = do
  left <- newIORef children
  let next = readIORef left >>= \case
        [] -> pure Success
        child : others -> tick child >>= \case
          Success -> writeIORef left others >> next
          status -> pure status
      restart = writeIORef left children
      remembering = next >>= \status -> status <$ when (status /= Running) restart
  pure Node {tick = remembering, halt = traverse_ halt children >> restart}

data ChangeKind = Started | Succeeded | Halted
  deriving (Eq, Show)

-- | An action with this name that runs by itself for the given number of ticks and then
-- has succeeded. A tick starts it, or reads its status.
action :: Clock -> String -> Int -> IO Node
action clock name duration = do
  startedAt <- newIORef Nothing
  let record kind = readIORef (ticks clock) >>= \t -> modifyIORef' (entries clock) ((t, name, kind) :)
      stop kind = writeIORef startedAt Nothing >> record kind
      start = readIORef (ticks clock) >>= writeIORef startedAt . Just >> record Started
      poll since = do
        t <- readIORef (ticks clock)
        if t - since >= duration then Success <$ stop Succeeded else pure Running
  pure
    Node
      { tick = readIORef startedAt >>= maybe (Running <$ start) poll
      , halt = readIORef startedAt >>= \running -> for_ running (const (stop Halted))
      }

-- | Counts ticks, up to a limit, and keeps a journal of the changes of the actions.
data Clock = Clock
  { limit :: Int
  , ticks :: IORef Int
  , entries :: IORef [(Int, String, ChangeKind)]
  }

newClock :: Int -> IO Clock
newClock n = Clock n <$> newIORef 0 <*> newIORef []

-- | All changes of the actions: the tick, the action, and the change.
journal :: Clock -> IO [(Int, String, ChangeKind)]
journal clock = reverse <$> readIORef (entries clock)

-- | A tree as a behaviour: ticks it until it has succeeded or failed. It also fails when
-- the clock reaches its limit.
ticked :: Clock -> Node -> Behavior ()
ticked clock node = go `onException` halt node
 where
  go = tick node >>= \case
    Success -> pure ()
    Failure -> failed
    Running -> do
      modifyIORef' (ticks clock) (+ 1)
      t <- readIORef (ticks clock)
      when (t >= limit clock) $ failWith ("not done after " ++ show t ++ " ticks")
      go
