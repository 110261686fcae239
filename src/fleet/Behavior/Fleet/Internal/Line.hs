{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- A connection that comes back. One behaviour at a time uses it; one that is interrupted in a statement leaves a
-- connection that is used no more.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Line
  ( Line
  , newLine
  , isThere
  , whyAway
  , isAwayFor
  , keeping
  , withSession
  , asking
  , askingFirst
  , posting
  , answering
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (forever, join, unless)
import Data.Maybe (isJust, isNothing)

import Behavior (Behavior, Seconds, StoppedWithFault (..), sleep, tryAny)
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Options
import Behavior.Parallel (firstOf)
import Behavior.STM (atomically)
import Behavior.Time (now)

-- | A connection, whenever there is one.
data Line = Line
  { place :: TVar Whereabouts
  , lastWhy :: TVar String
  , lineOptions :: FleetOptions
  , askedFirst, asked :: TQueue (Behavior ())
  -- ^ What callers have asked for, and its answer goes to them.
  }

-- | Where the connection is.
data Whereabouts
  = Nowhere
  | -- | Nowhere, and who asks for it is to have this fault.
    Refusing SomeException
  | Free Session
  | InUse
  | -- | It must not be used again; and why, if it was lost.
    Broken (Maybe String)

-- | One that has not connected yet.
newLine :: FleetOptions -> IO Line
newLine options =
  Line
    <$> newTVarIO Nowhere <*> newTVarIO "it has not connected yet" <*> pure options <*> newTQueueIO <*> newTQueueIO

-- | Whether there is a connection.
isThere :: Line -> STM Bool
isThere line = (\case Free _ -> True; InUse -> True; _ -> False) <$> readTVar (place line)

-- | Why there is no connection, or was none at last, or why what was asked for was not done.
whyAway :: Line -> STM String
whyAway = readTVar . lastWhy

-- | That is why.
isAwayFor :: Line -> String -> STM ()
isAwayFor = writeTVar . lastWhy

-- | Connects, and connects again whenever the connection is lost, with growing pauses. A server that does not answer in
-- time has twice as long the next time: for if many give it up and try again, it may have time for nothing else. The
-- first behaviour prepares a connection; the second runs beside its use. Says why there is no connection, when that
-- changes, and when there is one again.
keeping
  :: Database -> Line -> (Maybe String -> STM ()) -> (Session -> Behavior ()) -> (Session -> Behavior ()) -> Behavior a
keeping database line say prepare beside = newTVarIO Nothing >>= \said -> go said (connectAgainAfter options) firstLimit
 where
  options = lineOptions line
  go said pause limit = do
    usedFrom <- newTVarIO Nothing
    ended <- onlyStopped . tryAny . opening database limit $ \session -> do
      limited (max limit (answerWithin options)) (prepare session)
      now >>= atomically . writeTVar usedFrom . Just
      used said session
    atomically $ do
      why <- case ended of
        Right why -> pure why
        Left why -> do
          writeTVar (lastWhy line) (textOf why)
          writeTVar (place line) (if isFleetFault why then Refusing why else Nowhere)
          pure (Just (textOf why))
      before <- readTVar said
      unless (isNothing why || why == before) (writeTVar said why >> say why)
    lasted <- maybe (const 0) subtract <$> readTVarIO usedFrom <*> now
    sleep pause
    if lasted > connectAgainWithin options
      then go said (connectAgainAfter options) firstLimit
      else go said (min (connectAgainWithin options) (2 * pause)) $
        if isSlow ended then min longestLimit (2 * limit) else limit
  used said session = do
    atomically $ do
      writeTVar (place line) (Free session)
      swapTVar said Nothing >>= mapM_ (\_ -> say Nothing)
    firstOf [Nothing <$ beside session, atomically (readTVar (place line) >>= \case Broken why -> pure why; _ -> retry)]
      `finally` uninterruptibleMask_ (atomically leave)
  -- (A use has a limit of time. A connection must not be closed while it is used.)
  leave = readTVar (place line) >>= \case
    InUse -> retry
    _ -> writeTVar (place line) Nowhere
  isFleetFault why = isJust (fromException why :: Maybe FleetFault)
  isSlow = \case
    Left why | Just (TooSlow _) <- fromException why -> True
    _ -> False

-- | How long a server has to answer who connects, in seconds. (Libpq knows no limit that is shorter than the first.)
firstLimit, longestLimit :: Seconds
firstLimit = 2
longestLimit = 10

-- | Runs a behaviour with the connection, when it is there and free. It has 'answerWithin' for that. Throws
-- 'ConnectionLost' if the connection is lost meanwhile.
withSession :: Line -> (Session -> Behavior a) -> Behavior a
withSession line act = mask $ \restore -> do
  session <- atomically $ readTVar (place line) >>= \case
    Free session -> session <$ writeTVar (place line) InUse
    Refusing fault -> throwSTM fault
    _ -> retry
  result <- onlyStopped $ restore (limited (answerWithin (lineOptions line)) (act session)) `catch` \why -> do
    atomically (writeTVar (place line) (Broken (lossIn why)) >> writeTVar (lastWhy line) (textOf why))
    throwIO (why :: SomeException)
  result <$ atomically (writeTVar (place line) (Free session))
 where
  lossIn why = whyLost <$> fromException why

-- | A loss that comes while the behaviour is stopped is nothing that its caller has to know.
onlyStopped :: Behavior a -> Behavior a
onlyStopped act = act `catch` \why -> case fromException why of
  Just (StoppedWithFault stop fault) | isLoss fault -> throwIO stop
  _ -> throwIO (why :: SomeException)

-- | 'withSession', by the thread of 'answering'. So a caller that is interrupted (it gives up waiting for a door, say)
-- interrupts no statement: the connection, which all robots of the process share, is used on. What has not begun then
-- is not done.
asking :: Line -> (Session -> Behavior a) -> Behavior a
asking line = askingIn (asked line) line

-- | 'asking', before all that waits: what renews leases is not to wait for others, who are many, or whose statements
-- wait for locks.
askingFirst :: Line -> (Session -> Behavior a) -> Behavior a
askingFirst line = askingIn (askedFirst line) line

askingIn :: TQueue (Behavior ()) -> Line -> (Session -> Behavior a) -> Behavior a
askingIn queue line act = do
  isWanted <- newTVarIO True
  answer <- newTVarIO Nothing
  let unlessUnwanted session = readTVarIO isWanted >>= \is -> if is then Just <$> act session else pure Nothing
  atomically . writeTQueue queue $
    tryAny (withSession line unlessUnwanted) >>= atomically . writeTVar answer . either (Just . Left) (fmap Right)
  atomically (readTVar answer >>= maybe retry pure) `onException` atomically (writeTVar isWanted False)
    >>= either throwIO pure

-- | The same, but it is done also when its caller does not wait for it any more. If the connection is lost meanwhile,
-- or the behaviour gives that it is not done, it is tried again, as often as twenty times: each time after all else
-- that was asked for. Gives whether it is over.
posting :: Line -> (Session -> Behavior Bool) -> Behavior (STM Bool)
posting line act = do
  isOver <- newTVarIO False
  let go :: Int -> Behavior ()
      go times = do
        ended <- tryAny (withSession line act)
        let again = times > 1 && either isLoss not ended
        atomically (if again then writeTQueue (asked line) (go (times - 1)) else writeTVar isOver True)
  readTVar isOver <$ atomically (writeTQueue (asked line) (go 20))

isLoss :: SomeException -> Bool
isLoss why = isJust (fromException why :: Maybe ConnectionLost)

-- | Does what was asked for, one after the other.
answering :: Line -> Behavior a
answering line = forever (join (atomically (readTQueue (askedFirst line) `orElse` readTQueue (asked line))))

-- (A failure of the behaviour is its own, also one of a limit of time.)
limited :: Seconds -> Behavior a -> Behavior a
limited seconds act =
  firstOf [Just <$> act, Nothing <$ sleep seconds]
    >>= maybe (throwIO (TooSlow ("no answer within " ++ show seconds ++ " s"))) pure
