{-# LANGUAGE LambdaCase #-}

-- |
-- The plant beds that are to be inspected, and what was found. A bed is on the list until
-- it is settled: its result is entered and it is taken off the list in one transaction.
-- So whatever interrupts an inspection, no bed is lost, and none is settled twice.
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

-- | Puts a bed at the end of the list. Refused (false) when it is known already, or the
-- list is closed: then the rover would not see to it any more.
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

-- | Takes the bed off the list. What was found first stands.
settle :: Beds -> Bed -> Finding -> STM ()
settle beds bed finding = do
  modifyTVar' (waiting beds) (filter (/= bed))
  modifyTVar' (settled beds) (Map.insertWith (\_ first -> first) bed finding)

-- | Closes the list if nothing is left on it, and says whether it did.
closeIfEmpty :: Beds -> STM Bool
closeIfEmpty beds = do
  isEmpty <- null <$> readTVar (waiting beds)
  isEmpty <$ if isEmpty then writeTVar (open beds) False else pure ()

findings :: Beds -> STM (Map.Map Bed Finding)
findings = readTVar . settled
