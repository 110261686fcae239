{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Where a thread is in the tree of spans.
--
-- Each thread that is in a trace has a cell, which it alone writes, and which is found by the
-- thread's number. A thread that this library starts begins in the place of the thread that starts it.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Spans.Place
  ( -- * Places
    Place (..)
  , Around (..)
  , Open (..)
  , placeIn
  , inPath
  , myPlace
  , placeOf
  , inPlace

    -- * Traces
  , Trace (..)
  , Receiver (..)
  , newTrace
  , withReceiver
  , isTraced
  , withLiveTrace
  , newestTrace
  ) where

import Control.Concurrent (MVar, ThreadId, myThreadId, newMVar)
import Control.Exception (SomeException, bracket_, throwIO, try)
import Data.Bits ((.&.))
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef, writeIORef)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (intercalate)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Unique (Unique, newUnique)
import GHC.Arr (Array, listArray, unsafeAt)
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Core.Counter (add, total, traces)
import Behavior.Internal.Core.SafeText (safeShow)
import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Core.ThreadNumber (threadNumber)
import Behavior.Internal.Spans.Event

-- | Where a thread is in the tree of spans.
data Place = Place
  { trace :: !Trace
  , around :: [Around]
  -- ^ The spans and branches around it, the innermost first.
  , path :: [String]
  -- ^ The names of the spans around it, the innermost first.
  , abandonable :: [IORef (Maybe (IntMap Open))]
  -- ^ For each branch around it that may be abandoned: the spans that are open in that branch, whose end is still to be
  -- reported; nothing once it has been abandoned.
  }

-- | What is around a place. A receiver that needs no operators and branches does not see their spans.
data Around
  = -- | In the span with this number.
    InSpan !SpanKind !Int
  | -- | In the branch that the reaction with this number started.
    InBranchOf !Int
  | -- | In what is unknown.
    InUnknown

-- | A span that has begun.
data Open = Open
  { openNumber :: !Int
  , openKind :: !SpanKind
  , openName :: String
  , openSince :: !Seconds
  , openAt :: !Place
  -- ^ Where it began.
  }

-- | A trace while it is made. A trace inside another one uses the numbers of the outer one,
-- and its events have the receivers of both.
data Trace = Trace
  { lastNumber :: !(IORef Int)
  -- ^ The number of the span or reaction that came last.
  , traceClock :: IO Seconds
  -- ^ (In a simulation, to read it is not a scheduling point.)
  , recordsDetail :: !Bool
  -- ^ Whether a receiver needs operators and branches.
  , receivers :: [Receiver]
  , abandonLock :: !(MVar ())
  -- ^ For what is reported of branches that may be abandoned. It is taken only for a moment.
  }

-- | What receives the events of a trace. It must neither block nor throw.
data Receiver = Receiver
  { firstNumber :: !Int
  -- ^ Spans and reactions with a smaller number are outside of its trace.
  , needsDetail :: !Bool
  , receiveEvent :: Event -> IO ()
  }

-- | A trace on this clock, which has no receiver yet.
newTrace :: IO Seconds -> IO Trace
newTrace time = (\n -> Trace n time False []) <$> newIORef 0 <*> newMVar ()

-- | The trace with one more receiver.
withReceiver :: Receiver -> Trace -> Trace
withReceiver receiver t =
  t {receivers = receiver : receivers t, recordsDetail = needsDetail receiver || recordsDetail t}

-- | The place in these spans of a trace, in which no name is known.
placeIn :: [Around] -> Trace -> Place
placeIn spans t = Place {trace = t, around = spans, path = [], abandonable = []}

-- | The names of the spans around a place, the innermost first, in parentheses, for a thread's label. (Users'
-- code computes the names: they may be infinite, or throw.)
inPath :: [String] -> String
inPath [] = ""
inPath names = " (" ++ intercalate " > " (map (take 100 . safeShow) (reverse names)) ++ ")"

-- | Whether there is a trace in this process. Without one this costs one read of a counter.
isTraced :: IO Bool
isTraced = (> 0) <$> total traces
{-# INLINE isTraced #-}

-- | The place of the calling thread; nothing if it is in no trace.
myPlace :: IO (Maybe Place)
myPlace = isTraced >>= \traced -> if traced then myThreadId >>= placeOf else pure Nothing
{-# INLINE myPlace #-}

-- | The place of another thread.
placeOf :: ThreadId -> IO (Maybe Place)
placeOf thread = cellOf thread >>= maybe (pure Nothing) readIORef

-- | Runs the action in that place. Call it masked, and unmask the action.
inPlace :: Maybe Place -> IO a -> IO a
inPlace place act =
  myThreadId
    >>= cellOf
    >>= maybe inNewCell (\cell -> readIORef cell >>= \before -> inCell cell (writeIORef cell before))
 where
  inCell cell leave = do
    writeIORef cell place
    end <- try act
    () <- leave
    either throwSome pure end
  throwSome e = throwIO (e :: SomeException)
  inNewCell = do
    n <- threadNumber <$> myThreadId
    cell <- newIORef place
    atomicModifyIORef' (shard n) (\known -> (IntMap.insert n cell known, ()))
    inCell cell (atomicModifyIORef' (shard n) (\known -> (IntMap.delete n known, ())))

-- | The cell of a thread, if it has one.
cellOf :: ThreadId -> IO (Maybe (IORef (Maybe Place)))
cellOf thread = IntMap.lookup n <$> readIORef (shard n)
 where
  n = threadNumber thread

-- | The map of the cells of some threads, this one's among them.
shard :: Int -> IORef (IntMap (IORef (Maybe Place)))
shard n = unsafeAt shards (n .&. (shardCount - 1))

-- | Several maps, so that threads rarely change the same one at the same time.
shards :: Array Int (IORef (IntMap (IORef (Maybe Place))))
shards = unsafePerformIO (listArray (0, shardCount - 1) <$> mapM (const (newIORef IntMap.empty)) [1 .. shardCount])
{-# NOINLINE shards #-}

-- | A power of two.
shardCount :: Int
shardCount = 64

-- | The traces that are being made, the newest last. (Those of simulations are not among them.)
liveTraces :: IORef (Map Unique Trace)
liveTraces = unsafePerformIO (newIORef Map.empty)
{-# NOINLINE liveTraces #-}

-- | The trace that began last, of those that are being made.
newestTrace :: IO (Maybe Trace)
newestTrace = fmap snd . Map.lookupMax <$> readIORef liveTraces

-- | While the action runs, the trace is being made.
withLiveTrace :: Trace -> IO a -> IO a
withLiveTrace t act = do
  this <- newUnique
  bracket_
    (change (Map.insert this t) >> add traces 1)
    (add traces (-1) >> change (Map.delete this))
    act
 where
  change f = atomicModifyIORef' liveTraces (\known -> (f known, ()))
