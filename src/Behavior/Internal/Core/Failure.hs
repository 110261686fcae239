{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ExistentialQuantification #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Failure, and what to do about it.
--
-- A /failure/ is the robot's: it could not do its task. A /fault/ is the program's or
-- the machine's: a bug, a lost connection. A /cancellation/ comes from the caller's side: the
-- behaviour is to stop early. The three differ in their types:
--
-- +--------------+------------------------------------------+------------------------+
-- |              | is                                       | caught by '?'          |
-- +==============+==========================================+========================+
-- | failure      | an exception under 'BehaviorFailed'      | yes                    |
-- +--------------+------------------------------------------+------------------------+
-- | cancellation | an exception under 'SomeAsyncException'  | never                  |
-- +--------------+------------------------------------------+------------------------+
-- | fault        | every other exception                    | never                  |
-- +--------------+------------------------------------------+------------------------+
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.Failure
  ( Behavior

    -- * The hierarchy
  , BehaviorFailed (..)
  , failurePath
  , behaviorFailedToException
  , behaviorFailedFromException
  , Failed (..)

    -- * Failing
  , failed
  , failWith
  , failingOn
  , isFailure
  , isCancellation
  , trySynchronous
  , tryEvaluate

    -- * What to do when something fails
  , fallback
  , fallbackWith
  , (?)
  , fallbackOver
  , attempt

    -- * What to do about a fault
  , tryAny
  , catchAny

    -- * Faults while stopping
  , StoppedWithFault (..)
  ) where

import Control.Exception
  ( Exception (..)
  , SomeAsyncException
  , SomeException (..)
  , asyncExceptionFromException
  , asyncExceptionToException
  , catch
  , evaluate
  , throwIO
  , try
  , uninterruptibleMask_
  )
import Control.Monad.Catch (MonadThrow (throwM))
import Data.Foldable (toList)
import Data.List (intercalate)
import Data.Maybe (isJust)
import Data.Typeable (cast)

-- | An action of the agent: it takes time, returns an @a@, or throws.
--
-- Behaviours are composed in sequence with 'Prelude.>>=', 'Prelude.>>' and @do@
-- (which keep track of the current step), and with the operators of this package.
--
-- /Sections 4 and 5 of the paper./
--
-- @since 0.1.0.0
type Behavior = IO

-- | The root of all failures, as 'SomeException' is of all exceptions.
--
-- To define your own failure type, put it under this root; it can then be
-- caught by '?' together with every other failure, or by its own type:
--
-- >>> import Control.Exception
-- >>> data DoorLocked = DoorLocked deriving Show
-- >>> :{
-- instance Exception DoorLocked where
--   toException = behaviorFailedToException
--   fromException = behaviorFailedFromException
-- :}
--
-- >>> throwIO DoorLocked ? putStrLn "take the window"
-- take the window
--
-- >>> try (throwIO DoorLocked) >>= either (\DoorLocked -> putStrLn "fetch the key") pure
-- fetch the key
--
-- In a trace it contains the path of the names around the place where it was thrown
-- ("Behavior.Trace"), from the outside in, and is shown with it; otherwise the path is empty.
--
-- /Section 5 of the paper./
--
-- @since 0.1.0.0
data BehaviorFailed = forall e. Exception e => BehaviorFailed [String] e

instance Show BehaviorFailed where
  showsPrec precedence (BehaviorFailed path e)
    | null path = showsPrec precedence e
    | otherwise = showParen (precedence > 10) (showString (renderPath path) . shows e)

instance Exception BehaviorFailed where
  displayException (BehaviorFailed path e) = renderPath path ++ displayException e

renderPath :: [String] -> String
renderPath path = if null path then "" else intercalate " > " path ++ ": "

-- | The names of the spans in which it was thrown, from the outside in; empty without a trace.
--
-- @since 0.1.0.0
failurePath :: BehaviorFailed -> [String]
failurePath (BehaviorFailed path _) = path

-- | The 'toException' of a type that is to be a failure.
--
-- @since 0.1.0.0
behaviorFailedToException :: Exception e => e -> SomeException
behaviorFailedToException = toException . BehaviorFailed []

-- | The 'fromException' of a type that is to be a failure.
--
-- @since 0.1.0.0
behaviorFailedFromException :: Exception e => SomeException -> Maybe e
behaviorFailedFromException e = do
  BehaviorFailed _ inner <- fromException e
  cast inner

-- | The failure to throw when no better one is at hand.
--
-- /Section 6 of the paper, where it is the failure of @attempt@./
--
-- @since 0.1.0.0
data Failed
  = -- | It could not be done.
    Failed
  | -- | It could not be done, and this is why.
    FailedBecause String
  deriving (Eq, Show)

instance Exception Failed where
  toException = behaviorFailedToException
  fromException = behaviorFailedFromException
  displayException = \case
    Failed -> "the behaviour failed"
    FailedBecause why -> "the behaviour failed: " ++ why

-- | Fails with 'Failed'. It works in every 'MonadThrow', so in a transaction too.
--
-- > failed ? b  =  b
--
-- >>> failed ? pure "recovered"
-- "recovered"
--
-- @since 0.1.0.0
failed :: MonadThrow m => m a
failed = throwM Failed

-- | Fails with 'FailedBecause' the given reason.
--
-- >>> failWith "the door is locked" :: Behavior ()
-- *** Exception: FailedBecause "the door is locked"
--
-- @since 0.1.0.0
failWith :: MonadThrow m => String -> m a
failWith = throwM . FailedBecause

-- | Turns chosen faults into failures, at the edge where an action meets the
-- hardware: @failingOn chosen act@ is @act@; but if @act@ throws an @e@ for which
-- @chosen@ is true, it fails with that @e@ inside a 'BehaviorFailed'.
--
-- A failure stays as it is, and an asynchronous exception is never turned into a
-- failure, whatever the type @e@. Like '?' it decides by the exception's type, in the
-- caller's thread.
--
-- >>> import System.IO.Error
-- >>> let readSensor = readFile "/no/such/device"
-- >>> failingOn isDoesNotExistError readSensor ? pure "no sensor"
-- "no sensor"
--
-- @since 0.1.0.0
failingOn :: Exception e => (e -> Bool) -> Behavior a -> Behavior a
failingOn chosen act =
  -- 'catch', not 'try': between a 'try' and the rethrowing, a second cancellation
  -- could replace what was caught.
  act `catch` \e -> case fromException e of
    Just fault | not (isFailure e || isCancellation e), chosen fault -> throwIO (asFailure e)
    _ -> throwIO e
 where
  asFailure (SomeException e) = BehaviorFailed [] e

-- | Whether an exception is a failure.
isFailure :: SomeException -> Bool
isFailure e = isJust (fromException e :: Maybe BehaviorFailed)

-- | Whether an exception is a cancellation. Only its type shows that: it is asynchronous.
isCancellation :: SomeException -> Bool
isCancellation e = isJust (fromException e :: Maybe SomeAsyncException)

-- | 'try' that lets cancellations through.
trySynchronous :: IO a -> IO (Either SomeException a)
trySynchronous act = (Right <$> act) `catchSynchronous` (pure . Left)

-- | Evaluates an exception, or what is made of it; gives what that throws. It is not interrupted: what is thrown at
-- the caller meanwhile stays pending, and is not taken for what the evaluation throws.
tryEvaluate :: a -> IO (Either SomeException a)
tryEvaluate a = uninterruptibleMask_ (try (evaluate a))

-- | Handles whatever the action throws, except a cancellation.
catchSynchronous :: IO a -> (SomeException -> IO a) -> IO a
catchSynchronous act handler = act `catch` \e -> if isCancellation e then throwIO e else handler e

-- | @fallback first second@ runs @first@; if that /fails/, it runs @second@.
--
-- > fallback (pure a) b                  =  pure a
-- > fallback failed b                    =  b
-- > fallback a (fallback b c)            =  fallback (fallback a b) c
--
-- Faults and cancellations of @first@ pass through: @second@ does not run.
-- @second@ runs after @first@ and all its handlers have ended, in the caller's
-- own masking state (never inside an exception handler, where it could not be
-- interrupted). What @second@ throws is thrown.
--
-- It decides by the type of the exception, in the caller's thread: a failure that another
-- thread throws to the caller (by 'Control.Exception.throwTo') while @first@ runs counts as
-- the failure of @first@.
--
-- A chain that nests to the right, as '?' does, runs in constant space.
--
-- >>> fallback (failWith "locked") (putStrLn "smash it")
-- smash it
--
-- /Section 5 of the paper, Fallback; Section 3.3 for why it is not reactive./
--
-- @since 0.1.0.0
fallback :: Behavior a -> Behavior a -> Behavior a
fallback first second =
  -- 'try', not 'catch': a handler would run the second behaviour masked.
  try first >>= \case
    Right a -> pure a
    Left BehaviorFailed {} -> second
{-# INLINE fallback #-}

-- | 'fallback' where the second behaviour is given the failure.
--
-- > fallbackWith (pure a) b    =  pure a
-- > fallbackWith failed b      =  b (BehaviorFailed [] Failed)
-- > fallbackWith a (const b)   =  fallback a b
--
-- Faults and cancellations of the first pass through. The second runs as it does in
-- 'fallback': in the caller's own masking state, outside of any exception handler. What it
-- throws is thrown.
--
-- >>> fallbackWith (failWith "locked") (\why -> putStrLn ("smash it: " ++ show why))
-- smash it: FailedBecause "locked"
--
-- @since 0.1.0.0
fallbackWith :: Behavior a -> (BehaviorFailed -> Behavior a) -> Behavior a
fallbackWith first second = try first >>= either second pure
{-# INLINE fallbackWith #-}

-- | 'fallback' as an operator. It binds tighter than @|||@ and 'Prelude.>>', and
-- nests to the right.
--
-- >>> failed ? failed ? pure "the third"
-- "the third"
--
-- Under @ImplicitParams@ write spaces around it. For everything else see 'fallback'; in
-- particular, it decides by the type of the exception, in the caller's thread.
--
-- @since 0.1.0.0
(?) :: Behavior a -> Behavior a -> Behavior a
(?) = fallback
{-# INLINE (?) #-}

infixr 3 ?

-- | Tries a behaviour on each input in turn, until one does not fail.
--
-- > fallbackOver [x, y, z] act  =  act x ? act y ? act z
-- > fallbackOver []        act  =  failed
--
-- If all fail, the last failure is thrown. Faults and cancellations pass through
-- at once.
--
-- >>> let open door = if door == "back" then pure door else failWith (door ++ " is locked")
-- >>> fallbackOver ["front", "back", "cellar"] open
-- "back"
--
-- /Section 6 of the paper, @fallback@ over a list./
--
-- @since 0.1.0.0
fallbackOver :: Foldable t => t x -> (x -> Behavior a) -> Behavior a
fallbackOver inputs act = case toList inputs of
  [] -> failed
  first : others -> go first others
 where
  go x [] = act x
  go x (y : ys) = act x ? go y ys

-- | Tries a behaviour up to @n@ times.
--
-- > attempt 1 act        =  act
-- > attempt (n + 1) act  =  act ? attempt n act
--
-- The last failure is thrown as it is. With @n <= 0@ it fails at once with
-- 'Failed', and nothing runs. Faults and cancellations pass through at once. Like '?' it
-- decides by the exception's type, in the caller's thread.
--
-- >>> attempt 3 (putStrLn "push" >> failed)
-- push
-- push
-- push
-- *** Exception: Failed
--
-- To try a behaviour that takes an argument, compose: @attempt 3 . open@.
--
-- /Section 6 of the paper./
--
-- @since 0.1.0.0
attempt :: Int -> Behavior a -> Behavior a
attempt n act
  | n <= 0 = failed
  | n == 1 = act
  | otherwise = act ? attempt (n - 1) act

-- | Runs a behaviour and gives its result, or the failure or fault that it threw.
--
-- > tryAny (pure a)     =  pure (Right a)
-- > tryAny (throwIO e)  =  pure (Left (toException e))  -- unless e is asynchronous
--
-- A cancellation passes through. Only the type of an exception decides whether it is one: every
-- exception under 'SomeAsyncException' is, and no other, whichever thread threw it. So an exception of a
-- synchronous type that another thread throws to the caller counts as the behaviour's own.
--
-- Use it where a fault must not end the program (around each of many missions, say). For
-- failures use '?'.
--
-- >>> tryAny (failWith "locked" :: Behavior ())
-- Left (FailedBecause "locked")
--
-- @since 0.1.0.0
tryAny :: Behavior a -> Behavior (Either SomeException a)
tryAny = trySynchronous

-- | Runs a behaviour; if it throws a failure or fault, runs the handler with that.
--
-- > catchAny act handler  =  tryAny act >>= either handler pure
--
-- A cancellation passes through, by the same rule as in 'tryAny'. The handler runs in the
-- caller's own masking state, and not inside an exception handler of GHC: so it can be
-- interrupted. What it throws is thrown.
--
-- >>> catchAny (readFile "/no/such/map") (\_ -> pure "an empty map")
-- "an empty map"
--
-- @since 0.1.0.0
catchAny :: Behavior a -> (SomeException -> Behavior a) -> Behavior a
catchAny act handler = tryAny act >>= either handler pure

-- | What is thrown when a behaviour was cancelled and a cleanup faulted while it stopped:
-- the cancellation and the fault, as one asynchronous exception, so that no
-- handler for ordinary exceptions catches it.
--
-- An operator that requested the stop takes the fault out and throws that. You meet the pair
-- itself where a cancellation came from outside this library, from
-- 'System.Timeout.timeout' say.
--
-- @since 0.1.0.0
data StoppedWithFault = StoppedWithFault
  { stoppedBy :: !SomeException
  -- ^ The cancellation.
  , stoppedFault :: !SomeException
  -- ^ The leftmost fault of the behaviours that it stopped.
  }

instance Show StoppedWithFault where
  showsPrec precedence (StoppedWithFault cause fault) =
    showParen (precedence > 10) $
      showString "StoppedWithFault "
        . showsPrec 11 cause
        . showString " "
        . showsPrec 11 fault

instance Exception StoppedWithFault where
  toException = asyncExceptionToException
  fromException = asyncExceptionFromException
  displayException (StoppedWithFault (SomeException cause) (SomeException fault)) =
    "stopped by " ++ displayException cause ++ ", and while stopping: " ++ displayException fault
