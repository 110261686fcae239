{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The properties that are being tested, each in a thread; the mistakes that make such a test void, and what its
-- claims presuppose.
--
-- A mistake is thrown where it is made, but a behaviour or the property itself may catch that. So it is
-- also kept, and thrown again when the property has ended.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Property
  ( Property
  , testing
  , keepMistake
  , mistakeOf
  , keepPremises
  , premisesOf
  , threadProperty
  ) where

import Control.Concurrent (myThreadId)
import Control.Exception (Exception (toException), SomeException, bracket_, evaluate)
import Control.Monad (mplus)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import System.IO.Unsafe (unsafePerformIO)

import Behavior.Internal.Core.ThreadNumber

-- | One test of a property.
data Property = Property
  { mistake :: IORef (Maybe SomeException)
  , premises :: IORef (Map String Bool)
  }
  deriving (Eq)

-- | The properties by the numbers of their threads. (If the threads themselves were kept here, GHC could not find
-- them deadlocked.)
properties :: IORef (IntMap Property)
properties = unsafePerformIO (newIORef IntMap.empty)
{-# NOINLINE properties #-}

-- | Runs a test of a property in the calling thread.
testing :: (Property -> IO a) -> IO a
testing test = do
  me <- threadNumber <$> myThreadId
  around <- IntMap.lookup me <$> readIORef properties
  property <- Property <$> newIORef Nothing <*> newIORef Map.empty
  bracket_ (change (IntMap.insert me property)) (change (IntMap.alter (const around) me)) (test property)
 where
  change f = atomicModifyIORef' properties (\these -> (f these, ()))

-- | Keeps the mistake, if it is the first.
keepMistake :: Exception e => Property -> e -> IO ()
keepMistake this e = atomicModifyIORef' (mistake this) (\old -> (old `mplus` Just (toException e), ()))

-- | The first mistake that was made in it.
mistakeOf :: Property -> IO (Maybe SomeException)
mistakeOf = readIORef . mistake

-- | Keeps the premises of a claim, in words, each with whether it has come.
keepPremises :: Property -> [(String, Bool)] -> IO ()
keepPremises this these = do
  new <- evaluate (Map.fromListWith (||) these)
  atomicModifyIORef' (premises this) (\old -> (Map.unionWith (||) old new, ()))

-- | The premises of its claims, each with whether it has come.
premisesOf :: Property -> IO (Map String Bool)
premisesOf = readIORef . premises

-- | The property that the calling thread runs, outside of its simulation.
threadProperty :: IO (Maybe Property)
threadProperty = IntMap.lookup . threadNumber <$> myThreadId <*> readIORef properties
