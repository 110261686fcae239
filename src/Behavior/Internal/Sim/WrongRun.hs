{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What is used in a run that it does not belong to.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Sim.WrongRun
  ( WrongRun (..)
  , withinProperty
  , isWithinProperty
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Exception (Exception, bracket_)
import Data.IORef (IORef, atomicModifyIORef', newIORef, readIORef)
import Data.Set (Set)
import qualified Data.Set as Set
import System.IO.Unsafe (unsafePerformIO)

-- | The fault of a behaviour that uses what belongs to another run; the text says what to do.
newtype WrongRun = WrongRun String

instance Show WrongRun where
  show (WrongRun why) = why

instance Exception WrongRun

-- | Runs the property of an exploration.
withinProperty :: IO a -> IO a
withinProperty act = do
  already <- isWithinProperty
  self <- myThreadId
  if already then act else bracket_ (change (Set.insert self)) (change (Set.delete self)) act
 where
  change f = atomicModifyIORef' propertyThreads (\known -> (f known, ()))

-- | Whether the calling thread runs the property of an exploration.
isWithinProperty :: IO Bool
isWithinProperty = Set.member <$> myThreadId <*> readIORef propertyThreads

propertyThreads :: IORef (Set ThreadId)
propertyThreads = unsafePerformIO (newIORef Set.empty)
{-# NOINLINE propertyThreads #-}
