{-# LANGUAGE GeneralizedNewtypeDeriving #-}
{-# LANGUAGE RankNTypes #-}

-- |
-- The seam without its switch, as if there were no simulation: what the library would
-- cost then.
module Behavior.Internal.Seam
  ( Label (..)
  , Seconds (..)
  , Event (..)
  , Simulator (..)
  , inSimulation
  ) where

import Control.Concurrent (ThreadId)
import Control.Concurrent.STM (STM)
import Control.Exception (SomeException)
import Numeric (showFFloat)

data Label = Label String String

instance Show Label where
  show (Label operator "") = operator
  show (Label operator branch) = operator ++ ": " ++ branch

newtype Seconds = Seconds Double
  deriving (Eq, Ord, Num, Fractional, Real, RealFrac)

instance Show Seconds where
  showsPrec precedence (Seconds s) = showParen (s < 0 && precedence > 6) (showFFloat Nothing s)

data Event = Started Label | Ended Label | Noted String

data Simulator = Simulator
  { spawn :: forall a. Label -> (IO () -> (forall b. IO b -> IO b) -> IO a) -> (a -> STM ()) -> IO ThreadId
  , deliver :: ThreadId -> SomeException -> IO ()
  , send :: ThreadId -> SomeException -> IO ()
  , transact :: forall a. STM a -> IO a
  , clock :: IO Seconds
  , await :: Seconds -> IO ()
  , pause :: IO ()
  , record :: Event -> IO ()
  }

inSimulation :: IO a -> (Simulator -> IO a) -> IO a
inSimulation really _ = really
{-# INLINE inSimulation #-}
