{-# LANGUAGE ScopedTypeVariables #-}

module Behavior.FailureSpec (spec) where

import Control.Concurrent.Async (asyncThreadId)
import Control.Concurrent.STM (newTVarIO, readTVarIO, writeTVar)
import Control.Exception
import Control.Monad (void, (>=>))
import Data.Either (fromRight)
import Data.Foldable (for_)
import Data.IORef
import qualified Data.List.NonEmpty as NonEmpty
import System.IO.Error (isDoesNotExistError)
import qualified System.Timeout as System
import Test.Hspec
import Test.QuickCheck hiding (Failure, within)

import Behavior
import Behavior.Time (TimedOut (..), atomically, timeout)
import Support

spec :: Spec
spec = guarded $ do
  describe "the hierarchy of failures" hierarchy
  describe "fallback" fallbacks
  describe "fallbackOver" fallbacksOver
  describe "attempt" attempts
  describe "fallbackWith" fallbacksWith
  describe "tryAny and catchAny" catchingAny
  describe "failingOn" failingOns
  describe "a composition of ?, attempt, fallbackOver, >>= and pure" $
    it "ends as the pure model says, having done the same in the same order" $
      property $ \expression ->
        ioProperty $ do
          count <- newIORef 0
          actual <- observing (\notebook -> run count notebook expression)
          let (end, _, done) = predict 0 expression
          pure (cover 10 (length done > 3) "more than three effects" (actual === (end, done)))

hierarchy :: Spec
hierarchy = do
  it "lets a failure of one's own type be caught by that type" $
    (throwIO (Failure "locked") `catch` \(Failure why) -> pure why) `shouldReturn` "locked"

  it "does not catch one failure type by another" $
    ending (throwIO (Failure "locked") `catch` \(_ :: Failed) -> pure ())
      `shouldReturn` FailedWith (show (Failure "locked"))

  it "lets every failure be caught by the root, which shows what it holds" $ do
    (throwIO (Failure "locked") `catch` \(e :: BehaviorFailed) -> pure (show e))
      `shouldReturn` show (Failure "locked")
    (failWith "stuck" `catch` \(e :: BehaviorFailed) -> pure (displayException e))
      `shouldReturn` "the behaviour failed: stuck"

  it "does not take a fault or a cancellation for a failure" $ do
    ending (throwIO (Fault "bug") `catch` \(_ :: BehaviorFailed) -> pure ())
      `shouldReturn` FaultedWith (show (Fault "bug"))
    ending (throwIO (Cancel "user") `catch` \(_ :: BehaviorFailed) -> pure ())
      `shouldReturn` CancelledBy (show (Cancel "user"))

  it "fails with Failed and with FailedBecause the reason" $ do
    (failed :: IO ()) `shouldThrow` (== Failed)
    (failWith "no grip" :: IO ()) `shouldThrow` (== FailedBecause "no grip")
    displayException Failed `shouldBe` "the behaviour failed"

  it "fails in a transaction too, which is then undone" $ do
    var <- newTVarIO 'a'
    atomically (writeTVar var 'b' >> failed) ? pure ()
    readTVarIO var `shouldReturn` 'a'
    atomically (failWith "no value") `shouldThrow` (== FailedBecause "no value")

  it "fails in every MonadThrow" $
    (failed :: Maybe ()) `shouldBe` Nothing

fallbacks :: Spec
fallbacks = do
  it "is associative" $
    property $ \a b c ->
      sameAs
        (\notebook -> (play notebook a ? play notebook b) ? play notebook c)
        (\notebook -> play notebook a ? (play notebook b ? play notebook c))

  it "has failed for its identity on the left" $
    property $ \a ->
      sameAs (\notebook -> failed ? play notebook a) (`play` a)

  it "has failed on the right as its identity but for the failure, which is Failed" $
    property $ \a ->
      sameAs
        (\notebook -> play notebook a ? failed)
        (\notebook -> play notebook a `catch` \(_ :: BehaviorFailed) -> throwIO Failed)

  it "is absorbed by pure, by a fault and by a cancellation on the left" $
    property $ \(n :: Int) a -> do
      sameAs (\notebook -> pure n ? play notebook a) (\_ -> pure n)
        .&&. sameAs (\notebook -> throwIO (Fault "bug") ? play notebook a) (\_ -> throwIO (Fault "bug"))
        .&&. sameAs (\notebook -> throwIO (Cancel "user") ? play notebook a) (\_ -> throwIO (Cancel "user"))

  it "is the same as an operator and by its name" $
    property $ \a b ->
      sameAs
        (\notebook -> play notebook a ? play notebook b)
        (\notebook -> fallback (play notebook a) (play notebook b))

  it "binds tighter than >>" $ do
    -- pure () ? (left >> right) would note nothing.
    observing (\notebook -> pure () ? note notebook 'l' >> note notebook 'r')
      `shouldReturn` (Gave (), "r")

  it "nests to the right, or it could not be mixed with an operator that does" $
    (failed ? failed |?| pure 'c') `shouldReturn` 'c'

  it "catches a failure of every type" $
    for_ [throwIO (Failure "locked"), failed, failWith "stuck", throwIO (TimedOut 1)] $ \failure ->
      (failure ? pure "recovered") `shouldReturn` "recovered"

  it "does not run the second behaviour when the first faults, also with a bug in pure code" $ do
    observing (\notebook -> throwIO (Fault "bug") ? note notebook 'r')
      `shouldReturn` (FaultedWith (show (Fault "bug")), "")
    observing (\notebook -> evaluate (1 `div` (0 :: Int)) ? (1 <$ note notebook 'r'))
      `shouldReturn` (FaultedWith (show DivideByZero), "")

  it "does not run the second behaviour when the first is cancelled" $ do
    notebook <- newLog
    inside <- newGate
    cancelling ((open inside >> hang) ? note notebook 'r') (pass inside)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    notes notebook `shouldReturn` ""

  it "can be cancelled in the second behaviour" $ do
    inside <- newGate
    cancelling (failed ? (open inside >> hang)) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  it "runs the second behaviour after the handlers of the first have ended" $ do
    let first notebook = (failed `onException` note notebook "handler") `finally` note notebook "cleanup"
    observing (\notebook -> first notebook ? note notebook "second")
      `shouldReturn` (Gave (), ["handler", "cleanup", "second"])

  it "takes the failure of a cleanup for a failure, and its fault for a fault" $ do
    (throwIO (Fault "bug") `finally` failWith "cleanup" ? pure ()) `shouldReturn` ()
    (failed `finally` throwIO (Fault "cleanup") ? pure ()) `shouldThrow` (== Fault "cleanup")

  it "throws what the second behaviour throws" $
    (failWith "first" ? failWith "second" :: IO ()) `shouldThrow` (== FailedBecause "second")

  inCallersState "its second behaviour" (failed ?)
  inCallersState "its first behaviour" (? pure Unmasked)

fallbacksWith :: Spec
fallbacksWith = do
  it "is fallback when the second behaviour does not look at the failure" $
    property $ \a b ->
      sameAs
        (\notebook -> fallbackWith (play notebook a) (const (play notebook b)))
        (\notebook -> play notebook a ? play notebook b)

  it "gives the second behaviour the failure" $ do
    fallbackWith (throwIO (Failure "locked")) (pure . show) `shouldReturn` show (Failure "locked")
    fallbackWith (throwIO (Failure "locked")) throwIO `shouldThrow` (== Failure "locked")

  it "runs the second behaviour after the handlers of the first have ended" $ do
    let first notebook = (failed `onException` note notebook "handler") `finally` note notebook "cleanup"
    observing (\notebook -> fallbackWith (first notebook) (const (note notebook "second")))
      `shouldReturn` (Gave (), ["handler", "cleanup", "second"])

  it "can be cancelled in the second behaviour" $ do
    inside <- newGate
    cancelling (fallbackWith failed (const (open inside >> hang))) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  inCallersState "its second behaviour" (fallbackWith failed . const)
  inCallersState "its first behaviour" (`fallbackWith` const (pure Unmasked))

catchingAny :: Spec
catchingAny = do
  it "gives the result, the failure or the fault, and lets a cancellation through" $
    property $ \(Script name end) ->
      ioProperty $ do
        (actual, _) <- observing (\notebook -> either (Left . show) Right <$> tryAny (play notebook (Script name end)))
        pure $ case end of
          Succeeds n -> actual === Gave (Right n)
          Fails why -> actual === Gave (Left (show (Failure why)))
          Faults why -> actual === Gave (Left (show (Fault why)))
          Cancels why -> actual === CancelledBy (show (Cancel why))

  it "chooses by type: a synchronous one thrown from outside counts as the behaviour's own" $ do
    inside <- newGate
    launching (either show show <$> tryAny (open inside >> hang :: IO ())) $ \caller -> do
      pass inside
      throwTo (asyncThreadId caller) (Fault "from outside")
      awaitEnd caller `shouldReturn` Gave (show (Fault "from outside"))

  it "is tryAny, then the handler" $
    property $ \a b ->
      sameAs
        (\notebook -> catchAny (play notebook a) (const (play notebook b)))
        (\notebook -> tryAny (play notebook a) >>= either (const (play notebook b)) pure)

  it "does not keep a caller that is cancelled from stopping" $ do
    notebook <- newLog
    inside <- newGate
    cancelling (catchAny (open inside >> hang) (\_ -> note notebook "went on")) (pass inside)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    notes notebook `shouldReturn` []

  it "can be cancelled in the handler" $ do
    inside <- newGate
    cancelling (catchAny failed (const (open inside >> hang))) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  inCallersState "its handler" (catchAny failed . const)
  inCallersState "its behaviour" (`catchAny` const (pure Unmasked))
  inCallersState "its behaviour" (fmap (fromRight Unmasked) . tryAny)

fallbacksOver :: Spec
fallbacksOver = do
  it "is act x ? act y ? act z" $
    property $ \(scripts :: NonEmptyList Script) ->
      sameAs
        (fallbackOver (getNonEmpty scripts) . play)
        (\notebook -> foldr1 (?) (map (play notebook) (getNonEmpty scripts)))

  it "fails with Failed on nothing" $
    (fallbackOver [] pure :: IO ()) `shouldThrow` (== Failed)

  it "throws the last failure when all fail" $
    (fallbackOver ["front", "back", "cellar"] failWith :: IO ())
      `shouldThrow` (== FailedBecause "cellar")

  it "goes over any container, and no further into an endless one than it must" $ do
    fallbackOver (Just 'a') pure `shouldReturn` 'a'
    fallbackOver ('a' NonEmpty.:| "bc") (\x -> if x == 'b' then pure x else failed) `shouldReturn` 'b'
    fallbackOver [1 :: Int ..] (\x -> if x == 7 then pure x else failed) `shouldReturn` 7

  it "lets a fault and a cancellation through at once" $
    for_ [toException (Fault "bug"), toException (Cancel "user")] $ \e -> do
      (end, tried) <- observing $ \notebook ->
        fallbackOver "abc" (\x -> note notebook x >> if x == 'b' then throwIO e else failed :: IO ())
      end `shouldBe` endingOf (Left e)
      tried `shouldBe` "ab"

  inCallersState "every input" (\act -> fallbackOver [False, True] (\x -> if x then act else failed))

attempts :: Spec
attempts = do
  it "runs the behaviour until it does not fail, and at most n times" $
    property $ \(n :: Int) (Scripts scripts) -> do
      let runs
            | all isFailing scripts = max 0 n
            | otherwise = max 0 (min n (length (takeWhile isFailing scripts) + 1))
      ioProperty $ do
        (_, done) <- observing (attempt n . inTurn scripts)
        pure (cover 20 (runs > 1) "more than one try" (length done === runs))

  it "throws the last failure as it is" $ do
    count <- newIORef (0 :: Int)
    attempt 3 (modifyIORef count (+ 1) >> readIORef count >>= throwIO . Failure . show)
      `shouldThrow` (== Failure "3")

  it "is the behaviour itself when tried once" $
    property $ \a -> sameAs (\notebook -> attempt 1 (play notebook a)) (`play` a)

  it "is act ? attempt n act when tried n + 1 times" $
    property $ \(Positive n) (Scripts scripts) ->
      sameAs
        (attempt (n + 1) . inTurn scripts)
        (\notebook -> let act = inTurn scripts notebook in act ? attempt n act)

  it "multiplies when nested" $
    forAll ((,) <$> choose (0, 12) <*> choose (0, 12)) $ \(m, n) ->
      ioProperty $ do
        (end, done) <- observing (\notebook -> attempt m (attempt n (note notebook () >> failed)))
        pure ((end, length done) === (FailedWith (show Failed) :: Ending (), m * n))

  it "fails at once with Failed, and runs nothing, when tried zero or fewer times" $
    for_ [0, -1, minBound] $ \n ->
      observing (\notebook -> attempt n (note notebook 'a'))
        `shouldReturn` (FailedWith (show Failed), "")

  it "lets a fault and a cancellation through at once" $
    for_ [toException (Fault "bug"), toException (Cancel "user")] $ \e ->
      observing (\notebook -> attempt 3 (note notebook 'a' >> throwIO e :: IO ()))
        `shouldReturn` (endingOf (Left e), "a")

  it "can be cancelled in every try, and makes no other then" $
    for_ [1 .. 3 :: Int] $ \try' -> do
      notebook <- newLog
      inside <- newGate
      let act = do
            note notebook ()
            tries <- length <$> notes notebook
            if tries == try' then open inside >> hang else failed
      cancelling (attempt 3 act) (pass inside)
        `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
      length <$> notes notebook `shouldReturn` try'

  it "composes with a behaviour that takes an argument" $ do
    let open' notebook door = note notebook door >> failed :: IO ()
    snd <$> observing (\notebook -> (attempt 2 . open' notebook) "front")
      `shouldReturn` ["front", "front"]

  inCallersState "every try" $ \act -> do
    count <- newIORef (0 :: Int)
    attempt 2 $ do
      modifyIORef count (+ 1)
      tries <- readIORef count
      if tries == 1 then failed else act

failingOns :: Spec
failingOns = do
  it "turns a chosen fault into a failure that holds it" $ do
    let bug (Fault why) = why == "no device"
    (failingOn bug (throwIO (Fault "no device")) ? pure ()) `shouldReturn` ()
    (failingOn bug (throwIO (Fault "no device")) `catch` \(BehaviorFailed e) -> pure (show e))
      `shouldReturn` show (Fault "no device")

  it "leaves a fault that is not chosen, by its value or by its type, what it is" $ do
    failingOn (\(Fault why) -> why == "no device") (throwIO (Fault "bug"))
      `shouldThrow` (== Fault "bug")
    failingOn isDoesNotExistError (throwIO (Fault "bug")) `shouldThrow` (== Fault "bug")

  it "turns an error of the system into a failure" $
    (failingOn isDoesNotExistError (readFile "/no/such/device") ? pure "no sensor")
      `shouldReturn` "no sensor"

  it "changes nothing of what was not thrown, or not chosen" $
    property $ \a ->
      sameAs (\notebook -> failingOn (\(_ :: Fault) -> False) (play notebook a)) (`play` a)

  it "turns just the faults into failures when all exceptions are chosen" $
    property $ \(Script name end) ->
      ioProperty $ do
        (actual, _) <- observing (\notebook -> failingOn everything (play notebook (Script name end)))
        pure $ case end of
          Faults why -> actual === FailedWith (show (Fault why))
          Succeeds n -> actual === Gave n
          Fails why -> actual === FailedWith (show (Failure why))
          Cancels why -> actual === CancelledBy (show (Cancel why))

  it "leaves a failure the failure that it is, caught by its own type" $
    (failingOn everything (throwIO (Failure "locked")) `catch` \(Failure why) -> pure why)
      `shouldReturn` "locked"

  it "never turns a cancellation into anything, whatever type is asked for" $ do
    failingOn (\(_ :: AsyncException) -> True) (throwIO ThreadKilled)
      `shouldThrow` (== ThreadKilled)
    failingOn (\(_ :: SomeAsyncException) -> True) (throwIO UserInterrupt)
      `shouldThrow` (== UserInterrupt)
    failingOn (\(_ :: Cancel) -> True) (throwIO (Cancel "user")) `shouldThrow` (== Cancel "user")

  it "does not keep a caller that is cancelled from stopping" $ do
    notebook <- newLog
    inside <- newGate
    cancelling (failingOn everything (open inside >> hang) ? note notebook "went on") (pass inside)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    notes notebook `shouldReturn` []

  it "does not keep a behaviour that is out of time from stopping" $ do
    (end, done) <- observing $ \notebook ->
      timeout 0.001 (failingOn everything hang ? note notebook "went on")
    (end, done) `shouldBe` (FailedWith (show (TimedOut 0.001)), [])
    (end', done') <- observing $ \notebook ->
      System.timeout 1000 (failingOn everything hang ? note notebook "went on")
    (end', done') `shouldBe` (Gave Nothing, [])

  inCallersState "its behaviour" (failingOn everything)
 where
  everything :: SomeException -> Bool
  everything _ = True

-- | The masking state in a behaviour that the operator runs is the caller's.
inCallersState :: String -> (IO MaskingState -> IO MaskingState) -> Spec
inCallersState which place =
  it ("keeps the caller's masking state in " ++ which ++ ", neither raised nor lowered") $ do
    place getMaskingState `shouldReturn` Unmasked
    mask_ (place getMaskingState) `shouldReturn` MaskedInterruptible
    uninterruptibleMask_ (place getMaskingState) `shouldReturn` MaskedUninterruptible

-- | Another name for '?'.
(|?|) :: IO a -> IO a -> IO a
(|?|) = fallback

infixr 3 |?|

-- | What a behaviour does when it is run for the first time, the second time...
newtype Scripts = Scripts [Script]
  deriving (Show)

instance Arbitrary Scripts where
  arbitrary = Scripts <$> ((++) <$> listOf failing <*> listOf1 arbitrary)
   where
    failing = (\(Script name _) -> Script name (Fails "yet")) <$> arbitrary
  shrink (Scripts scripts) = [Scripts fewer | fewer@(_ : _) <- shrink scripts]

isFailing :: Script -> Bool
isFailing (Script _ (Fails _)) = True
isFailing _ = False

-- | Plays the scripts in turn, the last again and again.
inTurn :: [Script] -> Log String -> IO Int
inTurn scripts notebook = do
  soFar <- length <$> notes notebook
  play notebook ((scripts ++ repeat (last scripts)) !! soFar)

-- | A composition of the sequential operators.
data Expression
  = -- | Plays one of the scripts, depending on how many were played before.
    Play [Script]
  | Expression :? Expression
  | Attempt Int Expression
  | Over [Expression]
  | Expression :> Expression
  deriving (Show)

instance Arbitrary Expression where
  arbitrary = sized tree
   where
    tree n
      | n <= 1 = Play <$> resize 3 (listOf1 arbitrary)
      | otherwise =
          oneof
            [ (:?) <$> half <*> half
            , Attempt <$> choose (-1, 3) <*> half
            , Over <$> (choose (0, 3) >>= \k -> vectorOf k (tree (n `div` 3)))
            , (:>) <$> half <*> half
            ]
     where
      half = tree (n `div` 2)
  shrink expression = case expression of
    Play scripts -> [Play fewer | fewer@(_ : _) <- shrink scripts]
    a :? b -> [a, b] ++ [a' :? b | a' <- shrink a] ++ [a :? b' | b' <- shrink b]
    Attempt n a -> [a] ++ [Attempt n' a | n' <- shrink n] ++ [Attempt n a' | a' <- shrink a]
    Over as -> as ++ (Over <$> shrink as)
    a :> b -> [a, b] ++ [a' :> b | a' <- shrink a] ++ [a :> b' | b' <- shrink b]

run :: IORef Int -> Log String -> Expression -> IO Int
run count notebook = go
 where
  go expression = case expression of
    Play scripts -> do
      n <- atomicModifyIORef' count (\n -> (n + 1, n))
      play notebook (scripts !! (n `mod` length scripts))
    a :? b -> go a ? go b
    Attempt n a -> attempt n (go a)
    Over as -> fallbackOver as go
    a :> b -> (void . go >=> const (go b)) a

-- | How it ends when so many scripts were played before, how many have been played
-- then, and what they noted.
predict :: Int -> Expression -> (Ending Int, Int, [String])
predict count expression = case expression of
  Play scripts ->
    let Script name end = scripts !! (count `mod` length scripts)
     in (inPure end, count + 1, [name])
  a :? b -> predict count a `orOnFailure` (`predict` b)
  Attempt n a
    | n <= 0 -> noWay
    | n == 1 -> predict count a
    | otherwise -> predict count a `orOnFailure` (`predict` Attempt (n - 1) a)
  Over [] -> noWay
  Over [a] -> predict count a
  Over (a : as) -> predict count a `orOnFailure` (`predict` Over as)
  a :> b -> case predict count a of
    (Gave _, count', done) -> done `before'` predict count' b
    other -> other
 where
  noWay = (FailedWith (show Failed), count, [])
  orOnFailure (FailedWith _, count', done) second = done `before'` second count'
  orOnFailure other _ = other
  before' done (end, count', done') = (end, count', done ++ done')
  inPure end = case end of
    Succeeds n -> Gave n
    Fails why -> FailedWith (show (Failure why))
    Faults why -> FaultedWith (show (Fault why))
    Cancels why -> CancelledBy (show (Cancel why))
