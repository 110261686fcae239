{-# LANGUAGE LambdaCase #-}

-- |
-- The contract that every operator satisfies, anywhere in a tree: what it may do, given
-- what its branches did.
--
-- Each branch records how it ended. In reality a stop request may still arrive between
-- this record and the end of the thread, if the branch has returned. It cannot arrive if
-- the branch has thrown, nor if it has received one before, since no branch receives two.
-- So a branch has certainly completed only if it did so despite a stop request.
module Promises.Contract
  ( Clause (..)
  , satisfies
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (unless, void, when)
import Data.IORef
import Data.List (intercalate, sortOn)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isNothing)

import Behavior (Behavior, BehaviorFailed, attempt, both, failWith, fallback, parallel)
import Behavior.Internal.Seam.Runtime (Label (..), atomically, liveThreadCount)
import qualified Behavior.Parallel as Parallel
import Behavior.Signal (Signal, watching)
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)
import Promises.Stage hiding (ending)
import Promises.Tree
import Support (Ending (..), ThreadEvent (..), endingOf, hang, watchingThreads)

-- | The clauses of the contract.
data Clause = Structure | Exclusion | Work | FaultOut | Masking | Outcomes | Labels
  deriving (Eq, Show)

-- | The state of a test while its program runs.
data Context = Context
  { stage :: Stage
  , input :: TVar Int
  , recordedViolations :: Log (Clause, String)
  , threadLabels :: IORef (Map ThreadId Label)
  }

-- | Runs the program, and checks that no operator in it violated the clause.
satisfies :: Clause -> Stage -> Program -> IO ()
satisfies clause place (Program tree stimuli state) = do
  context <- Context place <$> newTVarIO 0 <*> newLog <*> newIORef Map.empty
  let caller = do
        before <- liveThreadCount
        end <- try (inState state (toBehavior context tree))
        after <- liveThreadCount
        unless (before == after) $
          recordViolation context Structure (show (after - before) ++ " threads were left running")
        case end of
          Left e | cancelledBy (endingOf (end :: Either SomeException Int)) -> throwIO e
          -- A caller that is to be cancelled waits for that. If its cancellation was lost, it
          -- waits for ever.
          _ -> if any (stopsCaller . snd) stimuli then hang else either throwIO pure end
      whole = calling place (atomically . writeTVar (input context)) stimuli caller
  end <- run place (if clause == Labels then watchingThreads (labelling context) whole else whole)
  case end of
    Gave outcome
      | cancelledBy outcome, not (any (stopsCaller . snd) stimuli) ->
          broken ("an outcome of a cancellation that was not sent: " ++ show outcome)
    Gave _ -> pure ()
    other -> broken ("the test's own thread ended: " ++ show other)
  found <- readLog (recordedViolations context)
  let violations = [how | (c, how) <- found, c == clause]
  unless (null violations) $ broken (intercalate "; " violations)
 where
  inState = \case
    Unmasked -> id
    MaskedInterruptible -> mask_
    MaskedUninterruptible -> uninterruptibleMask_
  labelling context = \case
    Started label ->
      myThreadId >>= \self -> atomicModifyIORef' (threadLabels context) (\m -> (Map.insert self label m, ()))
    _ -> pure ()

cancelledBy :: Ending a -> Bool
cancelledBy = \case
  CancelledBy _ -> True
  CancelledWithFault _ _ -> True
  FaultedWith f -> f == show Outside
  _ -> False

-- | The observations of one run of an operator.
data Observed = Observed
  { running :: IORef Int
  , entries :: IORef [(Int, Entry)]
  -- ^ The branches, the one that started last first, with the order of their starts.
  }

-- | A branch: its position from left to right, and how it ended, if it has.
data Entry = Entry Int (Maybe (Ending Int))

data Kind = Concurrent | Reactive
  deriving (Eq)

