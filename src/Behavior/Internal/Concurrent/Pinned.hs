{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Which capability the threads of a behaviour run on. (A capability is what GHC runs threads on,
-- one thread at a time: the runtime's option @-N@ says how many there are.)
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Pinned
  ( pinned
  , unpinned
  ) where

import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Seam.Runtime (Placement (..))

-- | Runs a behaviour with all its branches on one capability: the one that the caller runs on.
--
-- > pinned act  =  firstOf [act]
--
-- With several capabilities (@+RTS -N@) GHC moves threads from one to the other, and an operator
-- and its branches then wake each other from different processors. A reaction then takes ten times as long,
-- and sometimes a few milliseconds. In @pinned@ it takes as long as with one capability.
--
-- A branch in it that computes without a pause delays all others, by some 20 ms each time that a
-- thread is woken: run such a branch 'unpinned'. The thread that changes the conditions should be a
-- branch of the same behaviour, or be pinned to the same capability.
--
-- > main = runBehavior . pinned $ driver ||| unpinned planner ||| mission
--
-- [Result, failure, fault, cancellation] Those of the behaviour, which runs in a branch.
--
-- The branches that a pinned thread starts are pinned, too. So operators that are called in a thread of
-- 'Control.Concurrent.forkOn' stay on its capability without this function.
--
-- It has no effect in a simulation, with one capability, and without @-threaded@. If
-- 'Control.Concurrent.setNumCapabilities' takes the capability away, GHC moves all of these threads
-- to another. (Rather set their number by the option @-N@: the page @docs\/performance.md@ says how a
-- program can hang when it ends.)
--
-- >>> import Control.Concurrent (myThreadId, threadCapability)
-- >>> pinned (myThreadId >>= fmap snd . threadCapability)
-- True
--
-- @since 0.1.0.0
pinned :: Behavior a -> Behavior a
pinned = inBranch Pinned "pinned"

-- | Runs a behaviour that GHC may move to any capability, also within 'pinned': for one that
-- computes, or that calls foreign code which does.
--
-- > unpinned act  =  firstOf [act]
--
-- Its branches, too, can be moved. The first 20 ms or so it may still share its capability with
-- the pinned threads; then GHC moves it to one that is idle, if there is one.
--
-- [Result, failure, fault, cancellation] Those of the behaviour, which runs in a branch.
--
-- >>> import Control.Concurrent (myThreadId, threadCapability)
-- >>> pinned (unpinned (myThreadId >>= fmap snd . threadCapability))
-- False
--
-- @since 0.1.0.0
unpinned :: Behavior a -> Behavior a
unpinned = inBranch Unpinned "unpinned"

inBranch :: Placement -> String -> Behavior a -> Behavior a
inBranch here operator act = structured operator $ \scope -> do
  body <- branchWith plainly {placement = here} scope "body" (const act)
  endedBy "body" <$> awaitOutcome body
