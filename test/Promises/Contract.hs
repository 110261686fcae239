{-# LANGUAGE LambdaCase #-}

-- |
-- The contract that every operator satisfies, anywhere in a program: what it may do, given
-- what its parts did.
--
-- Each part records how it ended. In reality a stop request may still arrive between
-- this record and the end of the thread, if the branch has returned. It cannot arrive if
-- the branch has thrown, nor if it has received one before, since no branch receives two.
-- So a branch has certainly completed only if it did so despite a stop request.
module Promises.Contract
  ( Clause (..)
  , satisfies
  ) where

import Control.Concurrent (ThreadId, myThreadId)
import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (mfilter, replicateM_, unless, void, when)
import Data.Foldable (for_, toList)
import Data.IORef
import Data.List (intercalate, isInfixOf, sortOn)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, isNothing)

import Behavior (Behavior, failWith)
import Behavior.Internal.Seam.Runtime (Label, atomically, liveThreadCount)
import Behavior.Message (withInbox)
import Behavior.Signal (polling, watching)
import Language.Operator hiding (run, tick)
import qualified Language.Operator as Language
import Promises.Program
import Promises.Stage hiding (ending)
import Support (Ending (..), ThreadEvent (..), endingOf, hang, watchingThreads)

-- | The clauses of the contract.
data Clause = Structure | Exclusion | Work | FaultOut | Masking | Outcomes | Labels
  deriving (Eq, Show)

-- | The state of a test while its program runs.
data Context = Context
  { stage :: Stage
  , world :: TVar (Maybe World)
  -- ^ None when it is over.
  , recordedViolations :: Log (Clause, String)
  , threadLabels :: IORef (Map ThreadId Label)
  }

-- | Runs the program, and checks that no operator in it violated the clause.
satisfies :: Clause -> Stage -> Program -> IO ()
satisfies clause place (Program part stimuli state) = do
  context <- Context place <$> newTVarIO (Just 0) <*> newLog <*> newIORef Map.empty
  driver <- newIORef (\() -> pure ())
  let caller box = do
        before <- liveThreadCount
        end <- try (inState state (behavior context (environmentWith box) part))
        after <- liveThreadCount
        unless (before == after) $
          recordViolation context Structure (show (after - before) ++ " threads were left running")
        case end of
          Left e | cancelledBy (endingOf (end :: Either SomeException Result)) -> throwIO e
          -- A caller that is to be cancelled waits for that. If its cancellation was lost, it
          -- waits for ever.
          _ -> if any (stopsCaller . snd) stimuli then hang else either throwIO pure end
      change = \case
        Becomes n -> atomically (writeTVar (world context) (Just n))
        Delivers -> readIORef driver >>= ($ ())
        Over -> atomically (writeTVar (world context) Nothing) >> replicateM_ room (change Delivers)
      whole =
        withInbox room (\delivers -> pure () <$ writeIORef driver delivers) (calling place change stimuli . caller)
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
  -- More than there are parts that wait for a message.
  room = 20

cancelledBy :: Ending a -> Bool
cancelledBy = \case
  CancelledBy _ -> True
  CancelledWithFault _ _ -> True
  FaultedWith f -> f == show Outside
  _ -> False

-- | The numbers of the leaves whose results it consists of; negated if one completed despite a stop request.
type Result = [Int]

-- | One run of an operator, and its observations.
data Observed = Observed
  { operator :: Operator Sensing ()
  , callerState :: MaskingState
  , running :: IORef Int
  , entries :: IORef [Entry]
  -- ^ The parts that have started, the newest first.
  }

-- | A part: the label of its branch, if it has a thread of its own, and how it ended, if it has.
data Entry = Entry (Maybe String) (Maybe (Ending Result))

-- | What a part is: of which operator, and in which branch.
data Role = Role Observed (Maybe String)

