-- |
-- The greenhouse rover in mock greenhouses: its missions in virtual time, and its safety
-- rules under many schedules and on real threads.
module Examples.GreenhouseRoverSpec (spec) where

import Control.Exception (fromException, throwIO, try)
import Data.Foldable (for_)
import Data.IORef (modifyIORef, newIORef, readIORef)
import qualified Data.Map.Strict as Map
import Test.Hspec

import Beds
import Behavior
import Behavior.Parallel (fork, scoped)
import Behavior.STM
import Behavior.Sim
import Behavior.Sim.Mock
import GreenhouseRover
import GreenhouseWorld
import RoverTrial (asHspec)
import Support (guarded)

type Found = Map.Map Bed Finding

spec :: Spec
spec = guarded $ do
  describe "A mission" missions
  describe "Under many schedules" manySchedules
  it "keeps its rules on real threads, too" $ do
    (world, hardware) <- greenhouses calm {emergency = pressedAt 1}
    beds <- newBeds [Bed North 1]
    try (rover hardware beds) `shouldReturn` Left EmergencyStopped
    world `shouldRecord` safely <> stopped

missions :: Spec
missions = do
  it "inspects each bed, and ends in its dock" $ do
    (found, world) <- inspecting [Bed North 1, Bed South 1] calm
    found `shouldBe` Map.fromList (seen <$> [Bed North 1, Bed South 1])
    world `shouldRecord` whenever (successOf "camera Bed South 1") (eventually (becoming "position" (AtDock North)))
  it "inspects a bed that the operator adds meanwhile, and rejects one that it has already" $ do
    (world, hardware) <- greenhouses calm
    beds <- newBeds [Bed North 1]
    run <- simulate . scoped $ \nursery -> do
      _ <- fork nursery (sleep 2 >> mapM_ (atomically . addBed beds) [Bed South 1, Bed North 1])
      rover hardware beds
    found <- well run
    found `shouldBe` Map.fromList (seen <$> [Bed North 1, Bed South 1])
    world `shouldRecord` exactly 1 (startOf "camera Bed North 1")
  it "continues its list after charging" $ do
    (found, world) <- inspecting [Bed North 1, Bed North 2] calm {battery = [(0, 60), (4, 19.5), (4.5, 20.5)]}
    Map.size found `shouldBe` 2
    world `shouldRecord` successOf "camera Bed North 1" `comesBefore` startOf "charge"
    world `shouldRecord` successOf "charge" `comesBefore` successOf "camera Bed North 2"
    world `shouldRecord` once [Bed North 1, Bed North 2] <> exactly 1 (startOf "charge")
  it "charges in the other house when its dock is occupied" $ do
    (_, world) <- inspecting [Bed North 1] calm {battery = [(0, 60), (1, 10)], docks = occupied}
    world `shouldRecord` failureOf "charge North" `comesBefore` successOf "charge South"
    world `shouldRecord` eventually (successOf "camera Bed North 1")
  it "tries a camera that hangs three times, with pauses, and continues without the picture" $ do
    (found, world) <- inspecting [Bed North 1, Bed North 2] calm {pictures = hanging}
    found `shouldBe` Map.fromList [(Bed North 1, NotSeen "timed out after 2.0 s"), seen (Bed North 2)]
    record <- happened world
    let isWanted e = entrySubject e == "camera" && entryArgument e == "Bed North 1" && entryKind e == Begins
    map entryTime (filter isWanted (recordEntries record)) `shouldBe` [2.25, 5.25, 8.25]
  it "opens the door only while no person is near" $ do
    (_, world) <- inspecting [Bed South 1] calm {someone = [(0, True), (5, False), (5.3, True), (7, False)]}
    world `shouldRecord` never (successOf "open door" `during` being "someone near" True)
    world `shouldRecord` exactly 1 (interruptionOf "open door") <> eventually (successOf "open door")
  it "backs off when it bumps into something, and then drives on" $ do
    (found, world) <- inspecting [Bed North 1] calm {bumps = [(0, False), (1.2, True)]}
    Map.size found `shouldBe` 1
    world `shouldRecord` interruptionOf "steer to" `comesBefore` startOf "back off"
  it "stands still without a radio link, and continues when the link is back" $ do
    (found, world) <- inspecting [Bed North 1, Bed North 2] calm {radio = [succeeds, hangs, hangs, succeeds]}
    Map.size found `shouldBe` 2
    world `shouldRecord` once [Bed North 1, Bed North 2] <> exactly 1 (interruptionOf "steer to")
    world `shouldRecord` whenever (interruptionOf "steer to") (withinSeconds 1 (becoming "motors" False))
  it "follows changes of the mode, and then continues its list" $ do
    (found, world) <- inspecting [Bed North 1, Bed North 2] calm {orders = switched}
    Map.size found `shouldBe` 2
    world `shouldRecord` once [Bed North 1, Bed North 2] <> exactly 1 (startOf "joystick")
    world `shouldRecord` withinSeconds 2.5 (startOf "camera Bed North 1")
  it "writes a log, and continues when that fails" $ do
    written <- newIORef []
    _ <- inspecting [Bed North 1] calm {logged = \line -> modifyIORef written (line :)}
    readIORef written `shouldReturn` ["Bed North 1 ...", "mode: Auto"]
    (found, _) <- inspecting [Bed North 1] calm {logged = \_ -> throwIO (userError "the disk is full")}
    Map.size found `shouldBe` 1
 where
  occupied house = if house == North then [fails "occupied"] else docks calm house
  hanging bed = if bed == Bed North 1 then [hangs] else pictures calm bed
  -- The first change is too short to count.
  switched = [(0, Auto), (0.9, Manual), (1.4, Auto), (5, Manual), (7, Park), (9, Auto)]

