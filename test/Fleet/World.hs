-- |
-- A random day of a fleet: robots of a few processes do tasks and share a door, while processes die, clocks differ,
-- and the database answers late, twice or never.
module Fleet.World
  ( World (..)
  , Process (..)
  , Duty (..)
  , Order (..)
  , How (..)
  , Happening (..)
  , worlds
  , Report (..)
  , Stay (..)
  , orderKey
  , inWorld
  ) where

import Control.Concurrent.STM (check, modifyTVar', newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception (ErrorCall (..), bracket_, throwIO)
import Control.Monad (forM, forever, replicateM_, void, when)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe)
import Test.QuickCheck (Gen, choose, elements, frequency, listOf, resize, vectorOf)

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Fake
import Behavior.Fleet.Internal.Error (textOf)
import Behavior.Parallel (allOf, firstOf)
import Behavior.STM (atomically)
import Behavior.Time (now, sleepForever, sleepUntil, timeout)

-- | (Times are in hundredths of a second.)
data World = World
  { processes :: [Process]
  , orders :: [Order]
  , answers :: [Answer]
  -- ^ Of the first statements.
  , happenings :: [(Int, Happening)]
  -- ^ Each so long after the one before.
  }
  deriving (Show)

data Process = Process
  { rate :: Double
  -- ^ Of its own clock.
  , duties :: [Duty]
  }
  deriving (Show)

-- | What a robot does.
data Duty
  = Serves
  | -- | It passes the door so often, and takes so long for that.
    Passes Int Int
  deriving (Show)

data Order = Order
  { startScripts :: [How]
  -- ^ Of its starts, then again from the first.
  , pausesBetween :: [Int]
  , submittedAt :: Int
  }
  deriving (Show)

data How
  = Writes' Int
  | FailsAfter Int
  | FaultsAfter Int
  deriving (Show)

data Happening
  = ConnectionsLost
  | AwayFor Int
  | -- | The database's clock steps, to so far from the true time.
    StepsTo Int
  | -- | A process is killed, and started again after that time.
    Killed Int Int
  | -- | A process does not reach the database for that time, while others do.
    Parted Int Int
  | NoticesLost Bool
  | CancelsOrder Int
  deriving (Show)

