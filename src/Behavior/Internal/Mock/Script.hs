{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE DeriveFunctor #-}

-- |
-- What a scripted action does when it is called once.
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

    -- * What it does when it is asked to stop
  , slowToStop
  , failsStopping
  , faultsStopping
  , completesAnyway

    -- * Checking
  , checkScript
  ) where

import Control.Exception (ErrorCall (..), Exception (..), SomeException)
import Data.Foldable (for_)

import Behavior.Internal.Failure (Behavior, Failed (..))
import Behavior.Internal.Seconds (Seconds, duration)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | What a scripted action does in one call: how it ends, how long it takes, what
-- it causes, and what it does when it is asked to stop.
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

-- | What a scripted action does when it is asked to stop.
data Stopping
  = -- | It cleans up for so long, uninterruptibly, then lets itself be stopped, or
    -- throws this instead.
    CleansUp Seconds (Maybe SomeException)
  | -- | It does not heed.
    GoesOn

-- | Succeeds at once.
--
-- > succeeds  =  returning ()
--
-- @since 0.1.0.0
succeeds :: Script ()
succeeds = returning ()

-- | Returns this at once.
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

-- | Throws an exception of your own at once. It is on record as a failure if it is
-- one (a 'Behavior.BehaviorFailed'), else as a fault.
--
-- >>> grasp <- action mock "grasp" [throws (userError "no hand") :: Script ()]
-- >>> grasp
-- *** Exception: user error (no hand)
--
-- @since 0.1.0.0
throws :: Exception e => e -> Script a
throws = ending . Left . toException

-- | Goes on for ever, until it is asked to stop.
--
-- @since 0.1.0.0
hangs :: Script a
hangs = faults "the end of all time has come" `taking` (1 / 0)

-- | Takes so many seconds (zero or more; infinite is for ever) before it ends.
--
-- > script `taking` 0             =  script
-- > script `taking` s `taking` t  =  script `taking` (s + t)
--
-- The time passes by 'Behavior.sleep': under simulation in no time at all.
--
-- >>> wait <- action mock "wait" [succeeds `taking` 0.001]
-- >>> wait
--
-- A negative number is refused by what the script is given to, as is NaN.
--
-- @since 0.1.0.0
taking :: Script a -> Seconds -> Script a
taking script seconds = script {lasts = lasts script + seconds}

-- | Does this to the world when its time is over, right before it ends.
--
-- It runs with exceptions masked; what it throws, the action throws. Mostly it 'Behavior.Sim.Mock.set's
-- a condition. An action that is stopped before its time is over causes nothing.
--
-- >>> low <- condition mock "battery low" [(0, True)]
-- >>> recharge <- action mock "recharge" [succeeds `causing` set low False]
-- >>> recharge >> reading low
-- False
--
-- @since 0.1.0.0
causing :: Script a -> Behavior () -> Script a
causing script more = script {effect = effect script >> more}

-- | When it is asked to stop, it cleans up for so many seconds (zero or more), and
-- cannot be interrupted there. Said twice, it adds up.
--
-- @since 0.1.0.0
slowToStop :: Script a -> Seconds -> Script a
slowToStop script seconds = case stopping script of
  CleansUp s instead -> script {stopping = CleansUp (s + seconds) instead}
  GoesOn -> script

-- | When it is asked to stop, its cleanup fails for this reason, which takes the place
-- of the cancellation.
--
-- @since 0.1.0.0
failsStopping :: Script a -> String -> Script a
failsStopping script = throwsStopping script . FailedBecause

-- | When it is asked to stop, its cleanup faults, which takes the place of the
-- cancellation.
--
-- @since 0.1.0.0
faultsStopping :: Script a -> String -> Script a
faultsStopping script = throwsStopping script . ErrorCall

throwsStopping :: Exception e => Script a -> e -> Script a
throwsStopping script e = case stopping script of
  CleansUp s _ -> script {stopping = CleansUp s (Just (toException e))}
  GoesOn -> script

-- | When it is asked to stop, it goes on as if it had not been, and cannot be
-- interrupted any more: it ends as it would have ended, and as late. (So nothing stops
-- one that 'hangs'.)
--
-- @since 0.1.0.0
completesAnyway :: Script a -> Script a
completesAnyway script = script {stopping = GoesOn}

-- | Refuses a script that takes no length of time.
checkScript :: String -> Script a -> IO ()
checkScript who script = do
  _ <- duration who (lasts script)
  for_ [s | CleansUp s _ <- [stopping script]] (duration who)
