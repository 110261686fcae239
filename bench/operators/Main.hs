{-# LANGUAGE LambdaCase #-}

-- |
-- What the operators cost, and what the same costs by hand: a few rounds, each of which prints a
-- line for each case. In a round all cases run in turn, so that noise affects all of them
-- equally. (In a tool that measures each case in one go, it would affect single cases.)
module Main (main) where

import Control.Concurrent
  ( forkIO
  , killThread
  , newEmptyMVar
  , putMVar
  , readMVar
  , runInUnboundThread
  , takeMVar
  , threadDelay
  , yield
  )
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
import Behavior.Parallel (allOf, await, decide, firstOf, fork, scoped)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Trace (Sink (..), TraceOptions (..), defaultTraceOptions, named, withTrace, withTraceOptions)
import Measured

main :: IO ()
main =
  runInUnboundThread $
    getArgs >>= \case
      [] -> measureOperators
      ["fallback"] -> measureAll trying
      ["traces", setting] -> measureAll (tracing setting)
      ["idle"] -> measureBareIdle >> mapM_ measureIdle [10, 100, 1000]
      _ -> die "usage: operators [fallback | idle | traces SETTING]"

measureOperators :: IO ()
measureOperators = do
  nevers <- replicateM 1100 newEmptyMVar
  quiet <- newTVarIO False
  state <- newIORef 0
  -- Each waits for its own MVar: when threads that wait for the same MVar are stopped, GHC may
  -- leave a queue that keeps them in memory.
  let waits = map takeMVar nevers
      blocked = head waits
      steps = [checksState state n | n <- [1 .. 100000]]
  measureAll (pairs blocked ++ watched quiet blocked ++ many waits ++ long steps)
  -- Keeps the MVars alive until here: otherwise GHC would detect a deadlock.
  mapM_ (`putMVar` ()) nevers

-- | In both orders: for cases as short as these, being measured second makes a difference of a
-- tenth.
measureAll :: [Case] -> IO ()
measureAll cases = replicateM_ 2 (mapM_ measure (cases ++ reverse cases))

-- | Its name, how often to run it, and how to run it the given number of times.
data Case = Case String Int (Int -> Behavior ())

-- | Runs the action each time.
each :: String -> Int -> Behavior a -> Case
each name times act = Case name times (\n -> replicateM_ n (void act))

trying :: [Case]
trying =
  [ each "try that succeeds" 4000000 (bare succeeds)
  , each "? that succeeds" 4000000 (succeeds ? succeeds)
  , each "try that fails" 1000000 (bare fails)
  , each "? that fails" 1000000 (fails ? succeeds)
  ]

-- | The same as '?', by hand.
bare :: Behavior () -> Behavior ()
bare act =
  try act >>= \case
    Right () -> pure ()
    Left BehaviorFailed {} -> succeeds

-- Not inlined: the compiler must not know what they do.
succeeds, fails :: Behavior ()
succeeds = pure ()
{-# NOINLINE succeeds #-}
fails = throwIO Failed
{-# NOINLINE fails #-}

-- | What names and traces cost, with a sink that keeps up. The name of a setting (of the runtime) is
-- part of their names.
tracing :: String -> [Case]
tracing setting =
  [ each (setting ++ " no name") 4000000 succeeds
  , each (setting ++ " named") 4000000 (named "span" succeeds)
  , traced "named" 50000 (named "span" succeeds)
  , Case (setting ++ " traced named, the sink blocked") 50000 $ \n -> do
      gate <- newEmptyMVar
      withTraceOptions
        defaultTraceOptions {waitAtEnd = 0}
        [EachEvent (\_ -> takeMVar gate)]
        (replicateM_ n (named "span" succeeds))
      putMVar gate ()
  , Case (setting ++ " traced named, by two") 50000 $ \n ->
      inTrace (both (replicateM_ (n `div` 2) (named "span" succeeds)) (replicateM_ (n `div` 2) (named "span" succeeds)))
  , each (setting ++ " parallel") 10000 (parallel succeeds succeeds)
  , traced "parallel" 10000 (parallel succeeds succeeds)
  , each (setting ++ " monitor") 10000 (Signal.monitor (pure False) succeeds succeeds)
  , traced "monitor" 10000 (Signal.monitor (pure False) succeeds succeeds)
  ]
 where
  traced name times act = Case (setting ++ " traced " ++ name) times (\n -> inTrace (replicateM_ n act))
  inTrace = withTrace [EachEvent (\_ -> pure ())]

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
  [ each "monitor, uninterrupted" 20000 (Signal.monitor (watch quiet) succeeds succeeds)
  , each "rSelect, uninterrupted" 20000 (Signal.rSelect (watch quiet) succeeds succeeds)
  , each "monitor, polled" 5000 (monitor (pure False) succeeds succeeds)
  , Case "interruption, recovery and restart" 10000 (interruptions blocked)
  ]

-- | The task itself makes the condition true, the given number of times, and then completes.
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
      , about n "decide" (\size -> decide (\ends -> pure () <$ sequence ends) (replicate size succeeds))
      , about n "scoped, older children end" (olderEnd waits)
      , about n "scoped, children fork at once" forkAtOnce
      , about n "bare threads, stopped" (stopping . (`take` waits))
      ]
    | n <- [2, 10, 100, 1000]
    ]
    ++ concat
      [ [ about n "asum of Concurrently" $ \size ->
            runConcurrently (asum (map Concurrently (succeeds : take (size - 1) waits)))
        , about n "mapConcurrently_" (\size -> mapConcurrently_ id (replicate size succeeds))
        , Case ("transaction reading variables " ++ show n) (100000 `div` n) (readsAll n)
        ]
      | n <- [10, 100, 1000]
      ]
    ++ [Case ("teleoReactive " ++ show n) (100000 `div` n) (changes (head waits) n) | n <- [10, 100, 1000]]

-- | The given number of branches, more or less a tenth: with a fixed number the garbage
-- collections might come at the same moment of each run, the best or the worst one.
about :: Int -> String -> (Int -> Behavior ()) -> Case
about n name act = Case (name ++ " " ++ show n) (21000 `div` n * 2) (\times -> mapM_ act (take times (cycle sizes)))
 where
  sizes = [n - n `div` 10, n - n `div` 10 + max 1 (n `div` 100) .. n + n `div` 10]

-- | Half the given number of children end while as many newer ones wait; then as many are forked, one
-- after the other.
olderEnd :: [Behavior ()] -> Int -> Behavior ()
olderEnd waits size = scoped $ \nursery -> do
  begin <- newTVarIO False
  old <- replicateM half (fork nursery (atomically (readTVar begin >>= STM.check)))
  mapM_ (fork nursery) (take half waits)
  atomically (writeTVar begin True)
  mapM_ (atomically . await) old
  replicateM_ half (fork nursery succeeds >>= atomically . await)
 where
  half = size `div` 2

-- | The given number of children wait in 'fork' together.
forkAtOnce :: Int -> Behavior ()
forkAtOnce size = scoped $ \nursery -> do
  begin <- newEmptyMVar
  forking <- replicateM (size `div` 2) . fork nursery $ readMVar begin >> fork nursery succeeds >>= atomically . await
  putMVar begin ()
  mapM_ (atomically . await) forking

-- | The lower bound of 'firstOf': threads that are started, wait, and are stopped.
stopping :: [Behavior ()] -> Behavior ()
stopping waits = do
  threads <- mapM forkIO waits
  yield
  mapM_ killThread threads
  yield

-- | The given number of changes of the first rule that holds: from the last rule to the one in
-- the middle, whose condition becomes true and false, and back.
changes :: Behavior () -> Int -> Int -> Behavior ()
changes blocked rules times = do
  flags <- replicateM rules (newTVarIO False)
  left <- newIORef times
  let middle = flags !! (rules `div` 2 - 1)
      turning to = unlessOver left (set middle to >> blocked)
  Signal.teleoReactive $
    [(watch flag, turning False) | flag <- init flags] ++ [(pure True, turning True)]

-- | A change does this several times, besides the stop and the start of a branch: it reads all
-- the conditions in one transaction.
readsAll :: Int -> Int -> Behavior ()
readsAll n times = do
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

-- | An action that checks the state of the robot, and succeeds.
checksState :: IORef Int -> Int -> Behavior ()
checksState state n = readIORef state >>= \current -> when (current > n) failed
{-# NOINLINE checksState #-}

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

-- | Ordered rules of which no condition changes.
measureIdle :: Int -> IO ()
measureIdle rules = do
  flags <- replicateM rules (newTVarIO False)
  idling ("teleoReactive idle cpu " ++ show rules) (Signal.teleoReactive [(watch flag, succeeds) | flag <- flags])
  -- Keeps the variables alive until here.
  forM_ flags (`set` True)

-- | A thread that only waits.
measureBareIdle :: IO ()
measureBareIdle = do
  flag <- newTVarIO False
  idling "bare thread idle cpu" (STM.atomically (readTVar flag >>= STM.check))
  set flag True

-- | Processor seconds per second while the behaviour waits.
idling :: String -> Behavior () -> IO ()
idling name behavior =
  withAsync behavior . const $ do
    -- For some time after a thread has run, the runtime's timer ticks, and an idle garbage
    -- collection runs. That is so at the start and at the end.
    threadDelay 500000
    before <- processorTime
    threadDelay 4000000
    after <- processorTime
    line name ((after - before) / 4e9)
