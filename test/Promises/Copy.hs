{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The operators once more, as plain as can be, with the places where one goes wrong.
-- Without a flaw they keep all promises: so it is for its flaw that a broken one is
-- rejected, and not for being a copy.
module Promises.Copy
  ( Flaw (..)
  , copied
  ) where

import Control.Concurrent (myThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (forever, unless, void, (>=>))
import Data.Foldable (asum, traverse_)
import Data.Traversable (for)

import Behavior (Behavior, failWith)
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
    , beside = besideWith flaw
    , rSelect = \condition left right ->
        react flaw "rSelect" (believed condition) (\c -> if c then Run "left" left else Run "right" right)
    , monitor = \condition recovery task ->
        react flaw "monitor" (believed condition) (\c -> if c then RunToEnd "recovery" recovery else Run "task" task)
    , whileHolding = \condition act ->
        react flaw "whileHolding" (believed condition) $ \c ->
          if c then Run "branch" act else Conclude (failWith "the condition does not hold")
    , timeout = timeoutWith flaw
    , polling = pollingWith flaw
    }
 where
  numbers = map show [1 :: Int ..]
  believed (Signal opening)
    | flaw == Just TakesDeadForFalse =
        Signal (fmap (\source -> source {view = mapView (`catchSTM` \(_ :: SomeException) -> pure False) <$> view source}) . opening)
    | otherwise = Signal opening

-- * Side by side

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
  settle <$> atomically (asum (map outcomeOf ((if flaw == Just RightWinsTies then reverse else id) branches)))

besideWith :: Maybe Flaw -> [Behavior ()] -> Behavior a -> Behavior a
besideWith flaw others body = structured flaw "scoped" $ \scope -> do
  main <- branch scope "body" body
  forked <- traverse (branch scope "fork") others
  let wrong b = outcomeOf b >>= \case
        Done (Right ()) -> retry
        other -> pure (settle other >> throwIO (ErrorCall "unreachable"))
  atomically ((settle <$> outcomeOf main) `orElse` asum (map wrong forked))

gather :: Maybe Flaw -> String -> [(String, Behavior a)] -> Behavior [a]
gather flaw operator behaviors = structured flaw operator $ \scope -> do
  branches <- traverse (uncurry (branch scope)) behaviors
  let ended b = outcomeOf b >>= \case Done (Right a) -> pure (Right a); other -> pure (Left other)
      firstWrong = asum (map (ended >=> either pure (const retry)) branches)
      allRight = traverse (ended >=> either (const retry) pure) branches
  if flaw == Just WaitsFromLeftToRight
    then pure <$> traverse (\b -> atomically (outcomeOf b) >>= settle) branches
    else atomically ((settleWrong <$> firstWrong) `orElse` (pure <$> allRight))
 where
  settleWrong :: Outcome a -> IO b
  settleWrong wrong = settle wrong >> throwIO (ErrorCall "unreachable")

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
      choose sensors seen how = observe (readView how seen) >>= either (pure . throwIO) (obey sensors seen)

      obey sensors seen old = case reaction old of
        Conclude verdict -> pure verdict
        RunToEnd name recovery -> ask (map SomeBranch sensors) >> recover sensors seen name recovery Nothing
        Run name act -> do
          running <- branch scope name act
          event <- observe ((Right <$> outcomeOf running) `orElse` (Left <$> (reread seen >>= \new -> check (new /= old) >> pure new)))
          case event of
            Right (Right outcome) -> pure (settle outcome)
            Right (Left new) -> turn sensors seen new running (reaction new)
            Left dead -> turn sensors seen old running (Conclude (throwIO dead))

      turn sensors seen new running what = do
        let others = case what of
              Run _ _ -> []
              _ -> map SomeBranch sensors
        outcome <- stop others running
        next sensors seen new what outcome

      stop :: [SomeBranch] -> Branch b -> IO (Outcome b)
      stop others running
        | flaw == Just StartsBeforeTheEnd =
            Stopped (toException ThreadKilled) <$ askWithoutWaiting (others ++ [SomeBranch running])
        | otherwise = ask (others ++ [SomeBranch running]) >> atomically (outcomeOf running)

      next sensors seen new what outcome = case (what, outcome) of
        (_, Done (Right _)) | flaw == Just RunsTheCompletedAgain -> again
        (Conclude verdict, Done (Right _)) | flaw == Just DropsWhatCompletedInTime -> pure verdict
        (_, Done (Right a)) -> pure (pure a)
        (RunToEnd name recovery, Stopped _)
          | flaw == Just ReadsAgainBeforeTheRecovery -> rested sensors >> begin Reread
          | otherwise -> recover sensors seen name recovery Nothing
        (RunToEnd name recovery, wrong)
          | flaw /= Just ThrowsBeforeTheRecovery -> recover sensors seen name recovery (Just (settle wrong))
        (Conclude verdict, Stopped _) -> pure verdict
        (Run _ _, Stopped _) -> again
        (_, wrong) -> pure (settle wrong)
       where
        again = case what of
          Run _ _
            | flaw == Just DoesNotReadAgain -> obey sensors seen new
            | otherwise -> atomically (view source) >>= \fresh -> choose sensors fresh Reread
          _ -> rested sensors >> begin Reread

      recover sensors seen name recovery aftermath = do
        recovered <- branch scope name recovery
        outcome <-
          if flaw == Just WatchesDuringTheRecovery
            then observe ((Just <$> outcomeOf recovered) `orElse` (Nothing <$ (reread seen >>= \now' -> check (unwanted now'))))
            else Right . Just <$> atomically (outcomeOf recovered)
        case (outcome, aftermath) of
          (Right (Just (Done (Right ()))), Nothing) -> rested sensors >> begin Reread
          (Right (Just wrong), Nothing) -> pure (settle wrong >> throwIO (ErrorCall "unreachable"))
          (_, Just verdict) -> pure verdict
          (_, Nothing) -> stop [] recovered >> rested sensors >> begin Reread

      unwanted value = case reaction value of
        RunToEnd _ _ -> False
        _ -> True
  begin FirstRead
 where
  observe :: STM b -> IO (Either SomeException b)
  observe act = atomically ((Right <$> act) `catchSTM` (pure . Left))
  rested = traverse_ (atomically . outcomeOf)

