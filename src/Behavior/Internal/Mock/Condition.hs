{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Scripted conditions. A condition has no thread of its own: each access first makes the
-- changes that are due, and an operator that watches it has a worker that wakes at each
-- change. So no thread outlives the operator.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Condition
  ( Condition
  , condition
  , partialCondition
  , signal
  , reading
  , set
  , clear
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (mask_)
import Data.Foldable (for_, traverse_)
import Data.Maybe (isJust, listToMaybe)

import Behavior.Internal.Core.Failure (Behavior, failWith)
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Subject (SubjectKind (ACondition))
import Behavior.Internal.Mock.World
import Behavior.Internal.Seam.Runtime
import Behavior.Internal.Signal.Source
  ( Signal (..)
  , Source (workers)
  , View (..)
  , Worker (..)
  , constantView
  , fromView
  , namedWith
  )

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.Sim
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | A value in the world that changes: by itself at scripted times, and by 'set' and
-- 'clear'.
--
-- @since 0.1.0.0
data Condition a = Condition
  { world :: Mock
  , nameOf :: String
  , render :: a -> String
  , current :: TVar (Maybe a)
  , ahead :: TVar [(Seconds, Maybe a)]
  -- ^ The changes to come.
  , changeKinds :: Maybe a -> Maybe a -> [EntryKind]
  -- ^ How a change from the first value to the second is recorded.
  }

-- | Makes a condition with the given name, which has each value from the given time on:
-- in seconds since the clock of the world was started (see 'begin').
-- The times are zero or more, and increase. A value for time 0 is there from the start;
-- before the first time there is no value.
--
-- To watch its 'signal' or to poll its 'reading' is enough: nothing else has to run for
-- its changes to happen. They are recorded with the times at which they were due.
--
-- Times that do not increase, or a name that is already used in this world, are
-- rejected with an 'ErrorCall'.
--
-- >>> low <- condition mock "battery low" [(0, False), (0.001, True)]
-- >>> Signal.waitUntil (signal low)
-- >>> mock `shouldRecord` eventually (becoming "battery low" True)
--
-- >>> condition mock "door open" [(5, True), (2, False)] >>= reading
-- *** Exception: condition "door open": the times of the changes start from zero and increase; 2.0 must not come after 5.0
--
-- @since 0.1.0.0
condition :: Show a => Mock -> String -> [(Seconds, a)] -> IO (Condition a)
condition mock name = partialCondition mock name . map (fmap Just)

-- | A 'condition' that has no value at some times ('Nothing').
--
-- >>> beacon <- partialCondition mock "beacon" [(0, Just 'a'), (5, Nothing)]
-- >>> run <- simulate (Signal.waitUntil ((== 'b') <$> signal beacon))
-- >>> putStrLn (explain (outcome run))
-- it failed: the behaviour failed: beacon has no value any more
--
-- @since 0.1.0.0
partialCondition :: Show a => Mock -> String -> [(Seconds, Maybe a)] -> IO (Condition a)
partialCondition mock name changes = do
  checkTimes
    (<)
    ("condition " ++ show name ++ ": the times of the changes start from zero and increase")
    (map fst changes)
  register mock ACondition name
  first <- newTVarIO (initial >>= snd)
  rest <- newTVarIO (if isJust initial then drop 1 changes else changes)
  let c = Condition mock name show first rest kinds
  for_ (initial >>= snd) $ \a -> recordEntry mock (entry c 0 (Is (show a)))
  registerPending mock $ \end -> (\(_, _, made) -> made) <$> due c (<= end)
  pure c
 where
  initial = listToMaybe [(t, a) | (t, a) <- take 1 changes, t == 0]
  kinds old new
    | fmap show old == fmap show new = []
    | otherwise = [maybe LosesValue (Becomes . show) new]

entry :: Condition a -> Seconds -> EntryKind -> RecordEntry
entry c t = RecordEntry t (nameOf c) "" 1

-- | Applies the changes that are due: gives the value after them, the changes still
-- ahead, and the record entries of those applied.
due :: Condition a -> (Seconds -> Bool) -> STM (Maybe a, [(Seconds, Maybe a)], [RecordEntry])
due c hasCome = do
  old <- readTVar (current c)
  (passed, others) <- span (hasCome . fst) <$> readTVar (ahead c)
  let steps = zip (old : map snd passed) passed
      made = [entry c t kind | (from, (t, to)) <- steps, kind <- changeKinds c from to]
  pure (foldl (\_ (_, to) -> to) old passed, others, made)

-- | Reads the time, makes the changes that are due and runs the transaction, in one
-- step. The transaction is given the time at which the world began and the current time. It
-- must not block: this runs masked, so that nothing interrupts it before all is recorded.
upToDate :: Condition a -> (Seconds -> Seconds -> STM (b, [RecordEntry])) -> IO b
upToDate c transaction = do
  (zero, t) <- clock (world c)
  mask_ $ do
    (b, made) <- atomically $ do
      -- The same sum as the worker sleeps until: t - zero could be rounded to less than s.
      (new, others, made) <- due c (\s -> zero + s <= t)
      writeTVar (current c) new >> writeTVar (ahead c) others
      (b, more) <- transaction zero t
      pure (b, made ++ more)
    traverse_ (recordEntry (world c)) made
    pure b

-- | The condition as a signal: it wakes the operator that watches it at each change.
--
-- > reading c  and  signal c  have the same values at the same times
--
-- Like every signal it waits for its first value, and fails its operator when there is
-- no value any more. It has the condition's name ('Behavior.Signal.named').
--
-- @since 0.1.0.0
signal :: Condition a -> Signal a
signal c = namedWith (nameOf c) (render c) . Signal $ \_ -> do
  changesByItself <- upToDate c (\_ _ -> (,) . not . null <$> readTVar (ahead c) <*> pure [])
  -- A worker that is started again after a while has missed changes: until it has made
  -- them, reads of the signal block.
  caughtUp <- newTVarIO True
  let wake = do
        next <- upToDate c $ \zero _ -> do
          writeTVar caughtUp True
          changes <- readTVar (ahead c)
          pure (listToMaybe [zero + s | (s, _) <- changes], [])
        maybe (pure ()) (\s -> sleepUntil s >> wake) next -- (in constant stack; 'for_' is not)
      valueOr none = (readTVar caughtUp >>= check) >> readTVar (current c) >>= maybe none pure
      noneAnyMore = failWith (nameOf c ++ " has no value any more")
  pure
    (fromView (pure (constantView (valueOr retry)) {reread = valueOr noneAnyMore}))
      { workers = [Worker "clock" (const wake <$ writeTVar caughtUp False) | changesByItself]
      }

-- | The condition as a reading, to be polled: its current value. It fails when there is
-- no value.
--
-- >>> warm <- condition mock "warm" [(0, True)]
-- >>> rSelect (reading warm) (pure "swim") (pure "run")
-- "swim"
--
-- @since 0.1.0.0
reading :: Condition a -> Behavior a
reading c =
  upToDate c (\_ _ -> (,) <$> readTVar (current c) <*> pure [])
    >>= maybe (failWith (nameOf c ++ " has no value")) pure

-- | Changes the condition now. The scripted changes that are still ahead happen
-- nevertheless.
--
-- >>> wet <- condition mock "wet" [(0, False)]
-- >>> set wet True
-- >>> reading wet
-- True
--
-- @since 0.1.0.0
set :: Condition a -> a -> Behavior ()
set c = change c . Just

-- | Removes the value, as when a sensor has stopped working.
--
-- >>> gps <- condition mock "gps" [(0, "at home")]
-- >>> clear gps
-- >>> reading gps ? pure "lost"
-- "lost"
--
-- @since 0.1.0.0
clear :: Condition a -> Behavior ()
clear c = change c Nothing

change :: Condition a -> Maybe a -> Behavior ()
change c new = upToDate c $ \zero t -> do
  old <- readTVar (current c)
  writeTVar (current c) new
  pure ((), [entry c (t - zero) kind | kind <- changeKinds c old new])
