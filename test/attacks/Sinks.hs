{-# LANGUAGE LambdaCase #-}

-- |
-- Sinks that block, throw or are slow, with small queues and two producers. Expected: what a sink has received
-- and what was reported as lost is what was produced, exactly; the events of each thread come in order;
-- the trace ends in time, and the behaviour has its own result.
module Sinks (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM, forM_, forever, replicateM_, unless, void, when)
import Data.IORef
import GHC.Clock (getMonotonicTime)
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)
import GHC.Stats (gc, gcdetails_live_bytes, getRTSStats)
import System.Exit (ExitCode (..))
import System.IO (Handle, hClose, hFlush, hGetContents, hPutStrLn, stdout)
import System.Mem (performMajorGC)
import System.Posix.IO (createPipe, dup, dupTo, fdToHandle)
import System.Posix.Process (exitImmediately)

import Attack
import Behavior
import Behavior.STM (atomically, newTVarIO, readTVar, writeTVar)
import qualified Behavior.Signal as Signal
import Behavior.Trace

attack :: IO ()
attack = do
  accounting
  throwing
  ending
  reentrant
  interrupted
  bounded
  fullPipe

-- | What the action reports of its sinks.
reportsOf :: IO a -> IO (a, [SinkProblem])
reportsOf act = do
  reports <- newIORef []
  before <- getUncaughtExceptionHandler
  setUncaughtExceptionHandler $ \e -> case fromException e of
    Just problem -> atomicModifyIORef' reports (\known -> (known ++ [problem], ()))
    Nothing -> before e
  a <- act `finally` setUncaughtExceptionHandler before
  (,) a <$> readIORef reports

-- | Queues of all sizes, sinks that block at some event or are slow: every event is accounted for.
accounting :: IO ()
accounting = do
  below <- randomBelow 99
  forM_ [1 .. 150 :: Int] $ \k -> do
    limit <- (\i -> [0, 1, 2, 7, 30, 1000] !! i) <$> below 6
    blockAt <- (\i n -> if i == 0 then maxBound else n) <$> below 3 <*> below 200
    slow <- (== 0) <$> below 4
    batches <- (== 0) <$> below 2
    rounds <- below 4
    burst <- below 100
    gate <- newEmptyMVar
    received <- newIORef []
    let one e = do
          n <- atomicModifyIORef' received (\es -> (e : es, length es + 1))
          when (n == blockAt) (readMVar gate)
          when slow (threadDelay 20)
        sink = if batches then Batches (mapM_ one) else EachEvent one
        producer name = replicateM_ (rounds + 1) $ do
          forM_ [1 .. burst] $ \i -> named (name ++ show i) (pure ())
          threadDelay 4000
        what = "sink " ++ show (k, limit, blockAt, slow, batches, rounds, burst)
    (_, reports) <- reportsOf . inThread 5000 what $
      withTraceOptions defaultTraceOptions {queueLimit = limit, waitAtEnd = 0.03} [sink] $
        both (named "a" (producer "a")) (named "b" (producer "b"))
    events <- reverse <$> readIORef received
    let produced = 2 * (2 * (rounds + 1) * burst + 2)
        lost = sum [n | Lost n <- events]
        -- (In a batch the events behind the one at which the sink blocks have been passed to it, too.)
        whole = length [() | e <- events, notLost e]
        left = sum [n | SinkLeft _ n <- reports]
        accounted = whole + lost + left
    promise
      (what ++ ": received " ++ show whole ++ ", lost " ++ show lost ++ " and " ++ show left ++ " of " ++ show produced)
      (if batches && not (null reports) then accounted <= produced else accounted == produced)
    forM_ ["a", "b"] $ \name -> do
      let timeIn = \case
            Began s | take 1 (spanName s) == name -> [spanBegan s]
            Ended s t _ | take 1 (spanName s) == name -> [t]
            _ -> []
          times = concatMap timeIn events
      promise (what ++ ": not in order") (and (zipWith (<=) times (drop 1 times)))
    putMVar gate ()
    noThreads what
    when (not batches && not (null reports)) $ do
      later <- length <$> readIORef received
      promise
        ( what ++ ": it received " ++ show later ++ " in the end, and " ++ show (length events)
            ++ " before it was left behind"
        )
        (later == length events)
 where
  notLost = \case Lost _ -> False; _ -> True

