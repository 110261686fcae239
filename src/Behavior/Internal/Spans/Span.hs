{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Spans: what has a name, operators, and branches.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Spans.Span
  ( named
  , actionSpan
  , operatorSpan
  , branchSpan
  , abandonableIn
  , endOf

    -- * For reactions
  , newNumber
  , reportEach
  , parentFor
  ) where

import Control.Concurrent.MVar (withMVar)
import Control.Exception
  ( Exception (..)
  , SomeException
  , mask
  , throwIO
  , try
  , uninterruptibleMask_
  )
import Control.Monad (when)
import Data.Foldable (for_, traverse_)
import Data.IORef (atomicModifyIORef', newIORef)
import qualified Data.IntMap.Strict as IntMap
import Data.Maybe (isJust)
import Data.Traversable (for)

import Behavior.Internal.Core.Backend (Label, Simulator (pause, recordNote))
import Behavior.Internal.Core.Dispatch (inSimulation)
import Behavior.Internal.Core.Failure
  ( Behavior
  , BehaviorFailed (..)
  , StoppedWithFault (..)
  , isCancellation
  , tryEvaluate
  )
import Behavior.Internal.Core.Stop (atPath, causeOf, displayed)
import Behavior.Internal.Spans.Event
import Behavior.Internal.Spans.Place

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Trace

-- | Gives a behaviour a name: in a trace it is a /span/, which begins and ends, in the span around it.
--
-- > named name act  =  act     -- without a trace
--
-- Result, failure, fault and cancellation are the behaviour's. In a trace, the path of names is added
-- to a failure of the behaviour ('Behavior.failurePath'), which is caught as before. The behaviour runs
-- in the caller's thread and masking state. In a simulation there is a scheduling point before
-- and one after it, as for a scripted action.
--
-- Without a trace it costs less than two nanoseconds, and a loop whose next round is the last step of the
-- behaviour runs in constant space. In a trace the rounds of such a loop nest: name a part of the round instead.
--
-- > patrol = named "leg" drive >> patrol     -- not: patrol = named "leg" (drive >> patrol)
--
-- >>> withTrace [] (named "enter room" (named "front door" (failWith "locked")))
-- *** Exception: enter room > front door: FailedBecause "locked"
--
-- @since 0.1.0.0
named :: String -> Behavior a -> Behavior a
named name act = isTraced >>= \traced -> if traced then namedInTrace name act else act
{-# INLINE named #-}

namedInTrace :: String -> Behavior a -> Behavior a
namedInTrace name act = do
  scheduling
  spanned noting (\place -> atPath (reverse (name : path place))) name (act >>= \a -> a <$ scheduling)
 where
  scheduling = inSimulation (pure ()) pause
  noting text = inSimulation (pure ()) (`recordNote` (name ++ ": " ++ text))
{-# NOINLINE namedInTrace #-}

-- | 'named' for the scripted actions of a mock world, which have scheduling points and steps of their own. Their
-- names are not in the path of a failure: a test must see the failure that the robot sees.
actionSpan :: String -> Behavior a -> Behavior a
actionSpan name act = isTraced >>= \traced -> if traced then spanned (\_ -> pure ()) (const id) name act else act

-- | Runs the behaviour in a span with this name. The first function notes its beginning and its end in the steps
-- of a simulated run; the second changes what it throws.
spanned :: (String -> IO ()) -> (Place -> SomeException -> SomeException) -> String -> Behavior a -> Behavior a
spanned noting change name act =
  myPlace >>= \case
    Nothing -> newestTrace >>= maybe act (inside . placeIn [InUnknown])
    Just place -> inside place
 where
  inside place = mask $ \restore -> do
    noting "begins"
    end <- spanning Named name place (restore act)
    noting "ends"
    either (throwIO . change place) pure end

-- | Runs an operator with this body, in a span of its own where those are recorded. (Without a trace no
-- closure is made of the two.)
operatorSpan :: String -> (a -> IO b) -> a -> IO b
operatorSpan name run body = isTraced >>= \traced -> if traced then operatorInTrace name (run body) else run body
{-# INLINE operatorSpan #-}

operatorInTrace :: String -> IO a -> IO a
operatorInTrace name act =
  myPlace >>= \case
    Just place
      | recordsDetail (trace place) ->
          mask $ \restore -> spanning Operator name place (restore act) >>= either throwIO pure
    _ -> act
{-# NOINLINE operatorInTrace #-}

-- | Runs a branch in that place, with a span of its own where those are recorded. Call it masked, and
-- unmask the branch.
branchSpan :: Label -> Maybe Place -> IO a -> IO (Either SomeException a)
branchSpan label here act = maybe (try act) (\place -> branchInTrace label place act) here
{-# INLINE branchSpan #-}

branchInTrace :: Label -> Place -> IO a -> IO (Either SomeException a)
branchInTrace label place act
  | recordsDetail (trace place) = spanning Branch (show label) place act
  | otherwise = try (inPlace (Just place) act)
{-# NOINLINE branchInTrace #-}

-- | Runs the action, masked, in a span.
spanning :: SpanKind -> String -> Place -> IO a -> IO (Either SomeException a)
spanning kind name place act = do
  n <- newNumber place
  t <- traceClock (trace place)
  open <- inTurn $ do
    open <- register (Open n kind name t place)
    open <$ reportSpan Began open
  end <- try (inPlace (Just (within open)) act)
  how <- endOf end
  inTurn $ do
    isOpen <- takeOff open
    when isOpen (reportEnd how open)
  pure end
 where
  inTurn report = if null (abandonable place) then report else oneAtATime (trace place) report

-- | How a behaviour ended that returned or threw.
endOf :: Either SomeException a -> IO End
endOf = \case
  Right _ -> pure Succeeded
  Left e -> tryEvaluate (kind e) >>= either undefinedException pure
 where
  kind e
    | Just (BehaviorFailed _ failure) <- fromException e = FailedWith (displayException failure)
    | Just (StoppedWithFault _ fault) <- fromException e = FaultedWith (displayed fault)
    | isCancellation e = StoppedBy $! causeOf e
    | otherwise = FaultedWith (displayed e)
  undefinedException e = pure (FaultedWith (displayed e))

-- | Registers an open span in the branches around it that may be abandoned. If one of these has been
-- abandoned, the span around the new one has ended: then the new span's parent is unknown.
register :: Open -> IO Open
register open = do
  inAll <- for (abandonable place) $ \spans ->
    atomicModifyIORef' spans (\known -> (IntMap.insert (openNumber open) open <$> known, isJust known))
  if and inAll
    then pure open
    else open {openAt = (placeIn [InUnknown] (trace place)) {path = path place}} <$ takeOff open
 where
  place = openAt open

-- | Takes it off these branches. Whether none of them has been abandoned: then its end was not reported yet.
takeOff :: Open -> IO Bool
takeOff open = and <$> for (abandonable (openAt open)) isIn
 where
  isIn spans = atomicModifyIORef' spans (\known -> (IntMap.delete n <$> known, maybe False (IntMap.member n) known))
  n = openNumber open

-- | Runs an action that starts a branch which may be abandoned. It also gives an action for the moment when
-- the branch is abandoned, which reports the end of the spans that are open in it. Call it masked.
abandonableIn :: IO a -> IO (a, IO ())
abandonableIn act =
  myPlace >>= \case
    Nothing -> (\a -> (a, pure ())) <$> act
    Just place -> do
      spans <- newIORef (Just IntMap.empty)
      a <- inPlace (Just place {abandonable = spans : abandonable place}) act
      let ends = traverse_ (\open -> takeOff open >> reportEnd (StoppedBy WasAbandoned) open) . reverse . IntMap.elems
      pure (a, oneAtATime (trace place) (atomicModifyIORef' spans ((,) Nothing) >>= traverse_ ends))

-- | Runs such reports one at a time. Otherwise the reports of a branch that is being abandoned could come in the
-- wrong order: a span's end before its beginning, or after its parent's end.
oneAtATime :: Trace -> IO a -> IO a
oneAtATime t report = uninterruptibleMask_ (withMVar (abandonLock t) (const report))

-- | The place in a span.
within :: Open -> Place
within open = inside {path = [openName open | openKind open == Named] ++ path place}
 where
  place = openAt open
  inside = place {around = InSpan (openKind open) (openNumber open) : around place}

reportEnd :: End -> Open -> IO ()
reportEnd how open = do
  t <- traceClock (trace (openAt open))
  reportSpan (\s -> Ended s t how) open

reportSpan :: (Span -> Event) -> Open -> IO ()
reportSpan event open = for_ (receivers (trace place)) $ \receiver ->
  when (openKind open == Named || needsDetail receiver) . receiveEvent receiver . event $
    Span
      { spanNumber = openNumber open
      , spanParent = parentFor receiver place
      , spanKind = openKind open
      , spanName = openName open
      , spanBegan = openSince open
      , spanReaction =
          reactionFor receiver place
      }
 where
  place = openAt open

-- | The span around a place, for a receiver.
parentFor :: Receiver -> Place -> Parent
parentFor receiver place = case [s | s <- around place, isSeenBy receiver s] of
  InSpan _ n : _ | n >= firstNumber receiver -> Inside n
  InUnknown : _ -> UnknownParent
  InBranchOf _ : outer -> parentFor receiver place {around = outer}
  _ -> Top

-- | The reaction that started the innermost branch around a place, unless there is a span in between, for a
-- receiver.
reactionFor :: Receiver -> Place -> Maybe Int
reactionFor receiver place = case filter (isSeenBy receiver) (around place) of
  InBranchOf n : _ | n >= firstNumber receiver -> Just n
  _ -> Nothing

-- | Whether a receiver sees it. A receiver that needs no detail does not see the spans of operators and branches.
isSeenBy :: Receiver -> Around -> Bool
isSeenBy receiver = \case
  InSpan kind _ -> kind == Named || needsDetail receiver
  _ -> True

-- | Passes an event to the receivers of the trace.
reportEach :: Place -> (Receiver -> Event) -> IO ()
reportEach place event = for_ (receivers (trace place)) $ \receiver -> receiveEvent receiver (event receiver)

-- | The number of the next span or reaction.
newNumber :: Place -> IO Int
newNumber place = atomicModifyIORef' (lastNumber (trace place)) (\n -> let next = n + 1 in (next, next))
