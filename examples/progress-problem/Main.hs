{-# LANGUAGE LambdaCase #-}

-- |
-- Section 3.1 of the paper: ticked from its root, a Sequence of two actions that take
-- time never finishes; in this language it does.
module Main (main) where

import Control.Exception (displayException, try)
import Control.Monad (when)
import Data.Foldable (traverse_)

import Behavior
import Tick

main :: IO ()
main = runBehavior $ do
  compose "Sequence, ticked: action1 -> action2" $ \clock action1 action2 ->
    ticked clock (sequenceOf [action1, action2])
  compose "Sequence with memory, ticked: action1 ->* action2" $ \clock action1 action2 ->
    sequenceWithMemory [action1, action2] >>= ticked clock
  -- Here no tree is ticked: each action is a behaviour, which returns when it is done.
  compose "In this language: action1 >> action2" $ \clock action1 action2 ->
    ticked clock action1 >> ticked clock action2

-- | Composes two actions of three ticks each, runs them for at most a hundred ticks, and
-- shows the result.
compose :: String -> (Clock -> Node -> Node -> Behavior ()) -> Behavior ()
compose title composition = do
  clock <- newClock 100
  action1 <- action clock "action1" 3
  action2 <- action clock "action2" 3
  ended <- try (composition clock action1 action2)
  changes <- journal clock
  putStrLn title
  traverse_ (putStrLn . entry) (take 8 changes)
  when (length changes > 8) $ putStrLn "  ..."
  let started = starts changes
  putStrLn ("  action1 was started " ++ started "action1" ++ ", action2 " ++ started "action2")
  putStrLn ("  " ++ either because (const "done") ended)
 where
  entry (t, name, what) = "  tick " ++ show t ++ ": " ++ name ++ " " ++ verb what
  verb = \case
    Started -> "starts"
    Succeeded -> "has succeeded"
    Halted -> "is halted"
  starts changes name = case length [() | (_, n, Started) <- changes, n == name] of
    1 -> "once"
    n -> show n ++ " times"
  because failure = displayException (failure :: BehaviorFailed)
