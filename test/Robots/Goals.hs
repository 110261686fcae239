{-# LANGUAGE OverloadedStrings #-}

-- |
-- Goals of which the program writes what it believes about them.
module Robots.Goals
  ( fibonacci
  , Sending
  , plainly
  , untilFeedback
  , believing
  , uninterrupted
  , interrupted
  , awaitServers
  , awaitReached
  ) where

import Control.Exception (SomeAsyncException, SomeException, displayException, fromException, throwIO, try)
import Control.Monad (unless, void, when)
import Data.Aeson (Value, object, (.=))
import qualified Data.Aeson.Key as Key
import Data.Foldable (for_)
import Data.IORef
import Data.Maybe (isJust)
import Data.Text (Text)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Robots.Campaign
import Ros.Stage (failureOrFault, fibonacci)

-- | Sends a goal with that order.
type Sending = Int -> Behavior Value

plainly :: Ros -> Action Value -> Sending
plainly ros which order = goal ros which (object ["order" .= order])

-- | The behaviour runs when the goal's server works on it.
untilFeedback :: Ros -> Action Value -> Behavior () -> Sending
untilFeedback ros which act order =
  goalWith ros which (object ["order" .= order]) $ \feedback -> Signal.waitUntil (True <$ feedback) >> act

-- | Sends a goal with that order, and writes when that was, when its stop was requested, when and how it ended, and
-- what it gave. What it throws is thrown.
believing :: Campaign -> Row -> [(Text, String)] -> Int -> IORef (Maybe Double) -> Sending -> Behavior ()
believing campaign row more order stopAt send = do
  begun <- clock
  how <- try (send order)
  ended <- clock
  stopped <- readIORef stopAt
  note campaign row $
    ["order" .= order, "begun" .= begun, "stop" .= stopped, "ended" .= ended, "outcome" .= outcome how]
      ++ ["result" .= result | Right result <- [how]]
      ++ ["why" .= displayException why | Left why <- [how]]
      ++ [Key.fromText name .= value | (name, value) <- more]
  either throwIO (const (pure ())) how

-- | What a goal's end is called there.
outcome :: Either SomeException a -> String
outcome how = case how of
  Right _ -> "completed"
  Left why
    | Just (StoppedWithFault _ fault) <- fromException why -> outcome (Left fault :: Either SomeException ())
    | Just name <- failureOrFault why -> name
    | isJust (fromException why :: Maybe SomeAsyncException) -> "stopped"
    | otherwise -> "other"

-- | Sends a goal whose stop is never requested. What it throws is thrown.
uninterrupted :: Campaign -> Row -> [(Text, String)] -> Sending -> Behavior ()
uninterrupted campaign row more send = do
  order <- newOrder campaign
  stopAt <- newIORef Nothing
  believing campaign row more order stopAt send

-- | Sends a goal whose stop is requested when the behaviour has ended: gives when that was. (Whatever the goal throws
-- is only written.)
interrupted :: Campaign -> Row -> [(Text, String)] -> Behavior () -> Sending -> Behavior (Maybe Double)
interrupted campaign row more instant send = do
  order <- newOrder campaign
  stopAt <- newIORef Nothing
  void . tryAny $
    firstOf [believing campaign row more order stopAt send, instant >> clock >>= writeIORef stopAt . Just]
  readIORef stopAt

-- | Waits until goals reach these servers over the bridge: one that has just started loses them. (They are sent over a
-- link of their own, and their orders are not written.)
awaitServers :: Campaign -> Row -> Transport -> [String] -> Behavior ()
awaitServers campaign row bridge names =
  awaitReached campaign row bridge
    [(name, \ros reach -> untilFeedback ros (replacing (fibonacci name)) reach) | name <- names]

-- | The same for any servers: each with what sends it a goal, and runs that behaviour when its feedback comes.
awaitReached :: Campaign -> Row -> Transport -> [(String, Ros -> Behavior () -> Sending)] -> Behavior ()
awaitReached campaign row bridge servers =
  withRosOptions defaultRosOptions {patience = 0.1} bridge $ \ros -> for_ servers $ \(name, send) -> do
    reached <- newTVarIO False
    let reach = atomically (writeTVar reached True)
        go n = do
          order <- newOrder campaign
          _ <- tryAny . timeout 0.3 $ firstOf [void (send ros reach order), atomically (readTVar reached >>= check)]
          there <- readTVarIO reached
          unless there (if n < 50 then go (n + 1) else failWith ("no goal reaches " ++ name))
          when there (note campaign row ["server" .= name, "lost by the bridge" .= (n - 1 :: Int)])
    go 1
