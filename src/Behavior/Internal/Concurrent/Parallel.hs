{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Several behaviours at once.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Concurrent.Parallel
  ( -- * Two
    parallel
  , (|||)
  , both

    -- * Any number
  , firstOf
  , allOf
  , decide
  , agreeing
  ) where

import Control.Applicative ((<|>))
import Control.Concurrent.STM (STM, TVar, catchSTM, check, modifyTVar', newTVarIO, readTVar, retry)
import Control.Exception (ErrorCall (..), SomeException, evaluate, fromException, throwIO)
import Control.Monad (foldM, join, void, (<=<), (<$!>))
import Data.Either (isLeft)
import Data.Foldable (toList)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.List (intercalate)
import Data.Maybe (isNothing)
import Data.Traversable (mapAccumL)

import Behavior.Internal.Concurrent.Leftmost
import Behavior.Internal.Concurrent.Outcome (Outcome (..), outcomeToIO, result)
import Behavior.Internal.Concurrent.Scope
import Behavior.Internal.Core.Cause (Cause (..))
import Behavior.Internal.Core.Failure (Behavior, BehaviorFailed, failWith, failed)
import Behavior.Internal.Seam.Runtime (atomically, tryReadThenBlock)

-- $setup
-- >>> import Behavior

-- | Starts two behaviours at once; the first to finish ends the other.
--
-- > parallel left right  =  firstOf [void left, void right]
--
-- [Result] None. When both have finished by the time the operator reads them (a /tie/), the
--   left one's end counts.
-- [Failure] If the first to finish failed, its failure is thrown. The failure of a behaviour
--   that has already lost is ignored.
-- [Fault] The leftmost fault of the two, in a cleanup too, is always thrown.
-- [Cancellation] Requests the stop of both together. However it ends, it returns after
--   both have ended, cleanup included: a slow cleanup makes the caller wait.
--
-- >>> parallel (pure ()) (sleep 3600)
--
-- >>> parallel (failWith "lost sight of the wall") (sleep 3600)
-- *** Exception: FailedBecause "lost sight of the wall"
--
-- /Section 5 of the paper, Parallelism./
--
-- @since 0.1.0.0
parallel :: Behavior a -> Behavior b -> Behavior ()
-- ('firstOf' of the two would do, with other names for its branches. Two outcomes can be read as they are, without the
-- variable that says which of many came first.)
parallel left right = structured "parallel" $ \scope -> do
  l <- branch scope "left" (void left)
  r <- branch scope "right" (void right)
  -- Outside a transaction only the left one is read: if the right one were read so, the left
  -- one might have ended before it.
  tryReadThenBlock
    (fmap (endedBy "left") <$> tryReadOutcome l)
    (atomically (tryReadOutcomeSTM l >>= maybe (endedBy "right" <$> outcome r) (pure . endedBy "left")))

-- | 'parallel' as an operator. It binds looser than @?@ and tighter than
-- 'Prelude.>>'. (@Control.Arrow@ has another function of this name.)
--
-- >>> sleep 3600 ||| putStrLn "beep"
-- beep
--
-- @since 0.1.0.0
(|||) :: Behavior a -> Behavior b -> Behavior ()
(|||) = parallel

infixr 2 |||

-- | Starts two behaviours at once, and waits for both.
--
-- > both left right  =  void (allOf [void left, void right])
--
-- [Result] None.
-- [Failure] The first failure stops the other behaviour, and is thrown; on a tie
--   the left one.
-- [Fault] The leftmost fault of the two, in a cleanup too, is always thrown.
-- [Cancellation] Requests the stop of both together; returns after both have ended.
--
-- >>> both (sleep 0.01 >> putStrLn "arm is up") (putStrLn "light is on")
-- light is on
-- arm is up
--
-- /Section 5 of the paper, Parallelism./
--
-- @since 0.1.0.0
both :: Behavior a -> Behavior b -> Behavior ()
both left right = structured "both" $ \scope -> do
  l <- branch scope "left" (void left)
  r <- branch scope "right" (void right)
  let -- The left one is read first: what has ended then has also ended when the right one is read.
      tryReadBoth = tryReadOutcome l >>= maybe (pure Nothing) (\known -> verdict (Just known) <$!> tryReadOutcome r)
      readBoth = verdict <$> tryReadOutcomeSTM l <*> tryReadOutcomeSTM r
  tryReadThenBlock tryReadBoth (atomically (readBoth >>= maybe retry pure))
 where
  verdict l r = case (result <$> l, result <$> r) of
    (Just (Left e), _) -> Just (Verdict (SiblingFailed "left") (throwIO e))
    (_, Just (Left e)) -> Just (Verdict (SiblingFailed "right") (throwIO e))
    (Just (Right ()), Just (Right ())) -> Just (Verdict (SiblingFinished "right") (pure ()))
    _ -> Nothing

-- | Starts all behaviours at once, and gives the result of the first to finish.
--
-- > firstOf []  =  failed
--
-- [Result] That of the first to finish; on a tie, of the leftmost. The stop of the others is
--   requested together, and they have ended when it returns.
-- [Failure] If the first to finish failed, its failure is thrown. For the first that
--   /succeeds/, give each behaviour its own @?@.
-- [Fault] The leftmost fault of all, in a cleanup too, is always thrown.
-- [Cancellation] Requests the stop of all together; returns after all have ended.
--
-- >>> firstOf [sleep 3600 >> pure "camera", pure "lidar"]
-- "lidar"
--
-- @since 0.1.0.0
firstOf :: [Behavior a] -> Behavior a
firstOf [] = failed
firstOf behaviors = structured "firstOf" $ \scope -> do
  first <- newLeftmost
  void $ startAll scope (publish first) behaviors
  (n, end) <- tryReadThenBlock (tryReadLeftmost first) (atomically (readLeftmost first))
  pure (endedBy (show n) end)

-- | Starts all behaviours at once, waits for all, and gives their results, each in the place
-- of its behaviour.
--
-- [Result] All results. On an empty container it returns that.
-- [Failure] The first failure stops the rest, and is thrown; on a tie the leftmost.
-- [Fault] The leftmost fault of all, in a cleanup too, is always thrown.
-- [Cancellation] Requests the stop of all together; returns after all have ended.
--
-- >>> allOf [pure "left wheel", pure "right wheel"]
-- ["left wheel","right wheel"]
--
-- @since 0.1.0.0
allOf :: Traversable t => t (Behavior a) -> Behavior (t a)
allOf behaviors = structured "allOf" $ \scope -> do
  failure <- newLeftmost
  these <- startAll scope (publishFailure failure) (toList behaviors)
  let awaitAll [] =
        pure (Verdict (SiblingFinished "all") (refilled behaviors <$> traverse (outcomeToIO <=< awaitOutcome) these))
      awaitAll (b : bs) = do
        failing <-
          tryReadThenBlock ((Nothing <$) <$> completedNow b) . atomically $
            tryReadOutcomeSTM b >>= \case
              Just (Completed _) -> pure Nothing
              _ -> Just <$> readLeftmost failure
        maybe (awaitAll bs) (\(n, e) -> pure (Verdict (SiblingFailed (show n)) (throwIO e))) failing
  awaitAll these

-- | Starts all behaviours at once, and runs the behaviour that a function of their ends chooses.
--
-- > firstOf  =  decide (\ends -> listToMaybe [either throwIO pure end | Just end <- ends])
--
-- The function is given the ends so far, by position: 'Nothing' while a behaviour runs, then its
-- failure or its result. As soon as it chooses, the others are stopped; when they have ended, the
-- chosen behaviour runs. The function is called before the start (if it chooses then, nothing is
-- started), and after each end; several ends may have come together. It runs in a transaction, and
-- perhaps more often than necessary.
--
-- [Result] That of the chosen behaviour.
-- [Failure] That of the chosen behaviour. A behaviour's own failure is only passed to the function.
-- [Fault] The leftmost fault of all, in a cleanup too, is always thrown; then no chosen behaviour
--   runs. What the function throws is thrown. If all have ended and the function has still not chosen,
--   that is a fault too.
-- [Cancellation] Requests the stop of all together; returns after all have ended. The chosen
--   behaviour runs in the caller's thread.
--
-- The first that succeeds; if none does, it fails as the last one:
--
-- >>> import Control.Exception (throwIO)
-- >>> :{
-- firstToSucceed :: [Behavior a] -> Behavior a
-- firstToSucceed = decide $ \ends -> case ([a | Just (Right a) <- ends], sequence ends) of
--   (a : _, _) -> Just (pure a)
--   ([], Just failures) -> Just (last (failed : [throwIO e | Left e <- failures]))
--   _ -> Nothing
-- :}
--
-- >>> firstToSucceed [failWith "no satellite", sleep 0.01 >> pure "wheel encoders"]
-- "wheel encoders"
--
-- Any M of N, and those whose results agree: 'agreeing'.
--
-- /Section 2 of the paper: the Parallel node with its thresholds for success and failure./
--
-- @since 0.1.0.0
decide :: ([Maybe (Either BehaviorFailed a)] -> Maybe (Behavior b)) -> [Behavior a] -> Behavior b
decide choose behaviors =
  evaluate (choose (Nothing <$ behaviors)) >>= \case
    Just chosen -> chosen
    Nothing -> join . structured "decide" $ \scope -> do
      ends <- newTVarIO (Right IntMap.empty)
      void $ startAll scope (addEnd ends) behaviors
      chooseAfter ends IntMap.empty
 where
  -- What the function throws is caught where it runs: what is thrown in the operator's thread
  -- would be taken for an exception from outside.
  chooseAfter ends seen = join . atomically $
    readTVar ends >>= \case
      Left (n, fault) -> pure (pure (Verdict (SiblingFailed (show n)) (throwIO fault)))
      Right known -> do
        check (IntMap.size known > IntMap.size seen || count == 0)
        let verdict = Verdict (newEnds (known IntMap.\\ seen))
        (chosenOf ends known verdict <$> (pure $! choose (inOrder known)))
          `catchSTM` \e -> pure (pure (verdict (throwIO (e :: SomeException))))
  chosenOf ends known verdict = \case
    Just chosen -> pure (verdict (pure chosen))
    Nothing
      | IntMap.size known == count ->
          pure (verdict (throwIO (ErrorCall "decide: all behaviours have ended, and the function has chosen none")))
      | otherwise -> chooseAfter ends known
  inOrder known = [IntMap.lookup n known | n <- [1 .. count]]
  count = length behaviors

-- | M of N: starts all behaviours at once, and gives the results of the first @m@ that agree.
--
-- > agreeing m agree behaviors
--
-- The function says whether two results agree: @(==)@, or for measurements a tolerance. Each of the @m@
-- results agrees with each other one. As soon as there are @m@ such results, the other behaviours are
-- stopped. They are stopped, too, when so few still run that there can be no @m@ such results: then it fails.
--
-- > agreeing m (\_ _ -> True)     -- any m that succeed
-- > agreeing 1 (\_ _ -> True)     -- the first that succeeds
-- > head <$> agreeing m (==)       -- the value on which m agree
--
-- [Result] @m@ results, in the order of their behaviours; if several choices agree, the leftmost. With
--   @m <= 0@ none, and nothing is started.
-- [Failure] A 'Behavior.FailedBecause' when no @m@ results can agree any more; at once, if @m@ is greater
--   than the number of behaviours. A behaviour that fails only gives no result.
-- [Fault] The leftmost fault of all, in a cleanup too, is always thrown. What the function throws is
--   thrown.
-- [Cancellation] Requests the stop of all together; returns after all have ended.
--
-- The search takes time in proportion to the number of pairs, if agreement is an equivalence; with
-- a tolerance it can take longer: it is meant for a few dozen sensors.
--
-- >>> let near a b = abs (a - b) <= (0.5 :: Double)
-- >>> agreeing 2 near [pure 1.5, pure 9, sleep 0.01 >> pure 1.6, sleep 3600 >> pure 1.5]
-- [1.5,1.6]
--
-- >>> agreeing 2 near [pure 1.5, failWith "no echo", sleep 0.01 >> pure 9]
-- *** Exception: FailedBecause "no 2 of 3 agree"
--
-- /Section 2 of the paper: the Parallel node, with its threshold for success./
--
-- @since 0.1.0.0
agreeing :: Int -> (a -> a -> Bool) -> [Behavior a] -> Behavior [a]
agreeing m agree behaviors = decide choose behaviors
 where
  choose ends
    | Just results <- among m known = Just (pure results)
    | isNothing (among (m - running) known) =
        Just (failWith ("no " ++ show m ++ " of " ++ show (length behaviors) ++ " agree"))
    | otherwise = Nothing
   where
    known = [a | Just (Right a) <- ends]
    running = length (filter isNothing ends)
  -- The leftmost n of these results that all agree with each other.
  among n results
    | n <= 0 = Just []
    | otherwise = case results of
        a : others | length results >= n -> ((a :) <$> among (n - 1) (filter (agree a) others)) <|> among n others
        _ -> Nothing

-- | How the branches with these numbers have ended, or the first fault.
type Ends a = Either (Int, SomeException) (IntMap (Either BehaviorFailed a))

-- | Adds how a branch has ended.
addEnd :: TVar (Ends a) -> Int -> Outcome a -> STM ()
addEnd ends n end = modifyTVar' ends $ case (end, result end) of
  (_, Right a) -> (IntMap.insert n (Right a) <$!>)
  (FailedWith _, Left e) | Just failure <- fromException e -> (IntMap.insert n (Left failure) <$!>)
  (_, Left e) -> (>> Left (n, e))

-- | Why the rest is stopped when these branches have ended: they failed, or not all of them did.
newEnds :: IntMap (Either BehaviorFailed a) -> Cause
newEnds new =
  (if all isLeft new then SiblingFailed else SiblingFinished) (intercalate ", " (map show (IntMap.keys new)))

-- | The container with its elements replaced by those of the list, which has as many.
refilled :: Traversable t => t x -> [a] -> t a
refilled container = snd . flip (mapAccumL next) container
 where
  next (a : as) _ = (as, a)
  next [] _ = error "refilled: there are fewer elements than places"

-- | Starts behaviours from left to right, in branches that are numbered from 1. What the function gives for a
-- branch's number and outcome is part of the transaction that publishes that outcome.
--
-- In constant stack: after each start GHC may run another thread, and before that it traverses
-- the whole stack of this one.
startAll :: Scope -> (Int -> Outcome a -> STM ()) -> [Behavior a] -> IO [Branch a]
startAll scope publishing = fmap reverse . foldM next [] . zip [1 ..]
 where
  next started (n, act) = (: started) <$> branchWith plainly {hook = publishing n} scope (show n) (const act)
