{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A goal that was sent, and how it ended.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Sent
  ( Sent (..)
  , newSent
  , SentEnd (..)
  , mayStillRun
  , endWith
  , setOnce
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (when)
import Data.Aeson (Value)
import Data.Maybe (isNothing)
import Data.Text (Text)

import Behavior (Seconds)

-- | A goal that was sent, or waits to be sent.
data Sent = Sent
  { sentTo :: Text
  -- ^ The action.
  , sentIn :: !Int
  -- ^ The number of the connection.
  , feedback :: TVar (Maybe Value)
  , end :: TVar (Maybe SentEnd)
  , isSent :: TVar Bool
  -- ^ Whether it no longer waits to be sent.
  , cancelled :: TVar Bool
  -- ^ Whether we have asked the robot to cancel it.
  , arrivedBy :: TVar Seconds
  -- ^ When it has come to its server, or never will: some time after the next connection has begun.
  , isAbsent :: TVar Bool
  -- ^ Whether its server has said before that time, over a later connection, that none of its goals runs.
  }

-- | To this action, over that connection, with a place for its feedback.
newSent :: Text -> Int -> TVar (Maybe Value) -> STM Sent
newSent action connection latest =
  Sent action connection latest
    <$> newTVar Nothing <*> newTVar False <*> newTVar False <*> newTVar (1 / 0) <*> newTVar False

-- | How a goal ended, as far as we know.
data SentEnd
  = Ended !Int Value
  | Complained Text
  | -- | Its link was lost.
    Lost
  | -- | Its server has not confirmed in time that it has stopped.
    Unconfirmed

-- | Whether the goal may still run on the robot, although nothing waits for it.
mayStillRun :: SentEnd -> Bool
mayStillRun how = case how of
  Lost -> True
  Unconfirmed -> True
  _ -> False

-- | Ends the goal, unless it has ended.
endWith :: Sent -> SentEnd -> STM ()
endWith = setOnce . end

-- | Of several values only the first counts.
setOnce :: TVar (Maybe a) -> a -> STM ()
setOnce known what = readTVar known >>= \before -> when (isNothing before) (writeTVar known (Just what))
