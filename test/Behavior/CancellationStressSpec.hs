{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Stress tests: thousands of cancellations, at random moments, of random behaviours.
--
-- The moment is a random number of 'yield's after the start. A stress test proves
-- nothing about schedules that did not occur; but what it checks must hold under every
-- schedule, so no example can fail by chance.
module Behavior.CancellationStressSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (asyncThreadId, wait, withAsync)
import Control.Concurrent.STM (TVar, modifyTVar', newTVarIO, readTVar)
import Control.Exception
import Control.Monad (replicateM_)
import Data.Foldable (for_, toList)
import Data.IORef
import Test.Hspec hiding (parallel)
import Test.QuickCheck hiding (Failure, within)

import Behavior
import Behavior.Internal.Seam.Runtime (Label (..))
import Behavior.Message (Inbox, withInbox)
import Behavior.Parallel (pinned, unpinned)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Trace (adopt)
import Language.Operator
import Places
import Support

spec :: Spec
spec = guarded . describe "Thousands of cancellations at random moments" $ do
  it "leave nothing running, with every operator nested in every other" $
    property . withMaxSuccess 3000 $ \(Nest nest) leaf (Moments moments) ->
      ioProperty $ do
        inside <- newIORef (0 :: Int)
        let act = foldr placed (perform inside leaf) nest
        end <- cancellingAt moments (leavingNothing act)
        left <- readIORef inside
        pure $
          tabulate "it ended" [kindOf end] $
            counterexample (show end) (left === 0 .&&. end `among` leaf)

  it "leave nothing running in a tree of operators whose conditions change continually" $
    property . withMaxSuccess 2000 $ \tree (Moments moments) ->
      ioProperty $ do
        inside <- newIORef (0 :: Int)
        input <- newTVarIO (0 :: Int)
        driver <- newIORef (\() -> pure ())
        let change = atomically (modifyTVar' input (+ 1)) >> readIORef driver >>= ($ ())
            withMessages = withInbox 2 (\deliver -> pure () <$ writeIORef driver deliver)
        end <- cancellingAtWith change moments (leavingNothing (withMessages (\box -> grow inside input box tree)))
        left <- readIORef inside
        pure (tabulate "it ended" [kindOf end] (left === 0))

  it "stop an operator that has just been started" $
    for_ threaded $ \place ->
      replicateM_ 50 $ do
        end <- cancelling (leavingNothing (placed place hang)) (pure ())
        end `shouldBe` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  it "are never taken for a failure that occurs shortly before or after" $
    for_ [1 .. 600 :: Int] $ \n -> do
      let failing = replicateM_ (1 + n `mod` 7) yield >> failed
          act = case n `mod` 4 of
            0 -> attempt maxBound failing
            1 -> fallbackOver (repeat ()) (const failing)
            2 -> attempt maxBound (parallel failing hang)
            _ -> attempt maxBound (both hang failing)
      end <- cancellingAt [n `mod` 31] (leavingNothing act)
      end `shouldBe` CancelledBy (show (Cancel "the stress test"))

  it "lose no fault that a branch has thrown" $
    property . withMaxSuccess 2000 $
      forAll (elements branches) $ \place (NonNegative n) (Moments moments) ->
        ioProperty $ do
          thrown <- newIORef False
          let act = do
                replicateM_ n yield
                -- No cancellation can arrive between the write and the fault.
                mask_ (writeIORef thrown True >> throwIO (Fault "branch"))
          end <- cancellingAt moments (placed place act)
          wasThrown <- readIORef thrown
          pure . cover 10 wasThrown "the branch reached its fault" . counterexample (show end) $
            case end of
              FaultedWith fault -> fault === show (Fault "branch")
              CancelledWithFault _ fault -> fault === show (Fault "branch")
              _ -> wasThrown === False

  it "do not separate a failure from its alternative: the caller is cancelled, or the alternative runs" $
    property . withMaxSuccess 1000 $ \(NonNegative n) (Moments moments) ->
      ioProperty $ do
        (end, done) <- do
          entries <- newLog
          let first = replicateM_ n yield >> note entries 'f' >> failed
          e <- cancellingAt moments (first ? note entries 's')
          (,) e <$> notes entries
        pure . counterexample (show (end, done)) $
          case end of
            Gave () -> done === "fs"
            CancelledBy _ -> property (done `elem` ["", "f", "fs"])
            _ -> property False

-- | The places of branches. (A sensor is not a branch: a cancellation of the caller takes
-- precedence over a sensor's fault.)
branches :: [OperatorPlace]
branches = [place | place <- threaded, (labelBranch <$> placeLabel place) /= Just "polling"]

-- | Cancels the caller after the first number of 'yield's, again after the second number
-- of further 'yield's, and so on; then returns how it ended.
cancellingAt :: [Int] -> IO a -> IO (Ending a)
cancellingAt = cancellingAtWith (pure ())

cancellingAtWith :: IO () -> [Int] -> IO a -> IO (Ending a)
cancellingAtWith meanwhile moments act =
  withThread act $ \caller -> do
    for_ moments $ \moment -> do
      replicateM_ moment (meanwhile >> yield)
      throwing (asyncThreadId caller) (Cancel "the stress test")
    awaitEnd caller

-- | How often to yield before each of one to three cancellations.
newtype Moments = Moments [Int]
  deriving (Show)

instance Arbitrary Moments where
  arbitrary = Moments <$> (choose (1, 3) >>= \n -> vectorOf n (frequency [(3, choose (0, 10)), (1, choose (0, 100))]))
  shrink (Moments moments) = [Moments fewer | fewer@(_ : _) <- shrink moments, all (>= 0) fewer]

newtype Nest = Nest [OperatorPlace]
  deriving (Show)

instance Arbitrary Nest where
  arbitrary = Nest <$> (choose (1, 4) >>= \n -> vectorOf n (elements places))
  shrink (Nest nest) = [Nest fewer | fewer@(_ : _) <- shrinkList (const []) nest]

-- | What runs inside all operators: the given number of 'yield's, then one of these ends,
-- and its cleanup.
data Leaf = Leaf Int Bottom Cleanup
  deriving (Show)

data Bottom = Hangs | Returns | FailsThen | FaultsThen
  deriving (Bounded, Enum, Eq, Show)

data Cleanup = Quick | Slow | Faulty
  deriving (Bounded, Enum, Eq, Show)

instance Arbitrary Leaf where
  arbitrary = Leaf <$> choose (0, 30) <*> arbitraryBoundedEnum <*> arbitraryBoundedEnum

-- | Counts itself while it runs, however it ends; its cleanup cannot be interrupted.
perform :: IORef Int -> Leaf -> IO ()
perform inside (Leaf n bottom cleanup) =
  bracket_ (count 1) (uninterruptibleMask_ leave) $ do
    replicateM_ n yield
    case bottom of
      Hangs -> hang
      Returns -> pure ()
      FailsThen -> throwIO theFailure
      FaultsThen -> throwIO (Fault "bottom")
 where
  count d = atomicModifyIORef' inside (\k -> (k + d, ()))
  leave = do
    case cleanup of
      Quick -> pure ()
      _ -> replicateM_ 20 yield
    count (-1)
    case cleanup of
      Faulty -> throwIO (Fault "cleanup")
      _ -> pure ()

-- | Whether operators around the leaf may end so: as the leaf does, or cancelled. (The
-- fault of a cleanup replaces the cancellation if the leaf runs in the caller's thread, as
-- in GHC generally.)
among :: Ending () -> Leaf -> Bool
among end (Leaf _ bottom cleanup) = case end of
  CancelledBy e -> e == theCancel
  CancelledWithFault e fault -> e == theCancel && fault `elem` faults
  FaultedWith fault -> fault `elem` faults
  Gave () -> bottom == Returns && cleanup /= Faulty
  FailedWith e -> bottom == FailsThen && cleanup /= Faulty && e == show theFailure
 where
  theCancel = show (Cancel "the stress test")
  faults =
    [show (Fault "bottom") | bottom == FaultsThen] ++ [show (Fault "cleanup") | cleanup == Faulty]

kindOf :: Ending a -> String
kindOf = \case
  Gave _ -> "well"
  FailedWith _ -> "in failure"
  FaultedWith _ -> "in a fault"
  CancelledBy _ -> "cancelled"
  CancelledWithFault _ _ -> "cancelled, with a fault"

-- | On real threads, and so with what the simulator does not have.
data Tree
  = Bottom Leaf
  | Pinned Tree
  | Unpinned Tree
  | -- | In a thread that the library has not started; it has the caller's place in a trace.
    Adopted Tree
  | Op (Operator Sensed Tree)
  deriving (Show)

-- | Whether it can be divided by this number; or the nearest shared signal.
data Sensed = DividedBy Int | Nearest
  deriving (Show)

instance Arbitrary Tree where
  arbitrary = sized (tree outside . min 4)
   where
    tree :: Around -> Int -> Gen Tree
    tree place n
      | n <= 0 = Bottom <$> arbitrary
      | otherwise =
          frequency
            [ (4, tree place 0)
            , (1, Pinned <$> tree place (n - 1))
            , (1, Unpinned <$> tree place (n - 1))
            , (1, Adopted <$> tree place (n - 1))
            , (30, Op <$> operators (not . abandons) place sensed (\inner -> tree inner (n - 1)))
            ]
    sensed place = frequency ((3, DividedBy <$> choose (1, 3)) : [(3, pure Nearest) | sharing place])
  shrink = \case
    Bottom _ -> []
    Pinned a -> [a]
    Unpinned a -> [a]
    Adopted a -> [a]
    Op o -> toList o ++ (Op <$> shrinkOperator (const []) shrink o)

-- | Each message is delivered when the input changes.
grow :: IORef Int -> TVar Int -> Inbox () -> Tree -> IO ()
grow inside input box = runPart stress (environmentWith box) ()
 where
  stress =
    Language
      { runPart = \outer _ -> \case
          Bottom leaf -> perform inside leaf
          Pinned a -> pinned (runPart stress outer () a)
          Unpinned a -> unpinned (runPart stress outer () a)
          Adopted a -> adopt >>= \here -> withAsync (here (runPart stress outer () a)) wait
          Op o -> run stress outer () () o
      , inBranch = \_ _ -> ()
      , signalOf = \outer _ -> \case
          DividedBy n -> fromEnum . (== 0) . (`mod` n) <$> Signal.watching (readTVar input)
          Nearest -> nearest outer
      , reactsTo = id
      , tick = 0.0001
      , results = const ()
      }
