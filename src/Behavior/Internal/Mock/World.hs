{-# OPTIONS_HADDOCK not-home #-}

-- |
-- A mock world, and the record of what happens there.
--
-- To record an entry is not an operation of the seam; to read the time is one. So reading the time,
-- recording an entry right after that, and what is done right after the entry, are one step of a
-- simulation.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.World
  ( Mock
  , newMock
  , begin
  , note

    -- * For what is in the world
  , clock
  , recordEntry
  , register
  , registerPending
  , checkTimes

    -- * The record
  , happened
  , shouldRecord
  , BrokenClaim (..)
  ) where

import Control.Applicative ((<|>))
import Control.Concurrent.STM (STM)
import Control.Exception (ErrorCall (..), Exception, mask_, throwIO)
import Control.Monad (join, unless, void, when)
import Data.Foldable (for_)
import Data.IORef
import Data.Maybe (isJust, isNothing)

import Behavior.Internal.Core.Failure (Behavior)
import Behavior.Internal.Core.Property (Property, keepMistake, keepPremises)
import Behavior.Internal.Mock.Claim (Claim, premisesIn, verdict)
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Subject
import Behavior.Internal.Seam.Runtime

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Sim
-- >>> import Behavior.Sim.Mock
-- >>> mock <- newMock

-- | A mock world, and the record of what happens there. Make a new one for each run.
--
-- @since 0.1.0.0
data Mock = Mock
  { beginning :: IORef (Maybe Beginning)
  , madeIn :: Maybe Property
  -- ^ The property of an exploration that made the world.
  , misuse :: IORef (Maybe ErrorCall)
  -- ^ The error of a use in a run that is not the world's own. (It was thrown in that run, which may have caught it.)
  , subjects :: IORef [(String, SubjectKind)]
  -- ^ Newest first.
  , newestEntries :: IORef [RecordEntry]
  -- ^ Newest first.
  , pendingChanges :: IORef [Seconds -> STM [RecordEntry]]
  -- ^ For each condition its changes that are due by a given time but not recorded yet.
  }

-- | How a world's clock was started.
data Beginning = Beginning
  { ownRun :: Maybe Int
  -- ^ The number of the simulation that it belongs to; 'Nothing' in reality.
  , startTime :: Seconds
  , elapsed :: IO Seconds
  -- ^ How long the clock has run in that simulation, up to its end; in reality this is zero.
  }

-- | An empty world.
--
-- @since 0.1.0.0
newMock :: IO Mock
newMock =
  Mock <$> newIORef Nothing <*> currentProperty <*> newIORef Nothing <*> newIORef [] <*> newIORef [] <*> newIORef []

-- | Starts the clock of the world, if it is not running yet. Without this it starts when the first
-- action begins, or when a condition is read, watched or set for the first time.
--
-- A world belongs to the run in which its clock was started: one simulation, or reality. So begin it
-- inside of the simulation:
--
-- > simulate (begin world >> mission)
--
-- [Fault] If it is used in another run, that throws an 'ErrorCall', and so does reading its record later; and a
--   simulation ends with it, also if the behaviour catches it. In an exploration its use outside of the simulation
--   throws one, too. (Only the record may be read everywhere: 'happened', 'shouldRecord'.)
--
-- >>> begin mock
-- >>> run <- simulate (begin mock)
-- >>> putStrLn (explain (outcome run))
-- it faulted: a world belongs to the run in which its clock was started; this world's was started outside of the simulation: there, call neither begin nor anything that uses the world (simulate (begin world >> ...) is right)
--
-- @since 0.1.0.0
begin :: Mock -> Behavior ()
begin = void . clock

-- | The time at which the world's clock was started, and the current time. This is a
-- scheduling point, and the only operation of the seam that the mock world adds in order
-- to record something.
clock :: Mock -> IO (Seconds, Seconds)
clock mock = do
  t <- now
  here <- simulatedRun
  goesOn <- isRecorded
  property <- ownProperty mock
  -- Two kinds of uses do not start the clock: those after the end of a run, while it is unwound; and those outside of
  -- the simulation that a property runs.
  let first = Beginning (fst <$> here) t (maybe (pure 0) (fmap (subtract t) . snd) here)
      begins = goesOn && (isJust here || isNothing property)
      refuse why = writeIORef (misuse mock) (Just (ErrorCall why)) >> mistake property why
  begun <- atomicModifyIORef' (beginning mock) $ \old -> (old <|> (if begins then Just first else Nothing), old)
  case begun of
    Nothing
      | begins -> readIORef (subjects mock) >>= announceActions
      | goesOn -> refuse outsideOfSimulation
    Just own | ownRun own /= ownRun first -> refuse (belongsTo own first)
    _ -> pure ()
  pure (maybe t startTime begun, t)

-- | Throws a mistake, which fails the property and ends the run also if they catch it.
mistake :: Maybe Property -> String -> IO a
mistake property why = do
  keepInRun (ErrorCall why)
  mapM_ (`keepMistake` ErrorCall why) property
  throwIO (ErrorCall why)

-- | The property of an exploration that uses this world.
ownProperty :: Mock -> IO (Maybe Property)
ownProperty mock = (<|> madeIn mock) <$> currentProperty

-- | A property of an exploration uses a world outside of its simulation.
outsideOfSimulation :: String
outsideOfSimulation =
  "a world belongs to a run, and this world's clock would be started outside of the simulation that a property is to \
  \run: begin it inside, and use it there only (simulated (begin world >> ...), withInbox with its drivers too)"

-- | A world that belongs to the first run is used in the second.
belongsTo :: Beginning -> Beginning -> String
belongsTo own here =
  "a world belongs to the run in which its clock was started; this world's was started "
    ++ case (ownRun own, ownRun here) of
      (Nothing, _) ->
        "outside of the simulation: there, call neither begin nor anything that uses the world \
        \(simulate (begin world >> ...) is right)"
      (_, Just _) -> "in another simulation: make a new one for each run (in an exploration: in the property)"
      (_, Nothing) ->
        "in a simulation, which this thread is not part of: outside of it, only read its record \
        \(happened, shouldRecord)"

-- | Adds an entry to the record. Where exceptions are masked, this neither blocks nor is
-- interrupted. After the end of the run nothing is recorded.
recordEntry :: Mock -> RecordEntry -> IO ()
recordEntry mock entry = do
  goesOn <- isRecorded
  when goesOn $ do
    atomicModifyIORef' (newestEntries mock) (\old -> (entry : old, ()))
    annotate (show entry)

-- | Adds a note, any text of your own, to the record.
--
-- >>> note mock "a sheep crosses the road"
-- >>> mock `shouldRecord` eventually (noted "a sheep crosses the road")
--
-- @since 0.1.0.0
note :: Mock -> String -> Behavior ()
note mock text = do
  (zero, t) <- clock mock
  mask_ $ recordEntry mock (RecordEntry (t - zero) text "" 1 Noted)

-- | Registers something by its name, which only one thing in the world can have. Actions belong to the
-- coverage of the runs.
register :: Mock -> SubjectKind -> String -> IO ()
register mock kind name = do
  taken <- atomicModifyIORef' (subjects mock) $ \old ->
    if any ((== name) . fst) old then (old, True) else ((name, kind) : old, False)
  when taken . throwIO . ErrorCall $
    kindName kind ++ " " ++ show name ++ ": something else in this world has this name already"
  announceActions [(name, kind)]

announceActions :: [(String, SubjectKind)] -> IO ()
announceActions these = announce "" [name | (name, kind) <- these, kind `elem` anyAction]

-- | Registers how to find the changes of a condition that are due by a given time but not
-- recorded yet.
registerPending :: Mock -> (Seconds -> STM [RecordEntry]) -> IO ()
registerPending mock due = atomicModifyIORef' (pendingChanges mock) (\old -> (due : old, ()))

-- | Rejects scripted times with the given text, unless they start from zero, and each may follow the
-- one before. (The list may be infinite: only its first 1000 times are checked.)
checkTimes :: (Seconds -> Seconds -> Bool) -> String -> [Seconds] -> IO ()
checkTimes mayFollow rule times = for_ (zip (Nothing : map Just times) (take 1000 times)) $ \(before, t) ->
  unless (maybe (t >= 0) (`mayFollow` t) before) . throwIO . ErrorCall $
    rule ++ "; " ++ show t ++ maybe " is no such time" (\b -> " must not come after " ++ show b) before

-- | All that has happened until now. A change of a condition is in the record once a
-- later entry is, or once a simulated run has reached its time, even if nothing has read
-- the condition. The record ends when the run ends: what is unwound after that is not in
-- it.
--
-- >>> wave <- action mock "wave" [succeeds]
-- >>> wave
-- >>> map entryKind . recordEntries <$> happened mock
-- [Begins,Succeeds]
--
-- [Fault] Throws an 'ErrorCall' if the world was used in a run that it does not belong to (see 'begin'); if
--   nothing has used the world (then there is no record, not even an empty one); and, in an exploration, if the
--   world was made for another schedule.
--
-- @since 0.1.0.0
happened :: Mock -> IO Record
happened mock = do
  readIORef (misuse mock) >>= mapM_ throwIO
  property <- currentProperty
  when (isJust property && isJust (madeIn mock) && property /= madeIn mock) . mistake property $
    "this world was made in another test of an exploration, and its record is of that one: make a new one in the \
    \property, for each schedule"
  begun <- readIORef (beginning mock)
  when (isNothing begun) . throwIO . ErrorCall $
    "nothing has used this world, so there is no record to judge; if that is right, begin it: \
    \simulate (begin world >> ...)"
  seen <- readIORef (newestEntries mock)
  conditions <- readIORef (pendingChanges mock)
  came <- maybe (pure 0) elapsed begun
  let ended = maximum (came : map entryTime seen)
  due <- atomically (traverse ($ ended) conditions)
  known <- readIORef (subjects mock)
  pure (Record (reverse known) (inOrder (reverse (join due) ++ seen)) ended)

-- | Throws a 'BrokenClaim' with the reason, unless the claim holds for the record. Use it
-- like an expectation of hspec.
--
-- [Fault] Throws an 'ErrorCall' if there is no record ('happened').
--
-- In an exploration a claim that does not hold fails the property, even if it was checked inside of the run, and
-- something there catches the exception. And the report says if what the claim presupposes has never come
-- ('Behavior.Sim.reportNeverCame').
--
-- >>> begin mock
-- >>> mock `shouldRecord` eventually (noted "all is well")
-- *** Exception: This does not hold: eventually "all is well" is noted.
-- It never came.
-- <BLANKLINE>
--
-- @since 0.1.0.0
shouldRecord :: Mock -> Claim -> IO ()
shouldRecord mock claim = do
  record <- happened mock
  property <- ownProperty mock
  for_ (either Just (const Nothing) (verdict claim record)) $ \why -> do
    -- Inside of a run this exception is only how a behaviour ends.
    run <- simulatedRun
    when (isJust run) (keepInRun (BrokenClaim why) >> mapM_ (`keepMistake` BrokenClaim why) property)
    throwIO (BrokenClaim why)
  for_ property (`keepPremises` premisesIn record claim)

infix 1 `shouldRecord`

-- | The text of a claim that does not hold, with the reason.
--
-- @since 0.1.0.0
newtype BrokenClaim = BrokenClaim String

instance Show BrokenClaim where
  show (BrokenClaim why) = why

instance Exception BrokenClaim
