{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- A plain copy of the operators, with optional flaws. Without a flaw the copy keeps all
-- promises, so a broken operator is rejected because of its flaw, and not because it is a
-- copy.
module Promises.Copy
  ( Flaw (..)
  , copied
  ) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (forever, join, unless, void, (>=>))
import Data.Foldable (asum, traverse_)
import Data.Maybe (catMaybes, isJust)
import Data.Traversable (for)

import Behavior (Behavior, BehaviorFailed, failWith)
import Behavior.Internal.Failure (isCancellation, isFailure, trySynchronous)
import Behavior.Internal.Reactive.Timeout (TimedOut (..))
import Behavior.Internal.Runtime
import Behavior.Internal.Signal.Source
import Promises.CopiedScope
import Promises.Language hiding (sound)
import qualified Promises.Language as Sound

-- | The whole language, with one flaw or none.
copied :: Maybe Flaw -> Language
copied flaw =
  Sound.sound
    { fallback = fallbackWith flaw
    , attempt = \n act -> if n <= 0 then failWith "attempt" else foldr1 (fallbackWith flaw) (replicate n act)
    , failing = failingWith flaw
    , parallel = \left right -> race flaw "parallel" [("left", void left), ("right", void right)]
    , both = \left right -> void (gather flaw "both" [("left", void left), ("right", void right)])
    , firstOf = race flaw "firstOf" . zip numbers
    , allOf = gather flaw "allOf" . zip numbers
    , decide = decideWith flaw
    , beside = besideWith flaw
    , rSelect = \condition left right ->
        react flaw "rSelect" (possiblyFlawed condition) (\c -> if c then Run "left" left else Run "right" right)
    , monitor = \condition recovery task ->
        react flaw "monitor" (possiblyFlawed condition) $ \c ->
          if c then RunToEnd "recovery" recovery else Run "task" task
    , whileHolding = \condition act ->
        react flaw "whileHolding" (possiblyFlawed condition) $ \c ->
          if c then Run "branch" act else Conclude (failWith "the condition does not hold")
    , timeout = timeoutWith flaw
    , polling = pollingWith flaw
    }
 where
  numbers = map show [1 :: Int ..]
  possiblyFlawed (Signal opening)
    | flaw == Just TakesDeadForFalse =
        let orFalse = (`catchSTM` \(_ :: SomeException) -> pure False)
         in Signal (fmap (\source -> source {view = mapView orFalse <$> view source}) . opening)
    | otherwise = Signal opening

-- * Concurrent

fallbackWith :: Maybe Flaw -> Behavior a -> Behavior a -> Behavior a
fallbackWith flaw first second = case flaw of
  Just SwallowsCancellation -> try first >>= either (\(_ :: SomeException) -> second) pure
  Just RecoversInAHandler -> first `catch` \e -> if isFailure e then second else throwIO e
  _ -> try first >>= either (\e -> if isFailure e then second else throwIO e) pure

failingWith :: Maybe Flaw -> Behavior a -> Behavior a
failingWith flaw act =
  act `catch` \e ->
    if isFailure e || (isCancellation e && flaw /= Just FailsWhenCancelled) then throwIO e else failWith (show e)

race :: Maybe Flaw -> String -> [(String, Behavior a)] -> Behavior a
race flaw operator behaviors = structured flaw operator $ \scope -> do
  branches <- traverse (uncurry (branch scope)) behaviors
  outcomeToIO <$> atomically (asum (map outcomeOf ((if flaw == Just RightWinsTies then reverse else id) branches)))

besideWith :: Maybe Flaw -> [Behavior ()] -> Behavior a -> Behavior a
besideWith flaw others body = structured flaw "scoped" $ \scope -> do
  main <- branch scope "body" body
  forked <- traverse (branch scope "fork") others
  let wrong b = outcomeOf b >>= \case
        Done (Right ()) -> retry
        other -> pure (outcomeToIO other >> throwIO (ErrorCall "unreachable"))
  atomically ((outcomeToIO <$> outcomeOf main) `orElse` asum (map wrong forked))

gather :: Maybe Flaw -> String -> [(String, Behavior a)] -> Behavior [a]
gather flaw operator behaviors = structured flaw operator $ \scope -> do
  branches <- traverse (uncurry (branch scope)) behaviors
  let ended b = outcomeOf b >>= \case Done (Right a) -> pure (Right a); other -> pure (Left other)
      firstWrong = asum (map (ended >=> either pure (const retry)) branches)
      allRight = traverse (ended >=> either (const retry) pure) branches
  if flaw == Just WaitsFromLeftToRight
    then pure <$> traverse (\b -> atomically (outcomeOf b) >>= outcomeToIO) branches
    else atomically ((wrongToIO <$> firstWrong) `orElse` (pure <$> allRight))
 where
  wrongToIO :: Outcome a -> IO b
  wrongToIO wrong = outcomeToIO wrong >> throwIO (ErrorCall "unreachable")

decideWith :: Maybe Flaw -> ([Maybe (Either BehaviorFailed a)] -> Maybe (Behavior b)) -> [Behavior a] -> Behavior b
decideWith flaw choose behaviors
  | Just chosen <- choose (Nothing <$ behaviors) = chosen
  | otherwise = join . structured flaw "decide" $ \scope -> do
      branches <- traverse (uncurry (branch scope)) (zip (map show [1 :: Int ..]) behaviors)
      chosen <- atomically $ do
        outcomes <- traverse (\b -> (Just <$> outcomeOf b) `orElse` pure Nothing) branches
        let allEnded = all isJust outcomes
        check (allEnded || flaw /= Just ChoosesWhenAllHaveEnded)
        case (catMaybes outcomes >>= wrong, choose (map (>>= end) outcomes)) of
          (e : _, _) -> pure (throwIO e)
          ([], Just act) -> pure (pure act)
          ([], Nothing) -> check allEnded >> pure (throwIO (ErrorCall "decide"))
      if flaw == Just RunsTheChosenTooEarly then pure . pure <$> join chosen else pure chosen
 where
  wrong = \case
    Faulted e -> [e]
    Stopped e -> [e]
    Done _ -> []
  end = \case
    Done (Right a) -> Just (Right a)
    Done (Left e) -> Left <$> fromException e
    _ -> Nothing

-- * Reactive

data Reaction a = Run String (Behavior a) | RunToEnd String (Behavior ()) | Conclude (IO a)

react :: forall k a. Eq k => Maybe Flaw -> String -> Signal k -> (k -> Reaction a) -> Behavior a
react flaw operator signal reaction = structured flaw operator $ \scope -> do
  source <- open signal everyValue
  let begin how = do
        (runs, seen) <- atomically ((,) <$> traverse prepare (workers source) <*> view source)
        sensors <- for (zip (workers source) runs) (\(w, run) -> worker scope (workerName w) run)
        choose sensors seen how

      choose :: [Branch ()] -> View k -> ReadMode -> IO (IO a)
      choose sensors seen how =
        tryAtomically (readView how seen) >>= either (pure . throwIO) (applyReaction sensors seen)

      applyReaction sensors seen old = case reaction old of
        Conclude verdict -> pure verdict
        RunToEnd name recovery -> requestStop (map SomeBranch sensors) >> recover sensors seen name recovery Nothing
        Run name act -> do
          running <- branch scope name act
          let changed = reread seen >>= \new -> check (new /= old) >> pure new
          event <- tryAtomically ((Right <$> outcomeOf running) `orElse` (Left <$> changed))
          case event of
            Right (Right outcome) -> pure (outcomeToIO outcome)
            Right (Left new) -> stopAndNext sensors seen new running (reaction new)
            Left dead -> stopAndNext sensors seen old running (Conclude (throwIO dead))

      stopAndNext sensors seen new running what = do
        let others = case what of
              Run _ _ -> []
              _ -> map SomeBranch sensors
        outcome <- stop others running
        next sensors seen new what outcome

      stop :: [SomeBranch] -> Branch b -> IO (Outcome b)
      stop others running
        | flaw == Just StartsBeforeTheEnd =
            Stopped (toException ThreadKilled) <$ requestStopAsync (others ++ [SomeBranch running])
        | otherwise = requestStop (others ++ [SomeBranch running]) >> atomically (outcomeOf running)

      next sensors seen new what outcome = case (what, outcome) of
        (_, Done (Right _)) | flaw == Just RunsTheCompletedAgain -> again
        (Conclude verdict, Done (Right _)) | flaw == Just DropsWhatCompletedInTime -> pure verdict
        (_, Done (Right a)) -> pure (pure a)
        (RunToEnd name recovery, Stopped _)
          | flaw == Just ReadsAgainBeforeTheRecovery -> awaitStopped sensors >> begin Reread
          | otherwise -> recover sensors seen name recovery Nothing
        (RunToEnd name recovery, wrong)
          | flaw /= Just ThrowsBeforeTheRecovery -> recover sensors seen name recovery (Just (outcomeToIO wrong))
        (Conclude verdict, Stopped _) -> pure verdict
        (Run _ _, Stopped _) -> again
        (_, wrong) -> pure (outcomeToIO wrong)
       where
        again = case what of
          Run _ _
            | flaw == Just DoesNotReadAgain -> applyReaction sensors seen new
            | otherwise -> atomically (view source) >>= \fresh -> choose sensors fresh Reread
          _ -> awaitStopped sensors >> begin Reread

      recover sensors seen name recovery taskVerdict = do
        recovered <- branch scope name recovery
        outcome <-
          if flaw == Just WatchesDuringTheRecovery
            then
              let isUnwanted = reread seen >>= \now' -> check (unwanted now')
               in tryAtomically ((Just <$> outcomeOf recovered) `orElse` (Nothing <$ isUnwanted))
            else Right . Just <$> atomically (outcomeOf recovered)
        case (outcome, taskVerdict) of
          (Right (Just (Done (Right ()))), Nothing) -> awaitStopped sensors >> begin Reread
          (Right (Just wrong), Nothing) -> pure (outcomeToIO wrong >> throwIO (ErrorCall "unreachable"))
          (_, Just verdict) -> pure verdict
          (_, Nothing) -> stop [] recovered >> awaitStopped sensors >> begin Reread

      unwanted value = case reaction value of
        RunToEnd _ _ -> False
        _ -> True
  begin FirstRead
 where
  tryAtomically :: STM b -> IO (Either SomeException b)
  tryAtomically act = atomically ((Right <$> act) `catchSTM` (pure . Left))
  awaitStopped = traverse_ (atomically . outcomeOf)

