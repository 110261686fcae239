{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The scheduler: one thread at a time.
--
-- Each simulated thread is a real one, a 'Task', that runs only while it has the turn
-- and otherwise waits at a gate of its own. All operations of the seam begin in
-- 'operation', where the one that has the turn may hand it on. Only who has the turn
-- touches the state of the simulation, so that needs no locks.
--
-- An exception is not thrown from outside: its target raises it itself, when it next has
-- the turn, in the place of its operation. Whether it can be heard there is GHC's own rule:
-- unmasked, or masked and the operation has to wait.
--
-- Time moves when no task can do anything.
module Behavior.Internal.Sim.Scheduler
  ( Sim (..)
  , Task (..)
  , Verdict (..)
  , newSim
  , launch
  , simulation
  , waitings
  , Unwind (..)
  ) where

import Control.Concurrent
import Control.Concurrent.STM (STM, catchSTM, orElse, throwSTM)
import qualified Control.Concurrent.STM as STM
import Control.Exception
import Control.Monad (filterM, unless, void, when)
import Data.Foldable (for_)
import Data.IORef
import Data.List (find)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.Maybe (isJust)
import Foreign.StablePtr (newStablePtr)

import Behavior.Internal.Seam
import Behavior.Internal.Sim.Policy
import Behavior.Internal.Sim.Types

-- | A simulation.
data Sim = Sim
  { options :: !Options
  , chooser :: !Policy
  , capability :: !Int
  -- ^ All tasks are on one, so that handing the turn on is cheap.
  , current :: !(IORef Task)
  -- ^ Who has the turn.
  , tasks :: !(IORef (IntMap Task))
  -- ^ Those that have not ended.
  , nextNumber :: !(IORef Int)
  , time :: !(IORef Seconds)
  , counter :: !(IORef Int)
  -- ^ The number of the scheduling point.
  , askingAt :: !(IORef Int)
  -- ^ Up to this point, who has the turn keeps it as long as it can go on.
  , rotateAt :: !(IORef Int)
  -- ^ At this point another has to have its turn.
  , movedAt :: !(IORef Int)
  -- ^ At this point the time moved last.
  , commits :: !(IORef Int)
  -- ^ How many transactions were run: what a waiting one sees may have changed.
  , taken :: !(IORef [(Int, Int)])
  -- ^ The decisions that were not the usual ones, the latest first.
  , history :: !(IORef [Step])
  -- ^ The latest first.
  , over :: !(MVar Verdict)
  -- ^ How the run ended. Who puts it has no turn any more.
  , unwinding :: !(IORef Bool)
  -- ^ The run has ended; now its tasks are.
  , driven :: !(IORef Bool)
  -- ^ The driver has the turn, and lends it to one task after the other.
  , back :: !(MVar ())
  -- ^ The driver gets the turn back.
  , strikes :: !(IORef Int)
  -- ^ How many operations the task that is being unwound has tried.
  }

-- | How a run ended, when it is not that the behaviour did.
data Verdict
  = Over
  | Hopeless [Waiting]
  | Standing [Label]
  | Late
  | Tampered [Waiting]
  | Stuck Label Blocked
  | Slow Label
  | Unfit String

-- | A simulated thread; or a messenger, which has no thread and only throws.
data Task = Task
  { taskNumber :: !Int
  , taskLabel :: !Label
  , taskThread :: !(Maybe ThreadId)
  , gate :: !(MVar ())
  , place :: !(IORef Place)
  , raised :: !(IORef (Maybe SomeException))
  -- ^ What was thrown to it and has arrived; it raises that when it has the turn.
  , parent :: !Int
  }

-- | Where a task stands while it does not have the turn.
data Place
  = Unstarted
  | Before !MaskingState !Operation
  | Gone

-- | What a task is about to do, as far as it matters to whether it can.
data Operation
  = Free
  | Transaction (IO Bool) !(IORef Look)
  | Moment !Seconds
  | Delivery !Task SomeException

-- | Whether a transaction would have run, when so many had been run.
data Look = Look !Int !Bool

-- | What unwinds a task when the run has ended.
data Unwind = Unwind

instance Show Unwind where
  show Unwind = "Unwind: the simulation has ended"

instance Exception Unwind where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

-- | A simulation without tasks, on the caller's capability.
newSim :: Options -> Policy -> IO Sim
newSim o p = do
  (here, _) <- threadCapability =<< myThreadId
  firstAsk <- askAt p
  box <- newEmptyMVar
  nowhere <- newIORef Unstarted
  nothing <- newIORef Nothing
  let noTask = Task (-1) (Label "nobody" "") Nothing box nowhere nothing (-1)
  Sim o p here
    <$> newIORef noTask
    <*> newIORef IntMap.empty
    <*> newIORef 0
    <*> newIORef 0
    <*> newIORef 0
    <*> newIORef (min firstAsk turns)
    <*> newIORef turns
    <*> newIORef 0
    <*> newIORef 0
    <*> newIORef []
    <*> newIORef []
    <*> newEmptyMVar
    <*> newIORef False
    <*> newIORef False
    <*> newEmptyMVar
    <*> newIORef 0

-- | For so many points one task may go on in the undisturbed schedule.
turns :: Int
turns = 1000

-- * The operations

-- | What the seam calls.
simulation :: Sim -> Simulator
simulation sim =
  Simulator
    { hasTurn = \self -> (== Just self) . taskThread <$> readIORef (current sim)
    , spawn = \label' body publish -> do
        operation sim Free
        me <- readIORef (current sim)
        task <- launch sim (taskNumber me) label' body publish
        maybe (throwIO (ErrorCall "unreachable")) pure (taskThread task)
    , deliver = \target e -> withTarget target $ \there -> do
        detail sim (Throws (taskLabel there))
        operation sim (Delivery there e)
        arriveAt there e
    , send = \target e -> withTarget target $ \there -> do
        detail sim (Throws (taskLabel there))
        operation sim Free
        void (enlist sim (Label "interrupt" "messenger") Nothing (Before MaskedUninterruptible (Delivery there e)))
    , transact = transaction sim
    , clock = operation sim Free >> readIORef (time sim)
    , await = \moment -> do
        detail sim (Sleeps moment)
        operation sim (Moment moment)
    , pause = operation sim Free
    , record = \case
        Started _ -> noteStep sim Starts
        Ended _ -> noteStep sim Ends
        Noted text -> noteStep sim (Says text)
    }
 where
  -- One that has ended hears nothing.
  withTarget target act = do
    all' <- IntMap.elems <$> readIORef (tasks sim)
    case filter ((== Just target) . taskThread) all' of
      there : _ -> act there
      [] -> operation sim Free

-- | Starts a real thread for a task; it waits for its turn.
launch :: Sim -> Int -> Label -> (IO () -> (forall b. IO b -> IO b) -> IO a) -> (a -> STM ()) -> IO Task
launch sim mother label' body publish = do
  entrance <- newEmptyMVar
  thread <- mask_ $ forkOnWithUnmask (capability sim) $ \unmask -> do
    uninterruptibleMask_ (takeMVar entrance)
    self <- readIORef (current sim)
    a <- body (arrive sim self) unmask
    uninterruptibleMask_ (leave sim self (publish a))
  enlistWith sim mother label' (Just thread) entrance Unstarted

enlist :: Sim -> Label -> Maybe ThreadId -> Place -> IO Task
enlist sim label' thread here = do
  entrance <- newEmptyMVar
  me <- readIORef (current sim)
  enlistWith sim (taskNumber me) label' thread entrance here

enlistWith :: Sim -> Int -> Label -> Maybe ThreadId -> MVar () -> Place -> IO Task
enlistWith sim mother label' thread entrance here = do
  n <- readIORef (nextNumber sim)
  writeIORef (nextNumber sim) (n + 1)
  there <- newIORef here
  nothing <- newIORef Nothing
  let task = Task n label' thread entrance there nothing mother
  modifyIORef' (tasks sim) (IntMap.insert n task)
  pure task

-- | The scheduling point before an operation. When it returns, the calling task has the
-- turn and the operation can be done; or it throws what has arrived.
operation :: Sim -> Operation -> IO ()
operation sim op = do
  quick <- keeps sim
  possible' <- if quick then possible sim op else pure False
  unless possible' (handOn sim op)
{-# INLINE operation #-}

-- | Counts a scheduling point; whether who has the turn keeps it, if it can go on.
keeps :: Sim -> IO Bool
keeps sim = tick sim >>= \n -> (n <) <$> readIORef (askingAt sim)
{-# INLINE keeps #-}

-- | Each decision has a number of its own.
tick :: Sim -> IO Int
tick sim = do
  n <- (+ 1) <$> readIORef (counter sim)
  writeIORef (counter sim) $! n
  pure n
{-# INLINE tick #-}

-- | Runs a transaction, in its turn.
transaction :: Sim -> STM a -> IO a
transaction sim act = do
  detail sim Transacts
  quick <- keeps sim
  done <- if quick then tried else pure Nothing
  maybe (newIORef (Look (-1) False) >>= waiting) pure done
 where
  tried = do
    result <- STM.atomically ((Just <$> act) `orElse` pure Nothing)
    when (isJust result) (committed sim)
    pure result
  waiting look = do
    handOn sim (Transaction wouldRun look)
    -- It does run, unless something outside of the simulation undid it just now; or
    -- the run has ended.
    tried >>= \case
      Just a -> pure a
      Nothing -> do
        ending <- readIORef (unwinding sim)
        if ending then throwIO Unwind else waiting look
  wouldRun =
    STM.atomically $
      ((act >> throwSTM Undo) `catchSTM` \(_ :: SomeException) -> pure True) `orElse` pure False

data Undo = Undo
  deriving (Show)

instance Exception Undo

committed :: Sim -> IO ()
committed sim = do
  n <- readIORef (commits sim)
  writeIORef (commits sim) $! n + 1

-- * Handing the turn on

-- | Lets the others run, as the policy says, and returns when it is the caller's turn.
handOn :: Sim -> Operation -> IO ()
handOn sim op = do
  masking <- getMaskingState
  uninterruptibleMask_ $ do
    me <- readIORef (current sim)
    ending <- readIORef (unwinding sim)
    if ending
      then beingUnwound sim me
      else do
        writeIORef (place me) (Before masking op)
        next <- choose sim (Just me)
        case next of
          Just task | taskNumber task == taskNumber me -> pure ()
          _ -> for_ next (turnTo sim) >> takeMVar (gate me)
        arrive sim me

turnTo :: Sim -> Task -> IO ()
turnTo sim task = writeIORef (current sim) task >> putMVar (gate task) ()

-- | The caller has the turn: it raises what was thrown to it.
arrive :: Sim -> Task -> IO ()
arrive sim me = do
  ending <- readIORef (unwinding sim)
  if ending
    then throwIO Unwind
    else
      readIORef (raised me) >>= \case
        Nothing -> pure ()
        Just e -> do
          writeIORef (raised me) Nothing
          noteStep sim (Hears (show e))
          throwIO e

-- | The end of a task is an operation too.
leave :: Sim -> Task -> STM () -> IO ()
leave sim me publish = do
  ending <- readIORef (unwinding sim)
  unless ending (tick sim >> handOn sim Free `catch` \Unwind -> pure ())
  STM.atomically publish
  committed sim
  modifyIORef' (tasks sim) (IntMap.delete (taskNumber me))
  writeIORef (place me) Gone
  endingNow <- readIORef (unwinding sim)
  if endingNow
    then putMVar (back sim) ()
    else
      if taskNumber me == 0
        then conclude sim Over
        else tick sim >> choose sim Nothing >>= mapM_ (turnTo sim)

-- | Ends the run. If somebody else has ended it meanwhile, the turn goes to the driver.
conclude :: Sim -> Verdict -> IO ()
conclude sim verdict = do
  first <- tryPutMVar (over sim) verdict
  unless first (putMVar (back sim) ())

-- | Who is next. Nobody when the run has ended by this; then the driver has the turn.
choose :: Sim -> Maybe Task -> IO (Maybe Task)
choose sim me = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  able <- filterM (enabled sim) alive
  n <- readIORef (counter sim)
  moved <- readIORef (movedAt sim)
  rotating <- (n >=) <$> readIORef (rotateAt sim)
  case able of
    [] -> nobody sim alive >>= \hope -> if hope then choose sim me else pure Nothing
    _ | n - moved > standstill (options sim) -> finishing (Standing (map taskLabel able))
    [only] -> run n rotating only
    first : _ -> do
      let goesOn = any isMe able && not rotating
          usually
            | goesOn = mine
            | otherwise = maybe (taskNumber first) taskNumber (find ((> mine) . taskNumber) able)
      decided <- decide (chooser sim) (Decision n usually goesOn (map taskNumber able))
      case decided >>= \chosen -> maybe (Left "no such thread") Right (find ((== chosen) . taskNumber) able) of
        Left why -> finishing (Unfit why)
        Right task -> do
          when (taskNumber task /= usually) (modifyIORef' (taken sim) ((n, taskNumber task) :))
          when (goesOn && not (isMe task)) (detail sim IsPreempted)
          run n rotating task
 where
  mine = maybe (-1) taskNumber me
  isMe task = taskNumber task == mine
  finishing verdict = Nothing <$ conclude sim verdict

  run n rotating task = do
    when (rotating || not (isMe task)) (writeIORef (rotateAt sim) $! n + turns)
    ask <- askAt (chooser sim)
    rotate <- readIORef (rotateAt sim)
    writeIORef (askingAt sim) $! min ask rotate
    if isJust (taskThread task) then pure (Just task) else carry task

  -- A messenger does its one errand at once; then somebody else is next.
  carry messenger = do
    readIORef (place messenger) >>= \case
      Before _ (Delivery target e) -> arriveAt target e
      _ -> pure ()
    modifyIORef' (tasks sim) (IntMap.delete (taskNumber messenger))
    _ <- tick sim
    choose sim me

-- | What was thrown to the task has arrived, if that has not ended.
arriveAt :: Task -> SomeException -> IO ()
arriveAt target e =
  readIORef (place target) >>= \case
    Gone -> pure ()
    _ -> writeIORef (raised target) (Just e)

-- | Whether the task could use the turn.
enabled :: Sim -> Task -> IO Bool
enabled sim task =
  readIORef (raised task) >>= \case
    Just _ -> pure True
    Nothing ->
      readIORef (place task) >>= \case
        Unstarted -> pure True
        Before _ op -> possible sim op
        Gone -> pure False

-- | Whether the operation can be done now.
possible :: Sim -> Operation -> IO Bool
possible sim = \case
  Free -> pure True
  Moment t -> (t <=) <$> readIORef (time sim)
  Delivery target _ -> hears sim target
  Transaction wouldRun look -> do
    Look looked was <- readIORef look
    n <- readIORef (commits sim)
    if looked == n
      then pure was
      else do
        is <- wouldRun
        is <$ writeIORef look (Look n is)

-- | Whether what is thrown to the task arrives now (also: whether it has ended).
hears :: Sim -> Task -> IO Bool
hears sim target =
  readIORef (raised target) >>= \case
    Just _ -> pure False
    Nothing ->
      readIORef (place target) >>= \case
        Unstarted -> pure True
        Gone -> pure True
        Before Unmasked _ -> pure True
        Before MaskedInterruptible op -> not <$> possible sim op
        Before MaskedUninterruptible _ -> pure False

-- | No task can do anything: time moves on to when one can, and this is true; or the run
-- has ended.
nobody :: Sim -> [Task] -> IO Bool
nobody sim alive = do
  moments <- concat <$> traverse wakes alive
  t <- readIORef (time sim)
  case filter (not . isInfinite . realToDouble) moments of
    [] -> do
      disturbed <- meddled
      who' <- waitings sim
      False <$ conclude sim (if disturbed then Tampered who' else Hopeless who')
    some
      | next > endAt (options sim) -> do
          writeIORef (time sim) $! max t (endAt (options sim))
          False <$ conclude sim Late
      | otherwise -> do
          writeIORef (time sim) $! next
          readIORef (counter sim) >>= writeIORef (movedAt sim)
          pure True
     where
      next = minimum some
 where
  realToDouble (Seconds d) = d
  wakes task =
    readIORef (place task) >>= \case
      Before _ (Moment t) -> pure [t]
      _ -> pure []
  -- Nothing in the simulation can wake anybody. Something outside might just have: a
  -- thread of the user's own.
  meddled = looking (5 :: Int)
  looking 0 = pure False
  looking n = do
    committed sim
    able <- or <$> traverse (enabled sim) alive
    if able then pure True else threadDelay 1000 >> looking (n - 1)

-- | Who waits for what.
waitings :: Sim -> IO [Waiting]
waitings sim = do
  alive <- IntMap.elems <$> readIORef (tasks sim)
  traverse (\task -> Waiting (taskLabel task) . reason alive task <$> readIORef (place task)) alive
 where
  reason alive task = \case
    Before _ (Transaction _ _) -> case [show (taskLabel t) | t <- alive, parent t == taskNumber task, isJust (taskThread t)] of
      [] -> "a transaction"
      branches -> "its branches: " ++ commas branches
    Before _ (Moment _) -> "the end of time"
    Before _ (Delivery target _) -> show (taskLabel target) ++ ", to hear an exception"
    _ -> "its turn"
  commas = foldr1 (\a b -> a ++ ", " ++ b)

-- * When the run has ended

-- | The run has ended. Who is not driven yet gives the turn to the driver. Who is has
-- the turn for good: its operations are done at once, and what would wait is unwound
-- instead. One that goes on for ever all the same never runs again.
beingUnwound :: Sim -> Task -> IO ()
beingUnwound sim me = do
  isDriven <- readIORef (driven sim)
  if not isDriven
    then putMVar (back sim) () >> takeMVar (gate me) >> throwIO Unwind
    else do
      n <- readIORef (strikes sim)
      writeIORef (strikes sim) $! n + 1
      when (n > 20000) $ do
        -- While this reference lives, the thread is not woken to be told that it is
        -- waited for by nobody.
        _ <- newStablePtr (gate me)
        modifyIORef' (tasks sim) (IntMap.delete (taskNumber me))
        putMVar (back sim) ()
        takeMVar (gate me)
      when (n > 10000) (throwIO Unwind)

-- * The record

noteStep :: Sim -> Did -> IO ()
noteStep sim what' = do
  me <- readIORef (current sim)
  t <- readIORef (time sim)
  n <- readIORef (counter sim)
  modifyIORef' (history sim) (Step t n (taskNumber me) (taskLabel me) what' :)

detail :: Sim -> Did -> IO ()
detail sim what' = when (detailed (options sim)) (noteStep sim what')
{-# INLINE detail #-}
