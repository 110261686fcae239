-- |
-- Several behaviours at once: 'parallel' and 'both', and their kin for any number
-- of behaviours that give results.
--
-- +---------------------------------+------------------+-------------------------------+
-- |                                 | waits for        | gives                         |
-- +=================================+==================+===============================+
-- | 'parallel', @|||@, 'firstOf'    | the first to end | nothing; 'firstOf' its result |
-- +---------------------------------+------------------+-------------------------------+
-- | 'both', 'allOf'                 | all of them      | nothing; 'allOf' all results  |
-- +---------------------------------+------------------+-------------------------------+
-- | 'scoped' and 'fork'             | the scoped one   | its result                    |
-- +---------------------------------+------------------+-------------------------------+
--
-- What 'fork' starts is a 'Child': one can 'await' its result, look at it without waiting
-- ('tryAwait'), and ask it to stop ('requestStop').
--
-- Whatever happens, what these start has ended, cleanup included, when they return
-- or throw.
module Behavior.Parallel
  ( -- * Two
    parallel
  , (|||)
  , both

    -- * Any number
  , firstOf
  , allOf

    -- * One more, while the rest goes on
  , scoped
  , fork
  , Nursery

    -- * What was started
  , Child
  , await
  , tryAwait
  , requestStop
  , ChildStopped (..)
  ) where

import Behavior.Internal.Nursery
import Behavior.Internal.Parallel
