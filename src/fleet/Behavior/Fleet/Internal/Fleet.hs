{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- What the robots of a process share: two connections, the leases that they have, and what was noticed.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Fleet
  ( -- * A fleet
    Fleet (..)
  , Robot (..)
  , fleetRobot
  , newFleet
  , databaseUp

    -- * Asking the database
  , request
  , requestPatiently
  , requestTimed
  , refusedAs
  , whyBusy
  , seen
  , posted
  , report

    -- * What waits
  , Group (..)
  , Seeker (..)
  , Completion (..)

    -- * Notices
  , noticed
  , withNotices
  , orAfter
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (SomeException, bracket, throwIO, toException, try)
import Control.Monad (unless, void)
import Data.Aeson (Value)
import Data.Bifunctor (first, second)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Set (Set)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text
import Data.UUID.Types (UUID)

import Behavior (Behavior, Seconds, sleep, tryAny, (?))
import Behavior.Fleet.Internal.Check (whyNot)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Lease
import Behavior.Fleet.Internal.Line
import Behavior.Fleet.Internal.Options
import Behavior.Parallel (firstOf)
import Behavior.STM (atomically)
import Behavior.Signal (Signal, named, watching)
import Behavior.Time (cleanupWithin, timeout)

-- | A robot: its name, and what it is capable of.
--
-- @since 0.1.0.0
data Robot = Robot
  { robotName :: String
  -- ^ Of its own, of 1 to 200 characters: no two robots of a fleet have the same.
  , robotSkills :: [String]
  -- ^ Each of 1 to 50 characters.
  }
  deriving (Eq, Show)

-- | A robot in its fleet ('Behavior.Fleet.withFleet').
--
-- @since 0.1.0.0
data Fleet = Fleet
  { robot :: Robot
  , database :: Database
  , options :: FleetOptions
  , processId :: UUID
  , working :: Line
  -- ^ The connection for tasks, and for what they write.
  , listening :: Line
  -- ^ The connection that listens, polls, renews leases, and holds resources: nothing that takes long is in its way.
  , greatest :: TVar Number
  -- ^ The greatest number that was seen.
  , leases :: Leases
  , robots :: TVar (Map Text Int)
  -- ^ The robots of this process, and how often each of them is here.
  , groups :: TVar (Map (Text, Set Text) Group)
  , lastGroup :: TVar (Text, Set Text)
  -- ^ For which tasks were started last.
  , completions :: TVar [Completion]
  -- ^ The latest first.
  , changes :: TVar (Map Notice (Int, Int))
  -- ^ How many wait for each of these notices, and how often it has come.
  , missed :: TVar Int
  -- ^ How often notices may have been missed.
  , pollNow :: TVar Bool
  , reports :: TBQueue String
  }

-- | Those that wait for tasks of one queue, with the same skills.
data Group = Group
  { idle :: TVar [Seeker]
  -- ^ The latest first.
  , mayHave :: TVar Bool
  -- ^ Whether there may be a task for them.
  }

-- | A robot that waits for a task: a start (and when it was asked for, by the process's own clock), or what is wrong.
-- It is Nothing when it waits no more.
data Seeker = Seeker
  { seekerRobot :: Text
  , seekerGroup :: Group
  , isSeeking :: TVar Bool
  -- ^ Whether it has begun to wait.
  , handedOver :: TVar (Maybe (Maybe (Either SomeException (Seconds, Start))))
  }

-- | What waits to be completed together with others, and whether it is.
data Completion = Completion
  { completedTask :: TaskNumber
  , completedLease :: Number
  , completedResult :: Value
  , isCompleted :: TVar (Maybe (Either SomeException Bool))
  }

-- | A robot in its fleet, with the connections of a new process.
newFleet :: Database -> FleetOptions -> Robot -> IO Fleet
newFleet at chosen it = do
  unique <- newUnique at
  Fleet it at chosen unique
    <$> newLine chosen <*> newLine chosen
    <*> newTVarIO (Number 0)
    <*> newLeases
    <*> newTVarIO Map.empty <*> newTVarIO Map.empty <*> newTVarIO (Text.empty, Set.empty) <*> newTVarIO []
    <*> newTVarIO Map.empty <*> newTVarIO 0 <*> newTVarIO False
    <*> newTBQueueIO 64

-- | Which robot it is.
--
-- @since 0.1.0.0
fleetRobot :: Fleet -> Robot
fleetRobot = robot

-- | Whether the database is there: both connections. It is false until both have been made. (That one is lost is
-- noticed when it is used, at the latest after 'Behavior.Fleet.pollEvery'.) It never fails.
--
-- @since 0.1.0.0
databaseUp :: Fleet -> Signal Bool
databaseUp fleet = named "database up" (watching ((&&) <$> isThere (working fleet) <*> isThere (listening fleet)))

-- | Asks the database, as often as it takes: each function of the schema may be called again if its answer was lost.
-- Fails with 'NoDatabase' after 'noDatabaseAfter'.
request :: Fleet -> (Fleet -> Line) -> Request r -> Behavior (Either Refusal r)
request fleet line asked = snd <$> requestTimed fleet line asked

-- | 'request', which gives also when it was asked for (the time that was answered), by the own clock.
requestTimed :: Fleet -> (Fleet -> Line) -> Request r -> Behavior (Seconds, Either Refusal r)
requestTimed fleet line asked = firstOf [requestPatiently fleet line asked, sleep limit >> noDatabase]
 where
  limit = noDatabaseAfter (options fleet)
  noDatabase = do
    why <- atomically (whyAway (line fleet))
    throwIO (NoDatabase (databaseName (database fleet)) limit why)

-- | 'requestTimed', which waits for a database that is away for however long that is.
requestPatiently :: Fleet -> (Fleet -> Line) -> Request r -> Behavior (Seconds, Either Refusal r)
requestPatiently fleet line asked = case whyNot asked of
  Just why -> (,) <$> ownClock (database fleet) <*> pure (Left (BadArgument why))
  Nothing -> repeatedly fleet line asked

repeatedly :: Fleet -> (Fleet -> Line) -> Request r -> Behavior (Seconds, Either Refusal r)
repeatedly fleet line asked = try (asking (line fleet) once) >>= \case
  Left (_ :: ConnectionLost) -> repeatedly fleet line (askedAgain asked)
  Right (_, Left Busy) -> do
    atomically (isAwayFor (line fleet) whyBusy)
    sleep 0.1
    repeatedly fleet line asked
  Right answer -> pure answer
 where
  once session = (,) <$> ownClock (database fleet) <*> ask session asked

-- | The database has given out this number.
seen :: Fleet -> Number -> STM ()
seen fleet number = modifyTVar' (greatest fleet) (max number)

-- | What is thrown for a refusal. (A lease that is lost is mostly not thrown, nor is one that is to be asked again.)
refusedAs :: Refusal -> SomeException
refusedAs refusal = case refusal of
  LeaseGone -> toException (LeaseLost "a task")
  BadArgument why -> toException (NotAllowed (Text.unpack why))
  WasRestored why -> toException (RestoredFromCopy (Text.unpack why))
  NoFleet why -> toException (WrongSchema (Text.unpack why))
  Busy -> toException (ConnectionLost whyBusy)

-- | Why it is to be asked again.
whyBusy :: String
whyBusy = "a lock was not free in time"

-- | Says it to the database, also in a cleanup: waits for at most a second until it is said, and it is said later if
-- the database is away. (Nothing is thrown: it would take the place of what is being thrown. What is never said comes
-- out by itself, when leases end.)
posted :: Fleet -> (Fleet -> Line) -> Request r -> Behavior ()
posted fleet line asked = do
  isSaid <- posting (line fleet) (\session -> (/= Left Busy) . void <$> ask session asked)
  void . tryAny . cleanupWithin 1 $ atomically (isSaid >>= check)

-- | Hands a line to the user, unless too many wait.
report :: Fleet -> String -> STM ()
report fleet line = do
  full <- isFullTBQueue (reports fleet)
  unless full (writeTBQueue (reports fleet) line)

-- | What a notice is about is looked at.
noticed :: Fleet -> Notice -> STM ()
noticed fleet notice = case notice of
  OfQueue name -> readTVar (groups fleet) >>= mapM_ wake . Map.filterWithKey (\(it, _) _ -> it == name)
  OfLater -> writeTVar (pollNow fleet) True
  OfCancel task -> renewSoon (leases fleet) task
  OfAnything -> do
    modifyTVar' (missed fleet) (+ 1)
    readTVar (groups fleet) >>= mapM_ wake
  _ -> modifyTVar' (changes fleet) (Map.adjust (second (+ 1)) notice)
 where
  wake group = writeTVar (mayHave group) True

-- | Gives the behaviour what waits for the next notice of one of these, since the last time that it waited.
withNotices :: Fleet -> [Notice] -> (STM () -> Behavior a) -> Behavior a
withNotices fleet about use = bracket enter (const leave) (use . change)
 where
  enter = atomically $ do
    modifyTVar' (changes fleet) (\them -> foldr (Map.alter (Just . maybe (1, 0) (first (+ 1)))) them about)
    counts >>= newTVar
  leave = atomically $ modifyTVar' (changes fleet) (\them -> foldr (Map.update fewer) them about)
  fewer (waiting, count) = if waiting == 1 then Nothing else Just (waiting - 1 :: Int, count)
  counts = do
    them <- readTVar (changes fleet)
    (,) (map (fmap snd . (`Map.lookup` them)) about) <$> readTVar (missed fleet)
  change latest = do
    new <- counts
    readTVar latest >>= check . (/= new)
    writeTVar latest new

-- | Waits for that, and for at most that long.
orAfter :: STM () -> Seconds -> Behavior ()
orAfter change seconds = timeout seconds (atomically change) ? pure ()
