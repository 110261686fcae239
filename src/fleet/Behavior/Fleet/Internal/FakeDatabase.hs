{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- A database for tests: of a fleet's functions, and of how a real one answers late, twice or never.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.FakeDatabase
  ( FakeDatabase
  , newFakeDatabase
  , fakeDatabase
  , Answer (..)
  , willAnswer
  , setClock
  , fakeDatabaseBy
  , cutOff
  , loseConnections
  , setReachable
  , losingNotices
  , copyDatabase
  , restoreDatabase
  , runNewEpoch
  , tasksThere
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), Exception, finally, throwIO)
import Control.Monad (unless, when)
import Data.Foldable (for_, traverse_)
import qualified Data.Text as Text
import Data.UUID.Types (UUID)
import qualified Data.UUID.Types as UUID

import Behavior (Behavior, Seconds, (?))
import Behavior.Fleet.Internal.Commit
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Fleet.Internal.Model
import Behavior.Fleet.Internal.Model.Tables (emptyModel)
import Behavior.STM (atomically)
import Behavior.Time (now, timeout)

-- | A database that is a variable.
--
-- @since 0.1.0.0
data FakeDatabase = FakeDatabase
  { model :: TVar Model
  , clockOf :: TVar (Seconds -> Seconds)
  , answers :: TVar [Answer]
  , isReachable :: TVar Bool
  , losesNotices :: TVar Bool
  , clients :: TVar [Client]
  , unique :: TVar Int
  }

-- | A connection, as the database sees it.
data Client = Client
  { isLost :: TVar Bool
  , notices :: TQueue Notice
  }

-- | How a statement is answered.
--
-- @since 0.1.0.0
data Answer
  = -- | After that time; half of it has passed when it is done.
    After Seconds
  | -- | It is done, and the connection is lost before the answer.
    DoneAndLost
  | -- | It is not done, and the connection is lost.
    LostBefore
  | -- | It is never done, and there is no answer.
    NoAnswer
  | -- | It is done, and there is no answer.
    DoneWithoutAnswer
  | -- | It is not done: a lock was not free in time.
    LockNotFree
  deriving (Eq, Show)

-- | An empty database, whose clock is that of the run.
--
-- @since 0.1.0.0
newFakeDatabase :: IO FakeDatabase
newFakeDatabase =
  FakeDatabase
    <$> newTVarIO emptyModel <*> newTVarIO id <*> newTVarIO [] <*> newTVarIO True <*> newTVarIO False <*> newTVarIO []
    <*> newTVarIO 0

-- | The next statements are answered so, and those after them at once.
--
-- @since 0.1.0.0
willAnswer :: FakeDatabase -> [Answer] -> STM ()
willAnswer = writeTVar . answers

-- | The database's clock, of the run's time. (It may jump.)
--
-- @since 0.1.0.0
setClock :: FakeDatabase -> (Seconds -> Seconds) -> STM ()
setClock = writeTVar . clockOf

-- | All connections are lost, now.
--
-- @since 0.1.0.0
loseConnections :: FakeDatabase -> STM ()
loseConnections fake = readTVar (clients fake) >>= traverse_ (\it -> writeTVar (isLost it) True)

-- | Whether it can be reached. (If not, connections are lost.)
--
-- @since 0.1.0.0
setReachable :: FakeDatabase -> Bool -> STM ()
setReachable fake reachable = writeTVar (isReachable fake) reachable >> unless reachable (loseConnections fake)

-- | Whether no notice comes.
--
-- @since 0.1.0.0
losingNotices :: FakeDatabase -> Bool -> STM ()
losingNotices = writeTVar . losesNotices

-- | A copy, as a backup is one.
--
-- @since 0.1.0.0
copyDatabase :: FakeDatabase -> STM Model
copyDatabase = readTVar . model

-- | Restores it from a copy. (All connections are lost.)
--
-- @since 0.1.0.0
restoreDatabase :: FakeDatabase -> Model -> STM ()
restoreDatabase fake copy = writeTVar (model fake) copy >> loseConnections fake

