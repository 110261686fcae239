{-# LANGUAGE LambdaCase #-}

-- |
-- Runs the listings: each in a new world, with a script of changes during the actions, and a
-- log of the robot's steps.
module Paper.Stage
  ( -- * Playing a listing
    playing
  , playingIn
  , Step (..)
  , failedBecause

    -- * The script
  , Scene (..)
  , untilInterrupted
  , failing
  , unwatched

    -- * Changes of the world
  , becomes
  , doorBecomes
  , batteryDropsTo
  , withoutSensors
  ) where

import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception (displayException, throw)
import Control.Monad (join, when)
import Data.List (stripPrefix)
import Data.Maybe (fromMaybe)
import Test.Hspec (shouldBe)

import Behavior (Behavior, Failed (..), failWith)
import Behavior.Internal.Seam.Runtime (liveThreadCount)
import Behavior.STM (atomically)
import Robot (inWorld)
import Support (Ending (..), ending, hang)
import World
import WorldChange (ChangeKind, WorldChange (action, changeKind))
import qualified WorldChange

-- | @playing setting script listing@: how the listing ended, and what the robot did. All
-- scenes of the script must have been used.
playing :: Setting -> [Scene] -> Behavior a -> IO (Ending a, [Step])
playing stage script listing = playingIn stage script (const listing)

-- | 'playing' with access to the world, to change it first.
playingIn :: Setting -> [Scene] -> (World -> Behavior a) -> IO (Ending a, [Step])
playingIn stage script listing = do
  scenes <- newTVarIO script
  let named name (During n _) = n == name
      act world name = join . atomically $ do
        (before, from) <- break (named name) <$> readTVar scenes
        case from of
          During _ scene : after -> scene world <$ writeTVar scenes (before ++ after)
          [] -> pure (pure ())
  world <- newWorld stage {lasting = act}
  end <- ending (inWorld world (listing world))
  unplayed <- readTVarIO scenes
  [name | During name _ <- unplayed] `shouldBe` []
  events <- happened world
  pure (end, steps events)

-- | What the robot did. It does one action at a time: each ends before the next begins.
data Step
  = Did String
  | FailedTo String String
  | InterruptedIn String
  | FaultedIn String String
  | OutOfTurn String ChangeKind
  deriving (Eq, Show)

steps :: [WorldChange] -> [Step]
steps = \case
  begun : ended : others
    | changeKind begun == WorldChange.Begins
    , action begun == action ended
    , Just step <- endOf (action ended) (changeKind ended) ->
        step : steps others
  event : others -> OutOfTurn (action event) (changeKind event) : steps others
  [] -> []
 where
  endOf name = \case
    WorldChange.Begins -> Nothing
    WorldChange.Done -> Just (Did name)
    WorldChange.Fails why -> Just (FailedTo name (fromMaybe why (stripPrefix (announcing "") why)))
    WorldChange.Interrupted -> Just (InterruptedIn name)
    WorldChange.Faults what -> Just (FaultedIn name what)
  announcing = displayException . FailedBecause

-- | How a listing ends that fails for this reason.
failedBecause :: String -> Ending a
failedBecause = FailedWith . show . FailedBecause

-- | What happens during the action with this name: the first such scene in its first run, and
-- so on. An action without a scene ends at once.
data Scene = During String (World -> Behavior ())

-- | The action goes on after the scene, until it is interrupted.
untilInterrupted :: (World -> Behavior ()) -> World -> Behavior ()
untilInterrupted scene world = scene world >> hang

failing :: String -> World -> Behavior ()
failing why _ = failWith why

-- | Fails when the library has a thread, for a sensor or for a branch.
unwatched :: World -> Behavior ()
unwatched _ = liveThreadCount >>= \n -> when (n > 0) (failWith "a thread is running")

becomes :: Condition -> Bool -> World -> Behavior ()
becomes condition value world = atomically (writeTVar (holds world condition) value)

doorBecomes :: Door -> DoorState -> World -> Behavior ()
doorBecomes door state world = atomically (writeTVar (doorIs world door) state)

batteryDropsTo :: Double -> World -> Behavior ()
batteryDropsTo percent world = setBattery world percent

-- | While the behaviour runs, reading a condition of the world fails.
withoutSensors :: Behavior a -> World -> Behavior a
withoutSensors behavior world = inWorld blind behavior
 where
  blind = world {holds = \_ -> throw (FailedBecause "the sensor is broken")}