toBehavior :: Context -> Tree -> Behavior Int
toBehavior t = \case
  Leaf act -> perform (stage t) (pure ()) (recordViolation t Structure "a cleanup was interrupted") act
  Fallback a b -> do
    state <- getMaskingState
    fallback (toBehavior t a) $ do
      inside <- getMaskingState
      unless (inside == state) $ recordViolation t Masking ("the second of ? runs " ++ show inside)
      toBehavior t b
  Attempt n a -> attempt n (toBehavior t a)
  Parallel a b -> observed t "parallel" Concurrent [] $ \branch ->
    0 <$ parallel (branch 1 "left" a) (branch 2 "right" b)
  Both a b -> observed t "both" Concurrent [] $ \branch ->
    0 <$ both (branch 1 "left" a) (branch 2 "right" b)
  FirstOf as -> observed t "firstOf" Concurrent [] $ \branch ->
    Parallel.firstOf [branch n (show n) a | (n, a) <- zip [1 ..] as]
  AllOf as -> observed t "allOf" Concurrent [] $ \branch -> do
    results <- Parallel.allOf [abs <$> branch n (show n) a | (n, a) <- zip [1 ..] as]
    let expected = map valueOf as
    unless (and (zipWith agree expected results) && length results == length as) $
      recordViolation t Outcomes ("allOf gave " ++ show results)
    pure 0
  Decide m as -> observed t "decide" Concurrent ["too few have succeeded"] $ \branch -> do
    live <- newIORef (0 :: Int)
    let counted = bracket_ (count 1) (count (-1))
        count k = atomicModifyIORef' live (\n -> (n + k, ()))
        chosen = do
          n <- readIORef live
          unless (n == 0) $
            recordViolation t Structure ("what decide has chosen runs, but " ++ show n ++ " branches have not ended")
    Parallel.decide (atLeast m chosen) [counted (branch n (show n) a) | (n, a) <- zip [1 ..] as]
  Beside as b -> observed t "scoped" Concurrent [] $ \branch ->
    beside [void (branch n "fork" a) | (n, a) <- zip [2 ..] as] (branch 1 "body" b)
  Select sensing a b -> observed t "rSelect" Reactive [] $ \branch ->
    Signal.rSelect (odd <$> inputBy sensing) (branch 0 "left" a) (branch 0 "right" b)
  Monitor sensing a b -> observed t "monitor" Reactive [] $ \branch ->
    Signal.monitor ((== 2) <$> inputBy sensing) (branch 0 "recovery" a >> clear) (branch 0 "task" b)
  WhileHolding sensing a -> observed t "whileHolding" Reactive ["the condition does not hold"] $ \branch ->
    Signal.whileHolding ((/= 3) <$> inputBy sensing) (branch 0 "branch" a)
  Timeout n a -> observed t "timeout" Reactive ["TimedOut"] $ \branch ->
    timeout (fromIntegral n * tick (stage t)) (branch 0 "branch" a)
 where
  inputBy :: Sensing -> Signal Int
  inputBy Watched = watching (readTVar (input t))
  inputBy (Polled n) = Signal.polling (fromIntegral n * tick (stage t)) (atomically (readTVar (input t)))
  -- A recovery that did not remove its own cause would repeat for ever.
  clear = atomically (modifyTVar' (input t) (\w -> if w == 2 then 1 else w))
  valueOf = \case
    Leaf act -> Just (number act)
    _ -> Nothing
  agree expected result = maybe True (== result) expected

-- | The first result when that many have succeeded.
atLeast :: Int -> Behavior () -> [Maybe (Either BehaviorFailed Int)] -> Maybe (Behavior Int)
atLeast m chosen outcomes
  | length results >= m = Just (head results <$ chosen)
  | length results + length (filter isNothing outcomes) < m = Just (chosen >> failWith "too few have succeeded")
  | otherwise = Nothing
 where
  results = [n | Just (Right n) <- outcomes]

recordViolation :: Context -> Clause -> String -> IO ()
recordViolation t clause = append (recordedViolations t) . (,) clause

-- | Observes one run of an operator, whose branches are made by the function that the last
-- argument receives, and records the violations at its end. The texts are those of the
-- operator's own failures.
observed
  :: Context -> String -> Kind -> [String] -> ((Int -> String -> Tree -> Behavior Int) -> Behavior Int) -> Behavior Int
observed t operator kind ownFailures body = mask $ \restore -> do
  o <- Observed <$> newIORef 0 <*> newIORef []
  end <- try (restore (body (branching t operator kind o)))
  n <- readIORef (running o)
  unless (n == 0) $
    recordViolation t Structure (operator ++ " has ended, but " ++ show n ++ " of its branches have not")
  started <- reverse . map snd <$> readIORef (entries o)
  contract t operator kind ownFailures (endingOf end) started
  either (\e -> throwIO (e :: SomeException)) (pure . abs) end

-- | An observed branch.
branching :: Context -> String -> Kind -> Observed -> Int -> String -> Tree -> Behavior Int
branching t operator kind o place name tree = do
  state <- getMaskingState
  mask $ \restore -> do
    unless (state == Unmasked) $ recordViolation t Masking (expected ++ " runs " ++ show state)
    self <- Map.lookup <$> myThreadId <*> readIORef (threadLabels t)
    unless (self == Just (Label operator name)) $
      recordViolation t Labels (expected ++ " runs in a thread that is labelled " ++ show self)
    others <- atomicModifyIORef' (running o) (\n -> (n + 1, n))
    when (kind == Reactive && others > 0) $
      recordViolation t Exclusion (expected ++ " started although another branch runs")
    before <- readIORef (entries o)
    when (kind == Reactive && any (completedDespiteStop . snd) before) $
      recordViolation t Work (expected ++ " started although a branch had completed")
    key <- atomicModifyIORef' (entries o) (\es -> ((length es, Entry place Nothing) : es, length es))
    end <- try (restore (toBehavior t tree))
    let ended' = Entry place (Just (endingOf end))
    atomicModifyIORef' (entries o) (\es -> ([(k, if k == key then ended' else e) | (k, e) <- es], ()))
    atomicModifyIORef' (running o) (\n -> (n - 1, ()))
    either (\e -> throwIO (e :: SomeException)) pure end
 where
  expected = show (Label operator name)

