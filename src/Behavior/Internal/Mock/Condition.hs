{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Scripted conditions. No thread of its own changes one: whoever looks at it first
-- makes the changes that are due, and who watches it wakes for each. So no thread
-- outlives the operator that watches.
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
import Control.Exception (ErrorCall (..), mask_, throwIO)
import Control.Monad (unless)
import Data.Foldable (for_, traverse_)
import Data.Maybe (isJust, listToMaybe)

import Behavior.Internal.Failure (Behavior, failWith)
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.World
import Behavior.Internal.Runtime
import Behavior.Internal.Signal.Source (Signal (..), Source (workers), View (..), Worker (..), fromView)

-- $setup
-- >>> import Behavior
-- >>> import qualified Behavior.Signal as Signal
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | Something in the world that changes, by itself at certain times, or because
-- somebody 'set's it.
--
-- @since 0.1.0.0
data Condition a = Condition
  { world :: Mock
  , nameOf :: String
  , current :: TVar (Maybe a)
  , ahead :: TVar [(Seconds, Maybe a)]
  -- ^ The changes to come.
  , says :: Maybe a -> Maybe a -> [EntryKind]
  -- ^ What to say of a change from one to the other.
  }

-- | Makes a condition of this name, that has these values from these times on: in
-- seconds since the clock of the world was started (see 'begin'), zero or more, and
-- increasing. A value for time 0 is there from the start; before the first
-- there is no value.
--
-- Who watches its 'signal' or polls its 'reading' needs nothing else to make time
-- pass for it. Its changes are on record at the times at which they were due.
--
-- Times that do not increase, or a name that something else in this world has, are
-- refused with an 'ErrorCall'.
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

-- | A 'condition' that at times has no value ('Nothing').
--
-- >>> beacon <- partialCondition mock "beacon" [(0, Just 'a'), (0.001, Nothing)]
-- >>> Signal.waitUntil ((== 'b') <$> signal beacon)
-- *** Exception: FailedBecause "beacon has no value any more"
--
-- @since 0.1.0.0
partialCondition :: Show a => Mock -> String -> [(Seconds, Maybe a)] -> IO (Condition a)
partialCondition mock name changes = do
  -- Of endlessly many only so many can be looked at beforehand.
  for_ (zip (Nothing : map Just times) (take 1000 times)) $ uncurry checkTime
  registerName mock "condition" name
  first <- newTVarIO (initial >>= snd)
  rest <- newTVarIO (if isJust initial then drop 1 changes else changes)
  let c = Condition mock name first rest told
  for_ (initial >>= snd) $ \a -> recordEntry mock (entry c 0 (Is (show a)))
  registerPending mock $ \until' -> (\(_, _, said) -> said) <$> due c (<= until')
  pure c
 where
  initial = listToMaybe [(t, a) | (t, a) <- take 1 changes, t == 0]
  times = map fst changes
  checkTime before t =
    unless (maybe (t >= 0) (< t) before) . throwIO . ErrorCall $
      "condition " ++ show name ++ ": the times of the changes start from zero and increase; "
        ++ show t
        ++ maybe " is no such time" (\b -> " must not come after " ++ show b) before
  told old new
    | fmap show old == fmap show new = []
    | otherwise = [maybe LosesValue (Becomes . show) new]

entry :: Condition a -> Seconds -> EntryKind -> RecordEntry
entry c t = RecordEntry t (nameOf c) "" 1

-- | The changes ahead whose time has come: what then is the value, what is still to
-- come, and what is to be put on record.
due :: Condition a -> (Seconds -> Bool) -> STM (Maybe a, [(Seconds, Maybe a)], [RecordEntry])
due c hasCome = do
  old <- readTVar (current c)
  (passed, others) <- span (hasCome . fst) <$> readTVar (ahead c)
  let steps = zip (old : map snd passed) passed
      said = [entry c t what | (from, (t, to)) <- steps, what <- says c from to]
  pure (foldl (\_ (_, to) -> to) old passed, others, said)

-- | Asks for the time, makes the changes that are due, then runs the transaction, all
-- in one step. (The transaction does not wait; so, masked, it is not interrupted
-- before all is on record.) It is told when the world began, and what time it is.
upToDate :: Condition a -> (Seconds -> Seconds -> STM (b, [RecordEntry])) -> IO b
upToDate c transaction = do
  (zero, t) <- clock (world c)
  mask_ $ do
    (b, said) <- atomically $ do
      -- Added, as for who sleeps until then: a difference could be rounded to less.
      (new, others, said) <- due c (\s -> zero + s <= t)
      writeTVar (current c) new >> writeTVar (ahead c) others
      (b, more) <- transaction zero t
      pure (b, said ++ more)
    traverse_ (recordEntry (world c)) said
    pure b

-- | The condition as a signal, to be watched: it wakes its operator at each change.
--
-- > reading c  and  signal c  have the same values at the same times
--
-- Like every signal it waits for its first value, and fails its operator when the
-- value is lost.
--
-- @since 0.1.0.0
signal :: Condition a -> Signal a
signal c = Signal $ \_ -> do
  changesByItself <- upToDate c (\_ _ -> (,) . not . null <$> readTVar (ahead c) <*> pure [])
  -- A clock that was stopped for a while has slept through changes: until it has made
  -- them, nobody may look.
  made <- newTVarIO True
  let wake = do
        next <- upToDate c $ \zero _ -> do
          writeTVar made True
          changes <- readTVar (ahead c)
          pure (listToMaybe [zero + s | (s, _) <- changes], [])
        maybe (pure ()) (\s -> sleepUntil s >> wake) next -- (in constant stack; 'for_' is not)
      valueOr none = (readTVar made >>= check) >> readTVar (current c) >>= maybe none pure
      noneAnyMore = failWith (nameOf c ++ " has no value any more")
  pure
    (fromView (pure (View (valueOr retry) (valueOr noneAnyMore))))
      { workers = [Worker "clock" (const wake <$ writeTVar made False) | changesByItself]
      }

-- | The condition as a reading, to be polled: what it is now. It fails when there is no
-- value.
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

-- | Changes the condition now. The changes that it is still to make by itself, it
-- makes.
--
-- >>> wet <- condition mock "wet" [(0, False)]
-- >>> set wet True
-- >>> reading wet
-- True
--
-- @since 0.1.0.0
set :: Condition a -> a -> Behavior ()
set c = change c . Just

-- | Takes the value away, as from a sensor that has died.
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
  pure ((), [entry c (t - zero) what | what <- says c old new])