noThreads :: String -> IO ()
noThreads what = go (3000 :: Int)
 where
  go n = liveThreadCount >>= \left -> unless (left == 0) $ do
    when (n == 0) . void $ broken (what ++ ": " ++ show left ++ " threads were left")
    threadDelay 1000 >> go (n - 1)

-- | A sink that throws, whatever and whenever, is reported once, and receives nothing more; another one
-- receives everything.
throwing :: IO ()
throwing = forM_ exceptions $ \e -> forM_ [1, 2, 7, 42] $ \at -> do
  count <- newIORef (0 :: Int)
  good <- newIORef (0 :: Int)
  let bad _ = atomicModifyIORef' count (\n -> (n + 1, n + 1)) >>= \n -> when (n >= at) (throwIO e)
  (r, reports) <- reportsOf . withTrace [EachEvent bad, EachEvent (\_ -> modifyIORef' good (+ 1))] $ do
    replicateM_ 20 (named "x" (pure ()))
    "result" <$ named "end" (pure ())
  n <- readIORef count
  g <- readIORef good
  promise
    ("a sink that throws at " ++ show at ++ ": " ++ show (r, n, g, length reports))
    ((r, n, g, [() | SinkThrew _ <- reports]) == ("result", at, 42, [()]))
 where
  exceptions =
    [ toException (Boom 1)
    , toException ThreadKilled
    , toException (StoppedWithFault undefined undefined)
    , toException (ErrorCall undefined)
    , undefined
    ]

-- | A blocked sink delays the end of the trace by 'waitAtEnd', whatever state the caller is in.
ending :: IO ()
ending = forM_ each $ \(k, state, limit, cancelled) -> do
  gate <- newEmptyMVar
  let blocked = [EachEvent (\_ -> readMVar gate), Batches (\_ -> readMVar gate)]
      run = withTraceOptions defaultTraceOptions {waitAtEnd = limit} blocked $ do
        named "x" (pure ())
        if cancelled && k == 1 then forever (threadDelay 1000000) else threadDelay 20000
        getMonotonicTime
      -- The first time it is cancelled in the trace; then, where that can be, while the trace ends.
      storm t = when cancelled . void . forkIO $ threadDelay 10000 >> throwTo t ThreadKilled >> throwTo t ThreadKilled
  began <- getMonotonicTime
  (r, reports) <- reportsOf (endsWithin 2000 "the end of a trace" storm (state run))
  ended <- getMonotonicTime
  let took = either (const (ended - began)) (ended -) r
      what = "the end of a trace " ++ show (k, limit, cancelled)
  promise (what ++ ": took " ++ show took) (took < realToFrac limit + 0.2)
  promise (what ++ ": reports " ++ show reports) (length [() | SinkLeft _ _ <- reports] == 2)
  putMVar gate ()
  noThreads what
 where
  each =
    [ (k, state, limit, cancelled)
    | (k, state) <- zip [1 :: Int ..] [id, mask_, uninterruptibleMask_]
    , limit <- [0, 0.05]
    , cancelled <- [False, True]
    ]

-- | A sink that uses 'named' and a trace of its own: what it does is no part of the trace that it
-- receives, which would never end.
reentrant :: IO ()
reentrant = do
  count <- newIORef (0 :: Int)
  let sink = EachEvent $ \_ -> do
        modifyIORef' count (+ 1)
        _ <- named "in a sink" (both (named "in its branch" (pure ())) (pure ()))
        withTrace [EachEvent (\_ -> pure ())] (named "in a trace of the sink" (pure ()))
  (_, reports) <- reportsOf (withTrace [sink] (replicateM_ 10 (named "x" (threadDelay 5000))))
  n <- readIORef count
  promise ("a sink that uses names received " ++ show n ++ " of 20 events; " ++ show reports) (n == 20 && null reports)

-- | An operator is cancelled while it reports a reaction to four hundred sinks that wait to be woken. All of them
-- receive it or none does, and each is awake for what comes afterwards.
interrupted :: IO ()
interrupted = forM_ [1 .. 150 :: Int] $ \k -> do
  reacted <- newIORef (0 :: Int)
  marked <- newIORef (0 :: Int)
  let sink = EachEvent $ \case
        Reacted _ -> count reacted
        Began _ -> count marked
        _ -> pure ()
      count r = atomicModifyIORef' r (\n -> (n + 1, ()))
      spin end = getMonotonicTime >>= \t -> when (t < end) (yield >> spin end)
      awake n = readIORef marked >>= \m -> unless (m == sinks) $ do
        when (n == (0 :: Int)) . void . broken $
          "interrupted, " ++ show k ++ ": of " ++ show sinks ++ " sinks " ++ show (sinks - m) ++ " are not woken"
        threadDelay 1000 >> awake (n - 1)
  withTrace (replicate sinks sink) $ do
    flag <- newTVarIO False
    over <- newEmptyMVar
    here <- adopt
    let wait = here (Signal.waitUntil (Signal.watching (readTVar flag)))
    thread <- forkIO ((try wait :: IO (Either SomeException ())) >>= putMVar over)
    -- Until all of them sleep.
    threadDelay 15000
    began <- getMonotonicTime
    atomically (writeTVar flag True)
    spin (began + 2e-6 * fromIntegral (k * 37 `mod` 100))
    killThread thread >> void (takeMVar over)
    named "mark" (pure ())
    awake 1000
  n <- readIORef reacted
  promise
    ("interrupted, " ++ show k ++ ": " ++ show n ++ " of " ++ show sinks ++ " sinks received the reaction")
    (n `elem` [0, sinks])
 where
  sinks = 400

-- | Ten million events to a blocked sink and to one that receives them, and what is kept of them.
bounded :: IO ()
bounded = forM_ ["blocked", "receiving"] $ \state -> do
  gate <- newEmptyMVar
  unless (state == "blocked") (putMVar gate ())
  received <- newIORef (0 :: Int)
  let sink e = modifyIORef' received (+ (case e of Lost n -> n; _ -> 1)) >> readMVar gate
      what = "with a " ++ state ++ " sink"
      options = defaultTraceOptions {queueLimit = 1000, waitAtEnd = if state == "blocked" then 0 else 10}
  (sizes, reports) <- reportsOf . withTraceOptions options [EachEvent sink] $
    forM [1 .. 5 :: Int] $ \_ -> do
      replicateM_ 1000000 (named "x" (pure ()))
      performMajorGC >> gcdetails_live_bytes . gc <$> getRTSStats
  counted <- (+ sum [n | SinkLeft _ n <- reports]) <$> readIORef received
  promise (what ++ " there are these numbers of bytes: " ++ show sizes) (last sizes < head sizes + 100000)
  promise (what ++ " " ++ show counted ++ " of 10000000 events were counted") (counted == 10000000)
  when (state == "blocked") (putMVar gate ())
  noThreads ("bounded, " ++ what)

-- | A sink that prints to a pipe that is not read. The report that it is left behind must not wait
-- for it. (GHC's handler for uncaught exceptions flushes 'stdout', which the sink holds.)
fullPipe :: IO ()
fullPipe = do
  (from, to) <- createPipe
  hFlush stdout
  old <- dup 1
  _ <- dupTo to 1
  done <- newIORef False
  _ <- forkIO $ do
    threadDelay 3000000
    isDone <- readIORef done
    unless isDone $ do
      -- ('stdout' is the full pipe.)
      tell <- fdToHandle old :: IO Handle
      hPutStrLn tell "BROKEN  withTrace waits for a sink that prints into a full pipe" >> hClose tell
      void (exitImmediately (ExitFailure 1) :: IO ())
  handler <- getUncaughtExceptionHandler
  -- (As GHC's does, without the text.)
  setUncaughtExceptionHandler (\_ -> hFlush stdout)
  withTraceOptions defaultTraceOptions {waitAtEnd = 0.2} [EachEvent print] $
    replicateM_ 3000 (named "a name that takes some room in a pipe" (pure ()))
  writeIORef done True
  -- Somebody reads it after all.
  _ <- forkIO (fdToHandle from >>= hGetContents >>= void . evaluate . length)
  noThreads "a full pipe"
  hFlush stdout
  setUncaughtExceptionHandler handler
  void (dupTo old 1)
