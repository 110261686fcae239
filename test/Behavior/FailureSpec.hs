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
import Behavior.STM (atomically)
import Behavior.Time (TimedOut (..), timeout)
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
    it "ends as the pure model predicts, with equal entries in the same order" $
      property $ \expression ->
        ioProperty $ do
          count <- newIORef 0
          actual <- observing (\entries -> run count entries expression)
          let (end, _, done) = predict 0 expression
          pure (cover 10 (length done > 3) "more than three effects" (actual === (end, done)))

hierarchy :: Spec
hierarchy = do
  it "lets a failure of a user's own type be caught by that type" $
    (throwIO (Failure "locked") `catch` \(Failure why) -> pure why) `shouldReturn` "locked"

  it "does not catch one failure type by another" $
    ending (throwIO (Failure "locked") `catch` \(_ :: Failed) -> pure ())
      `shouldReturn` FailedWith (show (Failure "locked"))

  it "lets every failure be caught by the root type, which shows the failure that it holds" $ do
    (throwIO (Failure "locked") `catch` \(e :: BehaviorFailed) -> pure (show e))
      `shouldReturn` show (Failure "locked")
    (failWith "stuck" `catch` \(e :: BehaviorFailed) -> pure (displayException e))
      `shouldReturn` "the behaviour failed: stuck"

  it "shows the path of a failure before it, in parentheses where other exceptions have them" $ do
    let lost = BehaviorFailed ["mission", "arm"] Failed
    show lost `shouldBe` "mission > arm: Failed"
    show (Just lost) `shouldBe` "Just (mission > arm: Failed)"
    displayException lost `shouldBe` "mission > arm: the behaviour failed"

  it "does not take a fault or a cancellation for a failure" $ do
    ending (throwIO (Fault "bug") `catch` \(_ :: BehaviorFailed) -> pure ())
      `shouldReturn` FaultedWith (show (Fault "bug"))
    ending (throwIO (Cancel "user") `catch` \(_ :: BehaviorFailed) -> pure ())
      `shouldReturn` CancelledBy (show (Cancel "user"))

  it "fails with Failed and with FailedBecause the reason" $ do
    (failed :: IO ()) `shouldThrow` (== Failed)
    (failWith "no grip" :: IO ()) `shouldThrow` (== FailedBecause "no grip")
    displayException Failed `shouldBe` "the behaviour failed"

  it "fails in a transaction too, which is then rolled back" $ do
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
        (\entries -> (play entries a ? play entries b) ? play entries c)
        (\entries -> play entries a ? (play entries b ? play entries c))

  it "has failed as its left identity" $
    property $ \a ->
      sameAs (\entries -> failed ? play entries a) (`play` a)

  it "has failed as its right identity, except that the failure becomes Failed" $
    property $ \a ->
      sameAs
        (\entries -> play entries a ? failed)
        (\entries -> play entries a `catch` \(_ :: BehaviorFailed) -> throwIO Failed)

  it "is absorbed by pure, by a fault and by a cancellation on the left" $
    property $ \(n :: Int) a -> do
      sameAs (\entries -> pure n ? play entries a) (\_ -> pure n)
        .&&. sameAs (\entries -> throwIO (Fault "bug") ? play entries a) (\_ -> throwIO (Fault "bug"))
        .&&. sameAs (\entries -> throwIO (Cancel "user") ? play entries a) (\_ -> throwIO (Cancel "user"))

  it "is the same under its two names, ? and fallback" $
    property $ \a b ->
      sameAs
        (\entries -> play entries a ? play entries b)
        (\entries -> fallback (play entries a) (play entries b))

  it "binds tighter than >>" $ do
    -- pure () ? (left >> right) would add no entry.
    observing (\entries -> pure () ? note entries 'l' >> note entries 'r')
      `shouldReturn` (Gave (), "r")

  it "nests to the right, so that it can be mixed with other operators that do" $
    (failed ? failed |?| pure 'c') `shouldReturn` 'c'

  it "catches a failure of every type" $
    for_ [throwIO (Failure "locked"), failed, failWith "stuck", throwIO (TimedOut 1)] $ \failure ->
      (failure ? pure "recovered") `shouldReturn` "recovered"

  it "does not run the second behaviour when the first faults, also with a bug in pure code" $ do
    observing (\entries -> throwIO (Fault "bug") ? note entries 'r')
      `shouldReturn` (FaultedWith (show (Fault "bug")), "")
    observing (\entries -> evaluate (1 `div` (0 :: Int)) ? (1 <$ note entries 'r'))
      `shouldReturn` (FaultedWith (show DivideByZero), "")

  it "does not run the second behaviour when the first is cancelled" $ do
    entries <- newLog
    inside <- newGate
    cancelling ((open inside >> hang) ? note entries 'r') (pass inside)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    notes entries `shouldReturn` ""

  it "can be cancelled in the second behaviour" $ do
    inside <- newGate
    cancelling (failed ? (open inside >> hang)) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  it "runs the second behaviour after the handlers of the first have ended" $ do
    let first entries = (failed `onException` note entries "handler") `finally` note entries "cleanup"
    observing (\entries -> first entries ? note entries "second")
      `shouldReturn` (Gave (), ["handler", "cleanup", "second"])

  it "treats the failure of a cleanup as a failure, and its fault as a fault" $ do
    (throwIO (Fault "bug") `finally` failWith "cleanup" ? pure ()) `shouldReturn` ()
    (failed `finally` throwIO (Fault "cleanup") ? pure ()) `shouldThrow` (== Fault "cleanup")

  it "throws what the second behaviour throws" $
    (failWith "first" ? failWith "second" :: IO ()) `shouldThrow` (== FailedBecause "second")

  inCallersState "its second behaviour" (failed ?)
  inCallersState "its first behaviour" (? pure Unmasked)