timeoutWith :: Maybe Flaw -> Seconds -> Behavior a -> Behavior a
timeoutWith flaw seconds act
  | seconds <= 0 = throwIO (TimedOut seconds)
  | flaw == Just MistakesTheStop = do
      me <- myThreadId
      structured flaw "timeout" $ \scope -> do
        running <- branch scope "branch" act
        _ <- branch scope "clock" (sleep seconds >> throwToAll Stop [me])
        (settle <$> atomically (outcomeOf running)) `catch` \e ->
          if isCancellation e then pure (throwIO (TimedOut seconds)) else throwIO e
  | otherwise = do
      over <- newTVarIO False
      let clock = sleep seconds >> atomically (writeTVar over True)
          elapsed = Signal (\_ -> pure (fromView (pure (constantView (readTVar over)))) {workers = [Worker "clock" (pure (const clock))]})
      react flaw "timeout" elapsed (\up -> if up then Conclude (throwIO (TimedOut seconds)) else Run "branch" act)

-- * Sensors

pollingWith :: Maybe Flaw -> Seconds -> Behavior a -> Signal a
pollingWith flaw every act = Signal $ \_ -> do
  nextSlot <- newTVarIO Nothing
  started <- newTVarIO (0 :: Int)
  newest <- newTVarIO Nothing
  let readings asked = forever $ do
        atomically (readTVar nextSlot) >>= traverse_ sleepUntil
        begun <- now
        k <- atomically $ do
          modifyTVar' started (+ 1)
          writeTVar nextSlot (Just (begun + every))
          readTVar started
        read' <- trySynchronous act
        stopping <- asked
        if stopping
          then either throwIO (const (throwIO ThreadKilled)) read'
          else atomically (writeTVar newest (Just (k, read')))
      prepareReadings = do
        unless (flaw /= Just ForgetsThePeriod) (writeTVar nextSlot Nothing)
        pure (\asked -> readings asked `catch` \e -> if e == ThreadKilled then pure () else throwIO e)
      seen = do
        before <- readTVar started
        pure . constantView $
          readTVar newest >>= \case
            Just (k, read') | k > before -> either throwSTM pure read'
            _ -> retry
  pure (fromView seen) {workers = [Worker "polling" prepareReadings]}
