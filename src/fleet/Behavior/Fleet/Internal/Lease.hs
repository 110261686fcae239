{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Leases: each is renewed at each third of its term, and lost at two thirds, by the robot's own clock, counted from
-- before it was asked for. So the last third is left to stop in, and for clocks that differ.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Lease
  ( Leases
  , newLeases
  , LeaseName (..)
  , Lease
  , Standing (..)
  , withLease
  , lostAt
  , standing
  , loses

    -- * Keeping them
  , renewing
  , expiring
  , renewSoon
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (bracket)
import Control.Monad (filterM, forever, unless, when)
import Data.Foldable (traverse_)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.UUID.Types (UUID)

import Behavior (Behavior, Seconds, sleep, tryAny, (?))
import Behavior.Fleet.Internal.Contract
import Behavior.STM (atomically)
import Behavior.Time (timeout)

-- | The leases that the robots of a process have.
data Leases = Leases
  { held :: TVar (Map LeaseName Lease)
  , entered :: TVar Int
  -- ^ How many there have been.
  , isUrgent :: TVar Bool
  -- ^ Whether they are to be renewed now.
  }

-- | What it is for.
data LeaseName
  = OfStart TaskNumber Number
  | OfWish UUID
  deriving (Eq, Ord)

-- | A lease that a robot has.
data Lease = Lease
  { term :: Seconds
  , askedAt :: TVar Seconds
  -- ^ When it was last asked for, by the own clock.
  , standing_ :: TVar Standing
  }

-- | How a lease stands.
data Standing
  = Valid
  | -- | It is valid, and its task is to be cancelled.
    IsToEnd
  | LeaseIsLost
  deriving (Eq, Show)

-- | None.
newLeases :: IO Leases
newLeases = Leases <$> newTVarIO Map.empty <*> newTVarIO 0 <*> newTVarIO False

-- | How it stands now.
standing :: Lease -> STM Standing
standing = readTVar . standing_

-- | It is lost: the database has said so.
loses :: Lease -> STM ()
loses = become LeaseIsLost

-- | Keeps a lease while the behaviour runs, that was asked for at this time. (If the answer came too late, it is lost
-- before the behaviour begins.)
withLease :: Leases -> Behavior Seconds -> LeaseName -> Seconds -> Seconds -> (Lease -> Behavior a) -> Behavior a
withLease leases clock name lasts asked = bracket enter (const exit)
 where
  enter = do
    time <- clock
    atomically $ do
      lease <- Lease lasts <$> newTVar asked <*> newTVar (if time < lostAt asked lasts then Valid else LeaseIsLost)
      modifyTVar' (entered leases) (+ 1)
      lease <$ modifyTVar' (held leases) (Map.insert name lease)
  exit = atomically (modifyTVar' (held leases) (Map.delete name))

-- | The lease of this task, if it is one of these, is to be renewed now.
renewSoon :: Leases -> TaskNumber -> STM ()
renewSoon leases task = do
  names <- Map.keys <$> readTVar (held leases)
  when (or [it == task | OfStart it _ <- names]) $ writeTVar (isUrgent leases) True

-- | Renews them, by two functions of the database.
renewing
  :: Leases
  -> Behavior Seconds
  -> ([(TaskNumber, Number)] -> Behavior [(TaskNumber, Number, Bool)])
  -> ([UUID] -> Behavior [UUID])
  -> Behavior a
renewing leases clock renew keep = forever $ do
  untilNext leases clock (1 / 3) (at (1 / 3)) (readTVar (isUrgent leases))
  asked <- clock
  names <- atomically $ do
    urgent <- swapTVar (isUrgent leases) False
    -- (One statement is for many: so also for those that are halfway there.)
    valid leases >>= if urgent then pure else those (fmap (<= asked) . at (1 / 6))
  let (tasks, wishes) = Map.partitionWithKey (\name _ -> isOfStart name) names
  -- (What throws is tried again, and is not in the way of the other one. The leases end by themselves.)
  areAnswered <- (&&) <$> answered asked renewed tasks <*> answered asked kept wishes
  unless areAnswered $ sleep (minimum (term <$> names) / 20)
 where
  those keeps these = Map.fromList <$> filterM (keeps . snd) (Map.toList these)
  isOfStart = \case OfStart _ _ -> True; OfWish _ -> False
  renewed names = do
    gave <- renew [(task, n) | OfStart task n <- names]
    pure [(OfStart task n, isToEnd) | (task, n, isToEnd) <- gave]
  kept names = map (\n -> (OfWish n, False)) <$> keep [n | OfWish n <- names]
  answered asked asking these
    | Map.null these = pure True
    | otherwise =
        tryAny (asking (Map.keys these)) >>= \case
          Right answers -> True <$ atomically (mapM_ (booked asked answers) (Map.toList these))
          -- (It may be one of them that is in the way of the others.)
          Left _ | Map.size these > 1 -> and <$> traverse (answered asked asking) (apart these)
          Left _ -> pure False
  apart these = [Map.singleton name lease | (name, lease) <- Map.toList these]
  booked asked answers (name, lease) = case lookup name answers of
    Nothing -> become LeaseIsLost lease
    Just isToEnd -> writeTVar (askedAt lease) asked >> when isToEnd (become IsToEnd lease)

-- | Those that are lost by the own clock become so. (Nothing else that happens, or hangs, is in the way of that.)
expiring :: Leases -> Behavior Seconds -> Behavior a
expiring leases clock = forever $ do
  untilNext leases clock (1 / 20) end retry
  time <- clock
  atomically $ valid leases >>= traverse_ (unlessAt time)
 where
  end lease = (`lostAt` term lease) <$> readTVar (askedAt lease)
  unlessAt time lease = end lease >>= \ends -> when (time >= ends) (become LeaseIsLost lease)

-- | When one is lost that was asked for at this time, for this term.
lostAt :: Seconds -> Seconds -> Seconds
lostAt asked lasts = asked + 2 / 3 * lasts

-- | When that share of its term has passed.
at :: Seconds -> Lease -> STM Seconds
at share lease = (+ share * term lease) <$> readTVar (askedAt lease)

-- | Waits until the first of these times of a lease, or for that transaction; in steps of that share of a term, for the
-- own clock goes on while the machine is suspended, but a sleep does not.
untilNext :: Leases -> Behavior Seconds -> Seconds -> (Lease -> STM Seconds) -> STM Bool -> Behavior ()
untilNext leases clock share next sooner = do
  (count, these) <- atomically $ do
    these <- Map.elems <$> valid leases
    check (not (null these))
    (,) <$> readTVar (entered leases) <*> traverse (\lease -> (,) (term lease) <$> next lease) these
  time <- clock
  unless (any ((<= time) . snd) these) $ do
    let step = max 0.001 (minimum [min (end - time) (share * lasts) | (lasts, end) <- these])
        other = (True <$ (sooner >>= check)) `orElse` (False <$ (readTVar (entered leases) >>= check . (/= count)))
    isOver <- timeout step (atomically other) ? pure False
    unless isOver (untilNext leases clock share next sooner)

-- | Those that are not lost.
valid :: Leases -> STM (Map LeaseName Lease)
valid leases = readTVar (held leases) >>= fmap (Map.mapMaybe id) . traverse unlessLost
 where
  unlessLost lease = (\how -> if how == LeaseIsLost then Nothing else Just lease) <$> standing lease

-- | (Once lost it stays lost.)
become :: Standing -> Lease -> STM ()
become how lease = modifyTVar' (standing_ lease) (\before -> if before == LeaseIsLost then before else how)
