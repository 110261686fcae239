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

import Behavior.Internal.Core.Failure (Behavior, Failed (..), isCancellation, isFailure)
import Behavior.Internal.Core.SafeText
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Script
import Behavior.Internal.Mock.Subject (SubjectKind (..))
import Behavior.Internal.Mock.World
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Spans.Span (actionSpan)

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | Makes an action with the given name, whose n-th call follows the n-th script; the
-- last script is used for all further calls.
--
-- It records its beginning, its end, and the stop request if it receives one. In a trace it is a span
-- with its name ("Behavior.Trace").
-- 'Succeeds' is recorded if and only if the action returns. (A cancellation may
-- arrive right after that, as after any action.) The n-th call takes the n-th script
-- also when calls are concurrent.
--
-- An empty list of scripts, or a name that is already used in this world, is rejected
-- with an 'ErrorCall'.
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
  register mock AnAction name
  calls <- newIORef Map.empty
  pure (actionSpan name (play mock (nextCall mock calls name "" scripts)))

-- | 'action' with an argument: each argument has its own scripts and its own count of
-- calls.
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
  register mock AnActionOn name
  calls <- newIORef Map.empty
  pure $ \x -> do
    -- The scripts of an argument can be checked only when the argument is known.
    checkScripts ("action " ++ show (name ++ " " ++ show x)) (scripts x)
    actionSpan (name ++ " " ++ show x) (play mock (nextCall mock calls name (show x) (scripts x)))

-- | Makes a sensor with the given name, whose n-th reading follows the n-th script; the
-- last script is used for all further readings.
--
-- It is like an 'action' but records less: a value only if it differs from the value
-- before, and each reading that fails or faults.
--
-- >>> camera <- sensor mock "camera" [returning 3, fails "no picture", returning 5]
-- >>> Signal.waitUntil ((== 5) <$> Signal.polling 0.001 (camera ? camera))
-- >>> mock `shouldRecord` failureOf "camera" `comesBefore` becoming "camera" 5
--
-- @since 0.1.0.0
sensor :: Show a => Mock -> String -> [Script a] -> IO (Behavior a)
sensor mock name scripts = do
  checkScripts ("sensor " ++ show name) scripts
  register mock ASensor name
  calls <- newIORef Map.empty
  newest <- newIORef Nothing
  let write t kind = recordEntry mock (RecordEntry t name "" 1 kind)
      recorder =
        Recorder
          { recordKind = \t kind -> when (isFailed kind) (write t kind)
          , recordResult = \t a -> do
              let value = Just (show a)
              old <- atomicModifyIORef' newest (\old -> (value, old))
              unless (value == old) (traverse_ (write t . Becomes) value)
          }
  pure . play mock $ do
    (_, script) <- nextScript calls "" scripts
    pure (script, recorder)
 where
  isFailed kind = case kind of
    Fails _ -> True
    Faults _ -> True
    _ -> False

-- | How a call records what it does.
data Recorder a = Recorder
  { recordKind :: Seconds -> EntryKind -> IO ()
  -- ^ Everything except a result.
  , recordResult :: Seconds -> a -> IO ()
  }

-- | For each argument the number of its next call, and the scripts from that call on.
type Calls a = IORef (Map String (Int, [Script a]))

-- | The script of the next call of an action, and how that call is recorded.
nextCall :: Mock -> Calls a -> String -> String -> [Script a] -> IO (Script a, Recorder a)
nextCall mock calls name x scripts = do
  (n, script) <- nextScript calls x scripts
  announceStart name
  let write t kind = recordEntry mock (RecordEntry t name x n kind)
  pure (script, Recorder {recordKind = write, recordResult = \t _ -> write t Succeeds})

-- | Takes the number of the call and its script, atomically.
nextScript :: Calls a -> String -> [Script a] -> IO (Int, Script a)
nextScript calls x scripts = atomicModifyIORef' calls $ \old ->
  let (new, taken) = next (Map.findWithDefault (1, scripts) x old) in (Map.insert x new old, taken)
 where
  next (n, script : others) = ((n + 1, if null others then [script] else others), (n, script))
  next (_, []) = errorWithoutStackTrace "unreachable: no script"

-- | Plays one call.
play :: Mock -> IO (Script a, Recorder a) -> Behavior a
play mock next = do
  -- A cancellation that arrives here, where the time is read, takes no script and
  -- leaves no entry.
  (zero, begun) <- clock mock
  mask $ \restore -> do
    (script, recorder) <- next
    let present = (\(_, t) -> t - zero) <$> clock mock
        write kind = present >>= \t -> recordKind recorder t kind
        itsTime = pass (lasts script) begun
        finish = do
          caused <- try (effect script)
          case caused >> end script of
            Left e -> write (ending e) >> throwIO e
            -- Between this entry and the end of the call there is no operation of the seam.
            Right a -> present >>= \t -> a <$ recordResult recorder t a
        cleanUp seconds instead e = do
          when (seconds > 0) $ now >>= uninterruptibleMask_ . pass seconds
          write (maybe Stops ending instead)
          throwIO (fromMaybe e instead)
    recordKind recorder (begun - zero) Begins
    try (restore itsTime) >>= \waited -> case (waited, stopping script) of
      (Right (), _) -> finish
      (Left e, CleansUp seconds instead) -> write StopRequested >> cleanUp seconds instead (e :: SomeException)
      (Left _, GoesOn) -> write StopRequested >> uninterruptibleMask_ itsTime >> finish

-- | Waits until the given number of seconds have passed since a moment. A cancellation
-- can arrive there, even if the number is zero.
pass :: Seconds -> Seconds -> IO ()
pass seconds since
  | seconds <= 0 = checkpoint
  | isInfinite (realToFrac seconds :: Double) = atomically retry
  | otherwise = sleepUntil (since + seconds)

-- | How an end with this exception is recorded.
ending :: SomeException -> EntryKind
ending e
  | isCancellation e = Stops
  | isFailure e = Fails (safeShow (maybe (show e) reason (fromException e)))
  | otherwise = Faults (safeShow (show e))
 where
  reason (FailedBecause why) = why
  reason Failed = "for no reason given"

-- | Rejects an empty list and invalid scripts. The list may be infinite, so only its
-- first 1000 scripts are checked.
checkScripts :: String -> [Script a] -> IO ()
checkScripts owner scripts = do
  when (null scripts) . throwIO . ErrorCall $
    owner ++ ": at least one script is needed; the last one repeats for ever"
  traverse_ (checkScript owner) (take 1000 scripts)
