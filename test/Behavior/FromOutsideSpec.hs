{-# LANGUAGE LambdaCase #-}

-- |
-- Exceptions of a synchronous type that are thrown to the caller of an operator from outside
-- (as by @throwTo main (ExitFailure 3)@ in a signal handler); exceptions that users' code throws
-- in the operator's own thread; and exceptions that are themselves undefined.
module Behavior.FromOutsideSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (newTVarIO, readTVar, throwSTM, writeTVar)
import Control.Exception
import Control.Monad (void)
import Data.Foldable (for_)
import Data.Version (makeVersion)
import System.Exit (ExitCode (..))
import System.IO.Unsafe (unsafePerformIO)
import System.Info (compilerVersion)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Internal.Seam.Runtime (atomically)
import Behavior.Message (onMessage, withInbox)
import Behavior.Parallel (allOf, decide, firstOf, scoped)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time (abandoning, timeout)
import Support hiding (End (..))

spec :: Spec
spec = guarded $ do
  describe "A synchronous exception that is thrown to the caller from outside" thrownToTheCaller
  describe "Users' code in the operator's thread" usersCode
  describe "An exception that is itself undefined" undefinedExceptions
  describe "What is thrown while an exception is evaluated" duringEvaluation

-- | Each operator, with a branch that runs until it is stopped.
operators :: [(String, Behavior String -> Behavior String)]
operators =
  [ ("parallel", \act -> "" <$ parallel act hang)
  , ("both", \act -> "" <$ both act hang)
  , ("firstOf", \act -> firstOf [hang, act])
  , ("allOf", \act -> concat <$> allOf [act, hang])
  , ("decide", \act -> decide (fmap (either throwIO pure) . head) [act, hang])
  , ("scoped", scoped . const)
  , ("withShared", Signal.withShared (pure True) . const)
  , ("timeout", timeout 3600)
  , ("abandoning", abandoning 3600)
  , ("whileHolding", Signal.whileHolding (pure True))
  , ("switch", Signal.switch (pure 'k') . const)
  , ("teleoReactive", \act -> Signal.teleoReactive [(pure True, act)])
  , ("insteadWhen", Signal.insteadWhen (pure False) (pure ""))
  , ("insteadWhen (its emergency)", \act -> Signal.insteadWhen (pure True) act (pure ""))
  , ("rSelect", \act -> Signal.rSelect (pure True) act (pure ""))
  , ("monitor", Signal.monitor (pure False) (pure ()))
  , ("monitor (its recovery)", \act -> Signal.monitor (pure True) (void act) (pure ""))
  , ("onMessage", \act -> withInbox 1 silent (\inbox -> onMessage inbox (\() -> hang) act))
  , ( "onMessage (its handler)"
    , \act -> withInbox 1 speaking (\inbox -> onMessage inbox (\() -> pure () <$ act) (pure ""))
    )
  , ("rSelect, polled", \act -> rSelect (pure True) act (pure ""))
  , ("monitor, polled", monitor (pure False) (pure ()))
  ]
 where
  silent _ = pure (pure ())
  speaking deliver = pure () <$ deliver ()

-- | What a branch does when it is stopped.
data Stopping = Stops | Completes | Fails | Faults
  deriving (Bounded, Enum, Eq, Show)

thrownToTheCaller :: Spec
thrownToTheCaller = do
  for_ operators $ \(name, operator) ->
    for_ [minBound ..] $ \stopping -> do
      it (name ++ ": is thrown by the operator, though the branch " ++ manner stopping) $ do
        end <- hit (operator . endingBy stopping)
        end `shouldBe` expected stopping
      it (name ++ ": is not caught by ?, though the branch " ++ manner stopping) $ do
        end <- hit (\entered -> operator (endingBy stopping entered) ? pure "goes on!")
        end `shouldBe` expected stopping

  it "waitUntil: is thrown by the operator" $ do
    end <- withThread (Signal.waitUntil (pure False)) $ \caller -> do
      awaitIdle (asyncThreadId caller)
      throwing (asyncThreadId caller) (ExitFailure 3)
      awaitEnd caller
    end `shouldBe` FaultedWith "ExitFailure 3"
 where
  hit act = do
    entered <- newGate
    withThread (act entered) $ \caller -> do
      pass entered
      throwing (asyncThreadId caller) (ExitFailure 3)
      awaitEnd caller
  endingBy stopping entered =
    (open entered >> hang) `catch` \e -> case stopping of
      Stops -> throwIO (e :: SomeException)
      Completes -> pure "completed"
      Fails -> failWith "the arm did not park"
      Faults -> throwIO (Fault "a cleanup")
  manner = \case
    Stops -> "stops"
    Completes -> "nevertheless completes"
    Fails -> "fails while it stops"
    Faults -> "faults while it stops"
  expected = \case
    Faults -> CancelledWithFault "ExitFailure 3" (show (Fault "a cleanup"))
    _ -> FaultedWith "ExitFailure 3"

usersCode :: Spec
usersCode = do
  for_ followers $ \(name, follower) -> do
    it (name ++ ": a view that throws stops the branch, then ends the operator") $ do
      broken <- newTVarIO False
      let signal = Signal.watching (readTVar broken >>= \is -> if is then throwSTM (Fault "view") else pure True)
      stoppedFirst follower signal (atomically (writeTVar broken True)) (FaultedWith (show (Fault "view")))
    it (name ++ ": a function on a signal that throws stops the branch, then ends the operator") $ do
      level <- newTVarIO (0 :: Int)
      let signal = (\n -> n == 0 || throw (Fault "function")) <$> Signal.watching (readTVar level)
      stoppedFirst follower signal (atomically (writeTVar level 1)) (FaultedWith (show (Fault "function")))
  it "switch: an equality that throws stops the branch, then ends the operator" $ do
    level <- newTVarIO (Key 0)
    stoppedFirst
      (\signal act -> Signal.switch signal (const act))
      (Signal.watching (readTVar level))
      (atomically (writeTVar level (Key 1)))
      (FaultedWith (show (Fault "equality")))
  it "firstOf, allOf: when the list of behaviours ends in an error, the started branches end before it is thrown" $ do
    entries <- newLog
    for_ [firstOf, void . allOf] $ \operator -> do
      entered <- newGate
      let started = (open entered >> hang) `uninterruptibly` note entries "cleaned up"
          list = started : (unsafePerformIO (pass entered) `seq` throw (Fault "list"))
      ending (operator list) `shouldReturn` FaultedWith (show (Fault "list"))
    notes entries `shouldReturn` ["cleaned up", "cleaned up"]
 where
  followers =
    [ ("whileHolding", Signal.whileHolding)
    , ("rSelect", \signal act -> Signal.rSelect signal act (pure ()))
    , ("monitor", \signal -> Signal.monitor (not <$> signal) (pure ()))
    , ("insteadWhen", \signal -> Signal.insteadWhen (not <$> signal) (pure ()))
    , ("switch", \signal -> Signal.switch signal . const)
    , ("teleoReactive", \signal act -> Signal.teleoReactive [(signal, act)])
    ] :: [(String, Signal Bool -> Behavior () -> Behavior ())]

-- | Runs the operator, which must end as given, after the cleanup of its branch.
stoppedFirst :: (Signal k -> Behavior () -> Behavior ()) -> Signal k -> IO () -> Ending () -> IO ()
stoppedFirst follower signal breakIt expected = do
  entered <- newGate
  entries <- newLog
  end <- withThread (follower signal ((open entered >> hang) `uninterruptibly` note entries "cleaned up")) $
    \caller -> do
      pass entered
      breakIt
      awaitEnd caller
  end `shouldBe` expected
  notes entries `shouldReturn` ["cleaned up"]

-- | A key that cannot be compared with another one.
newtype Key = Key Int

instance Eq Key where
  Key a == Key b
    | a == b = True
    | otherwise = throw (Fault "equality")

undefinedExceptions :: Spec
undefinedExceptions = do
  it "thrown to the caller from outside: is thrown when the branches have ended" $ do
    entered <- newGate
    stopping <- newGate
    mayEnd <- newGate
    entries <- newLog
    let slow = (open entered >> hang) `uninterruptibly` (open stopping >> pass mayEnd >> note entries "cleaned up")
    end <- withThread (parallel slow hang) $ \caller -> do
      pass entered
      throwing (asyncThreadId caller) (throw (Fault "undefined") :: SomeException)
      pass stopping
      stillRunning caller
      open mayEnd
      awaitEnd caller
    -- (GHC 9.10 evaluates an exception that it throws again; earlier ones throw it as it is.)
    if compilerVersion < makeVersion [9, 10]
      then evaluate (length (show end)) `shouldThrow` (== Fault "undefined")
      else end `shouldBe` FaultedWith (show (Fault "undefined"))
    notes entries `shouldReturn` ["cleaned up"]

  for_ exceptions $ \(kind, bottom) -> do
    for_ several $ \(name, operator) ->
      it (name ++ ", " ++ kind ++ ": ends as a fault, after the other branch's cleanup") $
        beside bottom operator
    it ("withShared, " ++ kind ++ ": ends as a fault, after its sensor has ended") $ do
      reading <- newGate
      entries <- newLog
      let sensor = Signal.polling 0.001 ((open reading >> hang) `uninterruptibly` note entries "cleaned up")
      ending (Signal.withShared sensor (\_ -> pass reading >> bottom))
        `shouldReturn` FaultedWith (show (Fault "undefined"))
      notes entries `shouldReturn` ["cleaned up"]
    it ("monitor, " ++ kind ++ ": thrown by the task while it stops, is rethrown after the recovery") $ do
      condition <- newTVarIO False
      entered <- newGate
      entries <- newLog
      let task = (open entered >> hang) `onException` bottom
          monitored = Signal.monitor (Signal.watching (readTVar condition)) (note entries "recovered") task
      end <- withThread monitored $ \caller -> do
        pass entered
        atomically (writeTVar condition True)
        awaitEnd caller
      end `shouldBe` (FaultedWith (show (Fault "undefined")) :: Ending ())
      notes entries `shouldReturn` ["recovered"]
  it "as the fault of a cleanup that the user's code throws together with the stop: ends as a fault" $ do
    entered <- newGate
    let cleanup e = throwIO (StoppedWithFault e (toException (throw (Fault "undefined") :: Fault)))
    ending (pass entered `parallel` ((open entered >> hang) `catch` cleanup :: IO ()))
      `shouldReturn` FaultedWith (show (Fault "undefined"))
  it "made of other undefined exceptions: ends as a fault too" $
    for_ (take 3 (iterate throw (throw (Fault "undefined") :: SomeException))) $ \bottom ->
      beside (throwIO bottom) parallel
 where
  exceptions =
    [ ("SomeException", throwIO (throw (Fault "undefined") :: SomeException))
    , ("BehaviorFailed", throwIO (throw (Fault "undefined") :: BehaviorFailed))
    , ("a failure inside BehaviorFailed", throwIO (BehaviorFailed [] (throw (Fault "undefined") :: Failed)))
    , ("SomeAsyncException", throwIO (throw (Fault "undefined") :: SomeAsyncException))
    , ("a cancellation inside SomeAsyncException", throwIO (SomeAsyncException (throw (Fault "undefined") :: Cancel)))
    , ("a user's own type", throwIO (throw (Fault "undefined") :: Fault))
    ]
  several =
    [ ("parallel", parallel)
    , ("both", both)
    , ("firstOf", \a b -> firstOf [a, b])
    , ("allOf", \a b -> void (allOf [a, b]))
    , ("whileHolding", \a b -> Signal.whileHolding (pure True) (parallel a b))
    ]
  beside :: Behavior () -> (Behavior () -> Behavior () -> Behavior ()) -> IO ()
  beside bottom operator = do
    entered <- newGate
    stopping <- newGate
    mayEnd <- newGate
    entries <- newLog
    let slow = (open entered >> hang) `uninterruptibly` (open stopping >> pass mayEnd >> note entries "cleaned up")
    end <- withThread (operator slow (pass entered >> bottom)) $ \caller -> do
      pass stopping
      stillRunning caller
      open mayEnd
      awaitEnd caller
    end `shouldBe` FaultedWith (show (Fault "undefined"))
    notes entries `shouldReturn` ["cleaned up"]

duringEvaluation :: Spec
duringEvaluation = do
  it "at the caller, by another thread: is received after it" $
    evaluating $ \slow looking goesOn ->
      withThread ((try (parallel hang hang) :: IO (Either SomeException ())) >> hang) $ \caller -> do
        throwing (asyncThreadId caller) slow
        pass looking
        throwing (asyncThreadId caller) (Cancel "caller")
        goesOn
        awaitEnd caller `shouldReturn` (CancelledBy (show (Cancel "caller")) :: Ending ())
  it "at the branch, which is stopped: does not replace what the branch has thrown" $
    evaluating $ \slow looking goesOn ->
      withThread (parallel (throwIO slow) (pass looking)) $ \caller -> do
        awaitThrown (asyncThreadId caller)
        goesOn
        awaitEnd caller `shouldReturn` FaultedWith (show (Fault "slow"))
 where
  -- With a fault whose evaluation opens the gate, and then waits. (GHC from 9.10 on evaluates the 'SomeException' as
  -- it is thrown, but not what is in it.)
  evaluating act = do
    looking <- newGate
    goesOn <- newGate
    let slow = unsafePerformIO (Fault "slow" <$ (open looking >> pass goesOn))
    act slow looking (open goesOn)
