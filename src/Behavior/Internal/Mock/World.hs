{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A mock world, and the record of what happens there.
--
-- To note something is no operation of the seam, but to ask for the time is. So what
-- is noted right after the time was asked for, and what is done right after that, is
-- one step of a simulation.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.World
  ( Mock
  , newMock
  , begin
  , note

    -- * For what is in the world
  , clock
  , recordEntry
  , registerName
  , registerPending

    -- * The record
  , happened
  , shouldRecord
  , BrokenClaim (..)
  ) where

import Control.Concurrent.STM (STM)
import Control.Exception (ErrorCall (..), Exception, mask_, throwIO)
import Control.Monad (join, void, when)
import Data.IORef
import Data.Maybe (fromMaybe, isNothing)

import Behavior.Internal.Failure (Behavior)
import Behavior.Internal.Mock.Claim (Claim, verdict)
import Behavior.Internal.Mock.Record
import Behavior.Internal.Runtime

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | A world in which nothing is real, and the record of what happens there. One world
-- is for one run.
--
-- @since 0.1.0.0
data Mock = Mock
  { origin :: IORef (Maybe Seconds)
  -- ^ When the world's clock was started.
  , elapsed :: IORef (IO Seconds)
  -- ^ How long it has gone in a simulation, until that ended; in reality this is zero.
  , names :: IORef [String]
  , newestEntries :: IORef [RecordEntry]
  -- ^ Newest first.
  , unseen :: IORef [Seconds -> STM [RecordEntry]]
  -- ^ The changes until then that were due, but that nobody has seen yet.
  }

-- | An empty world.
--
-- @since 0.1.0.0
newMock :: IO Mock
newMock = Mock <$> newIORef Nothing <*> newIORef (pure 0) <*> newIORef [] <*> newIORef [] <*> newIORef []

-- | Starts the clock of the world, if it does not go already. Otherwise it starts
-- when the first action begins, or a condition is looked at for the first time.
--
-- >>> begin mock
--
-- @since 0.1.0.0
begin :: Mock -> Behavior ()
begin = void . clock

-- | When the world's clock was started, and what time it is. A scheduling point, and
-- the only operation of the seam in here that is done just to note something.
clock :: Mock -> IO (Seconds, Seconds)
clock mock = do
  t <- now
  (zero, isFirst) <- atomicModifyIORef' (origin mock) $ \started ->
    let zero = fromMaybe t started in (Just zero, (zero, isNothing started))
  when isFirst $ runClock >>= mapM_ (writeIORef (elapsed mock) . fmap (subtract zero))
  pure (zero, t)

-- | Notes, which nothing can block or interrupt where exceptions are masked. When the run
-- has ended, the record has.
recordEntry :: Mock -> RecordEntry -> IO ()
recordEntry mock entry = do
  goesOn <- isRecorded
  when goesOn $ do
    atomicModifyIORef' (newestEntries mock) (\old -> (entry : old, ()))
    annotate (show entry)

-- | Puts a note of your own on record.
--
-- >>> note mock "a sheep crosses the road"
-- >>> mock `shouldRecord` eventually (noted "a sheep crosses the road")
--
-- @since 0.1.0.0
note :: Mock -> String -> Behavior ()
note mock text = do
  (zero, t) <- clock mock
  mask_ $ recordEntry mock (RecordEntry (t - zero) text "" 1 Noted)

-- | Gives a thing of the world its name, which must not be another one's.
registerName :: Mock -> String -> String -> IO ()
registerName mock kind name = do
  taken <- atomicModifyIORef' (names mock) $ \old ->
    if name `elem` old then (old, True) else (name : old, False)
  when taken . throwIO . ErrorCall $
    kind ++ " " ++ show name ++ ": something else in this world has this name already"

-- | Has changes put on record (of those that were due by a given time) that nobody
-- has seen.
registerPending :: Mock -> (Seconds -> STM [RecordEntry]) -> IO ()
registerPending mock due = atomicModifyIORef' (unseen mock) (\old -> (due : old, ()))

-- | All that has happened until now. A change of a condition is on record once
-- something later is, or a simulated run has come to its time, whether or not anybody has
-- seen it. The record ends when the run does: what is unwound after that is not on it.
--
-- >>> wave <- action mock "wave" [succeeds]
-- >>> wave
-- >>> map happening . entries <$> happened mock
-- [Begins,Succeeds]
--
-- @since 0.1.0.0
happened :: Mock -> IO Record
happened mock = do
  seen <- readIORef (newestEntries mock)
  conditions <- readIORef (unseen mock)
  came <- join (readIORef (elapsed mock))
  due <- atomically (traverse ($ maximum (came : map entryTime seen)) conditions)
  known <- readIORef (names mock)
  pure (recorded (reverse known) (reverse (join due) ++ seen))

-- | Throws a 'BrokenClaim', which says why, unless the claim holds of what has
-- happened. To be used as hspec's expectations are.
--
-- >>> mock `shouldRecord` eventually (noted "all is well")
-- *** Exception: This does not hold: eventually "all is well" is noted.
-- It never came.
-- <BLANKLINE>
--
-- @since 0.1.0.0
shouldRecord :: Mock -> Claim -> IO ()
shouldRecord mock claim = happened mock >>= either (throwIO . BrokenClaim) pure . verdict claim

infix 1 `shouldRecord`

-- | A claim that does not hold, and why; it is shown to be read.
--
-- @since 0.1.0.0
newtype BrokenClaim = BrokenClaim String

instance Show BrokenClaim where
  show (BrokenClaim why) = why

instance Exception BrokenClaim