worlds :: Gen World
worlds = do
  count <- choose (1, 3)
  World
    <$> ((:) <$> (serves <$> aProcess) <*> vectorOf (count - 1) aProcess)
    <*> resize 4 (listOf order)
    <*> resize 12 (listOf answer)
    <*> resize 5 (listOf ((,) <$> choose (0, 150) <*> happening count))
 where
  -- (At least one of them does.)
  serves process = process {duties = Serves : drop 1 (duties process)}
  aProcess = Process <$> elements [1, 1, 0.95, 1.05] <*> (choose (1, 2) >>= (`vectorOf` duty))
  duty = frequency [(2, pure Serves), (1, Passes <$> choose (1, 3) <*> choose (1, 200))]
  order =
    Order <$> (choose (1, 3) >>= (`vectorOf` how)) <*> resize 3 (listOf (elements [0, 10, 50])) <*> choose (0, 100)
  how =
    frequency
      [ (4, Writes' <$> choose (0, 200))
      , (1, FailsAfter <$> choose (0, 50))
      , (1, FaultsAfter <$> choose (0, 50))
      ]
  answer =
    frequency
      [ (3, After <$> elements [0, 0.01, 0.05, 0.2])
      , (4, elements [DoneAndLost, LostBefore, NoAnswer, DoneWithoutAnswer])
      , (1, pure LockNotFree)
      ]
  happening count =
    frequency
      [ (1, pure ConnectionsLost)
      , (1, AwayFor <$> choose (1, 200))
      , (1, StepsTo <$> choose (-12, 12))
      , (2, Killed <$> choose (0, count - 1) <*> choose (0, 100))
      , (3, Parted <$> choose (0, count - 1) <*> choose (50, 250))
      , (1, NoticesLost <$> elements [True, False])
      , (1, CancelsOrder <$> choose (0, 3))
      ]

-- | Someone came to a place.
data Stay = Stay
  { stayIn :: String
  , stayFence :: Maybe Fence
  , began :: Seconds
  , beside :: Int
  -- ^ How many were there when it began.
  }
  deriving (Show)

data Report = Report
  { stays :: [Stay]
  -- ^ The first one first.
  , written :: [String]
  -- ^ By the users' own transactions.
  , tasks :: [(String, Task)]
  , strange :: [String]
  -- ^ What 'serving' and 'holding' have thrown that no script throws.
  }
  deriving (Show)

orderKey :: Int -> String
orderKey i = "order " ++ show i

hundredths :: Int -> Seconds
hundredths n = fromIntegral n / 100

inWorld :: World -> Behavior Report
inWorld world = do
  fake <- newFakeDatabase
  places <- newTVarIO []
  present <- newTVarIO Map.empty
  others <- newTVarIO []
  rows <- newTVarIO []
  counts <- newTVarIO Map.empty
  generations <- forM (processes world) (\_ -> newTVarIO (0 :: Int))
  parted <- forM (processes world) (\_ -> newTVarIO False)
  atomically (willAnswer fake (answers world))
  let orders' = queue "orders" :: Queue Int ()
      staying place fence act = do
        from <- now
        let enters = atomically $ do
              there <- Map.findWithDefault 0 place <$> readTVar present
              modifyTVar' present (Map.insert place (there + 1))
              modifyTVar' places (Stay place fence from there :)
        bracket_ enters (atomically (modifyTVar' present (Map.adjust (subtract 1) place))) act
      carry work = do
        let key = workKey work
            scripts = startScripts (orders world !! workInput work)
        n <- atomically $ do
          n <- fromMaybe 0 . Map.lookup key <$> readTVar counts
          n <$ modifyTVar' counts (Map.insert key (n + 1))
        staying key Nothing $ case scripts !! (n `mod` length scripts :: Int) of
          Writes' d -> sleep (hundredths d)
          FailsAfter d -> sleep (hundredths d) >> failed
          FaultsAfter d -> sleep (hundredths d) >> throwIO (ErrorCall "the arm")
        pure (instead (modifyTVar' rows (key :)) (writing (\_ -> pure ())))
      expecting what act = tryAny (void act) >>= either (unexpected what . textOf) pure
      unexpected what why = when (why /= what) (atomically (modifyTVar' others (why :)))
      robotDoes fleet i duty = withRobot fleet (Robot ("robot " ++ show (i :: Int)) []) $ \it -> case duty of
        Serves -> forever (expecting "the arm" (servingWith it orders' carry) >> sleep 0.01)
        Passes times d -> do
          replicateM_ times . expecting "the lease of door is lost" . holding it (resource "door") 1.5 $ \fence ->
            staying "door" (Just fence) (sleep (hundredths d))
          sleepForever
      runs generation isParted process = void . tryAny $ do
        cut <- newTVarIO False
        mine <- readTVarIO generation
        let isOver = readTVar generation >>= check . (/= mine)
            database = cutOff isParted (fakeDatabaseBy (* realToFrac (rate process)) fake)
        firstOf
          [ void . withFleetOptions quick (cutOff cut database) (Robot "process" []) $ \fleet ->
              firstOf (zipWith (robotDoes fleet) [1 ..] (duties process))
          , atomically (isOver >> writeTVar cut True)
          ]
      living generation isParted process = forever (runs generation isParted process >> sleep 0.01)
      submitting = withFleetOptions quick (fakeDatabase fake) (Robot "office" []) $ \fleet -> do
        void . allOf $
          [ sleepUntil (hundredths (submittedAt order)) >> sub fleet i order
          | (i, order) <- zip [0 ..] (orders world)
          ]
        mapM_ (happens fleet) (happenings world)
        atomically (willAnswer fake [] >> setReachable fake True >> losingNotices fake False)
        -- All is well again: so all ends by itself.
        timeout 300 (finished (length (orders world))) ? pure ()
      sub fleet i order =
        let chosen = defaultSubmitOptions {taskPauses = map hundredths (pausesBetween order)}
         in void (submitWith chosen fleet orders' (orderKey i) i)
      finished n = do
        there <- atomically (tasksThere fake)
        let over = length [() | (_, _, task) <- there, taskState task `elem` [Done, Dead, Cancelled]]
        if over >= n then sleep 1 else sleep 0.5 >> finished n
      happens fleet (after, what) = sleep (hundredths after) >> case what of
        ConnectionsLost -> atomically (loseConnections fake)
        AwayFor d -> atomically (setReachable fake False) >> sleep (hundredths d) >> atomically (setReachable fake True)
        StepsTo d -> atomically (setClock fake (+ hundredths d))
        Killed i d -> atomically (modifyTVar' (generations !! i) (+ 1)) >> sleep (hundredths d)
        Parted i d -> do
          atomically (writeTVar (parted !! i) True)
          sleep (hundredths d) >> atomically (writeTVar (parted !! i) False)
        NoticesLost are -> atomically (losingNotices fake are)
        CancelsOrder i -> void (cancelTask fleet orders' (orderKey i))
  firstOf (submitting : zipWith3 living generations parted (processes world))
  Report . reverse <$> readTVarIO places
    <*> readTVarIO rows
    <*> (map (\(_, key, task) -> (key, task)) <$> atomically (tasksThere fake))
    <*> readTVarIO others
 where
  -- (So that a statement that is not answered is given up at the same time at which a lease is lost.)
  quick =
    defaultFleetOptions
      { taskTerm = 0.75
      , answerWithin = 0.5
      , pollEvery = 1.5
      , connectAgainAfter = 0.02
      , connectAgainWithin = 0.1
      , noDatabaseAfter = 1000
      }
