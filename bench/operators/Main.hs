{-# LANGUAGE LambdaCase #-}

-- |
-- What the operators cost, and what does the same by hand: a few rounds, each with a line
-- for each. In a round all take turns, so that the machine's moods meet all alike. (A
-- tool that measures one thing after the other would give each a mood of its own.)
module Main (main) where

import Control.Concurrent (forkIO, killThread, newEmptyMVar, putMVar, runInUnboundThread, takeMVar, threadDelay, yield)
import Control.Concurrent.Async (Concurrently (..), concurrently_, mapConcurrently_, race, withAsync)
import Control.Concurrent.STM (TVar, newTVarIO, readTVar, writeTVar)
import qualified Control.Concurrent.STM as STM
import Control.Exception (throwIO, try)
import Control.Monad (forM_, replicateM, replicateM_, void, when)
import Data.Foldable (asum)
import Data.IORef (IORef, newIORef, readIORef, writeIORef)
import System.Environment (getArgs)
import System.Exit (die)
import System.Mem (performMajorGC)

import Behavior
import Behavior.Parallel (allOf, firstOf)
import qualified Behavior.Signal as Signal
import Behavior.Time (atomically)
import Measured

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      [] -> measureOperators
      ["fallback"] -> measureAll trying
      ["idle"] -> measureBareIdle >> mapM_ measureIdle [10, 100, 1000]
      _ -> die "usage: operators [fallback | idle]"

measureOperators :: IO ()
measureOperators = do
  nevers <- replicateM 1100 newEmptyMVar
  quiet <- newTVarIO False
  state <- newIORef 0
  -- Each waits for something of its own: after those who wait for the same, and are stopped,
  -- GHC may leave a queue that keeps them in memory.
  let waits = map takeMVar nevers
      blocked = head waits
      steps = [looks state n | n <- [1 .. 100000]]
  measureAll (pairs blocked ++ watched quiet blocked ++ many waits ++ long steps)
  -- In reach to the end, or they who wait for it would be told that it never comes.
  mapM_ (`putMVar` ()) nevers

-- | There and back: to come second makes a difference of a tenth to what is so short.
measureAll :: [Case] -> IO ()
measureAll cases = replicateM_ 2 (mapM_ measure (cases ++ reverse cases))

-- | Its name, how often to do it, and how to do it so many times.
data Case = Case String Int (Int -> Behavior ())

-- | What is done anew each time.
each :: String -> Int -> Behavior a -> Case
each name times act = Case name times (\n -> replicateM_ n (void act))

trying :: [Case]
trying =
  [ each "try that succeeds" 4000000 (bare succeeds)
  , each "? that succeeds" 4000000 (succeeds ? succeeds)
  , each "try that fails" 1000000 (bare fails)
  , each "? that fails" 1000000 (fails ? succeeds)
  ]

-- | What '?' is, by hand.
bare :: Behavior () -> Behavior ()
bare act =
  try act >>= \case
    Right () -> pure ()
    Left BehaviorFailed {} -> succeeds

