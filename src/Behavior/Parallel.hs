-- |
-- Several behaviours at once: 'parallel' and 'both', and similar operators for any number
-- of behaviours, which give results.
--
-- +---------------------------------+------------------+-------------------------------+
-- |                                 | waits for        | gives                         |
-- +=================================+==================+===============================+
-- | 'parallel', @|||@, 'firstOf'    | the first to end | nothing; 'firstOf' its result |
-- +---------------------------------+------------------+-------------------------------+
-- | 'both', 'allOf'                 | all of them      | nothing; 'allOf' all results  |
-- +---------------------------------+------------------+-------------------------------+
-- | 'decide'                        | what a function  | the result of the behaviour   |
-- |                                 | of the ends says | that the function chooses     |
-- +---------------------------------+------------------+-------------------------------+
-- | 'agreeing'                      | M that agree     | their results                 |
-- +---------------------------------+------------------+-------------------------------+
-- | 'scoped' and 'fork'             | the scoped one   | its result                    |
-- +---------------------------------+------------------+-------------------------------+
--
-- 'fork' starts a behaviour and gives a 'Child': you can 'await' its result, read it without
-- blocking ('tryAwait'), and request its stop ('requestStop').
--
-- 'pinned' and 'unpinned' say which processor threads run on.
--
-- In all cases, what these operators start has ended, cleanup included, when they return
-- or throw.
module Behavior.Parallel
  ( -- * Two
    parallel
  , (|||)
  , both

    -- * Any number
  , firstOf
  , allOf
  , decide
  , agreeing

    -- * Starting more while a behaviour runs
  , scoped
  , fork
  , Nursery

    -- * Which processor they run on
  , pinned
  , unpinned

    -- * The forked behaviour
  , Child
  , await
  , tryAwait
  , requestStop
  , ChildStopped (..)
  ) where

import Behavior.Internal.Concurrent.Nursery
import Behavior.Internal.Concurrent.Parallel
import Behavior.Internal.Concurrent.Pinned
