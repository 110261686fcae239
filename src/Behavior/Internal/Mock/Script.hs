{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE DeriveFunctor #-}

-- |
-- Scripts: what a scripted action does in one call.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Script
  ( Script (..)
  , Stopping (..)

    -- * How it ends
  , succeeds
  , returning
  , fails
  , faults
  , throws
  , hangs

    -- * How long it takes, and what it causes
  , taking
  , causing

    -- * What it does when its stop is requested
  , slowToStop
  , failsStopping
  , faultsStopping
  , completesAnyway

    -- * Checking
  , checkScript
  ) where

import Control.Exception (ErrorCall (..), Exception (..), SomeException)
import Data.Foldable (for_)

import Behavior.Internal.Core.Failure (Behavior, Failed (..))
import Behavior.Internal.Core.Seconds (Seconds, duration)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | What a scripted action does in one call: how it ends, how long it takes, what
-- it causes, and what it does when its stop is requested.
--
-- > fails "locked" `taking` 0.5
-- > succeeds `taking` 20 `causing` set batteryLow False `slowToStop` 2
--
-- @since 0.1.0.0
data Script a = Script
  { lasts :: Seconds
  , effect :: Behavior ()
  , end :: Either SomeException a
  , stopping :: Stopping
  }
  deriving (Functor)

-- | What a scripted action does when its stop is requested.
data Stopping
  = -- | It cleans up for the given time, uninterruptibly. Then it stops, or throws the
    -- given exception instead.
    CleansUp Seconds (Maybe SomeException)
  | -- | It ignores the request.
    GoesOn

-- | Succeeds at once.
--
-- > succeeds  =  returning ()
--
-- @since 0.1.0.0
succeeds :: Script ()
succeeds = returning ()

-- | Returns the given result at once.
--
-- >>> look <- action mock "look" [returning "a cat", returning "a dog"]
-- >>> look >> look
-- "a dog"
--
-- @since 0.1.0.0
returning :: a -> Script a
returning = ending . Right

ending :: Either SomeException a -> Script a
ending how = Script {lasts = 0, effect = pure (), end = how, stopping = CleansUp 0 Nothing}

-- | Fails at once, with 'FailedBecause' the given reason.
--
-- >>> open <- action mock "open door" [fails "locked", succeeds]
-- >>> open ? open
--
-- @since 0.1.0.0
fails :: String -> Script a
fails = throws . FailedBecause

-- | Faults at once: throws an 'Control.Exception.ErrorCall', as a bug would.
--
-- >>> drive <- action mock "drive" [faults "wheel came off" :: Script ()]
-- >>> drive ? putStrLn "a fault is never recovered from"
-- *** Exception: wheel came off
--
-- @since 0.1.0.0
faults :: String -> Script a
faults = throws . ErrorCall

-- | Throws the given exception at once. It is recorded as a failure if it is one (a
-- 'Behavior.BehaviorFailed'), otherwise as a fault.
--
-- >>> grasp <- action mock "grasp" [throws (userError "no hand") :: Script ()]
-- >>> grasp
-- *** Exception: user error (no hand)
--
-- @since 0.1.0.0
throws :: Exception e => e -> Script a
throws = ending . Left . toException

-- | Runs until its stop is requested.
--
-- @since 0.1.0.0
hangs :: Script a
hangs = faults "unreachable: an infinite time has passed" `taking` (1 / 0)

-- | Takes the given number of seconds (zero or more; possibly infinite) before it ends.
--
-- > script `taking` 0             =  script
-- > script `taking` s `taking` t  =  script `taking` (s + t)
--
-- It waits by 'Behavior.sleep': in a simulation that takes no real time.
--
-- >>> wait <- action mock "wait" [succeeds `taking` 0.001]
-- >>> wait
--
-- A negative number or NaN is rejected by the function that the script is given to.
--
-- @since 0.1.0.0
taking :: Script a -> Seconds -> Script a
taking script seconds = script {lasts = lasts script + seconds}

-- | Runs the given effect when the time of the action is over, right before it ends.
--
-- The effect runs with exceptions masked; what it throws, the action throws. Usually it
-- 'Behavior.Sim.Mock.set's a condition. An action that is stopped before its time is
-- over causes nothing.
--
-- >>> low <- condition mock "battery low" [(0, True)]
-- >>> recharge <- action mock "recharge" [succeeds `causing` set low False]
-- >>> recharge >> reading low
-- False
--
-- @since 0.1.0.0
causing :: Script a -> Behavior () -> Script a
causing script more = script {effect = effect script >> more}

-- | When its stop is requested, it cleans up for the given number of seconds (zero or
-- more), uninterruptibly. Applied twice, the times add up.
--
-- @since 0.1.0.0
slowToStop :: Script a -> Seconds -> Script a
slowToStop script seconds = case stopping script of
  CleansUp s instead -> script {stopping = CleansUp (s + seconds) instead}
  GoesOn -> script

-- | When its stop is requested, its cleanup fails for the given reason; this failure
-- replaces the cancellation.
--
-- @since 0.1.0.0
failsStopping :: Script a -> String -> Script a
failsStopping script = throwsStopping script . FailedBecause

-- | When its stop is requested, its cleanup faults; this fault replaces the
-- cancellation.
--
-- @since 0.1.0.0
faultsStopping :: Script a -> String -> Script a
faultsStopping script = throwsStopping script . ErrorCall

throwsStopping :: Exception e => Script a -> e -> Script a
throwsStopping script e = case stopping script of
  CleansUp s _ -> script {stopping = CleansUp s (Just (toException e))}
  GoesOn -> script

-- | When its stop is requested, it ignores that and continues uninterruptibly: it ends
-- in the same way and at the same time as without the request. (So nothing stops one
-- that 'hangs'.)
--
-- @since 0.1.0.0
completesAnyway :: Script a -> Script a
completesAnyway script = script {stopping = GoesOn}

-- | Rejects a script whose times are negative or NaN.
checkScript :: String -> Script a -> IO ()
checkScript owner script = do
  _ <- duration owner (lasts script)
  for_ [s | CleansUp s _ <- [stopping script]] (duration owner)