-- | Whether the branch has completed despite a stop request.
completedDespiteStop :: Entry -> Bool
completedDespiteStop (Entry _ end) = case end of
  Just (Gave n) -> n < 0
  _ -> False

-- | Records a violation if the operator may not end like this, given how its branches ended.
contract :: Context -> String -> Kind -> [String] -> Ending Int -> [Entry] -> IO ()
contract t operator kind ownFailures end started = do
  case faults of
    leftmost : _ -> case end of
      FaultedWith f | f == leftmost -> pure ()
      CancelledWithFault _ f | f == leftmost -> pure ()
      _ -> wrong FaultOut ("the leftmost fault of its branches is " ++ leftmost)
    [] -> case end of
      FaultedWith f | f /= show Outside -> wrong Outcomes "no branch faulted"
      CancelledWithFault _ _ -> wrong Outcomes "no branch faulted"
      _ -> pure ()
  case end of
    Gave n
      | n /= 0, n `notElem` results, negate n `notElem` results -> wrong Outcomes "no branch returned that"
    FailedWith why
      | why `notElem` failures, not (any (`begins` why) ownFailures) -> wrong Outcomes "no branch failed like that"
    _ -> pure ()
  when (operator == "both" && gave && length results /= 2) $ wrong Outcomes "not both have completed"
  case [n | kind == Reactive, Gave n <- outcomes, n < 0] of
    n : _
      | null faults, not (cancelledBy end), not (gave && valueIs n) ->
          wrong Work ("a branch completed with " ++ show (abs n))
    _ -> pure ()
 where
  wrong clause why = recordViolation t clause (operator ++ " ended: " ++ show end ++ ", but " ++ why)
  outcomes = [e | Entry _ (Just e) <- inOrder]
  -- Branches at the same position have started one after the other.
  inOrder = sortOn (\(Entry place _) -> place) started
  faults = concatMap (\case FaultedWith f -> [f]; CancelledWithFault _ f -> [f]; _ -> []) outcomes
  results = [n | Gave n <- outcomes]
  failures = [why | FailedWith why <- outcomes]
  gave = case end of Gave _ -> True; _ -> False
  valueIs n = case end of Gave m -> abs m == abs n; _ -> False
  begins prefix text = any (\k -> take (length prefix) (drop k text) == prefix) [0 .. length text]
