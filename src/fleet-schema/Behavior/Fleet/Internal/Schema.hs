{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE TemplateHaskell #-}

-- |
-- The schema of a fleet's database: see the comments in it.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Schema
  ( versions
  , rights
  ) where

import Data.ByteString (ByteString)
import Data.FileEmbed (embedFile)

-- | What makes each version of the one before; the first is made of nothing.
versions :: [ByteString]
versions = [$(embedFile "src/fleet-schema/schema-1.sql")]

-- | The rights of robots, and of those that only look: to be run after each of them, when the roles are there.
rights :: ByteString
rights = $(embedFile "src/fleet-schema/rights.sql")
