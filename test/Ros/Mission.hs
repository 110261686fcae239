{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Random missions of a fake robot, whose goals are slow, rejected, aborted, or do not stop, and whose link is lost.
module Ros.Mission
  ( -- * Missions
    World (..)
  , Mission (..)
  , Plan (..)
  , How (..)
  , Happening (..)
  , Level (..)
  , worlds
  , seconds
  , planOf
  , isReplacing

    -- * What comes of one
  , Report (..)
  , Leaf (..)
  , GoalOutcome (..)
  , inWorld
  , patienceHere
  , lostAfter
  ) where

import qualified Control.Concurrent.STM as STM
import Control.Exception (SomeException, finally, fromException, mask, throwIO, try)
import Control.Monad (void, when)
import Data.Aeson (Value (..), object, (.=))
import Data.Foldable (for_, traverse_)
import Data.IORef
import qualified Data.Map.Strict as Map
import Test.QuickCheck (Gen, choose, elements, frequency, listOf1, oneof, resize, sized, vectorOf)

import Behavior
import Behavior.Internal.Core.Failure (isCancellation)
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Fake
import Behavior.Ros.Internal.Link (sent)
import Behavior.Ros.Messages
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time

-- | A robot's day. (Times are in hundredths of a second.)
data World = World
  { phases :: [Mission]
  -- ^ One after the other; whatever one throws, the next one begins.
  , plans :: [Plan]
  -- ^ What the robot does with the goals, in the order in which they are begun; then again from the first.
  , happenings :: [(Int, Happening)]
  -- ^ Each so long after the one before.
  , stopAt :: Maybe Int
  -- ^ When all is stopped, the link included.
  , serial :: Bool
  -- ^ Whether the bridge works on requests only while no goal runs.
  }
  deriving (Show)

-- | One thing at a time. (Each goal has a number of its own, which is what is to be done.)
data Mission
  = -- | On the action with that number; with its feedback, which a behaviour beside it awaits.
    Goal Bool Int
  | Pause Int
  | Then Mission Mission
  | OrElse Mission Mission
  | Within Int Mission
  | Beside Int Mission
  | Monitored Mission Mission
  | Instead Mission Mission
  deriving (Show)

data Plan = Plan
  { accepts :: Int
  , lasts :: Int
  , how :: How
  , confirms :: Maybe Int
  -- ^ Nothing: it does not stop.
  , succeedsAnyway :: Bool
  }
  deriving (Show)

data How = Succeeding | Aborting | Cancelling | Refusing
  deriving (Eq, Show)

data Happening
  = -- | The bridge ends, and is there again after that time.
    Loses Int
  | -- | It does not answer, and is started again that long after this can be known.
    Freezes Int
  | Charge Level
  deriving (Show)

-- | What the battery's topic says.
data Level = High | Low | Unmeasured
  deriving (Eq, Show)

worlds :: Gen World
worlds = do
  isSerial <- frequency [(8, pure False), (1, pure True)]
  world <-
    World
      <$> (choose (1, 4) >>= \n -> vectorOf n (resize 6 missions))
      <*> resize 8 (listOf1 planned)
      <*> (choose (0, 4) >>= \n -> vectorOf n ((,) <$> ticks <*> happening isSerial))
      <*> frequency [(2, pure Nothing), (1, Just <$> choose (0, 150))]
      <*> pure isSerial
  frequency [(3, pure world), (1, outlived world)]
 where
  planned =
    Plan
      <$> frequency [(4, pure 0), (1, elements [1, 2, 5, 10, 30])]
      <*> frequency [(4, ticks), (1, elements [100, 300])]
      <*> frequency [(6, pure Succeeding), (2, pure Aborting), (1, pure Cancelling), (1, pure Refusing)]
      <*> frequency [(5, Just <$> elements [0, 0, 1, 2, 5, 30]), (1, pure Nothing)]
      <*> frequency [(4, pure False), (1, pure True)]
  happening isSerial =
    frequency $
      [(4, Charge <$> frequency [(3, pure Low), (2, pure High), (1, pure Unmeasured)])]
        ++ [(2, Loses <$> ticks) | not isSerial]
        ++ [(1, Freezes <$> ticks) | not isSerial]

-- | It begins so: a goal runs for much longer than its link, and others come when there is a link again.
outlived :: World -> Gen World
outlived world = do
  accepted <- elements [0, 80]
  which <- choose (0, 2)
  lost <- (,) <$> elements [5, 20] <*> (Loses <$> elements [1, 30])
  later <- Then . Pause <$> elements [30, 120, 200]
  pure
    world
      { phases = Goal False which : later (Goal False which) : phases world
      , plans = Plan accepted 300 Succeeding (Just 0) False : plans world
      , happenings = lost : happenings world
      , stopAt = Nothing
      , serial = False
      }

ticks :: Gen Int
ticks = elements [0, 1, 2, 3, 4, 6, 8, 10, 15, 20, 30, 50]

missions :: Gen Mission
missions = sized $ \size ->
  let part = resize (size `div` 2) missions
      pauses = frequency [(3, ticks), (1, elements [120, 200])]
      small = frequency [(6, Goal <$> elements [False, False, True] <*> choose (0, 2)), (1, Pause <$> pauses)]
  in if size <= 0
      then small
      else
        oneof
          [ small
          , Then <$> part <*> part
          , OrElse <$> part <*> part
          , Within <$> ticks <*> part
          , Beside <$> ticks <*> part
          , Monitored <$> part <*> part
          , Instead <$> part <*> part
          ]

-- | What comes of a day.
data Report = Report
  { leaves :: [Leaf]
  -- ^ In the order in which they ended.
  , came :: [(Seconds, Seen)]
  -- ^ The robot's own record.
  , happened :: [(Seconds, Happening)]
  , unsettled :: Int
  -- ^ How many goals may still run when the link has been there for a minute.
  , leftRunning :: [Int]
  -- ^ The robot's numbers of the goals that run when all has ended.
  }
  deriving (Show)

-- | A goal that was begun.
data Leaf = Leaf
  { order :: Int
  , actionOf :: Int
  , isGuarded :: Bool
  -- ^ Whether it must not run unless the battery's level is high.
  , begun :: Seconds
  , over :: Seconds
  , outcome :: GoalOutcome
  , runningThen :: [Int]
  -- ^ The robot's numbers of the goals that run when it is over.
  , movingThen :: Int
  -- ^ How many of ours may still run, as far as is known then.
  }
  deriving (Show)

data GoalOutcome
  = Completed Value
  | FailedWith RosFailure
  | FaultedWith RosFault
  | Stopped
  | Otherwise String
  deriving (Show)

-- | What the robot does with the goal of that number.
planOf :: World -> Int -> Plan
planOf world n = plans world !! (n `mod` length (plans world))

-- | A new goal on that action replaces the one before.
isReplacing :: Int -> Bool
isReplacing = (== 2)

actionNames :: [String]
actionNames = ["/move", "/turn", "/navigate"]

patienceHere :: Seconds
patienceHere = 1

-- | How long after the bridge is frozen the link is lost, at the latest.
lostAfter :: Seconds
lostAfter = 1

-- | Runs the missions in their world.
inWorld :: World -> Behavior Report
inWorld world = do
  ended <- newIORef []
  events <- newIORef []
  orders <- newIORef 0
  open <- newIORef 0
  let scripted (Number n) = scriptOf (planOf world (truncate n)) (Number n)
      scripted _ = succeeding
      limited = void . tryAny . maybe id (timeout . seconds) (stopAt world)
  withFakeRobot [(name, scripted) | name <- actionNames] $ \robot -> do
    when (serial world) (workSerially robot)
    charge robot events High
    limited . withRosOptions options (fakeRos robot) $ \ros -> do
      let doing = Doing robot ros events ended orders
          day = for_ (phases world) (\phase -> tryAny (run doing False phase) >> pause 3)
      firstOf [day, traverse_ (happen robot events) (happenings world) >> sleepForever]
      void . tryAny . timeout 60 $ Signal.waitUntil ((&&) <$> ((== 0) <$> movingGoals ros) <*> linkUp ros)
      Signal.read (movingGoals ros) >>= writeIORef open
    left <- atomically (runningGoals robot)
    record <- atomically (seen robot)
    Report <$> (reverse <$> readIORef ended) <*> pure record <*> readIORef events <*> readIORef open <*> pure left
 where
  options = defaultRosOptions {pingEvery = pings, pongWithin = 0.5, patience = patienceHere, noServerAfter = 0.3}
  -- (Fewer pings are simulated faster.)
  pings = if null [() | (_, Freezes _) <- happenings world] then 10 else 0.5

-- | What a mission is run with.
data Doing = Doing FakeRobot Ros (IORef [(Seconds, Happening)]) (IORef [Leaf]) (IORef Int)

-- | Runs the mission; whether it must not run unless the battery's level is high.
run :: Doing -> Bool -> Mission -> Behavior ()
run doing@(Doing robot ros events _ _) onlyWhenHigh = \case
  Goal False which -> leaf doing onlyWhenHigh which (goal ros (actionFor which))
  Goal True which -> leaf doing onlyWhenHigh which $ \wanted ->
    goalWith ros (actionFor which) wanted (\feedback -> Signal.waitUntil (True <$ feedback))
  Pause n -> pause n
  Then one other -> go one >> go other
  OrElse one other -> go one ? go other
  Within n act -> timeout (seconds n) (go act)
  Beside n act -> firstOf [pause n, go act]
  Monitored recovery task -> Signal.monitor low (go recovery >> charge robot events High) (careful task)
  Instead emergency act -> Signal.insteadWhen low (go emergency) (careful act)
 where
  go = run doing onlyWhenHigh
  careful = run doing True
  low = (< 0.1) <$> measured unStd (latest ros (topic "/level" latched :: Topic (Std (Maybe Double))))
  actionFor which = (if isReplacing which then replacing else id) (untyped (actionNames !! which) "a_robot/action/A")

-- | A goal, and how it ended.
leaf :: Doing -> Bool -> Int -> (Value -> Behavior Value) -> Behavior ()
leaf (Doing robot ros _ ended orders) onlyWhenHigh which act = mask $ \restore -> do
  n <- atomicModifyIORef orders (\n -> (n + 1, n))
  before <- now
  end <- try (restore (act (Number (fromIntegral n))))
  after <- now
  -- (These are no scheduling points.)
  running <- STM.atomically (runningGoals robot)
  moving <- Map.size <$> STM.readTVarIO (sent ros)
  modifyIORef' ended (Leaf n which onlyWhenHigh before after (outcomeOf end) running moving :)
  either throwIO (const (pure ())) end

outcomeOf :: Either SomeException Value -> GoalOutcome
outcomeOf = \case
  Right value -> Completed value
  Left e
    -- (Where several behaviours were stopped: the fault of one of them.)
    | Just (StoppedWithFault _ fault) <- fromException e -> outcomeOf (Left fault)
    | Just failure <- fromException e -> FailedWith failure
    | Just fault <- fromException e -> FaultedWith fault
    | isCancellation e -> Stopped
    | otherwise -> Otherwise (show e)

-- | Does what happens.
happen :: FakeRobot -> IORef [(Seconds, Happening)] -> (Int, Happening) -> Behavior ()
happen robot events (after, what) = do
  pause after
  case what of
    Charge level -> charge robot events level
    Loses n -> noting >> (loseLink robot >> pause n) `finally` restoreLink robot
    Freezes n -> do
      noting
      (freezeLink robot >> sleep lostAfter >> pause n) `finally` (loseLink robot >> restoreLink robot)
 where
  noting = now >>= \time -> modifyIORef' events ((time, what) :)

-- | The battery has that level now.
charge :: FakeRobot -> IORef [(Seconds, Happening)] -> Level -> Behavior ()
charge robot events level = do
  time <- now
  modifyIORef' events ((time, Charge level) :)
  publish robot "/level" (object ["data" .= value])
 where
  value = case level of
    High -> Number 0.9
    Low -> Number 0.05
    Unmeasured -> Null

scriptOf :: Plan -> Value -> GoalScript
scriptOf plan wanted =
  GoalScript
    { acceptedAfter = seconds (accepts plan)
    , endsAfter = seconds (lasts plan)
    , endsWith = case how plan of
        Succeeding -> Succeeds wanted
        Aborting -> Aborts (object ["order" .= wanted])
        Cancelling -> Cancels
        Refusing -> Refuses
    , confirmsAfter = maybe (1 / 0) seconds (confirms plan)
    , confirmsWith = if succeedsAnyway plan then Succeeds wanted else Cancels
    , feedbacks = [(0.01, wanted)]
    }

pause :: Int -> Behavior ()
pause = sleep . seconds

-- | A number of hundredths.
seconds :: Int -> Seconds
seconds n = fromIntegral n / 100