-- The compiler must not see what they do.
succeeds, fails :: Behavior ()
succeeds = pure ()
{-# NOINLINE succeeds #-}
fails = throwIO Failed
{-# NOINLINE fails #-}

pairs :: Behavior () -> [Case]
pairs blocked =
  [ each "race, both end at once" 20000 (race succeeds succeeds)
  , each "parallel, both end at once" 20000 (parallel succeeds succeeds)
  , each "race, one to be stopped" 20000 (race succeeds blocked)
  , each "parallel, one to be stopped" 20000 (parallel succeeds blocked)
  , each "concurrently_, both end at once" 20000 (concurrently_ succeeds succeeds)
  , each "both, both end at once" 20000 (both succeeds succeeds)
  , each "concurrently_, one to be stopped" 20000 (bare (concurrently_ fails blocked))
  , each "both, one to be stopped" 20000 (bare (both fails blocked))
  ]

watched :: TVar Bool -> Behavior () -> [Case]
watched quiet blocked =
  [ each "monitor, undisturbed" 20000 (Signal.monitor (watch quiet) succeeds succeeds)
  , each "rSelect, undisturbed" 20000 (Signal.rSelect (watch quiet) succeeds succeeds)
  , each "monitor, polled" 5000 (monitor (pure False) succeeds succeeds)
  , Case "interruption, recovery and restart" 10000 (interruptions blocked)
  ]

-- | The task itself makes the condition true, so many times, and then completes.
interruptions :: Behavior () -> Int -> Behavior ()
interruptions blocked times = do
  low <- newTVarIO False
  left <- newIORef times
  Signal.monitor (watch low) (set low False) (unlessOver left (set low True >> blocked))

many :: [Behavior ()] -> [Case]
many waits =
  concat
    [ [ about n "firstOf" (\size -> firstOf (succeeds : take (size - 1) waits))
      , about n "firstOf, the last ends" (\size -> firstOf (take (size - 1) waits ++ [succeeds]))
      , about n "allOf" (\size -> void (allOf (replicate size succeeds)))
      , about n "bare threads, stopped" (stopping . (`take` waits))
      ]
    | n <- [2, 10, 100, 1000]
    ]
    ++ concat
      [ [ about n "asum of Concurrently" $ \size ->
            runConcurrently (asum (map Concurrently (succeeds : take (size - 1) waits)))
        , about n "mapConcurrently_" (\size -> mapConcurrently_ id (replicate size succeeds))
        , Case ("a look at variables " ++ show n) (100000 `div` n) (looksAt n)
        ]
      | n <- [10, 100, 1000]
      ]
    ++ [Case ("teleoReactive " ++ show n) (100000 `div` n) (changes (head waits) n) | n <- [10, 100, 1000]]

-- | So many, give or take a tenth: of just so many the collector might meet each at the same
-- moment of its life, the best or the worst.
about :: Int -> String -> (Int -> Behavior ()) -> Case
about n name act = Case (name ++ " " ++ show n) (21000 `div` n * 2) (\times -> mapM_ act (take times (cycle sizes)))
 where
  sizes = [n - n `div` 10, n - n `div` 10 + max 1 (n `div` 100) .. n + n `div` 10]

-- | What 'firstOf' cannot do without: threads that are started, wait, and are stopped.
stopping :: [Behavior ()] -> Behavior ()
stopping waits = do
  threads <- mapM forkIO waits
  yield
  mapM_ killThread threads
  yield

-- | So many changes of the first rule that holds: from the last rule to the one in the
-- middle, whose condition comes and goes, and back.
changes :: Behavior () -> Int -> Int -> Behavior ()
changes blocked rules times = do
  flags <- replicateM rules (newTVarIO False)
  left <- newIORef times
  let middle = flags !! (rules `div` 2 - 1)
      turning to = unlessOver left (set middle to >> blocked)
  Signal.teleoReactive $
    [(watch flag, turning False) | flag <- init flags] ++ [(pure True, turning True)]

-- | What a change takes several times, besides the stop and the start of a branch: all the
-- conditions seen at one moment.
looksAt :: Int -> Int -> Behavior ()
looksAt n times = do
  flags <- replicateM n (newTVarIO False)
  replicateM_ times (STM.atomically (mapM_ readTVar flags))

-- | Counts down, and completes at the end.
unlessOver :: IORef Int -> Behavior () -> Behavior ()
unlessOver left act = do
  n <- readIORef left
  when (n > 0) $ writeIORef left (n - 1) >> act

-- | A step of a long program.
long :: [Behavior ()] -> [Case]
long steps =
  [ Case "sequence, a step" (20 * length steps) (often (sequence_ steps))
  , Case "fallback, a step" (10 * length steps) (often (foldr (?) succeeds (fails <$ steps)))
  ]
 where
  often program n = replicateM_ (n `div` length steps) program

-- | An action that looks at the state of the robot, and is content.
looks :: IORef Int -> Int -> Behavior ()
looks state n = readIORef state >>= \seen -> when (seen > n) failed
{-# NOINLINE looks #-}

watch :: TVar Bool -> Signal.Signal Bool
watch = Signal.watching . readTVar

set :: TVar Bool -> Bool -> Behavior ()
set flag = atomically . writeTVar flag

-- | Nanoseconds, after a warm-up.
measure :: Case -> IO ()
measure (Case name times act) = do
  act (times `div` 10)
  performMajorGC
  begun <- time
  act times
  ended <- time
  line name ((ended - begun) / fromIntegral times)

-- | Ordered rules of which nothing changes.
measureIdle :: Int -> IO ()
measureIdle rules = do
  flags <- replicateM rules (newTVarIO False)
  idling ("teleoReactive idle cpu " ++ show rules) (Signal.teleoReactive [(watch flag, succeeds) | flag <- flags])
  -- In reach to the end.
  forM_ flags (`set` True)

-- | A thread that waits, and nothing else.
measureBareIdle :: IO ()
measureBareIdle = do
  flag <- newTVarIO False
  idling "bare thread idle cpu" (STM.atomically (readTVar flag >>= STM.check))
  set flag True

-- | Seconds of the processor's time in a second in which the behaviour waits.
idling :: String -> Behavior () -> IO ()
idling name behavior =
  withAsync behavior . const $ do
    -- For some time after anything has run, now and at the end, the runtime's clock ticks
    -- and it collects its garbage.
    threadDelay 500000
    before <- processorTime
    threadDelay 4000000
    after <- processorTime
    line name ((after - before) / 4e9)
