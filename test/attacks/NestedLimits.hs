-- | Three nested System.Timeouts expire in every order while an operator stops a slow branch,
-- the caller masked or not. Expected: the outcome in plain GHC; a masked caller keeps its
-- result.
module NestedLimits (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, void)
import Data.List (permutations)
import System.Timeout (timeout)

import Attack
import Behavior
import Behavior.Parallel (allOf, firstOf, scoped)
import qualified Behavior.Signal as Signal

attack :: IO ()
attack =
  forM_ (permutations [20, 40, 60]) $ \limits -> do
    expected <- run id limits id
    forM_ operators $ \(name, operator) -> do
      got <- run id limits operator
      promise (name ++ " " ++ show limits ++ ": " ++ got ++ ", and in GHC " ++ expected) (got == expected)
    -- All expire while the operator waits, and it was not interrupted before: the result must
    -- not be lost.
    forM_ masks $ \(name, around) -> do
      kept <- run around limits (\act -> parallel (milliseconds 3600000 `finally` act) (pure ()))
      promise (name ++ " " ++ show limits ++ ": " ++ kept) ("result" `elem` words kept)
 where
  masks = [("masked", mask_), ("uninterruptible", uninterruptibleMask_)]
  operators =
    [ ("parallel", \act -> parallel (hang `finally` act) hang)
    , ("both", \act -> both hang (hang `finally` act))
    , ("in three", \act -> both hang (both hang (parallel hang (hang `finally` act))))
    , ("firstOf", \act -> firstOf [hang `finally` act, hang])
    , ("allOf", \act -> void (allOf [hang, hang `finally` act]))
    , ("scoped", \act -> scoped (const (hang `finally` act)))
    , ("whileHolding", \act -> Signal.whileHolding (pure True) (hang `finally` act))
    , ("withShared", \act -> Signal.withShared (pure ()) (const (hang `finally` act)))
    , ("recovery", \act -> Signal.monitor (pure True) (hang `finally` act) (pure ()))
    ]
  hang = milliseconds 3600000

run :: (IO () -> IO ()) -> [Int] -> (IO () -> IO ()) -> IO String
run around limits operator = do
  book <- newMVar ([] :: [String])
  let write what = modifyMVar_ book (pure . (what :))
      nested [] = around (operator slow >> write "result")
      nested (l : ls) = do
        r <- timeout (l * 1000) (nested ls)
        write ("limit " ++ show l ++ " " ++ show r)
        milliseconds 10
  end <- inThread 5000 "nested limits" (nested limits >> milliseconds 100)
  notes <- takeMVar book
  pure (unwords (reverse notes) ++ either (\e -> " escaped: " ++ show e) (const "") end)
 where
  slow = uninterruptibleMask_ (milliseconds 100)
