{-# LANGUAGE RankNTypes #-}

-- |
-- The operators as a record: a promise is a property of a 'Language'. The library's own
-- language must keep it, and a broken one must not.
module Promises.Language
  ( Language (..)
  , sound
  ) where

import Control.Exception (SomeException)
import Data.Foldable (traverse_)

import Behavior (Behavior, BehaviorFailed)
import qualified Behavior
import Behavior.Parallel (fork, scoped)
import qualified Behavior.Parallel as Parallel
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time (Seconds)
import qualified Behavior.Time as Time

-- | The operators that the promises are about.
data Language = Language
  { fallback :: forall a. Behavior a -> Behavior a -> Behavior a
  , attempt :: forall a. Int -> Behavior a -> Behavior a
  , failing :: forall a. Behavior a -> Behavior a
  -- ^ Turns every fault into a failure.
  , parallel :: forall a b. Behavior a -> Behavior b -> Behavior ()
  , both :: forall a b. Behavior a -> Behavior b -> Behavior ()
  , firstOf :: forall a. [Behavior a] -> Behavior a
  , allOf :: forall a. [Behavior a] -> Behavior [a]
  , decide :: forall a b. ([Maybe (Either BehaviorFailed a)] -> Maybe (Behavior b)) -> [Behavior a] -> Behavior b
  , beside :: forall a. [Behavior ()] -> Behavior a -> Behavior a
  -- ^ Forks the behaviours of the list in a scope, then runs the other as its body.
  , rSelect :: forall a. Signal Bool -> Behavior a -> Behavior a -> Behavior a
  , monitor :: forall a. Signal Bool -> Behavior () -> Behavior a -> Behavior a
  , whileHolding :: forall a. Signal Bool -> Behavior a -> Behavior a
  , timeout :: forall a. Seconds -> Behavior a -> Behavior a
  , polling :: forall a. Seconds -> Behavior a -> Signal a
  }

-- | The library's own.
sound :: Language
sound =
  Language
    { fallback = Behavior.fallback
    , attempt = Behavior.attempt
    , failing = Behavior.failingOn (const True :: SomeException -> Bool)
    , parallel = Behavior.parallel
    , both = Behavior.both
    , firstOf = Parallel.firstOf
    , allOf = Parallel.allOf
    , decide = Parallel.decide
    , beside = \others body -> scoped (\nursery -> traverse_ (fork nursery) others >> body)
    , rSelect = Signal.rSelect
    , monitor = Signal.monitor
    , whileHolding = Signal.whileHolding
    , timeout = Time.timeout
    , polling = Signal.polling
    }
