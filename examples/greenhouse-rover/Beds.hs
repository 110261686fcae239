{-# LANGUAGE LambdaCase #-}

-- |
-- The plant beds to be inspected, and the findings. A bed stays on the list until it is
-- settled: one transaction enters its finding and removes it from the list. So whatever
-- interrupts an inspection, no bed is lost, and none is settled twice.
module Beds
  ( House (..)
  , Bed (..)
  , Finding (..)
  , Beds
  , newBeds
  , addBed
  , nextBed
  , settle
  , closeIfEmpty
  , findings
  ) where

import qualified Data.Map.Strict as Map

import Behavior.STM

data House = North | South
  deriving (Eq, Ord, Show)

data Bed = Bed House Int
  deriving (Eq, Ord, Show)

data Finding
  = Picture String
  | -- | Why there is no picture.
    NotSeen String
  deriving (Eq, Show)

data Beds = Beds
  { waiting :: TVar [Bed]
  , settled :: TVar (Map.Map Bed Finding)
  , open :: TVar Bool
  }

newBeds :: [Bed] -> IO Beds
newBeds beds = Beds <$> newTVarIO beds <*> newTVarIO Map.empty <*> newTVarIO True

-- | Adds a bed to the end of the list, and returns whether it did. It does not if the bed
-- is known already, or if the list is closed, since then the rover inspects no more beds.
addBed :: Beds -> Bed -> STM Bool
addBed beds bed = do
  isOpen <- readTVar (open beds)
  known <- (||) <$> (elem bed <$> readTVar (waiting beds)) <*> (Map.member bed <$> readTVar (settled beds))
  let accepted = isOpen && not known
  accepted <$ if accepted then modifyTVar' (waiting beds) (++ [bed]) else pure ()

nextBed :: Beds -> STM (Maybe Bed)
nextBed beds = readTVar (waiting beds) >>= \case
  [] -> pure Nothing
  bed : _ -> pure (Just bed)

-- | Removes the bed from the list. If it has a finding already, that one is kept.
settle :: Beds -> Bed -> Finding -> STM ()
settle beds bed finding = do
  modifyTVar' (waiting beds) (filter (/= bed))
  modifyTVar' (settled beds) (Map.insertWith (\_ first -> first) bed finding)

-- | Closes the list if it is empty, and returns whether it did.
closeIfEmpty :: Beds -> STM Bool
closeIfEmpty beds = do
  isEmpty <- null <$> readTVar (waiting beds)
  isEmpty <$ if isEmpty then writeTVar (open beds) False else pure ()

findings :: Beds -> STM (Map.Map Bed Finding)
findings = readTVar . settled