fallbacksWith :: Spec
fallbacksWith = do
  it "is fallback when the second behaviour does not use the failure" $
    property $ \a b ->
      sameAs
        (\entries -> fallbackWith (play entries a) (const (play entries b)))
        (\entries -> play entries a ? play entries b)

  it "passes the failure to the second behaviour" $ do
    fallbackWith (throwIO (Failure "locked")) (pure . show) `shouldReturn` show (Failure "locked")
    fallbackWith (throwIO (Failure "locked")) throwIO `shouldThrow` (== Failure "locked")

  it "runs the second behaviour after the handlers of the first have ended" $ do
    let first entries = (failed `onException` note entries "handler") `finally` note entries "cleanup"
    observing (\entries -> fallbackWith (first entries) (const (note entries "second")))
      `shouldReturn` (Gave (), ["handler", "cleanup", "second"])

  it "can be cancelled in the second behaviour" $ do
    inside <- newGate
    cancelling (fallbackWith failed (const (open inside >> hang))) (pass inside)
      `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())

  inCallersState "its second behaviour" (fallbackWith failed . const)
  inCallersState "its first behaviour" (`fallbackWith` const (pure Unmasked))

catchingAny :: Spec
catchingAny = do
  it "gives the result, the failure or the fault, and rethrows a cancellation" $
    property $ \(Script name end) ->
      ioProperty $ do
        (actual, _) <- observing (\entries -> either (Left . show) Right <$> tryAny (play entries (Script name end)))
        pure $ case end of
          Succeeds n -> actual === Gave (Right n)
          Fails why -> actual === Gave (Left (show (Failure why)))
          Faults why -> actual === Gave (Left (show (Fault why)))
          Cancels why -> actual === CancelledBy (show (Cancel why))

  it "decides by type: a synchronous exception thrown from outside counts as the behaviour's own" $ do
    inside <- newGate
    withThread (either show show <$> tryAny (open inside >> hang :: IO ())) $ \caller -> do
      pass inside
      throwTo (asyncThreadId caller) (Fault "from outside")
      awaitEnd caller `shouldReturn` Gave (show (Fault "from outside"))

  it "is tryAny, then the handler" $
    property $ \a b ->
      sameAs
        (\entries -> catchAny (play entries a) (const (play entries b)))
        (\entries -> tryAny (play entries a) >>= either (const (play entries b)) pure)

  it "does not prevent a cancelled caller from stopping" $ do
    entries <- newLog
    inside <- newGate
    cancelling (catchAny (open inside >> hang) (\_ -> note entries "went on")) (pass inside)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    notes entries `shouldReturn` []

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
        (\entries -> foldr1 (?) (map (play entries) (getNonEmpty scripts)))

  it "fails with Failed on nothing" $
    (fallbackOver [] pure :: IO ()) `shouldThrow` (== Failed)

  it "throws the last failure when all fail" $
    (fallbackOver ["front", "back", "cellar"] failWith :: IO ())
      `shouldThrow` (== FailedBecause "cellar")

  it "takes any container, and evaluates an endless one only as far as needed" $ do
    fallbackOver (Just 'a') pure `shouldReturn` 'a'
    fallbackOver ('a' NonEmpty.:| "bc") (\x -> if x == 'b' then pure x else failed) `shouldReturn` 'b'
    fallbackOver [1 :: Int ..] (\x -> if x == 7 then pure x else failed) `shouldReturn` 7

  it "rethrows a fault and a cancellation at once" $
    for_ [toException (Fault "bug"), toException (Cancel "user")] $ \e -> do
      (end, tried) <- observing $ \entries ->
        fallbackOver "abc" (\x -> note entries x >> if x == 'b' then throwIO e else failed :: IO ())
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

  it "throws the last failure unchanged" $ do
    count <- newIORef (0 :: Int)
    attempt 3 (modifyIORef count (+ 1) >> readIORef count >>= throwIO . Failure . show)
      `shouldThrow` (== Failure "3")

  it "is the behaviour itself when tried once" $
    property $ \a -> sameAs (\entries -> attempt 1 (play entries a)) (`play` a)

  it "is act ? attempt n act when tried n + 1 times" $
    property $ \(Positive n) (Scripts scripts) ->
      sameAs
        (attempt (n + 1) . inTurn scripts)
        (\entries -> let act = inTurn scripts entries in act ? attempt n act)

  it "multiplies the numbers of tries when nested" $
    forAll ((,) <$> choose (0, 12) <*> choose (0, 12)) $ \(m, n) ->
      ioProperty $ do
        (end, done) <- observing (\entries -> attempt m (attempt n (note entries () >> failed)))
        pure ((end, length done) === (FailedWith (show Failed) :: Ending (), m * n))

  it "fails at once with Failed, and runs nothing, when tried zero or fewer times" $
    for_ [0, -1, minBound] $ \n ->
      observing (\entries -> attempt n (note entries 'a'))
        `shouldReturn` (FailedWith (show Failed), "")

  it "rethrows a fault and a cancellation at once" $
    for_ [toException (Fault "bug"), toException (Cancel "user")] $ \e ->
      observing (\entries -> attempt 3 (note entries 'a' >> throwIO e :: IO ()))
        `shouldReturn` (endingOf (Left e), "a")

  it "can be cancelled in every try, and then makes no further one" $
    for_ [1 .. 3 :: Int] $ \nth -> do
      entries <- newLog
      inside <- newGate
      let act = do
            note entries ()
            tries <- length <$> notes entries
            if tries == nth then open inside >> hang else failed
      cancelling (attempt 3 act) (pass inside)
        `shouldReturn` (CancelledBy (show (Cancel "the caller")) :: Ending ())
      length <$> notes entries `shouldReturn` nth

  it "composes with a behaviour that takes an argument" $ do
    let openNoting entries door = note entries door >> failed :: IO ()
    snd <$> observing (\entries -> (attempt 2 . openNoting entries) "front")
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
    (failingOn bug (throwIO (Fault "no device")) `catch` \(BehaviorFailed _ e) -> pure (show e))
      `shouldReturn` show (Fault "no device")

  it "leaves a fault unchanged that is not chosen, by its value or by its type" $ do
    failingOn (\(Fault why) -> why == "no device") (throwIO (Fault "bug"))
      `shouldThrow` (== Fault "bug")
    failingOn isDoesNotExistError (throwIO (Fault "bug")) `shouldThrow` (== Fault "bug")

  it "turns a system error into a failure" $
    (failingOn isDoesNotExistError (readFile "/no/such/device") ? pure "no sensor")
      `shouldReturn` "no sensor"

  it "changes nothing when no exception is thrown, or none that is chosen" $
    property $ \a ->
      sameAs (\entries -> failingOn (\(_ :: Fault) -> False) (play entries a)) (`play` a)

  it "turns only the faults into failures when all exceptions are chosen" $
    property $ \(Script name end) ->
      ioProperty $ do
        (actual, _) <- observing (\entries -> failingOn everything (play entries (Script name end)))
        pure $ case end of
          Faults why -> actual === FailedWith (show (Fault why))
          Succeeds n -> actual === Gave n
          Fails why -> actual === FailedWith (show (Failure why))
          Cancels why -> actual === CancelledBy (show (Cancel why))

  it "leaves a failure unchanged, so that it is caught by its own type" $
    (failingOn everything (throwIO (Failure "locked")) `catch` \(Failure why) -> pure why)
      `shouldReturn` "locked"

  it "never changes a cancellation, whatever type is chosen" $ do
    failingOn (\(_ :: AsyncException) -> True) (throwIO ThreadKilled)
      `shouldThrow` (== ThreadKilled)
    failingOn (\(_ :: SomeAsyncException) -> True) (throwIO UserInterrupt)
      `shouldThrow` (== UserInterrupt)
    failingOn (\(_ :: Cancel) -> True) (throwIO (Cancel "user")) `shouldThrow` (== Cancel "user")

  it "does not prevent a cancelled caller from stopping" $ do
    entries <- newLog
    inside <- newGate
    cancelling (failingOn everything (open inside >> hang) ? note entries "went on") (pass inside)
      `shouldReturn` CancelledBy (show (Cancel "the caller"))
    notes entries `shouldReturn` []

  it "throws what it has caught, although a cancellation comes just then" $ do
    entered <- newGate
    mayGo <- newGate
    (_, done) <- observing $ \entries -> do
      let act = uninterruptibleMask_ (open entered >> pass mayGo >> throwIO (Cancel "first")) :: IO ()
          caught = mask $ \restore -> ending (restore (failingOn everything act)) >>= note entries
      withThread caught $ \caller -> do
        pass entered
        throwing (asyncThreadId caller) (Cancel "second")
        open mayGo
        awaitEnd caller
    done `shouldBe` [CancelledBy (show (Cancel "first"))]

  it "does not prevent a behaviour that has timed out from stopping" $ do
    (end, done) <- observing $ \entries ->
      timeout 0.001 (failingOn everything hang ? note entries "went on")
    (end, done) `shouldBe` (FailedWith (show (TimedOut 0.001)), [])
    (endOutside, doneOutside) <- observing $ \entries ->
      System.timeout 1000 (failingOn everything hang ? note entries "went on")
    (endOutside, doneOutside) `shouldBe` (Gave Nothing, [])

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

-- | Plays the scripts in turn, then the last one repeatedly.
inTurn :: [Script] -> Log String -> IO Int
inTurn scripts entries = do
  played <- length <$> notes entries
  play entries ((scripts ++ repeat (last scripts)) !! played)

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
run count entries = go
 where
  go expression = case expression of
    Play scripts -> do
      n <- atomicModifyIORef' count (\n -> (n + 1, n))
      play entries (scripts !! (n `mod` length scripts))
    a :? b -> go a ? go b
    Attempt n a -> attempt n (go a)
    Over as -> fallbackOver as go
    a :> b -> (void . go >=> const (go b)) a

-- | How the expression ends when the given number of scripts were played before it; how many
-- have been played after it; and the entries that they added.
predict :: Int -> Expression -> (Ending Int, Int, [String])
predict count expression = case expression of
  Play scripts ->
    let Script name end = scripts !! (count `mod` length scripts)
     in (inPure end, count + 1, [name])
  a :? b -> predict count a `orOnFailure` (`predict` b)
  Attempt n a
    | n <= 0 -> noTry
    | n == 1 -> predict count a
    | otherwise -> predict count a `orOnFailure` (`predict` Attempt (n - 1) a)
  Over [] -> noTry
  Over [a] -> predict count a
  Over (a : as) -> predict count a `orOnFailure` (`predict` Over as)
  a :> b -> case predict count a of
    (Gave _, count', done) -> done `precedes` predict count' b
    other -> other
 where
  noTry = (FailedWith (show Failed), count, [])
  orOnFailure (FailedWith _, count', done) second = done `precedes` second count'
  orOnFailure other _ = other
  precedes done (end, count', done') = (end, count', done ++ done')
  inPure end = case end of
    Succeeds n -> Gave n
    Fails why -> FailedWith (show (Failure why))
    Faults why -> FaultedWith (show (Fault why))
    Cancels why -> CancelledBy (show (Cancel why))
