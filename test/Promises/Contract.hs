{-# LANGUAGE LambdaCase #-}

-- |
-- The contract that every operator is held to, wherever in a tree it stands: what it may
-- do, given what its branches did.
--
-- How a branch ended is noted by the branch itself. In reality a request to stop may
-- still strike between the note and the end of the thread, when the branch has returned;
-- not when it has thrown, nor when it was asked before, for nobody is asked twice. So
-- only the work of those that were asked counts as done for sure.
module Promises.Contract
  ( Clause (..)
  , obeys
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar, writeTVar)
import Control.Exception
import Control.Monad (unless, void, when)
import Data.IORef
import Data.List (intercalate, sortOn)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map

import Behavior (Behavior)
import Behavior.Internal.Runtime (Event (..), Label (..), atomically, liveThreadCount, withSink)
import Behavior.Signal (Signal, watching)
import Promises.Language (Language)
import qualified Promises.Language as L
import Promises.Stage hiding (ending)
import Promises.Tree
import Support (Ending (..), endingOf, hang)

-- | What a complaint is about.
data Clause = Structure | Exclusion | Work | FaultOut | Masking | Outcomes | Labels
  deriving (Eq, Show)

-- | What is known while a program runs.
data Theatre = Theatre
  { stage :: Stage
  , language :: Language
  , input :: TVar Int
  , complaints :: Journal (Clause, String)
  , named :: IORef (Map ThreadId Label)
  }

-- | Runs the program, and sees that no operator in it violated the clause.
obeys :: Clause -> Stage -> Language -> Program -> IO ()
obeys clause stage' language' (Program tree deeds state) = do
  theatre <- Theatre stage' language' <$> newTVarIO 0 <*> newJournal <*> newIORef Map.empty
  let caller = do
        before <- liveThreadCount
        end <- try (inState state (grow theatre tree))
        after <- liveThreadCount
        unless (before == after) $ complaint theatre Structure (show (after - before) ++ " threads were left running")
        case end of
          Left e | cancelledBy (endingOf (end :: Either SomeException Int)) -> throwIO e
          -- Whoever was cancelled and goes on waits for ever.
          _ -> if any (stopsIt . snd) deeds then hang else either throwIO pure end
      whole = calling stage' (atomically . writeTVar (input theatre)) deeds caller
  end <- (if clause == Labels then withSink (labelling theatre) else id) (run stage' whole)
  case end of
    Gave outcome
      | cancelledBy outcome, not (any (stopsIt . snd) deeds) -> broken ("a cancellation that nobody sent: " ++ show outcome)
    Gave _ -> pure ()
    other -> broken ("the frame of the trial ended: " ++ show other)
  found <- journal (complaints theatre)
  let violations = [how | (c, how) <- found, c == clause]
  unless (null violations) $ broken (intercalate "; " violations)
 where
  inState = \case
    Unmasked -> id
    MaskedInterruptible -> mask_
    MaskedUninterruptible -> uninterruptibleMask_
  labelling theatre = \case
    Started label -> myThreadId >>= \self -> atomicModifyIORef' (named theatre) (\m -> (Map.insert self label m, ()))
    _ -> pure ()

cancelledBy :: Ending a -> Bool
cancelledBy = \case
  CancelledBy _ -> True
  CancelledWithFault _ _ -> True
  FaultedWith f -> f == show Outside
  _ -> False

-- | One run of an operator, as it is observed.
data Observed = Observed
  { running :: IORef Int
  , entries :: IORef [(Int, Entry)]
  -- ^ The branches, the one that started last first.
  }

-- | A branch: its place from left to right, and how it ended, if it has.
data Entry = Entry Int (Maybe (Ending Int))

-- | What kind of operator it is.
data Kind = Concurrent | Reactive
  deriving (Eq)

grow :: Theatre -> Tree -> Behavior Int
grow t = \case
  Leaf act -> perform (stage t) (pure ()) (complaint t Structure "a cleanup was interrupted") act
  Fallback a b -> do
    state <- getMaskingState
    L.fallback l (grow t a) $ do
      inside <- getMaskingState
      unless (inside == state) $ complaint t Masking ("the second of ? runs " ++ show inside)
      grow t b
  Attempt n a -> L.attempt l n (grow t a)
  Parallel a b -> observed t "parallel" Concurrent [] $ \branch ->
    0 <$ L.parallel l (branch 1 "left" a) (branch 2 "right" b)
  Both a b -> observed t "both" Concurrent [] $ \branch ->
    0 <$ L.both l (branch 1 "left" a) (branch 2 "right" b)
  FirstOf as -> observed t "firstOf" Concurrent [] $ \branch ->
    L.firstOf l [branch n (show n) a | (n, a) <- zip [1 ..] as]
  AllOf as -> observed t "allOf" Concurrent [] $ \branch -> do
    results <- L.allOf l [abs <$> branch n (show n) a | (n, a) <- zip [1 ..] as]
    let expected = map valueOf as
    unless (and (zipWith agree expected results) && length results == length as) $
      complaint t Outcomes ("allOf gave " ++ show results)
    pure 0
  Beside as b -> observed t "scoped" Concurrent [] $ \branch ->
    L.beside l [void (branch n "fork" a) | (n, a) <- zip [2 ..] as] (branch 1 "body" b)
  Select look a b -> observed t "rSelect" Reactive [] $ \branch ->
    L.rSelect l (odd <$> inputBy look) (branch 0 "left" a) (branch 0 "right" b)
  Monitor look a b -> observed t "monitor" Reactive [] $ \branch ->
    L.monitor l ((== 2) <$> inputBy look) (branch 0 "recovery" a >> clear) (branch 0 "task" b)
  WhileHolding look a -> observed t "whileHolding" Reactive ["the condition does not hold"] $ \branch ->
    L.whileHolding l ((/= 3) <$> inputBy look) (branch 0 "branch" a)
  Timeout n a -> observed t "timeout" Reactive ["TimedOut"] $ \branch ->
    L.timeout l (fromIntegral n * tick (stage t)) (branch 0 "branch" a)
 where
  l = language t
  inputBy :: Look -> Signal Int
  inputBy Watched = watching (readTVar (input t))
  inputBy (Polled n) = L.polling l (fromIntegral n * tick (stage t)) (atomically (readTVar (input t)))
  -- A recovery that did not remove its own cause would run for ever.
  clear = atomically (modifyTVar' (input t) (\w -> if w == 2 then 1 else w))
  valueOf = \case
    Leaf act -> Just (number act)
    _ -> Nothing
  agree expected result = maybe True (== result) expected

complaint :: Theatre -> Clause -> String -> IO ()
complaint t clause = enter (complaints t) . (,) clause

-- | Observes one run of an operator, of which the branches are made by the given
-- function; and complains when it is over. The texts are those of its own failures.
observed
  :: Theatre -> String -> Kind -> [String] -> ((Int -> String -> Tree -> Behavior Int) -> Behavior Int) -> Behavior Int
observed t operator kind own body = mask $ \restore -> do
  o <- Observed <$> newIORef 0 <*> newIORef []
  end <- try (restore (body (branching t operator kind o)))
  n <- readIORef (running o)
  unless (n == 0) $ complaint t Structure (operator ++ " has ended, but " ++ show n ++ " of its branches have not")
  started <- reverse . map snd <$> readIORef (entries o)
  contract t operator kind own (endingOf end) started
  either (\e -> throwIO (e :: SomeException)) (pure . abs) end

-- | A branch, as it is observed.
branching :: Theatre -> String -> Kind -> Observed -> Int -> String -> Tree -> Behavior Int
branching t operator kind o place name tree = do
  state <- getMaskingState
  mask $ \restore -> do
    unless (state == Unmasked) $ complaint t Masking (expected ++ " runs " ++ show state)
    self <- Map.lookup <$> myThreadId <*> readIORef (named t)
    unless (self == Just (Label operator name)) $ complaint t Labels (expected ++ " runs in a thread that is labelled " ++ show self)
    others <- atomicModifyIORef' (running o) (\n -> (n + 1, n))
    when (kind == Reactive && others > 0) $ complaint t Exclusion (expected ++ " started although another branch runs")
    before <- readIORef (entries o)
    when (kind == Reactive && any (completedAllTheSame . snd) before) $
      complaint t Work (expected ++ " started although a branch had completed")
    key <- atomicModifyIORef' (entries o) (\es -> ((length es, Entry place Nothing) : es, length es))
    end <- try (restore (grow t tree))
    atomicModifyIORef' (entries o) (\es -> ([(k, if k == key then Entry place (Just (endingOf end)) else e) | (k, e) <- es], ()))
    atomicModifyIORef' (running o) (\n -> (n - 1, ()))
    either (\e -> throwIO (e :: SomeException)) pure end
 where
  expected = show (Label operator name)

-- | It was asked to stop, and completed.
completedAllTheSame :: Entry -> Bool
completedAllTheSame (Entry _ end) = case end of
  Just (Gave n) -> n < 0
  _ -> False

-- | How an operator may end, given how its branches did.
contract :: Theatre -> String -> Kind -> [String] -> Ending Int -> [Entry] -> IO ()
contract t operator kind own end started = do
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
      | why `notElem` failures, not (any (`begins` why) own) -> wrong Outcomes "no branch failed like that"
    _ -> pure ()
  when (operator == "both" && gave && length results /= 2) $ wrong Outcomes "not both have completed"
  case [n | kind == Reactive, Gave n <- outcomes, n < 0] of
    n : _ | null faults, not (cancelledBy end), not (gave && valueIs n) -> wrong Work ("a branch completed with " ++ show (abs n))
    _ -> pure ()
 where
  wrong clause why = complaint t clause (operator ++ " ended: " ++ show end ++ ", but " ++ why)
  outcomes = [e | Entry _ (Just e) <- inOrder]
  -- Those of one place started one after the other.
  inOrder = sortOn (\(Entry place _) -> place) started
  faults = concatMap (\case FaultedWith f -> [f]; CancelledWithFault _ f -> [f]; _ -> []) outcomes
  results = [n | Gave n <- outcomes]
  failures = [why | FailedWith why <- outcomes]
  gave = case end of Gave _ -> True; _ -> False
  valueIs n = case end of Gave m -> abs m == abs n; _ -> False
  begins prefix text = any (\k -> take (length prefix) (drop k text) == prefix) [0 .. length text]
