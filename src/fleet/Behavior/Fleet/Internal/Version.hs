{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The version of the schema that this library knows.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Version
  ( newest
  , unfit
  , noFleet
  ) where

import Behavior.Fleet.Internal.Schema (versions)

-- | The version that robots of this library use.
newest :: Int
newest = length versions

-- | Why robots of this library do not use a schema of that version, and what is to be done.
unfit :: Int -> Maybe String
unfit version
  | version == newest = Nothing
  | otherwise =
    Just $ "the schema of the fleet's database has version " ++ show version ++ ", and this program knows version "
      ++ show newest ++ ": " ++ if version > newest then newer else "run behavior-fleet migrate"
 where
  newer = "it needs a newer behavior-lang"

-- | What is said of a database without a schema.
noFleet :: String
noFleet = "there is no fleet in this database: run behavior-fleet create"
