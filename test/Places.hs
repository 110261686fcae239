-- |
-- All the places where an operator runs a behaviour. The promises of every operator
-- are tested in each of them.
module Places
  ( OperatorPlace (..)
  , places
  , threaded
  , inCaller
  , theFailure
  ) where

import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Concurrent.STM.TSem (newTSem)
import Control.Exception (SomeException, throwIO)
import Control.Monad (void)
import Data.Foldable (traverse_)
import Data.Maybe (listToMaybe)

import Behavior
import Behavior.Internal.Seam.Runtime (Label (..))
import Behavior.Message (handleNext, messageRule, onMessage, withInbox)
import Behavior.Parallel (allOf, await, decide, firstOf, fork, pinned, scoped, unpinned)
import Behavior.STM (atomically, withTSem)
import qualified Behavior.Signal as Signal
import Behavior.Time (abandoning, timeout, timeoutAt)
import Behavior.Trace (named, withTrace)
import Support

-- | A place in an operator. All other branches of the operator do nothing: when the
-- behaviour in this place ends, the operator ends in the same way.
data OperatorPlace = OperatorPlace
  { placeName :: String
  , placeLabel :: Maybe Label
  -- ^ The label of the thread that runs the behaviour, if it is not the caller's.
  , placed :: Behavior () -> Behavior ()
  }

instance Show OperatorPlace where
  show = placeName

-- | The places where a behaviour runs in a thread of its own.
threaded :: [OperatorPlace]
threaded = [place | place@OperatorPlace {placeLabel = Just _} <- places]

-- | The places where it runs in the caller's thread.
inCaller :: [OperatorPlace]
inCaller = [place | place@OperatorPlace {placeLabel = Nothing} <- places]

places :: [OperatorPlace]
places =
  [ inPlace "the first of ?" (? throwIO theFailure)
  , inPlace "the second of ?" (failed ?)
  , inPlace "the last of fallbackOver" $ \act ->
      fallbackOver [False, True] (\isLast -> if isLast then act else failed)
  , inPlace "attempt" (attempt 1)
  , inPlace "failingOn" (failingOn noException)
  , inPlace "named" (named "name")
  , inPlace "named, in a trace" (withTrace [] . named "name")
  , inThread "parallel" "left" (`parallel` hang)
  , inThread "parallel" "right" (hang |||)
  , inThread "both" "left" (`both` pure ())
  , inThread "both" "right" (both (pure ()))
  , inThread "firstOf" "1" (\act -> firstOf [act, hang, hang])
  , inThread "firstOf" "2" (\act -> firstOf [hang, act, hang])
  , inThread "allOf" "1" (\act -> void (allOf [act, pure (), pure ()]))
  , inThread "allOf" "3" (\act -> void (allOf [pure (), pure (), act]))
  , inThread "decide" "1" (\act -> decide firstEnd [act, hang])
  , inThread "decide" "2" (\act -> decide firstEnd [hang, act])
  , inPlace "what decide chooses" (\act -> decide (fmap (const act) . firstEnd) [pure ()])
  , inThread "scoped" "body" (\act -> scoped (const act))
  , inThread "scoped" "fork" $ \act ->
      scoped (\nursery -> fork nursery act >>= atomically . await)
  , inThread "pinned" "body" pinned
  , inThread "unpinned" "body" unpinned
  , inThread "timeout" "branch" (timeout 3600)
  , inThread "timeoutAt" "branch" (timeoutAt (1 / 0))
  , inThread "abandoning" "branch" (abandoning 3600)
  , inThread "rSelect" "left" (\act -> Signal.rSelect (pure True) act hang)
  , inThread "rSelect" "right" (\act -> rSelect (pure False) hang act)
  , inThread "monitor" "task" (monitor (pure False) hang)
  , inThread "monitor" "recovery" $ \act -> do
      needed <- newTVarIO True
      let recovery = atomically (writeTVar needed False) >> act
      Signal.monitor (Signal.watching (readTVar needed)) recovery (pure ())
  , inThread "switch" "branch" (\act -> Signal.switch (pure 'a') (const act))
  , inThread "teleoReactive" "rule 2" $ \act ->
      Signal.teleoReactive [(pure False, hang), (pure True, act)]
  , inThread "insteadWhen" "branch" (Signal.insteadWhen (pure False) hang)
  , inThread "insteadWhen" "emergency" (\act -> Signal.insteadWhen (pure True) act hang)
  , inThread "pausedWhile" "branch" (Signal.pausedWhile (pure False) hang hang)
  , inThread "stoppedWhile" "branch" (Signal.stoppedWhile (pure False))
  , inPlace "withTSem" (\act -> atomically (newTSem 1) >>= (`withTSem` act))
  , inThread "onMessage" "task" (\act -> withMessages [] (\inbox -> onMessage inbox (\() -> hang) act))
  , inThread "onMessage" "handler" $ \act ->
      withMessages [()] (\inbox -> onMessage inbox (\() -> pure () <$ act) (pure ()))
  , inThread "messageRule" "handler" $ \act -> withMessages [()] $ \inbox -> do
      rule <- messageRule inbox (\() -> pure () <$ act)
      Signal.teleoReactive [rule, (pure True, pure ())]
  , inPlace "the handler of handleNext" $ \act ->
      withMessages [()] (\inbox -> handleNext inbox (\() -> pure () <$ act))
  , inPlace "withInbox" (withMessages [()] . const)
  , inThread "whileHolding" "branch" (Signal.whileHolding (pure True))
  , inThread "withShared" "body" (\act -> Signal.withShared (pure ()) (const act))
  , inThread "waitUntil" "polling" $ \act ->
      Signal.waitUntil (Signal.polling 3600 (True <$ act))
  ]
 where
  withMessages messages = withInbox 1 (\deliver -> pure () <$ traverse_ deliver messages)
  firstEnd ends = listToMaybe [either throwIO pure end | Just end <- ends]
  inPlace name = OperatorPlace name Nothing
  inThread operator name = OperatorPlace (show label) (Just label) where label = Label operator name
  noException :: SomeException -> Bool
  noException _ = False

-- | The failure of a behaviour that fails in its place. In the first place of '?' the
-- second behaviour then runs; it fails with this failure too.
theFailure :: Failure
theFailure = Failure "in its place"