-- | Runs the part of a program.
behavior :: Context -> Environment Role Result -> Part -> Behavior Result
behavior t around = \case
  Leaf act -> pure <$> perform (stage t) (pure ()) (recordViolation t Structure "a cleanup was interrupted") act
  Calm -> [] <$ atomically (modifyTVar' (world t) (calm <$))
  Op o -> observed t o (\role -> Language.run (language t) around role role o)

-- | The library's operators, with each part observed.
language :: Context -> Language Role Sensing Part Result
language t =
  Language
    { runPart = \around role -> observedPart t role . behavior t around
    , inBranch = \label (Role o _) -> Role o (Just label)
    , signalOf = \around role -> \case
        Watched levels -> levelIn levels <$> watching reading
        Polled n levels ->
          levelIn levels <$> polling (fromIntegral n * tick (stage t)) (judgeLabel t role >> atomically reading)
        Shared -> nearest around
    , reactsTo = id
    , Language.tick = tick (stage t)
    , results = maybe [] concat
    }
 where
  reading = readTVar (world t) >>= maybe (failWith sawNothing) pure . mfilter (/= blind)
  levelIn levels n = (levels ++ [0]) !! n

-- | Why signals fail in a blind world, and parts when all is over.
sawNothing :: String
sawNothing = "nothing is seen"

recordViolation :: Context -> Clause -> String -> IO ()
recordViolation t clause = append (recordedViolations t) . (,) clause

-- | Observes one run of the operator, which gets its role, and records the violations at its end.
observed :: Context -> Operator Sensing Part -> (Role -> Behavior Result) -> Behavior Result
observed t o body = do
  state <- getMaskingState
  mask $ \restore -> do
    this <- Observed (void o) state <$> newIORef 0 <*> newIORef []
    end <- try (restore (body (Role this Nothing)))
    n <- readIORef (running this)
    unless (n == 0) $
      recordViolation t Structure (nameOf o ++ " has ended, but " ++ show n ++ " of its branches have not")
    readIORef (entries this) >>= contract t (operator this) (endingOf end) . reverse
    either (\e -> throwIO (e :: SomeException)) (pure . withoutSign) end
 where
  -- A stop request that another thread received was not this one's.
  withoutSign = if isJust (operatorName o) || forks o then map abs else id

-- | Observes a part of an operator.
observedPart :: Context -> Role -> Behavior Result -> Behavior Result
observedPart t role@(Role this branch) act = do
  state <- getMaskingState
  mask $ \restore -> do
    unless (state == maybe (callerState this) (const Unmasked) branch) $
      recordViolation t Masking (name ++ " runs " ++ show state)
    judgeLabel t role
    others <- atomicModifyIORef' (running this) (\n -> (n + 1, n))
    before <- readIORef (entries this)
    case branch of
      Nothing -> when (others > 0) $ recordViolation t Structure (name ++ " runs beside its branches")
      Just _ -> unless (atOnce (operator this)) $ do
        when (others > 0) $ recordViolation t Exclusion (name ++ " started although another branch runs")
        when (any completedDespiteStop before) $
          recordViolation t Work (name ++ " started although a branch had completed")
    key <- atomicModifyIORef' (entries this) (\es -> (Entry branch Nothing : es, length es))
    isOver <- isNothing <$> readTVarIO (world t)
    end <- try (restore (if isOver then failWith sawNothing else act))
    let ended' = Entry branch (Just (endingOf end))
    atomicModifyIORef' (entries this) $ \es ->
      let (newer, older) = splitAt (length es - key - 1) es in (newer ++ ended' : drop 1 older, ())
    atomicModifyIORef' (running this) (\n -> (n - 1, ()))
    either (\e -> throwIO (e :: SomeException)) pure end
 where
  name = nameOfPart role

-- | Records a violation if the thread does not have the label of the branch.
judgeLabel :: Context -> Role -> Behavior ()
judgeLabel t role@(Role _ branch) = for_ branch $ \expected -> do
  self <- Map.lookup <$> myThreadId <*> readIORef (threadLabels t)
  unless (fmap show self == Just expected) $
    recordViolation t Labels (nameOfPart role ++ " runs in a thread that is labelled " ++ show self)

nameOf :: Show s => Operator s p -> String
nameOf = show . void

nameOfPart :: Role -> String
nameOfPart (Role this branch) = maybe ("a part of " ++ nameOf (operator this)) show branch

-- | Whether the branch has completed despite a stop request. (A handler that has does not keep its rule from being
-- stopped.)
completedDespiteStop :: Entry -> Bool
completedDespiteStop (Entry branch end) = case end of
  Just (Gave ns) -> any (< 0) ns && branch /= Just "messageRule: handler"
  _ -> False

-- | Records a violation if the operator may not end like this, given how its parts ended, in the order of their
-- starts.
contract :: Context -> Operator Sensing () -> Ending Result -> [Entry] -> IO ()
contract t o end started = do
  case (faults, faultOf end) of
    ([], [f]) | f /= show Outside, not (isOwn f) -> wrong Outcomes "no part faulted"
    ([], _) -> pure ()
    ((first, leftmost) : _, fs) ->
      unless (any (`elem` [f | (place, f) <- faults, place == first]) fs) $
        wrong FaultOut ("the leftmost fault of its parts is " ++ leftmost)
  case end of
    Gave ns | not (fits ns) -> wrong Outcomes ("its parts returned " ++ show given)
    FailedWith why | why `notElem` failures, not (isOwn why) -> wrong Outcomes "no part failed like that"
    _ -> pure ()
  case [ns | not (atOnce o), (_, entry@(Entry (Just _) (Just (Gave ns)))) <- inOrder, completedDespiteStop entry] of
    ns : _
      | null faults, not (cancelledBy end), not (gaveThat ns) -> wrong Work ("a branch completed with " ++ show ns)
    _ -> pure ()
 where
  wrong clause why = recordViolation t clause (nameOf o ++ " ended: " ++ show end ++ ", but " ++ why)
  inOrder = sortOn fst (zipWith (\n entry -> (placeOf o n entry, entry)) [0 ..] started)
  outcomes = [(place, e) | (place, Entry _ (Just e)) <- inOrder]
  faults = [(place, f) | (place, e) <- outcomes, f <- faultOf e]
  faultOf = \case
    FaultedWith f -> [f]
    CancelledWithFault _ f -> [f]
    _ -> []
  given = [map abs ns | (_, Gave ns) <- outcomes]
  failures = [why | (_, FailedWith why) <- outcomes]
  gaveThat ns = case end of Gave ms -> map abs ms == map abs ns; _ -> False
  fits ns = case o of
    AllOf as -> length given == length as && map abs ns == concat given
    Both _ _ -> null ns && length given == 2
    _ -> null ns || map abs ns `elem` given || isAwaited
  isOwn text = isAwaited || any (`isInfixOf` text) (sawNothing : ownErrors o)
  -- What a child gives is an outcome of its scope's part.
  isAwaited = forks o

-- | The place of the part that started as the n-th: from left to right. (Labels are in this order, and what does not
-- run in a branch runs when these have ended. Which of two was forked first is not known.)
placeOf :: Operator s p -> Int -> Entry -> (Int, String)
placeOf o n (Entry branch _)
  | atOnce o = maybe (1, "") ((,) 0) branch
  | otherwise = (n, "")

-- | In the texts of the errors that an operator throws itself.
ownErrors :: Operator s p -> [String]
ownErrors o = case o of
  Decide {} -> ["too few have succeeded", "decide: all behaviours have ended"]
  WhileHolding _ _ -> ["the condition does not hold"]
  Timeout _ _ -> ["TimedOut"]
  Attempt n _ | n <= 0 -> ["Failed"]
  FallbackOver _ | null (toList o) -> ["Failed"]
  FirstOf [] -> ["Failed"]
  _ -> []