manySchedules :: Spec
manySchedules = do
  it "stops its motors and parks its arm when the emergency stop is pressed, at any time" $
    for_ (quarters 24) $ \moment ->
      explored 5 calm {emergency = pressedAt moment, battery = [(0, 100), (3, 15)]} $ \world run -> do
        case outcome run of
          Threw e | Just EmergencyStopped <- fromException e -> pure ()
          other -> expectationFailure (explain other)
        world `shouldRecord` safely <> stopped
  it "inspects each bed once, with interruptions at any time" $
    for_ (quarters 16) $ \moment ->
      explored 4 (interruptedAt moment) $ \world run -> do
        found <- well run
        found `shouldBe` Map.fromList (seen <$> [Bed North 1, Bed South 1])
        world `shouldRecord` safely
 where
  quarters n = [fromIntegral i / 4 | i <- [1 .. n :: Int]]
  interruptedAt moment =
    calm
      { battery = [(0, 100), (moment, 15)]
      , orders = [(0, Auto), (moment, Manual), (moment + 1, Auto)]
      }
  explored n setting property = explore (randomly n) {planShowException = asHspec} $ \simulated -> do
    (world, hardware) <- greenhouses setting
    beds <- newBeds [Bed North 1, Bed South 1]
    simulated (rover hardware beds) >>= property world

-- | This must hold for every mission.
safely :: Claim
safely = never (being "motors" True `overlapping` being "arm out" True) <> once [Bed North 1, Bed South 1]

-- | This must hold when the emergency stop is pressed: a tenth of a second later the motors
-- are off and stay off, and the arm is parked at the end.
stopped :: Claim
stopped =
  never (being "motors" True `overlapping` (being "emergency stop" True `heldFor` 0.1))
    <> whenever (becoming "emergency stop" True) (eventually (successOf "park arm"))

-- | No bed is inspected again after a success.
once :: [Bed] -> Claim
once = foldMap $ \bed ->
  let name = "camera " ++ show bed
   in whenever (successOf name) (never (startOf name))

pressedAt :: Seconds -> [(Seconds, Bool)]
pressedAt moment = [(0, False), (moment, True)]

seen :: Bed -> (Bed, Finding)
seen bed = (bed, Picture ("picture of " ++ show bed))

inspecting :: [Bed] -> Setting -> IO (Found, Mock)
inspecting todo setting = do
  (world, hardware) <- greenhouses setting
  beds <- newBeds todo
  found <- simulate (rover hardware beds) >>= well
  pure (found, world)
