{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Scripted actions and sensors.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Action
  ( action
  , actionOn
  , sensor
  ) where

import Control.Concurrent.STM (retry)
import Control.Exception
import Control.Monad (unless, when)
import Data.Foldable (traverse_)
import Data.IORef
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe)

import Behavior.Internal.Failure (Behavior, Failed (..), isCancellation, isFailure)
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Script
import Behavior.Internal.Mock.World
import Behavior.Internal.Runtime
import Behavior.Internal.Sim.Text

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | Makes an action of this name, whose n-th call does what the n-th script says; the
-- last script repeats for ever.
--
-- On record come its beginning, how it ends, and when it heard that it was to stop.
-- 'Succeeds' is on record if and only if the action returns. (A cancellation may
-- come right behind, as behind any action.) Which call gets which
-- script is exact, whoever calls at the same time.
--
-- No script, or a name that something else in this world has, is refused with an
-- 'ErrorCall'.
--
-- >>> openDoor <- action mock "open door" [fails "locked", succeeds]
-- >>> attempt 3 openDoor
-- >>> mock `shouldRecord` exactly 1 (failureOf "open door") <> exactly 2 (startOf "open door")
--
-- >>> action mock "close door" [] :: IO (Behavior ())
-- *** Exception: action "close door": at least one script is needed; the last one repeats for ever
--
-- @since 0.1.0.0
action :: Mock -> String -> [Script a] -> IO (Behavior a)
action mock name scripts = do
  checkScripts ("action " ++ show name) scripts
  registerName mock "action" name
  calls <- newIORef Map.empty
  pure (play mock (nextCall mock calls name "" scripts))

-- | 'action' with an argument: each argument has scripts, and calls, of its own.
--
-- >>> let doors door = if door == "front" then [fails "locked"] else [returning door]
-- >>> leaveBy <- actionOn mock "leave by" doors
-- >>> fallbackOver ["front", "back"] leaveBy
-- "back"
-- >>> mock `shouldRecord` failureOf "leave by \"front\"" `comesBefore` startOf "leave by \"back\""
--
-- @since 0.1.0.0
actionOn :: Show x => Mock -> String -> (x -> [Script a]) -> IO (x -> Behavior a)
actionOn mock name scripts = do
  registerName mock "action" name
  calls <- newIORef Map.empty
  pure $ \x -> do
    -- Those of an argument can be checked only by one who has the argument.
    checkScripts ("action " ++ show (name ++ " " ++ show x)) (scripts x)
    play mock (nextCall mock calls name (show x) (scripts x))

-- | Makes a sensor of this name, whose n-th reading does what the n-th script says; the
-- last script repeats for ever.
--
-- It is an 'action', but one that would fill the record: on record comes only what a
-- reading gives when that is not what the last one gave, and each reading that
-- fails or faults.
--
-- >>> camera <- sensor mock "camera" [returning 3, fails "no picture", returning 5]
-- >>> Signal.waitUntil ((== 5) <$> Signal.polling 0.001 (camera ? camera))
-- >>> mock `shouldRecord` failureOf "camera" `comesBefore` becoming "camera" 5
--
-- @since 0.1.0.0
sensor :: Show a => Mock -> String -> [Script a] -> IO (Behavior a)
sensor mock name scripts = do
  checkScripts ("sensor " ++ show name) scripts
  registerName mock "sensor" name
  calls <- newIORef Map.empty
  newest <- newIORef Nothing
  let say t what = recordEntry mock (RecordEntry t name "" 1 what)
      telling =
        Reporting
          { says = \t what -> when (isTrouble what) (say t what)
          , gives = \t a -> do
              let value = Just (show a)
              old <- atomicModifyIORef' newest (\old -> (value, old))
              unless (value == old) (traverse_ (say t . Becomes) value)
          }
  pure . play mock $ do
    (_, script) <- takeTurn calls "" scripts
    pure (script, telling)
 where
  isTrouble what = case what of
    Fails _ -> True
    Faults _ -> True
    _ -> False

-- | How a call puts on record what happens to it.
data Reporting a = Reporting
  { says :: Seconds -> EntryKind -> IO ()
  , gives :: Seconds -> a -> IO ()
  -- ^ It returns this.
  }

-- | The number of the next call with each argument, and the scripts from there on.
type Calls a = IORef (Map String (Int, [Script a]))

-- | The script whose turn it is, and how to tell of it.
nextCall :: Mock -> Calls a -> String -> String -> [Script a] -> IO (Script a, Reporting a)
nextCall mock calls name x scripts = do
  (n, script) <- takeTurn calls x scripts
  let say t what = recordEntry mock (RecordEntry t name x n what)
  pure (script, Reporting {says = say, gives = \t _ -> say t Succeeds})

-- | Takes the number of the call and its script, in one step, whoever calls at the
-- same time.
takeTurn :: Calls a -> String -> [Script a] -> IO (Int, Script a)
takeTurn calls x scripts = atomicModifyIORef' calls $ \old ->
  let (new, turn) = next (Map.findWithDefault (1, scripts) x old) in (Map.insert x new old, turn)
 where
  next (n, script : others) = ((n + 1, if null others then [script] else others), (n, script))
  next (_, []) = errorWithoutStackTrace "unreachable: no script"

-- | Plays one call.
play :: Mock -> IO (Script a, Reporting a) -> Behavior a
play mock next = do
  -- Here, while the time is asked for, a cancellation comes before all else.
  (zero, begun) <- clock mock
  mask $ \restore -> do
    (script, telling) <- next
    let present = (\(_, t) -> t - zero) <$> clock mock
        say what = present >>= \t -> says telling t what
        itsTime = pass (lasts script) begun
        finish = do
          caused <- try (effect script)
          case caused >> end script of
            Left e -> say (ending e) >> throwIO e
            -- From the record to the end there is no operation of the seam.
            Right a -> present >>= \t -> a <$ gives telling t a
        cleanUp seconds instead e = do
          when (seconds > 0) $ now >>= uninterruptibleMask_ . pass seconds
          say (maybe Stops ending instead)
          throwIO (fromMaybe e instead)
    says telling (begun - zero) Begins
    try (restore itsTime) >>= \heard -> case (heard, stopping script) of
      (Right (), _) -> finish
      (Left e, CleansUp seconds instead) -> say StopRequested >> cleanUp seconds instead (e :: SomeException)
      (Left _, GoesOn) -> say StopRequested >> uninterruptibleMask_ itsTime >> finish

-- | Lets so many seconds pass from a moment on. Even if there are none, it is a
-- point where a cancellation can arrive.
pass :: Seconds -> Seconds -> IO ()
pass seconds since
  | seconds <= 0 = checkpoint
  | isInfinite (realToFrac seconds :: Double) = atomically retry
  | otherwise = sleepUntil (since + seconds)

-- | What is to be said of an end with this exception.
ending :: SomeException -> EntryKind
ending e
  | isCancellation e = Stops
  | isFailure e = Fails (safeShow (maybe (show e) reason (fromException e)))
  | otherwise = Faults (safeShow (show e))
 where
  reason (FailedBecause why) = why
  reason Failed = "for no reason given"

-- | Refuses what can be no script for an action. Of endlessly many only so many can be
-- looked at beforehand.
checkScripts :: String -> [Script a] -> IO ()
checkScripts who scripts = do
  when (null scripts) . throwIO . ErrorCall $
    who ++ ": at least one script is needed; the last one repeats for ever"
  traverse_ (checkScript who) (take 1000 scripts)
