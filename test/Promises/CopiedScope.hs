{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Structured concurrency once more, with the places where it goes wrong.
module Promises.CopiedScope
  ( Flaw (..)

    -- * Scopes
  , Scope
  , structured
  , Branch
  , SomeBranch (..)
  , branch
  , worker
  , outcomeOf

    -- * Asking to stop
  , ask
  , askWithoutWaiting
  , Stop (..)

    -- * How a branch ends
  , Outcome (..)
  , settle
  ) where

import Control.Concurrent (ThreadId)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception
import Control.Monad (filterM)
import Data.Foldable (traverse_)
import Data.IORef
import Data.Traversable (for)

import Behavior.Internal.Failure (StoppedWithFault (..), isCancellation, isFailure)
import Behavior.Internal.Runtime

-- | What can be wrong with an operator.
data Flaw
  = ReturnsBeforeTheLoser
  | OrphansAtSecondCancel
  | AsksTwice
  | SwallowsCancellation
  | TakesWhatIsThrownForItsOwn
  | FailsWhenCancelled
  | RecoversInAHandler
  | InheritsMasking
  | PublishesByAHandler
  | StopsOneByOne
  | RightWinsTies
  | WaitsFromLeftToRight
  | DropsTheLosersFault
  | ThrowsTheRightmostFault
  | HidesCancellationByAFault
  | StartsBeforeTheEnd
  | RunsTheCompletedAgain
  | DropsWhatCompletedInTime
  | DoesNotReadAgain
  | ReadsAgainBeforeTheRecovery
  | WatchesDuringTheRecovery
  | ThrowsBeforeTheRecovery
  | TakesDeadForFalse
  | ForgetsThePeriod
  | MistakesTheStop
  | DoesNotLabel
  deriving (Bounded, Enum, Eq, Ord, Show)

data Scope = Scope (Maybe Flaw) String (IORef [SomeBranch])

data Branch a = Branch ThreadId (IORef Bool) (STM (Outcome a))

data SomeBranch = forall a. SomeBranch (Branch a)

data Outcome a = Done (Either SomeException a) | Faulted SomeException | Stopped SomeException

newtype Stop = Stop ThreadId
  deriving (Eq)

instance Show Stop where
  show _ = "Stop"

instance Exception Stop where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException

structured :: Maybe Flaw -> String -> (Scope -> IO (IO a)) -> IO a
structured flaw operator body = mask $ \restore -> do
  scope <- Scope flaw operator <$> newIORef []
  verdict <- try (restore (body scope))
  faults <- end scope
  cancelled <- case verdict of
    Left e | isCancellation e || flaw /= Just TakesWhatIsThrownForItsOwn -> pure (Left e)
    _ -> try (restore checkpoint)
  case (cancelled, if flaw == Just ThrowsTheRightmostFault then reverse faults else faults) of
    (Left cancellation, []) -> throwIO cancellation
    (Left cancellation, fault : _)
      | flaw == Just HidesCancellationByAFault -> throwIO fault
      | otherwise -> throwIO (StoppedWithFault cancellation fault)
    (Right (), fault : _) -> throwIO fault
    (Right (), []) -> either throwIO id verdict

end :: Scope -> IO [SomeException]
end (Scope flaw _ branches) = do
  started <- reverse <$> readIORef branches
  case flaw of
    Just ReturnsBeforeTheLoser -> [] <$ askWithoutWaiting started
    Just StopsOneByOne -> concat <$> for started (\b -> ask [b] >> waitFirmly b)
    Just OrphansAtSecondCancel -> ask started >> concat <$> traverse wait started
    Just AsksTwice -> ask started >> concat <$> for started (\b -> wait b `onInterruption` (askByMessenger b >> waitFirmly b))
    Just DropsTheLosersFault -> do
      ask started
      byThemselves <- filterM (\(SomeBranch (Branch _ asked _)) -> not <$> readIORef asked) started
      traverse_ waitFirmly started
      concat <$> traverse waitFirmly byThemselves
    _ -> ask started >> concat <$> traverse waitFirmly started
 where
  onInterruption act after = try act >>= either (\(_ :: SomeException) -> after) pure
  wait (SomeBranch b) = atomically (fault <$> outcomeOf b)
  waitFirmly (SomeBranch b) = awaitUninterruptibly (atomically (fault <$> outcomeOf b))
  fault = \case
    Faulted e -> [e]
    _ -> []

branch :: Scope -> String -> IO a -> IO (Branch a)
branch scope name act = worker scope name (const act)

worker :: Scope -> String -> (IO Bool -> IO a) -> IO (Branch a)
worker (Scope flaw operator branches) name act = do
  state <- getMaskingState
  mask_ $ do
    asked <- newIORef False
    box <- newEmptyTMVarIO
    let label = Label operator (if flaw == Just DoesNotLabel then "" else name)
        run = act (readIORef asked)
        put = atomically . putTMVar box
    (thread, end') <- case flaw of
      Just PublishesByAHandler -> do
        thread <- start label ((run >>= put . Right) `catch` (put . Left))
        pure (threadId thread, readTMVar box)
      _ -> do
        thread <- start label (if flaw == Just InheritsMasking then inState state run else run)
        pure (threadId thread, threadEnd thread)
    let new = Branch thread asked (ending thread <$> end')
    modifyIORef' branches (SomeBranch new :)
    pure new
 where
  inState = \case
    Unmasked -> id
    MaskedInterruptible -> mask_
    MaskedUninterruptible -> uninterruptibleMask_

ending :: ThreadId -> Either SomeException a -> Outcome a
ending self = \case
  Left e
    | own e -> Stopped e
    | Just (StoppedWithFault cause fault) <- fromException e, own cause -> Faulted fault
    | not (isFailure e) -> Faulted e
  other -> Done other
 where
  own e = fromException e == Just (Stop self)

-- | Asks all at once those that were not asked and have not ended.
ask :: [SomeBranch] -> IO ()
ask branches = mask_ (filterM unasked branches >>= go)
 where
  go [] = pure ()
  go [SomeBranch (Branch thread _ _)] = uninterruptibleMask_ (interrupt thread (Stop thread))
  go (b : bs) = askByMessenger b >> go bs

askWithoutWaiting :: [SomeBranch] -> IO ()
askWithoutWaiting branches = mask_ (filterM unasked branches >>= traverse_ askByMessenger)

unasked :: SomeBranch -> IO Bool
unasked (SomeBranch (Branch _ asked outcome)) = do
  over <- atomically ((True <$ outcome) `orElse` pure False)
  if over then pure False else not <$> atomicModifyIORef' asked (\was -> (True, was))

askByMessenger :: SomeBranch -> IO ()
askByMessenger (SomeBranch (Branch thread _ _)) = throwToAll Stop [thread]

outcomeOf :: Branch a -> STM (Outcome a)
outcomeOf (Branch _ _ outcome) = outcome

settle :: Outcome a -> IO a
settle = \case
  Done r -> either throwIO pure r
  Faulted e -> throwIO e
  Stopped e -> throwIO e
