-- |
-- fleet-mission on a fake database: whatever goes wrong with processes and with the database, and under each schedule,
-- each order is delivered once, no door or charger is shared, and no battery is flat (which is a fault).
module Examples.FleetMissionSpec (spec) where

import Control.Monad (when)
import Data.Foldable (for_)
import Data.List (group, sort)
import Test.Hspec

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Fake
import Behavior.Parallel (firstOf)
import Behavior.STM
import Behavior.Time (sleepForever, sleepUntil)
import qualified Examples.WorstDay as Worst
import FleetMission
import SimulatedBody
import Support (guarded, sampleSize)

spec :: Spec
spec = guarded $ do
  -- (Such a day takes most of a second without optimization: three schedules an example.)
  seeds <- runIO (sampleSize 6)
  for_ [0 .. seeds - 1] $ \seed -> describe ("under schedules of seed " ++ show seed) $ do
    let survives = Worst.survivesOf seed 3 . day
    it "delivers each order once, and none from the empty shelf" $ survives calm
    for_ [0.5, 1, 3, 5.3, 11] $ \moment ->
      it ("also when a process is killed after " ++ show moment ++ " s, and once more") $
        survives calm {killedAt = [moment, moment + 4]}
    for_ [0.5, 3, 5.3] $ \moment ->
      it ("also when the database is away after " ++ show moment ++ " s, sends no notices, and its answers are lost") $
        survives calm {happens = badWeather moment}
  it "and robots that write by themselves that an order is delivered do so twice" $
    Worst.failsWith "(\"delivered twice\",[1" 4 (day calm {killedAt = [5.3], robots = writeThemselves})
  it "and robots that do not hold a door share it" $
    Worst.failsWith "(\"shared\",[\"north door" 4 (day calm {robots = holdNothing})
  it "and robots that stay in a door when they are interrupted share it" $
    Worst.failsWith "(\"shared\",[\"north door" 4 (day calm {robots = \_ body -> body {backOut = \_ -> pure ()}})
 where
  writeThemselves world body =
    body {putDown = \order -> atomically (writes world order) >> putDown body order, delivered = \_ -> pure ()}
  holdNothing world body = body {carry = staying world "north door" . carry body}

-- | What happens, and what robots there are.
data Day = Day
  { killedAt :: [Seconds]
  -- ^ When the process of two robots is killed. It is started again at once.
  , happens :: FakeDatabase -> Behavior ()
  , robots :: World -> Body -> Body
  }

calm :: Day
calm = Day {killedAt = [], happens = \_ -> pure (), robots = \_ body -> body}

badWeather :: Seconds -> FakeDatabase -> Behavior ()
badWeather moment fake = do
  atomically (losingNotices fake True)
  sleepUntil moment >> atomically (setReachable fake False)
  sleep 15 >> atomically (setReachable fake True)
  sleep 5 >> atomically (willAnswer fake [DoneAndLost, NoAnswer, LostBefore, DoneWithoutAnswer])

-- | What is seen from outside.
data World = World
  { rows :: TVar [Int]
  -- ^ The table of what was delivered.
  , visited :: TVar [Place]
  , present :: TVar [Place]
  -- ^ The doors and chargers at which a robot is.
  , shared :: TVar [Place]
  -- ^ Those at which two were.
  }

writes :: World -> Order -> STM ()
writes world order = modifyTVar' (rows world) (number order :)

-- | A robot that is interrupted there stays there.
staying :: World -> Place -> Behavior () -> Behavior ()
staying world place act = atomically enters >> act >> atomically (leaves world place)
 where
  enters = do
    modifyTVar' (visited world) (place :)
    others <- readTVar (present world)
    writeTVar (present world) (place : others)
    when (place `elem` others) $ modifyTVar' (shared world) (place :)

leaves :: World -> Place -> STM ()
leaves world place =
  modifyTVar' (present world) (\them -> takeWhile (/= place) them ++ drop 1 (dropWhile (/= place) them))

day :: Day -> Worst.Day
day today simulated = do
  world <- World <$> newTVarIO [] <*> newTVarIO [] <*> newTVarIO [] <*> newTVarIO []
  ends <- newTVarIO []
  run <- simulated $ do
    fake <- newFakeDatabase
    isAlive <- newTVarIO False
    let process isDead = withFleet (cutOff isDead (fakeDatabase fake))
        works :: Fleet -> Robot -> Behavior ()
        works fleet robot = do
          body <- newBody 5 2.5 (\_ -> pure ()) (robotName robot) $ \order ->
            instead (writes world order) (writing (\_ -> pure ()))
          withRobot fleet robot (`mission` robots today world (inWorld world body))
    firstOf
      [ process isAlive (Robot "office" []) (`office` wanted) >>= atomically . writeTVar ends
      , killed (killedAt today) $ \isDead -> process isDead amy (\fleet -> works fleet amy ||| works fleet bo)
      , process isAlive cid (`works` cid)
      , happens today fake >> sleepForever
      ]
  Worst.ended run `shouldBe` "returned"
  there <- sort <$> readTVarIO (rows world)
  twice <- readTVarIO (shared world)
  ("delivered twice", [n | n : _ : _ <- group there]) `shouldBe` ("delivered twice" :: String, [])
  ("shared", twice) `shouldBe` ("shared" :: String, [])
  readTVarIO (visited world) >>= (`shouldSatisfy` any (`elem` ["charger " ++ show n | n <- [1 .. 4 :: Int]]))
  there `shouldBe` filter (/= 13) (map number wanted)
  dead <- readTVarIO ends
  [(key, taskStarts task) | (key, task) <- dead] `shouldBe` [("order 13", 7)]
 where
  wanted = [Order n (n `elem` [10, 12]) | n <- [10 .. 14]]
  amy = Robot "amy" ["lift"]
  bo = Robot "bo" []
  cid = Robot "cid" ["lift"]
  inWorld world body =
    body
      { passThrough = \door fence -> staying world door (passThrough body door fence)
      , chargeAt = \charger fence -> staying world charger (chargeAt body charger fence)
      , backOut = \place -> backOut body place >> atomically (leaves world place)
      }

-- | In place of a process that is killed at these times, and started again at once.
killed :: [Seconds] -> (TVar Bool -> Behavior ()) -> Behavior ()
killed moments run = do
  isDead <- newTVarIO False
  case moments of
    [] -> run isDead
    moment : later -> do
      firstOf [run isDead, sleepUntil moment >> atomically (writeTVar isDead True)]
      killed later run
