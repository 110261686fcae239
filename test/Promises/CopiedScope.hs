{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- A plain copy of the library's scopes, with optional flaws.
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

    -- * Stop requests
  , requestStop
  , requestStopAsync
  , Stop (..)

    -- * How a branch ends
  , Outcome (..)
  , outcomeToIO
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

-- | The flaws that an operator can have.
data Flaw
  = ReturnsBeforeTheLoser
  | OrphansAtSecondCancel
  | RequestsStopTwice
  | SwallowsCancellation
  | TakesForeignExceptionAsItsOwn
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
  | ChoosesWhenAllHaveEnded
  | RunsTheChosenTooEarly
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
    Left e | isCancellation e || flaw /= Just TakesForeignExceptionAsItsOwn -> pure (Left e)
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
    Just ReturnsBeforeTheLoser -> [] <$ requestStopAsync started
    Just StopsOneByOne -> concat <$> for started (\b -> requestStop [b] >> waitUninterruptibly b)
    Just OrphansAtSecondCancel -> requestStop started >> concat <$> traverse wait started
    Just RequestsStopTwice ->
      requestStop started
        >> concat <$> for started (\b -> wait b `onInterruption` (requestStopByHelper b >> waitUninterruptibly b))
    Just DropsTheLosersFault -> do
      requestStop started
      byThemselves <- filterM (\(SomeBranch (Branch _ requested _)) -> not <$> readIORef requested) started
      traverse_ waitUninterruptibly started
      concat <$> traverse waitUninterruptibly byThemselves
    _ -> requestStop started >> concat <$> traverse waitUninterruptibly started
 where
  onInterruption act after = try act >>= either (\(_ :: SomeException) -> after) pure
  wait (SomeBranch b) = atomically (fault <$> outcomeOf b)
  waitUninterruptibly (SomeBranch b) = awaitUninterruptibly (atomically (fault <$> outcomeOf b))
  fault = \case
    Faulted e -> [e]
    _ -> []

branch :: Scope -> String -> IO a -> IO (Branch a)
branch scope name act = worker scope name (const act)

worker :: Scope -> String -> (IO Bool -> IO a) -> IO (Branch a)
worker (Scope flaw operator branches) name act = do
  state <- getMaskingState
  mask_ $ do
    requested <- newIORef False
    box <- newEmptyTMVarIO
    let label = Label operator (if flaw == Just DoesNotLabel then "" else name)
        run = act (readIORef requested)
        put = atomically . putTMVar box
    (thread, end') <- case flaw of
      Just PublishesByAHandler -> do
        thread <- start label ((run >>= put . Right) `catch` (put . Left))
        pure (threadId thread, readTMVar box)
      _ -> do
        thread <- start label (if flaw == Just InheritsMasking then inState state run else run)
        pure (threadId thread, threadEnd thread)
    let new = Branch thread requested (ending thread <$> end')
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
    | isOwn e -> Stopped e
    | Just (StoppedWithFault cause fault) <- fromException e, isOwn cause -> Faulted fault
    | not (isFailure e) -> Faulted e
  other -> Done other
 where
  isOwn e = fromException e == Just (Stop self)

-- | Requests the stop of all branches at once, except those with an earlier request and those
-- that have ended.
requestStop :: [SomeBranch] -> IO ()
requestStop branches = mask_ (filterM claimStopRequest branches >>= go)
 where
  go [] = pure ()
  go [SomeBranch (Branch thread _ _)] = uninterruptibleMask_ (interrupt thread (Stop thread))
  go (b : bs) = requestStopByHelper b >> go bs

requestStopAsync :: [SomeBranch] -> IO ()
requestStopAsync branches = mask_ (filterM claimStopRequest branches >>= traverse_ requestStopByHelper)

claimStopRequest :: SomeBranch -> IO Bool
claimStopRequest (SomeBranch (Branch _ requested outcome)) = do
  over <- atomically ((True <$ outcome) `orElse` pure False)
  if over then pure False else not <$> atomicModifyIORef' requested (\was -> (True, was))

requestStopByHelper :: SomeBranch -> IO ()
requestStopByHelper (SomeBranch (Branch thread _ _)) = throwToAll Stop [thread]

outcomeOf :: Branch a -> STM (Outcome a)
outcomeOf (Branch _ _ outcome) = outcome

outcomeToIO :: Outcome a -> IO a
outcomeToIO = \case
  Done r -> either throwIO pure r
  Faulted e -> throwIO e
  Stopped e -> throwIO e
