{-# LANGUAGE CPP #-}
{-# LANGUAGE FlexibleInstances #-}
{-# LANGUAGE MultiParamTypeClasses #-}
{-# LANGUAGE TypeFamilies #-}
{-# LANGUAGE TypeOperators #-}

-- |
-- The language with the surface syntax of the paper: with this module the paper's
-- complete listings compile as they are printed.
--
-- > {-# LANGUAGE RebindableSyntax #-}
-- > {-# LANGUAGE ScopedTypeVariables #-}
-- > module Example where
-- >
-- > import Behavior.Paper
-- > import Robot -- your actions: insideRoom, passThrough, close, ...
-- >
-- > bt = do if not insideRoom then passThrough door else return ();
-- >         close door
--
-- A module with a listing imports this module in place of the Prelude.
-- @RebindableSyntax@ keeps the Prelude out, and makes GHC take @if@ (and literals,
-- and @do@) from what is in scope: 'ifThenElse' here, everything else from the
-- Prelude. @ScopedTypeVariables@ is for the listing that defines 'fallback' by
-- 'catch'.
--
-- Besides what is described below, the module gives
--
-- * the Prelude, except 'not' and '>', which are overloaded here;
-- * "Behavior", except the names that are overloaded here: '?', 'parallel', @|||@,
--   'both' and 'fallbackOver' are those of "Behavior";
-- * 'throw' and 'catch'.
--
-- Nothing is implemented twice: every overloaded name stands for one of "Behavior" or
-- of the Prelude, chosen only by the type of its first argument. All other types
-- follow from that, so listings need no annotations.
--
-- Therefore the type of the first argument of 'fallback', 'attempt' and '>' must
-- be known: @5 > 3@ does not compile here, nor does @fallback failed (return 1)@. In
-- your own code, use "Behavior".
--
-- Some of the paper's listings do not do what its text states: the page of errata,
-- @docs/errata.md@, lists them.
module Behavior.Paper
  ( -- * Conditions
    Condition (..)
  , Conditional (..)
  , unless
  , Comparison (..)

    -- * What to do when something fails
  , Fallback (..)
  , Attempt (..)
  , attemptNTimes

    -- * Reacting while something runs
  , rSelect
  , monitor

    -- * The rest of the language
  , module Behavior
#ifndef __HADDOCK_VERSION__
    -- Haddock would list the whole Prelude here.
  , throw
  , catch
  , module Prelude
#endif
  ) where

import Control.Exception (catch, throw)
import qualified Control.Monad as Monad
import Prelude hiding (not, (>))
import qualified Prelude

import Behavior hiding (attempt, fallback, monitor, rSelect)
import qualified Behavior

-- $setup
-- >>> let insideRoom = return False :: Behavior Bool
-- >>> let doorClosed = return True :: Behavior Bool
-- >>> let batteryLevel = return 5 :: Behavior Int

-- | What @if@, 'unless', 'rSelect' and 'monitor' can test: a 'Bool', which never changes,
-- or a @'Behavior' Bool@, which is run to find out.
--
-- [Failure] A condition that fails is not \"false\": the operator that tests it fails.
-- [Fault] Likewise.
--
-- /Section 4.1 of the paper: a condition is a @Behavior Bool@./
--
-- @since 0.1.0.0
class Condition c where
  -- | Tests the condition, once.
  --
  -- > holds True       =  return True
  -- > holds condition  =  condition
  --
  -- @since 0.1.0.0
  holds :: c -> Behavior Bool

  -- | The opposite of a condition, tested by testing the condition.
  --
  -- > not condition  =  Prelude.not <$> condition
  --
  -- >>> not insideRoom
  -- True
  --
  -- /Section 3.3 of the paper./
  --
  -- @since 0.1.0.0
  not :: c -> c

  -- | Whether both conditions are true. The second is tested after the first, and only if
  -- the first is true. It binds like '&&'.
  --
  -- > left & right  =  do { l <- left; if l then right else return False }
  --
  -- >>> not insideRoom & doorClosed
  -- True
  --
  -- /Section 3.1 of the paper./
  --
  -- @since 0.1.0.0
  (&) :: c -> c -> c

infixr 3 &

-- | Of the Prelude: 'Prelude.not' and '&&'.
instance Condition Bool where
  holds = pure
  not = Prelude.not
  (&) = (&&)

-- | For @'Behavior' Bool@.
instance (m ~ Behavior, a ~ Bool) => Condition (m a) where
  holds = id
  not = fmap Prelude.not
  left & right = left >>= \l -> if l then right else pure False

-- | What an @if@ on a condition can choose between: anything if the condition is a
-- 'Bool'; behaviours if it is a @'Behavior' Bool@.
--
-- @since 0.1.0.0
class Condition c => Conditional c r where
  -- | The meaning of @if@ under @RebindableSyntax@. A @'Behavior' Bool@ is tested once, before
  -- a branch starts; unlike 'rSelect', it interrupts nothing afterwards.
  --
  -- > if condition then yes else no  =  do { c <- condition; if c then yes else no }
  --
  -- >>> ifThenElse insideRoom (putStrLn "stay") (putStrLn "go in")
  -- go in
  --
  -- >>> ifThenElse True 'y' 'n'
  -- 'y'
  --
  -- [Failure] If the condition fails, the whole @if@ fails, and neither branch runs.
  -- [Fault] Likewise.
  -- [Cancellation] Passes through.
  --
  -- /Section 3.3 of the paper./
  --
  -- @since 0.1.0.0
  ifThenElse :: c -> r -> r -> r

-- | The @if@ of Haskell.
instance Conditional Bool r where
  ifThenElse condition yes no = if condition then yes else no

-- | For @'Behavior' Bool@.
instance (m ~ Behavior, a ~ Bool, r ~ Behavior b) => Conditional (m a) r where
  ifThenElse condition yes no = condition >>= \c -> if c then yes else no

-- | @unless condition act@ tests the condition, once, and runs @act@ if it is false.
--
-- > unless condition act  =  if condition then return () else act
--
-- It fails (or faults) if the condition does, and then @act@ does not run.
--
-- >>> do unless insideRoom (putStrLn "go in"); putStrLn "close the door"
-- go in
-- close the door
--
-- /Section 3.3 of the paper (footnote), and Section 6./
--
-- @since 0.1.0.0
unless :: Condition c => c -> Behavior () -> Behavior ()
unless condition act = holds condition >>= \c -> Monad.unless c act

-- | What can be compared with '>': the values of any ordered type, and a behaviour
-- that returns one.
--
-- @since 0.1.0.0
class Comparison a b r where
  -- | Compares two values; or, given a behaviour, makes a condition of it.
  --
  -- > act > limit  =  (Prelude.> limit) <$> act
  --
  -- The condition fails (or faults) if the behaviour does.
  --
  -- >>> batteryLevel > 10
  -- False
  --
  -- >>> (12 :: Int) > 10
  -- True
  --
  -- /Section 3.2 of the paper./
  --
  -- @since 0.1.0.0
  (>) :: a -> b -> r

infix 4 >

-- | 'Prelude.>' on two values of one type.
instance {-# OVERLAPPABLE #-} (Ord a, b ~ a, r ~ Bool) => Comparison a b r where
  (>) = (Prelude.>)

-- | What a behaviour returns, compared with a value.
instance (Ord a, b ~ a, r ~ Behavior Bool) => Comparison (IO a) b r where
  act > limit = (Prelude.> limit) <$> act

-- | The arguments of 'fallback': two behaviours, or a list of inputs and a behaviour
-- to try on each.
--
-- @since 0.1.0.0
class Fallback s k r where
  -- | Runs the first behaviour; if that /fails/, runs the next.
  --
  -- > fallback first second  =  Behavior.fallback first second     =  first ? second
  -- > fallback inputs act    =  Behavior.fallbackOver inputs act
  --
  -- If everything fails, the last failure is thrown; on an empty list it fails with
  -- 'Failed'. Faults and cancellations pass through at once.
  --
  -- >>> fallback (putStrLn "pull" >> failWith "locked") (putStrLn "smash it")
  -- pull
  -- smash it
  --
  -- >>> fallback ["front", "back"] (\door -> if door == "back" then return door else failed)
  -- "back"
  --
  -- /Section 5 of the paper; on a list, the Introduction and Section 6./
  --
  -- @since 0.1.0.0
  fallback :: s -> k -> Behavior r

-- | Two behaviours: 'Behavior.fallback'.
instance (a ~ r, k ~ Behavior r) => Fallback (IO a) k r where
  fallback = Behavior.fallback

-- | A list of inputs: 'fallbackOver'.
instance k ~ (x -> Behavior r) => Fallback [x] k r where
  fallback = fallbackOver

-- | What 'attempt' can try: a behaviour, or one that still takes arguments.
--
-- @since 0.1.0.0
class Attempt b where
  -- | Tries a behaviour up to @n@ times; one that takes arguments, each time with the
  -- arguments that it is given.
  --
  -- > attempt n act    =  Behavior.attempt n act
  -- > attempt n act x  =  attempt n (act x)
  --
  -- The last failure is thrown as it is. With @n <= 0@ it fails at once with
  -- 'Failed', and nothing runs. Faults and cancellations pass through at once.
  --
  -- >>> let open door = putStrLn ("push " ++ door) >> failed :: Behavior ()
  -- >>> fallback ["front", "back"] (attempt 2 open)
  -- push front
  -- push front
  -- push back
  -- push back
  -- *** Exception: Failed
  --
  -- /Section 6 of the paper./
  --
  -- @since 0.1.0.0
  attempt :: Int -> b -> b

-- | 'Behavior.attempt'.
instance Attempt (IO a) where
  attempt = Behavior.attempt

-- | A behaviour that takes one more argument.
instance Attempt b => Attempt (x -> b) where
  attempt n act = attempt n . act

-- | 'attempt', by its name in the paper's introduction.
--
-- > attemptNTimes  =  attempt
--
-- >>> attemptNTimes 2 (putStrLn "push" >> failed) ? putStrLn "give up"
-- push
-- push
-- give up
--
-- /Figure 1 of the paper./
--
-- @since 0.1.0.0
attemptNTimes :: Attempt b => Int -> b -> b
attemptNTimes = attempt

-- | A reactive @if@, on any condition.
--
-- > rSelect test left right  =  Behavior.rSelect (holds test) left right
--
-- Result, failure, fault and cancellation are those of 'Behavior.rSelect'.
--
-- >>> rSelect (batteryLevel > 10) (putStrLn "task") (putStrLn "recharge")
-- recharge
--
-- /Definition 3.1 and Section 5 of the paper./
--
-- @since 0.1.0.0
rSelect :: Condition c => c -> Behavior a -> Behavior a -> Behavior a
rSelect test = Behavior.rSelect (holds test)

-- | One-sided interruption, on any condition.
--
-- > monitor test recovery task  =  Behavior.monitor (holds test) recovery task
--
-- Result, failure, fault and cancellation are those of 'Behavior.monitor'.
--
-- >>> monitor insideRoom (putStrLn "go in") (putStrLn "close the door")
-- close the door
--
-- /Definition 3.2 and Section 5 of the paper./
--
-- @since 0.1.0.0
monitor :: Condition c => c -> Behavior () -> Behavior a -> Behavior a
monitor test = Behavior.monitor (holds test)