timeoutWith :: Maybe Flaw -> Seconds -> Behavior a -> Behavior a
timeoutWith flaw seconds act
  | seconds <= 0 = throwIO (TimedOut seconds)
  | flaw == Just MistakesTheStop = do
      me <- myThreadId
      structured flaw "timeout" $ \scope -> do
        running <- branch scope "branch" act
        _ <- branch scope "clock" (sleep seconds >> throwToAll Stop [me])
        (outcomeToIO <$> atomically (outcomeOf running)) `catch` \e ->
          if isCancellation e then pure (throwIO (TimedOut seconds)) else throwIO e
  | otherwise = do
      over <- newTVarIO False
      let clock = sleep seconds >> atomically (writeTVar over True)
          isOver = fromView (pure (constantView (readTVar over)))
          elapsed = Signal (\_ -> pure isOver {workers = [Worker "clock" (pure (const clock))]})
      react flaw "timeout" elapsed (\up -> if up then Conclude (throwIO (TimedOut seconds)) else Run "branch" act)

-- * Sensors

pollingWith :: Maybe Flaw -> Seconds -> Behavior a -> Signal a
pollingWith flaw every act = Signal $ \_ -> do
  nextSlot <- newTVarIO Nothing
  started <- newTVarIO (0 :: Int)
  newest <- newTVarIO Nothing
  let readRepeatedly stopRequested = forever $ do
        atomically (readTVar nextSlot) >>= traverse_ sleepUntil
        begun <- now
        k <- atomically $ do
          modifyTVar' started (+ 1)
          writeTVar nextSlot (Just (begun + every))
          readTVar started
        read' <- trySynchronous act
        stopping <- stopRequested
        if stopping
          then either throwIO (const (throwIO ThreadKilled)) read'
          else atomically (writeTVar newest (Just (k, read')))
      prepareReadings = do
        unless (flaw /= Just ForgetsThePeriod) (writeTVar nextSlot Nothing)
        pure $ \stopRequested ->
          readRepeatedly stopRequested `catch` \e -> if e == ThreadKilled then pure () else throwIO e
      seen = do
        before <- readTVar started
        pure . constantView $
          readTVar newest >>= \case
            Just (k, read') | k > before -> either throwSTM pure read'
            _ -> retry
  pure (fromView seen) {workers = [Worker "polling" prepareReadings]}
