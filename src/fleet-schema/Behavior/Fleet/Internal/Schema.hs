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

-- | Who may do what: to be run after each of them, by whom the roles are there already.
rights :: ByteString
rights = $(embedFile "src/fleet-schema/rights.sql")