-- | What @behavior-fleet new-epoch@ does.
--
-- @since 0.1.0.0
runNewEpoch :: FakeDatabase -> Behavior ()
runNewEpoch fake = do
  time <- now
  atomically (readTVar (clockOf fake) >>= \clock -> modifyTVar' (model fake) (newEpoch (clock time)))

-- | The tasks that are there: queue, key, and what is known of them.
--
-- @since 0.1.0.0
tasksThere :: FakeDatabase -> STM [(String, String, Task)]
tasksThere fake = map named . allTasks <$> readTVar (model fake)
 where
  named (name, key, task) = (Text.unpack name, Text.unpack key, task)

-- | The way to it.
--
-- @since 0.1.0.0
fakeDatabase :: FakeDatabase -> Database
fakeDatabase = fakeDatabaseBy id

-- | The same for a process whose own clock is another function of the run's time.
--
-- @since 0.1.0.0
fakeDatabaseBy :: (Seconds -> Seconds) -> FakeDatabase -> Database
fakeDatabaseBy clock fake =
  Database
    { databaseName = "the fake database"
    , newUnique = atomically (numbered <$> stateTVar (unique fake) (\n -> (n, n + 1)))
    , ownClock = clock <$> now
    , opening = \_ use -> do
        it <- atomically $ do
          reachable <- readTVar (isReachable fake)
          unless reachable (throwSTM (ConnectionLost "connection refused"))
          it <- Client <$> newTVar False <*> newTQueue
          it <$ modifyTVar' (clients fake) (it :)
        use (sessionOf fake it)
          `finally` atomically (modifyTVar' (clients fake) (filter ((/= isLost it) . isLost)))
    }

-- | The database, for a process that is killed when this becomes true: nothing that its cleanups say reaches it any
-- more. (In a simulation no process dies: stop its behaviour at that time, too.)
--
-- > isDead <- newTVarIO False
-- > firstOf [withFleet (cutOff isDead (fakeDatabase db)) amy mission, sleep 3 >> atomically (writeTVar isDead True)]
--
-- @since 0.1.0.0
cutOff :: TVar Bool -> Database -> Database
cutOff isDead it = it {opening = \limit use -> opening it limit (use . cutting)}
 where
  cutting session =
    session
      { ask = \request -> alive >> ask session request
      , commit = \task lease json wanted -> alive >> commit session task lease json wanted
      }
  alive = atomically (readTVar isDead) >>= \is -> when is (throwIO (ConnectionLost "the process is dead"))

numbered :: Int -> UUID
numbered n = UUID.fromWords 0 0 0 (fromIntegral n)

sessionOf :: FakeDatabase -> Client -> Session
sessionOf fake it =
  Session
    { ask = \request -> answered fake it (\time -> performing fake time request)
    , commit = \task lease json wanted -> case wanted of
        WritesNothing o -> answered fake it (completing task lease json (pure o))
        Writes _ (Just there) -> answered fake it (completing task lease json there)
        Writes _ Nothing -> throwIO (ErrorCall notInstead)
    , listen = pure ()
    , awaitNews = atomically (unlessLost it (isEmptyTQueue (notices it) >>= check . not))
    , takeNews = atomically (unlessLost it (flushTQueue (notices it)))
    }
 where
  notInstead = "writing: a fake database needs to know what is done instead: see 'instead'"
  -- (What was written is rolled back, if it is refused.)
  completing task lease json act time = (Right <$> written) `catchSTM` \(RolledBack refusal) -> pure (Left refusal)
   where
    written = do
      o <- act
      performing fake time (Complete [(task, lease, json o)]) >>= \case
        Left refusal -> throwSTM (RolledBack refusal)
        Right [] -> throwSTM (RolledBack LeaseGone)
        Right _ -> pure o

newtype RolledBack = RolledBack Refusal
  deriving (Show)

instance Exception RolledBack

performing :: FakeDatabase -> Seconds -> Request r -> STM (Either Refusal r)
performing fake time request = do
  clock <- readTVar (clockOf fake)
  (gave, after, news) <- perform (clock time) request <$> readTVar (model fake)
  writeTVar (model fake) after
  quiet <- readTVar (losesNotices fake)
  unless quiet $ readTVar (clients fake) >>= traverse_ (for_ news . writeTQueue . notices)
  pure gave

answered :: FakeDatabase -> Client -> (Seconds -> STM (Either Refusal a)) -> Behavior (Either Refusal a)
answered fake it act = do
  how <- atomically (stateTVar (answers fake) (\case [] -> (After 0, []); first : others -> (first, others)))
  case how of
    After seconds -> sleepSome (seconds / 2) >> done <* sleepSome (seconds / 2) <* atomically (unlessLost it (pure ()))
    DoneAndLost -> done >> atomically (writeTVar (isLost it) True) >> lost
    LostBefore -> atomically (writeTVar (isLost it) True) >> lost
    NoAnswer -> lost
    DoneWithoutAnswer -> done >> lost
    LockNotFree -> pure (Left Busy)
 where
  done = now >>= \time -> atomically (unlessLost it (act time))
  -- (A connection that is lost meanwhile is noticed at once.)
  sleepSome seconds = when (seconds > 0) (timeout seconds lost ? pure ())
  lost :: Behavior a
  lost = atomically (unlessLost it retry)

unlessLost :: Client -> STM a -> STM a
unlessLost it act = readTVar (isLost it) >>= \is -> if is then throwSTM (ConnectionLost "connection lost") else act
