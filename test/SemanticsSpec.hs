{-# LANGUAGE LambdaCase #-}

-- |
-- Compares the library with its specification: "Semantics.Step" defines what is allowed, and
-- what is observed in a simulation must be allowed.
module SemanticsSpec
  ( spec
  , onlyWhatIsAllowed
  , onlyWhatIsAllowedOf
  , allThatIsAllowed
  , allThatIsAllowedOf
  , slipping
  ) where

import Data.Bifunctor (first)
import Data.Foldable (for_)
import Data.List (intercalate, isInfixOf)
import qualified Data.Set as Set
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior.Sim (Schedule (..))
import Semantics.Generate
import Semantics.Path
import Semantics.Program
import Semantics.Run
import Support (sampleSize, sampling)

spec :: Spec
spec = do
  describe "The relation" relation
  describe "The library" library

library :: Spec
library = do
  sampling 3000 $
    prop "does only what the relation allows, for random programs" onlyWhatIsAllowed
  schedules <- runIO (sampleSize 1000)
  it "does only what the relation allows, for rare situations under many schedules" $
    for_ rareWorlds $ \world -> for_ [1 .. schedules] $ \seed -> judge world seed `shouldReturn` Fine
  it "can do all that the relation allows, for rare situations" $
    for_ rareWorlds $ \world -> compared world `shouldReturn` Fine
  sampling 60 $
    prop "can do all that the relation allows, for small random programs" allThatIsAllowed
  sampling 500 $
    prop "does only what the relation allows when timers are late" $
      onlyWhatIsAllowedOf 10 (slipping (worlds (const True) 3))
  sampling 30 $
    prop "can do all that the relation allows when timers are late" $
      allThatIsAllowedOf (slipping smallWorlds)

-- | A random program, under a random schedule.
onlyWhatIsAllowed :: Property
onlyWhatIsAllowed = onlyWhatIsAllowedOf 60 (worlds (const True) 4)

-- | For these worlds, of which at least the given percentage nest four deep.
onlyWhatIsAllowedOf :: Double -> Gen World -> Property
onlyWhatIsAllowedOf deep some =
  forAllBlind ((,) <$> some <*> arbitrary) $ \(world, seed) -> ioProperty $ do
    found <- judge world seed
    message <- case found of
      Wrong _ -> smallest world seed
      _ -> pure ""
    pure
      . cover deep (depth (program world) >= 4) "nested four deep"
      . cover 99 (found /= Undecided) "decided"
      . counterexample message
      $ found `elem` [Fine, Undecided]

-- | A small random program, under all schedules.
allThatIsAllowed :: Property
allThatIsAllowed = allThatIsAllowedOf smallWorlds

allThatIsAllowedOf :: Gen World -> Property
allThatIsAllowedOf some =
  forAllShrink some shrinkWorld $ \world -> ioProperty $ do
    found <- compared world
    pure
      . cover 90 (found /= Undecided) "decided"
      . counterexample (show found)
      $ found `elem` [Fine, Undecided]

-- | Worlds in which timers are late. (Without polled sensors, whose slots are not late: each
-- counts from the slot before, whenever the reading there began.)
slipping :: Gen World -> Gen World
slipping some = do
  world <- some `suchThat` (not . isInfixOf "Polled" . show . program)
  (\n -> world {slippage = n}) <$> choose (1, 3)

-- | Worlds for situations that random worlds rarely have.
rareWorlds :: [World]
rareWorlds =
  [ -- The timeout expires as its action ends, after which the next one fails at once.
    alone (Timeout 1 (uninterruptible 1 "a" `Then` FirstOf []))
  , -- The timeout expires while the operator inside stops its branches after its verdict.
    alone (Timeout 2 (FirstOf [act 1 "a" Fails StopsAtOnce, act 9 "b" Fails (StopsAfter 2)]))
  , -- The task completes despite the stop request, while the condition becomes false again.
    (alone (Monitor (Watched "p") (act 1 "r" Fails StopsAtOnce) (act 9 "t" Fails (EndsAfter 1 (Succeeds 7)))))
      { changes = [Change 1 "p" (At 1), Change 2 "p" (At 0)]
      }
  , -- Child and body fault at the same time.
    alone (Scoped (Fork (act 1 "a" Faults StopsAtOnce) `Then` act 1 "b" Faults StopsAtOnce))
  , -- The handler of a message completes despite the stop request of a rule before it; another message has come.
    ( alone
        ( Deliver
            `Then` Both
              (act 1 "d" (Succeeds 0) StopsAtOnce `Then` Deliver)
              ( MessageRule
                  (Watched "p")
                  (act 9 "f" Fails StopsAtOnce)
                  (act 2 "h" (Succeeds 0) (EndsAfter 1 (Succeeds 0)))
                  (Watched "q")
                  (act 1 "t" (Succeeds 7) StopsAtOnce)
              )
        )
    )
      { changes = [Change 1 "p" (At 1), Change 3 "p" (At 0), Change 4 "q" (At 1)]
      }
  , -- Two children are forked at the same time, and fail at the same time.
    alone . Scoped $
      Both (Fork (act 1 "a" Fails StopsAtOnce)) (Fork (act 1 "b" Fails StopsAtOnce)) `Then` WaitUntil (Watched "p")
  , -- The shared sensor has failed, and the body reads it before it receives its stop request.
    ( alone
        ( WithShared
            (Polled 1 (act 9 "s" Fails (EndsAfter 0 Fails)))
            (uninterruptible 2 "a" `Then` (WaitUntil Shared `Else` act 1 "b" Fails StopsAtOnce))
        )
    )
      { cancelAt = 1
      }
  , -- The shared sensor faults before the body does; the body's fault still comes first.
    (alone (WithShared (Polled 1 (act 9 "s" Fails (EndsAfter 0 Faults))) (act 9 "b" Fails (EndsAfter 1 Faults))))
      { cancelAt = 1
      , caller = PlainThread Asynchronous 9
      }
  , -- The hysteresis was high while its value did not matter to the operator.
    ( alone
        ( RSelect
            (And (Hysteresis False 0 2 (Watched "p")) (Watched "q"))
            (act 1 "l" Fails StopsAtOnce)
            (act 9 "r" Fails StopsAtOnce)
        )
    )
      { changes = [Change 1 "p" (At 2), Change 2 "p" (At 1), Change 3 "q" (At 1)]
      }
  , -- A throttled change is reverted just when it may be taken.
    (alone (WhileHolding (Throttle 1 (Watched "p")) (act 4 "a" Fails StopsAtOnce)))
      { conditions = [("p", At 1)]
      , changes = [Change 1 "p" (At 0), Change 1 "p" (At 1)]
      }
  , -- A change has lasted long enough just when it is reverted.
    (alone (WhileHolding (Debounce 1 (Watched "p")) (act 4 "a" Fails StopsAtOnce)))
      { conditions = [("p", At 1)]
      , changes = [Change 1 "p" (At 0), Change 2 "p" (At 1)]
      }
  , -- A reading ends just when it becomes overdue.
    alone (WaitUntil (StaleAfter 2 (Polled 3 (act 2 "s" (Succeeds 1) StopsAtOnce))))
  , -- Branch and sensor fault together; the sensor's fault comes first, whichever thread is
    -- older.
    alone $
      RSelect
        (Polled 1 (act 1 "s" (Succeeds 1) (EndsAfter 0 Faults)))
        (act 1 "l" Faults StopsAtOnce)
        (act 1 "r" Fails StopsAtOnce)
  , -- The child's result is published just when the timeout expires.
    alone (Timeout 2 (Scoped (Await (act 2 "a" (Succeeds 1) StopsAtOnce) (act 1 "b" (Succeeds 2) StopsAtOnce))))
  , -- The child fails, and the body that awaits it continues for a moment.
    alone . Scoped $
      Await
        (act 1 "a" Fails StopsAtOnce)
        (act 1 "b" Fails StopsAtOnce `Else` act 0 "c" Fails StopsAtOnce)
        `Else` act 1 "d" Fails StopsAtOnce
  , -- The child's stop is requested by its handle just when it ends.
    alone . Scoped $
      StopChild (act 1 "a" (Succeeds 1) StopsAtOnce) (act 1 "b" (Succeeds 2) StopsAtOnce)
        `Else` act 1 "c" (Succeeds 3) StopsAtOnce
  , -- The child fails in its cleanup.
    alone . Scoped $
      StopChild (act 9 "a" Fails (EndsAfter 1 Fails)) (act 1 "b" (Succeeds 2) StopsAtOnce)
        `Else` act 1 "c" (Succeeds 3) StopsAtOnce
  , -- The child forks just when the body returns.
    alone . Scoped $
      Fork
        (uninterruptible 1 "a" `Then` (Fork (act 1 "b" Fails StopsAtOnce) `Else` act 1 "c" Fails StopsAtOnce))
        `Then` act 1 "d" (Succeeds 1) StopsAtOnce
  , -- The scope receives a stop request just after it has started a child.
    ( alone
        ( Scoped
            ( act 1 "a" (Succeeds 1) StopsAtOnce
                `Then` (Fork (act 1 "b" Fails StopsAtOnce) `Else` act 1 "c" Fails StopsAtOnce)
            )
        )
    )
      { cancelAt = 1
      , caller = PlainThread Asynchronous 9
      }
  , -- The program completes despite a stop request, and receives another.
    (alone (Parallel (uninterruptible 3 "a") (act 9 "b" Fails (EndsAfter 1 Faults)) `Else` act 9 "c" Fails StopsAtOnce))
      { cancelAt = 1
      , caller = PlainThread Asynchronous 1
      }
  , ( alone
        ( uninterruptible 2 "a"
            `Then` (act 9 "b" Fails (EndsAfter 0 (Succeeds 1)) `Then` act 1 "c" Fails StopsAtOnce)
        )
    )
      { cancelAt = 1
      , caller = PlainThread Asynchronous 0
      }
  ]
 where
  alone p = World [("p", At 0), ("q", At 0)] [] 9 p Operator 0
  uninterruptible n name = Do name [Script n (Succeeds 0) Uninterruptible StopsAtOnce]
  act n name how response = Do name [Script n how Unmasked response]

data Judgement
  = Fine
  | Wrong String
  | -- | There were more states, or more schedules, than the limit.
    Undecided
  deriving (Eq, Show)

-- | Simulates the world under the schedule of the seed, and judges what was observed.
judge :: World -> Int -> IO Judgement
judge world seed =
  observed (Seeded seed) world >>= \case
    Left why -> pure (Wrong why)
    Right seen -> pure $ case explains 4000 visible world seen of
      Possible -> Fine
      OutOfFuel -> Undecided
      Impossible at instead ->
        Wrong (unlines [described seen, "impossible from here on:", rows at, "possible are:", rows instead])
      ImpossibleEnd instead ->
        Wrong (unlines (described seen : "the end is impossible; possible are:" : map show instead))
 where
  described seen = "under schedule " ++ show seed ++ "\n" ++ rows (timeline seen) ++ "\n" ++ show (end seen)
  rows transitions = intercalate "\n" ["  " ++ show t ++ "  " ++ show e | (t, e) <- transitions]

-- | The transitions that are compared. 'everything' distinguishes ties, too; it requires that
-- the simulator records the end of a thread at the moment when it is published.
visible :: Transition -> Bool
visible = everything

-- | Shrinks a world that the library gets wrong. Each smaller world is tried under many
-- schedules, since the schedule of the larger one does not fit it.
smallest :: World -> Int -> IO String
smallest world seed = wrongly world >>= maybe (pure "") (go world)
 where
  go small why =
    firstJust [fmap ((,) w) <$> wrongly w | w <- shrinkWorld small]
      >>= maybe (pure (show small ++ "\n" ++ why)) (uncurry go)
  wrongly w =
    firstJust
      [ (\case Wrong why -> Just why; _ -> Nothing) <$> judge w s
      | s <- seed : [1 .. 40]
      ]
  firstJust = \case
    [] -> pure Nothing
    act : acts -> act >>= maybe (firstJust acts) (pure . Just)

-- | Compares all that is observed in simulations of the world with all that the relation
-- allows. The search ends when all that is allowed was observed, or all schedules were tried.
compared :: World -> IO Judgement
compared world = case paths 500 whatIsDone world of
  Nothing -> pure Undecided
  Just these -> go (Set.map Right these) Set.empty searches
 where
  searches = [exhaustive k 2000 | k <- [0 .. 3]] ++ [sampled, exhaustive maxBound 20000]
  exhaustive k most = first (Set.map comparable) <$> allObserved k most world
  comparable = fmap (\s -> s {timeline = filter (whatIsDone . snd) (timeline s), end = asDeadlock (end s)})
  -- A program that has finite paths and does not end is in a deadlock.
  asDeadlock = \case
    Unknown _ -> Deadlock
    other -> other
  sampled =
    (\found -> (Set.fromList found, False))
      <$> traverse (fmap comparable . (`observed` world) . Seeded) [1 .. 2000]
  go _ _ [] = pure Undecided
  go allowed seen (search : others) = do
    (found, complete) <- search
    let sofar = Set.union seen found
        surplus = sofar `Set.difference` allowed
        missing = allowed `Set.difference` sofar
    case (Set.toList surplus, Set.toList missing) of
      (wrong : _, _) -> pure (Wrong ("not allowed: " ++ show wrong))
      ([], []) -> pure Fine
      ([], wrong : _)
        | null others && complete -> pure (Wrong ("allowed, but never observed: " ++ show wrong))
        | otherwise -> go allowed sofar others

-- | The outcomes of some programs, worked out by hand.
relation :: Spec
relation = do
  describe "Sequences and fallbacks" $ do
    it "run the second program when the first fails, and not when it faults" $ do
      (act "a" 1 Fails `Else` act "b" 2 (Succeeds 7)) `endsIn` [Gave 3 (Succeeded (Number 7))]
      (act "a" 1 Faults `Else` act "b" 2 (Succeeds 7)) `endsIn` [Gave 1 (FaultedWith "a")]
    it "throw the last failure of several attempts" $ do
      Attempt 2 (Do "a" [script 1 Fails, script 2 Fails, script 3 (Succeeds 7)]) `endsIn` [Gave 3 (FailedWith "a")]
      Attempt 3 (Do "a" [script 1 Fails, script 2 Fails, script 3 (Succeeds 7)])
        `endsIn` [Gave 6 (Succeeded (Number 7))]
      Attempt 0 (act "a" 1 (Succeeds 7)) `endsIn` [Gave 0 (FailedWith noAlternative)]
      FallbackOver [] `endsIn` [Gave 0 (FailedWith noAlternative)]

    it "retry after each delay, and throw the last failure" $ do
      Retrying [2, 0] (Do "a" [script 1 Fails, script 1 Fails, script 1 (Succeeds 7)])
        `endsIn` [Gave 5 (Succeeded (Number 7))]
      Retrying [2] (act "a" 1 Fails) `endsIn` [Gave 4 (FailedWith "a")]
      Retrying [2] (act "a" 1 Faults) `endsIn` [Gave 1 (FaultedWith "a")]
    it "begin every run in a slot of its own, and skip the slots that a slow one has missed" $
      Every 2 (Do "a" [script 1 (Succeeds 0), script 3 (Succeeds 0), script 1 Fails])
        `endsIn` [Gave 7 (FailedWith "a")]

  describe "Concurrent operators" $ do
    it "end with the first branch to finish" $
      Parallel (act "a" 1 (Succeeds 0)) (act "b" 2 Faults) `endsIn` [Gave 1 (Succeeded Unit)]
    it "may end with either branch when both finish at the same time" $
      Parallel (act "a" 1 (Succeeds 0)) (act "b" 1 Fails) `endsIn` [Gave 1 (Succeeded Unit), Gave 1 (FailedWith "b")]
    it "throw the leftmost fault, not the first" $
      FirstOf [act "a" 1 Fails, stoppedBy (EndsAfter 3 Faults) "b", stoppedBy (EndsAfter 1 Faults) "c"]
        `endsIn` [Gave 4 (FaultedWith (cleanupOf "b"))]
    it "wait for all branches, or for the first that fails" $ do
      AllOf [act "a" 2 (Succeeds 1), act "b" 1 (Succeeds 2)]
        `endsIn` [Gave 2 (Succeeded (Several [Number 1, Number 2]))]
      AllOf [act "a" 2 (Succeeds 1), act "b" 1 Fails] `endsIn` [Gave 1 (FailedWith "b")]
      Both (act "a" 2 Fails) (stoppedBy (StopsAfter 3) "b") `endsIn` [Gave 5 (FailedWith "a")]
    it "decide as soon as enough have succeeded, or too few are left, and then run what is chosen" $ do
      let of3 m =
            Decide
              (AtLeast m)
              [act "a" 3 (Succeeds 1), act "b" 1 Fails, stoppedBy (StopsAfter 2) "c"]
              (act "d" 1 (Succeeds 7))
      of3 0 `endsIn` [Gave 1 (Succeeded (Number 7))]
      of3 1 `endsIn` [Gave 6 (Succeeded (Number 7))]
      of3 3 `endsIn` [Gave 3 (FailedWith tooFew)]
      Decide NoChoice [act "a" 3 (Succeeds 1), act "b" 1 Fails] (act "d" 1 (Succeeds 7))
        `endsIn` [Gave 3 (FaultedWith noneChosen)]
    it "stop the children when the body ends, and body and children when a child fails" $ do
      Scoped (Fork (stoppedBy (StopsAfter 2) "a") `Then` act "b" 1 (Succeeds 7))
        `endsIn` [Gave 3 (Succeeded (Number 7))]
      Scoped (Fork (act "a" 1 Fails) `Then` stoppedBy (StopsAfter 2) "b") `endsIn` [Gave 3 (FailedWith "a")]
    it "wait for a child's result, and throw its failure" $ do
      Scoped (Await (act "a" 3 (Succeeds 7)) (act "b" 1 (Succeeds 1))) `endsIn` [Gave 3 (Succeeded (Number 7))]
      Scoped (Await (act "a" 3 Fails) (act "b" 1 (Succeeds 1)) `Else` act "c" 1 (Succeeds 1))
        `endsIn` [Gave 3 (FailedWith "a")]

    it "stop a child by its handle, which is a failure where the child is awaited, and not of the scope" $ do
      Scoped (StopChild (stoppedBy (StopsAfter 2) "a") (act "b" 1 (Succeeds 1)) `Else` act "c" 1 (Succeeds 7))
        `endsIn` [Gave 4 (Succeeded (Number 7))]
      Scoped (StopChild (stoppedBy (EndsAfter 2 (Succeeds 7)) "a") (act "b" 1 (Succeeds 1)))
        `endsIn` [Gave 3 (Succeeded (Number 7))]
      Scoped (StopChild (stoppedBy (EndsAfter 2 Faults) "a") (act "b" 1 (Succeeds 1)) `Else` act "c" 1 (Succeeds 7))
        `endsIn` [Gave 3 (FaultedWith (cleanupOf "a"))]
    it "let a fork fail while the scope stops its branches" $
      Scoped
        ( Fork (Do "a" [(script 2 (Succeeds 0)) {masking = Uninterruptible}] `Then` Fork (act "b" 1 Faults))
            `Then` act "c" 1 (Succeeds 7)
        )
        `endsIn` [Gave 2 (Succeeded (Number 7))]

  describe "Stopping" $ do
    it "keeps the result of a branch that completes despite its stop request" $
      Timeout 1 (stoppedBy (EndsAfter 2 (Succeeds 7)) "a") `endsIn` [Gave 3 (Succeeded (Number 7))]
    it "throws the fault of a cleanup" $
      Timeout 1 (stoppedBy (EndsAfter 2 Faults) "a") `endsIn` [Gave 3 (FaultedWith (cleanupOf "a"))]
    it "throws the fault of a cleanup through several operators" $
      Timeout 1 (Parallel (stoppedBy StopsAtOnce "a") (Timeout 5 (stoppedBy (EndsAfter 2 Faults) "b")))
        `endsIn` [Gave 3 (FaultedWith (cleanupOf "b"))]
    it "waits for a branch that is masked uninterruptibly" $
      Timeout 1 (Do "a" [(script 4 (Succeeds 7)) {masking = Uninterruptible}] `Then` act "b" 1 (Succeeds 0))
        `endsIn` [Gave 4 (FailedWith (timedOut 1))]
    it "is given up after a time by abandoning, whose behaviour goes on" $ do
      let slow = Do "a" [(script 9 (Succeeds 7)) {onStop = EndsAfter 3 (Succeeds 8)}]
          left n = Timeout 1 (Abandoning n slow) `Else` act "b" 5 (Succeeds 7)
      with [] (left 2)
        `hasTimeline` [ (0, Action "a" Begins)
                      , (1, Action "a" ReceivesStop)
                      , (3, Action "b" Begins)
                      , (4, Action "a" (Ends (Succeeds 8)))
                      , (8, Action "b" (Ends (Succeeds 7)))
                      ]
      with [] (left 4)
        `hasTimeline` [ (0, Action "a" Begins)
                      , (1, Action "a" ReceivesStop)
                      , (4, Action "a" (Ends (Succeeds 8)))
                      , (4, Action "b" Begins)
                      , (9, Action "b" (Ends (Succeeds 7)))
                      ]
    it "loses the fault of a behaviour that was abandoned, and no other" $ do
      let faulty = stoppedBy (EndsAfter 2 Faults) "a"
      Timeout 1 (Abandoning 1 faulty) `endsIn` [Gave 2 (FailedWith (timedOut 1))]
      Timeout 1 (Abandoning 3 faulty) `endsIn` [Gave 3 (FaultedWith (cleanupOf "a"))]
    it "interrupts no cleanupWithin, whose own limit ends it" $ do
      Timeout 1 (CleanupWithin 3 (stoppedBy StopsAtOnce "a") `Then` act "b" 9 (Succeeds 1))
        `endsIn` [Gave 3 (FailedWith (timedOut 1))]
      CleanupWithin 3 (act "a" 2 Fails) `endsIn` [Gave 2 (FailedWith "a")]

    it "throws the fault of a cleanup together with another thread's cancellation" $ do
      cancelledTwice (Parallel (stoppedBy StopsAtOnce "a") (stoppedBy (EndsAfter 3 Faults) "b"))
        `endsWith` [Gave 5 (Stopped (Just (cleanupOf "b")))]
    it "can be requested twice by another thread; the second request is received after a cleanup" $ do
      cancelledTwice (stoppedBy (EndsAfter 0 (Succeeds 7)) "a" `Then` stoppedBy StopsAtOnce "b")
        `endsWith` [Gave 3 (Stopped Nothing)]
      cancelledTwice (stoppedBy (EndsAfter 2 (Succeeds 7)) "a")
        `endsWith` [Gave 4 (Stopped Nothing)]
    it "that another thread requests twice interrupts the caller's cleanup, but not a branch's" $ do
      cancelledTwice (stoppedBy (CleansUpInterruptibly 5) "a") `endsWith` [Gave 3 (Stopped Nothing)]
      cancelledTwice (Timeout 50 (stoppedBy (CleansUpInterruptibly 5) "a"))
        `endsWith` [Gave 7 (Stopped Nothing)]

  describe "Conditions that change" $ do
    it "start a monitor's recovery even if they become false before it" $
      with
        [Change 2 "p" (At 1), Change 3 "p" (At 0)]
        (Monitor (Watched "p") (act "r" 2 (Succeeds 0)) (Do "t" [(script 10 (Succeeds 7)) {onStop = StopsAfter 2}]))
        `hasTimeline` [ (0, Action "t" Begins)
               , (2, Becomes "p" (At 1))
               , (2, Action "t" ReceivesStop)
               , (3, Becomes "p" (At 0))
               , (4, Action "t" Stops)
               , (4, Action "r" Begins)
               , (6, Action "r" (Ends (Succeeds 0)))
               , (6, Action "t" Begins)
               , (16, Action "t" (Ends (Succeeds 7)))
               ]
    it "start a monitor's recovery even if the task's cleanup fails, and that failure is thrown after it" $
      with [Change 1 "p" (At 1)] (Monitor (Watched "p") (act "r" 2 (Succeeds 0)) (stoppedBy (EndsAfter 1 Fails) "t"))
        `endsWith` [Gave 4 (FailedWith (cleanupOf "t"))]
    it "are read again after a branch was stopped" $
      with
        [Change 1 "p" (At 1), Change 2 "p" (At 0)]
        (RSelect (Watched "p") (act "l" 1 (Succeeds 1)) (Do "r" [(script 3 (Succeeds 2)) {onStop = StopsAfter 2}]))
        `endsWith` [Gave 6 (Succeeded (Number 2))]
    it "are not false when they have no value any more, or fault" $ do
      with [Change 1 "p" NoValue] (RSelect (Watched "p") (act "l" 3 (Succeeds 1)) (act "r" 3 (Succeeds 2)))
        `endsWith` [Gave 1 (FailedWith noValue)]
      with
        [Change 1 "p" ThrowsFault]
        (WhileHolding (Watched "p") (act "a" 3 (Succeeds 1)) `Else` WaitUntil (Watched "p"))
        `endsWith` [Gave 1 (FaultedWith "p")]
    it "skip the slots that a slow reading has missed" $
      WaitUntil (Polled 2 (Do "s" [script 0 (Succeeds 0), script 3 (Succeeds 0), script 0 (Succeeds 1)]))
        `endsIn` [Gave 6 (Succeeded Unit)]
    it "are read again by a reading that began after the branch had stopped" $
      RSelect
        (Polled 2 (Do "s" [script 0 (Succeeds 1), script 1 (Succeeds 0), script 1 (Succeeds 1)]))
        (Do "l" [(script 9 (Succeeds 1)) {onStop = StopsAfter 2}, script 1 (Succeeds 2)])
        (act "r" 9 (Succeeds 3))
        `endsIn` [Gave 8 (Succeeded (Number 2))]

  describe "Messages" $ do
    it "stop the task, are handled one after the other, and then the task begins again" $
      does
        ( Both
            (OnMessage (act "h" 2 (Succeeds 0)) (act "t" 3 (Succeeds 7)))
            (act "a" 1 (Succeeds 0) `Then` Deliver `Then` Deliver)
        )
        ["t", "h"]
        [ (0, Action "t" Begins)
        , (1, Action "t" ReceivesStop)
        , (1, Action "h" Begins)
        , (3, Action "h" (Ends (Succeeds 0)))
        , (3, Action "h" Begins)
        , (5, Action "h" (Ends (Succeeds 0)))
        , (5, Action "t" Begins)
        , (8, Action "t" (Ends (Succeeds 7)))
        ]
    it "whose handler does not succeed are handled again" $
      (Deliver `Then` (Timeout 1 (HandleNext (act "h" 2 (Succeeds 7))) `Else` HandleNext (act "h" 2 (Succeeds 8))))
        `endsIn` [Gave 3 (Succeeded (Number 8))]
    it "as one of ordered rules are handled again when a rule before them interrupts that; a rule after them waits" $
      with
        [Change 1 "p" (At 1), Change 2 "p" (At 0), Change 3 "q" (At 1)]
        ( Deliver
            `Then` MessageRule
              (Watched "p")
              (act "f" 9 (Succeeds 1))
              (act "h" 2 (Succeeds 0))
              (Watched "q")
              (act "t" 1 (Succeeds 7))
        )
        `endsWith` [Gave 5 (Succeeded (Number 7))]
    it "are dropped, the oldest first, when there is no room" $
      foldr Then (WaitUntil (Watched "p")) (replicate 3 Deliver ++ replicate 3 (HandleNext (act "h" 1 (Succeeds 7))))
        `endsIn` [Gave 100 (Succeeded timeIsUp)]

  describe "Signals made of others" $ do
    it "can require several conditions to hold" $
      with [Change 1 "p" (At 1), Change 2 "q" (At 1)] (WaitUntil (And (Watched "p") (Watched "q")))
        `endsWith` [Gave 2 (Succeeded Unit)]
    it "with a hysteresis stay high above the lower threshold" $
      with
        [Change 1 "p" (At 2), Change 2 "p" (At 1), Change 3 "p" (At 0)]
        ( WithShared
            (Hysteresis False 0 2 (Watched "p"))
            (WaitUntil Shared `Then` WhileHolding Shared (act "a" 9 (Succeeds 7)))
        )
        `endsWith` [Gave 3 (FailedWith doesNotHold)]
    it "with a debounce ignore a short change" $
      with [Change 1 "p" (At 1), Change 2 "p" (At 0), Change 3 "p" (At 1)] (WaitUntil (Debounce 2 (Watched "p")))
        `endsWith` [Gave 5 (Succeeded Unit)]
    it "with a throttle take a change when the time has passed since the one before" $
      with [Change 1 "p" (At 1)] (WaitUntil (Throttle 3 (Watched "p"))) `endsWith` [Gave 3 (Succeeded Unit)]
    it "fail while a reading takes too long, and the operator waits for the reading to stop" $
      WaitUntil (StaleAfter 2 (Polled 1 (stoppedBy (StopsAfter 3) "s"))) `endsIn` [Gave 5 (FailedWith (overdueBy 2))]
    it "are read once for all operators that share them" $
      WithShared
        (Polled 2 (Do "s" [script 0 (Succeeds 0), script 0 (Succeeds 0), script 0 (Succeeds 1)]))
        (Both (WaitUntil Shared) (act "b" 1 (Succeeds 0) `Then` WaitUntil Shared))
        `endsIn` [Gave 4 (Succeeded Unit)]
    it "stop together with the body that shares them, whose fault comes first" $
      Timeout 1 (WithShared (Polled 1 (stoppedBy (EndsAfter 0 Faults) "s")) (stoppedBy (EndsAfter 2 Faults) "b"))
        `endsIn` [Gave 3 (FaultedWith (cleanupOf "b"))]
 where
  act name n how = Do name [script n how]
  script n how = Script n how Unmasked StopsAtOnce
  -- An action that takes longer than anything else, and responds to a stop request like that.
  stoppedBy response name = Do name [(script 50 (Succeeds 0)) {onStop = response}]
  with later p =
    World
      { conditions = [("p", At 0), ("q", At 0)]
      , changes = later
      , cancelAt = 100
      , program = p
      , caller = Operator
      , slippage = 0
      }
  -- Another thread cancels it at 2 and at 3.
  cancelledTwice p = (with [] p) {cancelAt = 2, caller = PlainThread Asynchronous 1}
  endsIn p = endsWith (with [] p)
  -- What the actions with these names do, in each of its timelines.
  does p names these =
    fmap (Set.map (filter (ofThem . snd) . timeline)) (paths 10000 whatIsDone (with [] p))
      `shouldBe` Just (Set.singleton these)
   where
    ofThem = \case
      Action name _ -> name `elem` names
      _ -> False
  endsWith world expected = fmap (Set.map end) (paths 10000 whatIsDone world) `shouldBe` Just (Set.fromList expected)
  hasTimeline world transitions =
    fmap (Set.map timeline) (paths 10000 whatIsDone world) `shouldBe` Just (Set.singleton transitions)
