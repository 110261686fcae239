-- |
-- Sinks: what they receive, and that they cost the behaviour nothing when they block or throw.
module Trace.SinkSpec (spec) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.MVar
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (replicateM_, void, when)
import Data.Foldable (for_)
import Data.IORef
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)
import System.IO.Unsafe (unsafePerformIO)
import Test.Hspec

import Behavior
import Behavior.Internal.Seam.Runtime (liveThreadCount)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Run (..), defaultSimOptions, explain, outcome, simulateWith)
import qualified Behavior.Sim as Sim
import Behavior.Trace
import Support hiding (End, Ending (..), Failure, ThreadEvent (..))

spec :: Spec
spec = guarded $ do
  describe "A sink" receiving
  describe "A sink that blocks" blocking
  describe "A sink that throws" throwingSinks
  describe "In a simulation, a sink" simulated

receiving :: Spec
receiving = do
  it "receives all events, in order, before withTrace returns" $ do
    seen <- newIORef []
    withTraceOptions patient [EachEvent (\e -> modifyIORef' seen (e :))] (spans 10000)
    received <- reverse <$> readIORef seen
    [spanNumber s | Began s <- received] `shouldBe` [1 .. 10000]
    [spanNumber s | Ended s _ _ <- received] `shouldBe` [1 .. 10000]

  it "receives them also if the behaviour throws" $ do
    seen <- newIORef []
    (withTraceOptions patient [Batches (\batch -> modifyIORef' seen (++ batch))] (named "a" failed) :: IO ())
      `shouldThrow` (== Failed)
    map isEnd <$> readIORef seen `shouldReturn` [False, True]

  it "receives texts that were evaluated, and cut if they are long; what they throw is named" $ do
    seen <- newIORef []
    withTraceOptions patient [EachEvent (\e -> modifyIORef' seen (e :))] $ do
      named (cycle "long ") (pure ())
      named (throw (Fault "no name")) (pure ())
      named ("of a type that is asynchronous: " ++ throw ThreadKilled) (pure ())
      named (throw StackOverflow) (pure ())
    names <- reverse <$> readIORef seen
    let found = [spanName s | Began s <- names]
    map (take 5) (take 1 found) `shouldBe` ["long "]
    map length (take 1 found) `shouldSatisfy` all (< 20000)
    map (reverse . take 4 . reverse) (take 1 found) `shouldBe` [" ..."]
    drop 1 found
      `shouldBe` [ "<its text throws an exception>"
                 , "of a type that is asynchronous: <its text throws an exception>"
                 , "<its text throws an exception>"
                 ]

  it "can be cancelled: what is thrown to it while it evaluates a text, is not taken for what the text throws" $ do
    thread <- newEmptyMVar
    entered <- newEmptyMVar
    mayGo <- newEmptyMVar
    let slow = unsafePerformIO (putMVar entered () >> readMVar mayGo)
    seen <- newIORef []
    reporting $ \reports -> do
      let receive e = modifyIORef' seen (e :) >> void (myThreadId >>= tryPutMVar thread)
      withTraceOptions patient [EachEvent receive] $ do
        named "first" (pure ())
        sink <- readMVar thread
        named slow (takeMVar entered >> throwing sink (Cancel "the sink"))
        putMVar mayGo "slow"
      told <- reports
      [show thrown | SinkThrew thrown <- told] `shouldBe` [show (Cancel "the sink")]
    names <- readIORef seen
    [spanName s | Began s <- names] `shouldBe` ["first"]

  it "receives a reaction, whatever the names of its signals and the texts of their values are" $
    for_
      [ (throw (Fault "no text"), "<its text")
      , ('a' : throw (Fault "no text"), "a<its text")
      , (throw ThreadKilled, "<its text")
      , (cycle "ab", "abab")
      ]
      $ \(text, expected) -> do
        seen <- newIORef []
        held <- newTVarIO True
        let finger = Signal.namedWith text (const text) (Signal.watching (readTVar held))
            letGo = (\left right -> not (left && right)) <$> finger <*> finger
        withTraceOptions patient [EachEvent (\e -> modifyIORef' seen (e :))] $
          Signal.insteadWhen letGo (pure ()) (atomically (writeTVar held False) >> hang)
        found <- readIORef seen
        [map (take (length expected)) [changeSignal c, changeAfter c] | Reacted r <- found, c <- reactionChanges r]
          `shouldBe` [[expected, expected]]

  it "receives the number of those that it lost, in their place: accepted and lost are all" $ do
    (received, lost) <- counting
    mayGo <- newEmptyMVar
    isFirst <- newIORef True
    let sink e = do
          begins <- readIORef isFirst
          when begins (takeMVar mayGo >> writeIORef isFirst False)
          count received lost e
    withTraceOptions patient {queueLimit = 10} [EachEvent sink] (spans 1000 >> putMVar mayGo ())
    (+) <$> readIORef received <*> readIORef lost `shouldReturn` 2000
    readIORef lost >>= (`shouldSatisfy` (> 0))

blocking :: Spec
blocking = do
  it "does not keep the behaviour from ending; what it has not received is reported" $
    reporting $ \reports -> do
      (received, lost) <- counting
      never <- newEmptyMVar
      let sink e = count received lost e >> readIORef received >>= \n -> when (n == 100) (takeMVar never)
      withTraceOptions defaultTraceOptions {waitAtEnd = 0.01, queueLimit = 1000} [EachEvent sink] (spans 5000)
      n <- readIORef received
      told <- reports
      [(limit, n + left) | SinkLeft limit left <- told] `shouldBe` [(0.01, 10000)]
      putMVar never ()
      eventually ((== 0) <$> liveThreadCount)
      -- Nothing of what was lost is passed to it later.
      readIORef received `shouldReturn` n

  it "is counted among the threads that live until it ends" $
    reporting $ \_ -> do
      never <- newEmptyMVar
      entered <- newEmptyMVar
      let sink _ = putMVar entered () >> takeMVar never
      withTraceOptions defaultTraceOptions {waitAtEnd = 0} [EachEvent sink] (spans 1 >> takeMVar entered)
      liveThreadCount `shouldReturn` 1
      putMVar never ()
      eventually ((== 0) <$> liveThreadCount)

throwingSinks :: Spec
throwingSinks = do
  for_ [("an exception", toException (Fault "disk")), ("an asynchronous exception", toException ThreadKilled)] $
    \(what, e) ->
      it ("receives nothing more, is reported once, and does not disturb the others: " ++ what) $
        reporting $ \reports -> do
          (received, lost) <- counting
          tried <- newIORef (0 :: Int)
          withTraceOptions
            patient
            [EachEvent (\_ -> modifyIORef' tried (+ 1) >> throwIO e), EachEvent (count received lost)]
            (spans 1000)
          readIORef received `shouldReturn` 2000
          readIORef tried `shouldReturn` 1
          told <- reports
          [show thrown | SinkThrew thrown <- told] `shouldBe` [show e]
          map show told `shouldBe` ["withTrace: a sink threw an exception, and receives nothing more: " ++ show e]

simulated :: Spec
simulated = do
  it "receives events with virtual times" $ do
    seen <- newIORef []
    let traced = withTraceOptions patient [EachEvent (\e -> modifyIORef' seen (e :))] (named "sleep" (sleep 3600))
    _ <- simulateWith defaultSimOptions traced
    times <- readIORef seen
    [(spanBegan s, t) | Ended s t _ <- times] `shouldBe` [(0, 3600)]

  it "changes neither the schedule nor the end, also if it blocks or throws" $
    reporting $ \_ ->
      for_ [1 .. 100] $ \seed -> do
        never <- newEmptyMVar
        let mission traced =
              traced $
                named "a" (both (named "b" (sleep 1 >> sleep 1)) (named "c" (sleep 1.5)))
                  >> (named "d" failed ? sleep 1)
            run traced = simulateWith defaultSimOptions {Sim.scheduled = Sim.Seeded seed} (mission traced)
            summary r = (explain (outcome r), finished r, runPoints r, runSchedule r)
            sinks =
              [EachEvent (\_ -> throwIO (Fault "sink")), EachEvent (\_ -> pure ())]
                ++ [EachEvent (\_ -> takeMVar never) | seed == 7]
        plain <- run id
        traced <- run (withTraceOptions defaultTraceOptions {waitAtEnd = 0.1} sinks)
        summary traced `shouldBe` summary plain
        events traced `shouldBe` events plain

-- | A thousand spans one after the other, say.
spans :: Int -> Behavior ()
spans n = replicateM_ n (named "span" (pure ()))

patient :: TraceOptions
patient = defaultTraceOptions {waitAtEnd = 1 / 0}

isEnd :: Event -> Bool
isEnd Ended {} = True
isEnd _ = False

-- | How many events were received, and how many were lost.
counting :: IO (IORef Int, IORef Int)
counting = (,) <$> newIORef 0 <*> newIORef 0

count :: IORef Int -> IORef Int -> Event -> IO ()
count _ lost (Lost n) = modifyIORef' lost (+ n)
count received _ _ = modifyIORef' received (+ 1)

-- | Runs the test with an action that gives what has been reported of sinks.
reporting :: (IO [SinkProblem] -> IO a) -> IO a
reporting test = do
  told <- newIORef []
  let tell e = for_ (fromException e) (\problem -> modifyIORef' told (problem :))
  bracket
    (getUncaughtExceptionHandler <* setUncaughtExceptionHandler tell)
    setUncaughtExceptionHandler
    (\_ -> test (reverse <$> readIORef told))
