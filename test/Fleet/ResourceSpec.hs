{-# LANGUAGE GADTs #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Resources on a fake database: one robot at a time, in order.
module Fleet.ResourceSpec (spec) where

import Control.Exception (finally, throwIO)
import Control.Monad (forM_, replicateM_, void)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.Set as Set
import qualified Data.Text as Text
import Test.Hspec

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Fake
import Behavior.Fleet.Internal.Contract (Refusal (..), Request (..), Wish (..))
import Behavior.Fleet.Internal.Database (Database (..), Session (..))
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Parallel (allOf, firstOf)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (simulate, well)
import Behavior.Time (now, sleepUntil, timeout)

spec :: Spec
spec = describe "A resource" $ do
  it "is held by one robot at a time, in the order in which they asked" $ do
    found <- day $ \_ robots noting ->
      inTurn [holding robot door 2 (\_ -> noting n (sleep 5)) | (n, robot) <- zip [1 ..] robots]
    found `shouldBe` [(1, 0.1, 5.1), (2, 5.1, 10.1), (3, 10.1, 15.1)]

  it "has a greater fence for each holder" $ do
    fences <- newIORef []
    _ <- day $ \_ robots _ -> forM_ robots $ \robot -> holding robot door 2 (\fence -> modifyIORef' fences (fence :))
    them <- readIORef fences
    zipWith (>) them (drop 1 them) `shouldBe` [True, True]

  it "is held together with others, or not at all: none waits in a circle" $ do
    let both' = [door, charger]
    found <- day $ \_ robots noting ->
      inTurn
        [ holdingAll robot (order both') 2 (\_ -> noting n (sleep 1))
        | (n, order, robot) <- zip3 [1 ..] [id, reverse, id] robots
        ]
    found `shouldBe` [(1, 0.1, 1.1), (2, 1.1, 2.1), (3, 2.1, 3.1)]

  it "is held inside of another one, also when someone waits for both" $ do
    found <- day $ \_ robots noting -> case robots of
      one : other : _ ->
        inTurn
          [ holding one door 2 (\_ -> sleep 1 >> holding one charger 2 (\_ -> noting 1 (sleep 1)))
          , holdingAll other [charger, door] 2 (\_ -> noting 2 (sleep 1))
          ]
      _ -> pure ()
    map (\(n, _, _) -> n) found `shouldBe` [1, 2]

  it "that is free is not kept from a robot by one that waits for others, in a circle of three" $ do
    found <- day $ \_ robots noting -> case robots of
      [one, other, third] -> do
        let [a, b, c] = map resource ["a", "b", "c"]
        void . allOf $
          [ holding one b 2 (\_ -> sleep 1 >> holding one c 2 (\_ -> noting 1 (pure ())))
          , sleep 0.5 >> holdingAll other [a, b] 2 (\_ -> noting 2 (pure ()))
          , holding third c 2 (\_ -> sleep 1 >> holding third a 2 (\_ -> noting 3 (pure ())))
          ]
      _ -> pure ()
    [n | (n, _, over) <- found, over < 10] `shouldMatchList` [1, 2, 3]

  it "that is free is not kept from a robot by one that is behind another in the line, which waits for that robot" $ do
    found <- day $ \_ robots noting -> case robots of
      [one, other, third] -> do
        let [a, b] = map resource ["a", "b"]
        void . allOf $
          [ holding one b 2 (\_ -> sleep 2 >> holding one a 2 (\_ -> noting 1 (pure ())))
          , sleep 1 >> holdingAll other [a, b] 2 (\_ -> noting 2 (pure ()))
          , sleep 1.5 >> holding third a 2 (\_ -> noting 3 (pure ()))
          ]
      _ -> pure ()
    [(n, over < 2.5) | (n, _, over) <- found] `shouldBe` [(1, True), (2, True), (3, True)]

  it "is held for longer than its term, while the robot runs" $ do
    found <- day $ \_ robots noting ->
      inTurn [holding robot door 0.5 (\_ -> noting n (sleep 20)) | (n, robot) <- zip [1, 2] robots]
    found `shouldBe` [(1, 0.1, 20.1), (2, 20.1, 40.1)]

  it "that is lost interrupts at two thirds of the term, and is a fault" $ do
    ends <- newIORef []
    found <- day $ \fake robots noting -> do
      let first' : _ = robots
      end <- tryAny (holding first' door 3 (\_ -> noting 1 (atomically (setReachable fake False) >> sleep 100)))
      modifyIORef' ends (either show show end :)
    map (\(_, begun, over) -> over - begun > 1.9 && over - begun < 2.1) found `shouldBe` [True]
    readIORef ends `shouldReturn` ["LeaseLost \"door\""]

  it "that was renewed, and then is lost, interrupts at two thirds of the term after it was last asked for" $ do
    found <- day $ \fake robots noting -> do
      let first' : _ = robots
          away = atomically (setReachable fake False) >> sleep 100
      void . tryAny $ holding first' door 3 (\_ -> sleep 8.7 >> noting 1 away)
    -- (It is renewed at each third of the term.)
    map (\(_, begun, over) -> over - begun > 0.9 && over - begun < 2.1) found `shouldBe` [True]

  for_ [(1.5, "is held still"), (1.9, "may be another's")] $ \(late, what) ->
    it ("is used only within two thirds of the term after it was asked for: it " ++ what) $ do
      found <- day $ \fake robots noting -> do
        sleep 0.01 -- (The first poll is over.)
        let first' : _ = robots
        atomically (willAnswer fake [After late])
        holding first' door 0.8 (\_ -> noting 1 (sleep 1))
      found `shouldBe` [(1, 0.01 + late, 1.01 + late)]

  it "is free when the term is over, after its holder's process has died" $ do
    found <- day $ \fake robots noting -> case robots of
      one : other : _ -> do
        -- (Nothing is said any more by the one that has died.)
        let inDoor = sleep 0.5 >> atomically (setReachable fake False) >> sleep 100
            dies = timeout 1 (holding one door 3 (\_ -> noting 1 inDoor)) ? pure ()
            comes = sleep 2 >> atomically (setReachable fake True) >> holding other door 3 (\_ -> noting 2 (sleep 1))
        void (dies `both` comes)
      _ -> pure ()
    found `shouldSatisfy` \case
      [(1, 0, 1), (2, begun, _)] -> begun >= 3 && begun < 3.5
      _ -> False

  it "is free when the database is there again, if it could not be released before" $ do
    found <- day $ \fake robots noting -> case robots of
      one : other : _ -> do
        let reachable = atomically . setReachable fake
        holding one door 60 (\_ -> noting 1 (sleep 1 >> reachable False))
        sleep 4
        reachable True
        holding other door 60 (\_ -> noting 2 (pure ()))
      _ -> pure ()
    found `shouldSatisfy` \case
      [(1, 0, 1), (2, begun, _)] -> begun > 5 && begun < 10
      _ -> False

  it "is waited for, kept and released also when a lock is not free in time" $ do
    found <- day $ \fake robots noting -> case robots of
      one : other : _ -> do
        let busy = atomically (willAnswer fake (replicate 3 LockNotFree))
        sleep 1 -- (The first poll is over.)
        busy
        holding one door 3 (\_ -> noting 1 (busy >> sleep 5 >> busy))
        holding other door 3 (\_ -> noting 2 (pure ()))
      _ -> pure ()
    found `shouldSatisfy` \case
      [(1, begun, over), (2, again, _)] ->
        begun > 1.29 && begun < 1.31 && over == begun + 5 && again >= over && again < over + 0.1
      _ -> False

  for_ ["a lock is not free", "the connection is lost"] $ \why ->
    it ("that cannot be released does not keep what else is asked for waiting: " ++ why) $ do
      time <- simulate (do
        fake <- newFakeDatabase
        let over session = session {ask = answers (ask session)}
            answers :: (Request r -> Behavior (Either Refusal r)) -> Request r -> Behavior (Either Refusal r)
            answers asking = \case
              Release _ | why == "a lock is not free" -> sleep 0.25 >> pure (Left Busy)
              Release _ -> sleep 0.25 >> throwIO (ConnectionLost "lost")
              request -> asking request
            at = fakeDatabase fake
        withFleet at {opening = \limit use -> opening at limit (use . over)} (Robot "amy" []) $ \amy ->
          withRobot amy (Robot "bob" []) $ \bob -> do
            Signal.waitUntil (databaseUp amy)
            times <- allOf [now <* holding amy door 3 (\_ -> pure ()), sleep 0.1 >> holding bob charger 3 (const now)]
            pure (times !! 1)) >>= well
      time `shouldSatisfy` (< 1)

  it "is kept although many others wait, and the answers to them are late" $ do
    run <- simulate $ do
      fake <- newFakeDatabase
      let late session = session {ask = answers (ask session)}
          answers :: (Request r -> Behavior (Either Refusal r)) -> Request r -> Behavior (Either Refusal r)
          answers asking = \case
            Hold wish | map Text.unpack (Set.toList (wishFor wish)) == ["door"] -> sleep 0.25 >> pure (Left Busy)
            request -> asking request
          at = fakeDatabase fake
      withFleet at {opening = \limit use -> opening at limit (use . late)} (Robot "amy" []) $ \amy -> do
        Signal.waitUntil (databaseUp amy)
        let others = allOf [withRobot amy (Robot ("robot " ++ show n) []) passes | n <- [1 .. 20 :: Int]]
        firstOf [holding amy charger 3 (\_ -> sleep 30 >> now), 0 <$ others]
    well run >>= (`shouldSatisfy` (> 29))

  it "is not kept from others for long by robots that have died while they waited" $ do
    found <- day $ \fake robots noting -> case robots of
      [one, other, third] -> do
        isDead <- newTVarIO False
        let inFleet = withFleet (cutOff isDead (fakeDatabase fake)) (Robot "dan" [])
            waits = inFleet (\dan -> holding dan door 2 (\_ -> pure ()))
            passesLater (n, robot) = sleepUntil 8 >> holding robot door 2 (\_ -> noting n (pure ()))
        void . allOf $
          [ holding one door 2 (\_ -> sleep 8)
          , firstOf [waits, sleepUntil 7.5 >> atomically (writeTVar isDead True)]
          , passesLater (1, one) >> passesLater (2, other) >> passesLater (3, third)
          ]
      _ -> pure ()
    -- (The first one waits for half a second for the one that has died, the others do not.)
    found `shouldSatisfy` \case
      [(1, begun, _), _, (3, _, over)] -> begun < 9 && over < begun + 0.1
      _ -> False

  it "is asked for again by the robot whose turn it is, not by all that wait" $ do
    asked <- newIORef (0 :: Int)
    let counted session = session {ask = counting (ask session)}
        counting :: (Request r -> Behavior (Either Refusal r)) -> Request r -> Behavior (Either Refusal r)
        counting asking request = case request of
          Hold _ -> modifyIORef' asked (+ 1) >> asking request
          _ -> asking request
    run <- simulate $ do
      at <- fakeDatabase <$> newFakeDatabase
      withFleet at {opening = \limit use -> opening at limit (use . counted)} (Robot "amy" []) $ \amy -> do
        sleep 1 -- (The first poll is over.)
        void (allOf [withRobot amy (Robot name []) passes | n <- [1 .. 20 :: Int], let name = "robot " ++ show n])
    _ <- well run
    -- (Once when it comes, and once when it is its turn; the first robot only once.)
    readIORef asked `shouldReturn` 39

  it "is had in order by those behind one that has died when it was the first" $ do
    found <- day $ \fake robots noting -> case robots of
      [one, other, third] -> do
        isDead <- newTVarIO False
        let waits = withFleet (cutOff isDead (fakeDatabase fake)) (Robot "dan" []) $ \dan ->
              holding dan door 2 (\_ -> pure ())
            dies = sleepUntil 2.5 >> atomically (writeTVar isDead True)
        inTurn
          [ holding one door 2 (\_ -> noting 1 (sleep 3))
          , firstOf [waits, dies]
          , holding other door 2 (\_ -> noting 2 (sleep 1))
          , holding third door 2 (\_ -> noting 3 (sleep 1))
          ]
      _ -> pure ()
    found `shouldSatisfy` \case
      [(1, _, over), (2, begun, over'), (3, begun', _)] ->
        begun >= over + 0.5 && begun < over + 0.76 && begun' >= over' && begun' < over' + 0.1
      _ -> False

  it "whose waiting robot is stopped is not kept from the next one" $ do
    found <- day $ \_ robots noting -> case robots of
      [one, other, third] ->
        inTurn
          [ holding one door 2 (\_ -> noting 1 (sleep 5))
          , timeout 2 (holding other door 2 (\_ -> noting 2 (sleep 5))) ? pure ()
          , holding third door 2 (\_ -> noting 3 (sleep 5))
          ]
      _ -> pure ()
    found `shouldBe` [(1, 0.1, 5.1), (3, 5.1, 10.1)]

  it "is waited for within a limit, which is none of its use" $ do
    found <- day $ \_ robots noting -> case robots of
      [one, other, third] -> inTurn
        [ holding one door 2 (\_ -> noting 1 (sleep 5))
        , holdingWithin 3 other door 2 (\_ -> noting 2 (sleep 5)) ? pure ()
        , holdingWithin 10 third door 2 (\_ -> noting 3 (sleep 20))
        ]
      _ -> pure ()
    found `shouldBe` [(1, 0.1, 5.1), (3, 5.1, 25.1)]

  it "that is waited for within a limit fails for its own reasons, too" $ do
    ends <- newIORef []
    _ <- day $ \fake robots _ -> case robots of
      one : _ -> do
        let ending which seconds = do
              end <- tryAny (holdingWithin 100 one which seconds (\_ -> pure ()))
              modifyIORef' ends (either show show end :)
        ending door 0.01
        ending (resource "") 1
        atomically (setReachable fake False)
        ending door 1
        atomically (setReachable fake True)
      _ -> pure ()
    reverse <$> readIORef ends `shouldReturn`
      [ "wait for door: NotAllowed \"a term has 0.1 seconds to 1 day\""
      , "wait for : NotAllowed \"the name of a resource has 1 to 200 characters\""
      , "wait for door: NoDatabase \"the fake database\" 60.0 \"connection refused\""
      ]

  it "is waited for, and given up, without the loss of a connection" $ do
    found <- day $ \fake robots noting -> case robots of
      one : other : _ -> holding one door 3 $ \_ -> do
        Signal.waitUntil (databaseUp other)
        -- (Each time it is interrupted in the middle of a statement.)
        atomically (willAnswer fake (replicate 1000 (After 0.02)))
        firstOf
          [ replicateM_ 5 (timeout 0.01 (holding other door 3 (\_ -> pure ())) ? pure ())
          , Signal.waitUntil (not <$> databaseUp other) >> noting 1 (pure ())
          ]
      _ -> pure ()
    found `shouldBe` []

  it "has a name of 1 to 200 characters, and a term of 0.1 s to a day" $ do
    let refused which seconds why =
          day (\_ robots _ -> forM_ robots $ \robot -> holding robot which seconds (\_ -> pure ()))
            `shouldThrow` errorCall ("it failed: wait for " ++ why)
    refused (resource "") 1 ": the name of a resource has 1 to 200 characters"
    refused door 0.01 "door: a term has 0.1 seconds to 1 day"
    refused door (1 / 0) "door: a duration is a finite number of seconds, not Infinity"
    refused (resource "a\0b") 1 "a\0b: a text has no character U+0000: \"a\\NULb\""

passes :: Fleet -> Behavior ()
passes robot = holding robot door 2 (\_ -> sleep 0.1)

door, charger :: Resource
door = resource "door"
charger = resource "charger"

-- | Runs them side by side: the first begins after a tenth of a second, and each further one after another tenth.
inTurn :: [Behavior ()] -> Behavior ()
inTurn behaviors = void (allOf [sleep (0.1 * n) >> behavior | (n, behavior) <- zip [1 ..] behaviors])

-- | Three robots of two processes. Gives who was where, from when to when, in the order of the ends.
day :: (FakeDatabase -> [Fleet] -> (Int -> Behavior () -> Behavior ()) -> Behavior ()) -> IO [(Int, Seconds, Seconds)]
day act = do
  stays <- newIORef []
  let noting n doing = now >>= \begun -> doing `finally` (now >>= \over -> modifyIORef' stays ((n, begun, over) :))
  run <- simulate $ do
    fake <- newFakeDatabase
    withFleet (fakeDatabase fake) (Robot "amy" []) $ \one ->
      withFleet (fakeDatabase fake) (Robot "bob" []) $ \other ->
        withRobot other (Robot "cleo" []) $ \third -> act fake [one, other, third] noting
  _ <- well run
  reverse <$> readIORef stays
