{-# LANGUAGE LambdaCase #-}

-- |
-- The library against its specification: "Semantics.Step" says what may happen, and
-- whatever does happen in a simulation must be that.
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
import Test.Hspec.QuickCheck (modifyMaxSuccess, prop)
import Test.QuickCheck

import Behavior.Sim (Schedule (..))
import Semantics.Generate
import Semantics.Parts (depth)
import Semantics.Path
import Semantics.Program
import Semantics.Run
import Semantics.Shrink

spec :: Spec
spec = do
  describe "The relation" relation
  describe "The library" library

-- | More programs than these are tried by @--qc-max-success@.
library :: Spec
library = do
  modifyMaxSuccess (max 3000) $
    prop "does in a simulation only what the relation allows" onlyWhatIsAllowed
  it "does only what the relation allows, under many schedules" $
    for_ subtle $ \world -> for_ [1 .. 1000] $ \seed -> judge world seed `shouldReturn` Fine
  it "can do all that the relation allows, where that is not found by chance" $
    for_ subtle $ \world -> compared world `shouldReturn` Fine
  modifyMaxSuccess (max 60 . (`div` 100)) $
    prop "can do all that the relation allows" allThatIsAllowed
  modifyMaxSuccess (max 500 . (`div` 6)) $
    prop "does only what the relation allows, too, where timers are late" $
      onlyWhatIsAllowedOf 10 (slipping (worlds 3))
  modifyMaxSuccess (max 30 . (`div` 200)) $
    prop "can do all that the relation allows, too, where timers are late" $
      allThatIsAllowedOf (slipping smallWorlds)

-- | A random program, under a random schedule.
onlyWhatIsAllowed :: Property
onlyWhatIsAllowed = onlyWhatIsAllowedOf 60 (worlds 4)

-- | Of these worlds, so many in a hundred nested deep.
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

-- | Where timers are late. (The slots of polled sensors are not: they count from the slot
-- before, whenever that reading began.)
slipping :: Gen World -> Gen World
slipping some = do
  world <- some `suchThat` (not . isInfixOf "Polled" . show . program)
  (\n -> world {slippage = n}) <$> choose (1, 3)

-- | Worlds in which something happens that is rare.
subtle :: [World]
subtle =
  [ -- Time is up while the operator inside stops the rest after its verdict.
    alone (Timeout 2 (FirstOf [act 1 "a" Fails StopsAtOnce, act 9 "b" Fails (StopsAfter 2)]))
  , -- It completes although asked to stop, just as the condition is false again.
    (alone (Monitor (Watched "p") (act 1 "r" Fails StopsAtOnce) (act 9 "t" Fails (EndsAfter 1 (Succeeds 7)))))
      { changes = [Change 1 "p" (At 1), Change 2 "p" (At 0)]
      }
  , -- What was forked and the body go wrong together.
    alone (Scoped (Fork (act 1 "a" Faults StopsAtOnce) `Then` act 1 "b" Faults StopsAtOnce))
  , -- Two are forked at once, and fail at once.
    alone (Scoped (Both (Fork (act 1 "a" Fails StopsAtOnce)) (Fork (act 1 "b" Fails StopsAtOnce)) `Then` WaitUntil (Watched "p")))
  , -- What is shared has died, and its body looks before it hears that it should stop.
    (alone (WithShared (Polled 1 (act 9 "s" Fails (EndsAfter 0 Fails))) (deaf 2 "a" `Then` (WaitUntil Shared `Else` act 1 "b" Fails StopsAtOnce))))
      { patience = 1
      }
  , -- What is shared faults before the body does, which stands first all the same.
    (alone (WithShared (Polled 1 (act 9 "s" Fails (EndsAfter 0 Faults))) (act 9 "b" Fails (EndsAfter 1 Faults))))
      { patience = 1
      , caller = Stranger Asynchronous 9
      }
  , -- It was high, unnoticed by the operator.
    (alone (RSelect (And (Hysteresis False 0 2 (Watched "p")) (Watched "q")) (act 1 "l" Fails StopsAtOnce) (act 9 "r" Fails StopsAtOnce)))
      { changes = [Change 1 "p" (At 2), Change 2 "p" (At 1), Change 3 "q" (At 1)]
      }
  , -- A change has lasted just as it is taken back.
    (alone (WhileHolding (Debounce 1 (Watched "p")) (act 4 "a" Fails StopsAtOnce)))
      { conditions = [("p", At 1)]
      , changes = [Change 1 "p" (At 0), Change 2 "p" (At 1)]
      }
  , -- A reading ends just as it is overdue.
    alone (WaitUntil (StaleAfter 2 (Polled 3 (act 2 "s" (Succeeds 1) StopsAtOnce))))
  , -- Branch and sensor fault together, and the sensor stands first, whichever thread is older.
    alone (RSelect (Polled 1 (act 1 "s" (Succeeds 1) (EndsAfter 0 Faults))) (act 1 "l" Faults StopsAtOnce) (act 1 "r" Fails StopsAtOnce))
  , -- The answer is there just as time is up.
    alone (Timeout 2 (Scoped (Await (act 2 "a" (Succeeds 1) StopsAtOnce) (act 1 "b" (Succeeds 2) StopsAtOnce))))
  , -- The child fails, and whoever awaits it goes on for a moment.
    alone (Scoped (Await (act 1 "a" Fails StopsAtOnce) (act 1 "b" Fails StopsAtOnce `Else` act 0 "c" Fails StopsAtOnce) `Else` act 1 "d" Fails StopsAtOnce))
  , -- The child is stopped by its handle, just as it ends.
    alone (Scoped (Retract (act 1 "a" (Succeeds 1) StopsAtOnce) (act 1 "b" (Succeeds 2) StopsAtOnce) `Else` act 1 "c" (Succeeds 3) StopsAtOnce))
  , -- It fails in its cleanup.
    alone (Scoped (Retract (act 9 "a" Fails (EndsAfter 1 Fails)) (act 1 "b" (Succeeds 2) StopsAtOnce) `Else` act 1 "c" (Succeeds 3) StopsAtOnce))
  , -- It forks as the body returns.
    alone (Scoped (Fork (deaf 1 "a" `Then` (Fork (act 1 "b" Fails StopsAtOnce) `Else` act 1 "c" Fails StopsAtOnce)) `Then` act 1 "d" (Succeeds 1) StopsAtOnce))
  , -- The scope is asked to stop just as it has started a child.
    (alone (Scoped (act 1 "a" (Succeeds 1) StopsAtOnce `Then` (Fork (act 1 "b" Fails StopsAtOnce) `Else` act 1 "c" Fails StopsAtOnce))))
      { patience = 1
      , caller = Stranger Asynchronous 9
      }
  , -- It completes although asked to stop, and is asked again.
    (alone (Parallel (deaf 3 "a") (act 9 "b" Fails (EndsAfter 1 Faults)) `Else` act 9 "c" Fails StopsAtOnce))
      { patience = 1
      , caller = Stranger Asynchronous 1
      }
  , (alone (deaf 2 "a" `Then` (act 9 "b" Fails (EndsAfter 0 (Succeeds 1)) `Then` act 1 "c" Fails StopsAtOnce)))
      { patience = 1
      , caller = Stranger Asynchronous 0
      }
  ]
 where
  alone p = World [("p", At 0), ("q", At 0)] [] 9 p Operator 0
  deaf n name = Do name [Script n (Succeeds 0) Uninterruptible StopsAtOnce]
  act n name how asked = Do name [Script n how Unmasked asked]

data Judgement
  = Fine
  | Wrong String
  | -- | There was more to look at than we have the patience for.
    Undecided
  deriving (Eq, Show)

-- | Simulates the world under the schedule of the seed, and judges what could be seen.
judge :: World -> Int -> IO Judgement
judge world seed =
  observed (Seeded seed) world >>= \case
    Left why -> pure (Wrong why)
    Right seen -> pure $ case explains 4000 visible world seen of
      Possible -> Fine
      OutOfFuel -> Undecided
      Impossible at instead ->
        Wrong (unlines [told seen, "impossible from here on:", rows at, "possible are:", rows instead])
      ImpossibleEnd instead ->
        Wrong (unlines (told seen : "the end is impossible; possible are:" : map show instead))
 where
  told seen = "under schedule " ++ show seed ++ "\n" ++ rows (timeline seen) ++ "\n" ++ show (end seen)
  rows events = intercalate "\n" ["  " ++ show t ++ "  " ++ show e | (t, e) <- events]

-- | What is compared. To see 'everything' tells ties apart too, but asks of the simulator
-- that it records the end of a thread at the moment when others can know of it.
visible :: Transition -> Bool
visible = everything

-- | A small world that goes wrong, for one that does. Each is tried under many
-- schedules, since a smaller world needs another one.
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

-- | Compares all that can be seen in simulations of the world with all that the relation
-- allows. The search goes on until all that is allowed was seen, or all schedules were.
compared :: World -> IO Judgement
compared world = case paths 500 whatIsDone world of
  Nothing -> pure Undecided
  Just these -> go (Set.map Right these) Set.empty searches
 where
  searches = [allAlike k 2000 | k <- [0 .. 3]] ++ [sampled, allAlike maxBound 20000]
  allAlike k most = first (Set.map seenAlike) <$> allObserved k most world
  seenAlike = fmap (\s -> s {timeline = filter (whatIsDone . snd) (timeline s), end = hopeless (end s)})
  -- A program whose paths are finite, and that does not end, is in a deadlock.
  hopeless = \case
    Unknown _ -> Deadlock
    other -> other
  sampled = (\found -> (Set.fromList found, False)) <$> traverse (fmap seenAlike . (`observed` world) . Seeded) [1 .. 2000]
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
        | null others && complete -> pure (Wrong ("allowed, and never seen: " ++ show wrong))
        | otherwise -> go allowed sofar others

-- | What must come of some programs, worked out by hand.
relation :: Spec
relation = do
  describe "Sequence, and what to do about failure" $ do
    it "runs the second when the first fails, and not when it faults" $ do
      (act "a" 1 Fails `Else` act "b" 2 (Succeeds 7)) `endsIn` [Gave 3 (Succeeded (Number 7))]
      (act "a" 1 Faults `Else` act "b" 2 (Succeeds 7)) `endsIn` [Gave 1 (Faulted "a")]
    it "throws the last failure of several attempts" $ do
      Attempt 2 (Do "a" [script 1 Fails, script 2 Fails, script 3 (Succeeds 7)]) `endsIn` [Gave 3 (Failed "a")]
      Attempt 3 (Do "a" [script 1 Fails, script 2 Fails, script 3 (Succeeds 7)]) `endsIn` [Gave 6 (Succeeded (Number 7))]
      Attempt 0 (act "a" 1 (Succeeds 7)) `endsIn` [Gave 0 (Failed nothingElse)]
      FallbackOver [] `endsIn` [Gave 0 (Failed nothingElse)]

  describe "Several at once" $ do
    it "ends with the first to finish" $
      Parallel (act "a" 1 (Succeeds 0)) (act "b" 2 Faults) `endsIn` [Gave 1 (Succeeded Unit)]
    it "may see either first when they finish at the same time" $
      Parallel (act "a" 1 (Succeeds 0)) (act "b" 1 Fails) `endsIn` [Gave 1 (Succeeded Unit), Gave 1 (Failed "b")]
    it "throws the leftmost fault, not the first" $
      FirstOf [act "a" 1 Fails, stoppedBy (EndsAfter 3 Faults) "b", stoppedBy (EndsAfter 1 Faults) "c"]
        `endsIn` [Gave 4 (Faulted (cleanupOf "b"))]
    it "waits for all, or for the first that fails" $ do
      AllOf [act "a" 2 (Succeeds 1), act "b" 1 (Succeeds 2)] `endsIn` [Gave 2 (Succeeded (Several [Number 1, Number 2]))]
      AllOf [act "a" 2 (Succeeds 1), act "b" 1 Fails] `endsIn` [Gave 1 (Failed "b")]
      Both (act "a" 2 Fails) (stoppedBy (StopsAfter 3) "b") `endsIn` [Gave 5 (Failed "a")]
    it "stops what was forked when the body ends, and all when that fails" $ do
      Scoped (Fork (stoppedBy (StopsAfter 2) "a") `Then` act "b" 1 (Succeeds 7)) `endsIn` [Gave 3 (Succeeded (Number 7))]
      Scoped (Fork (act "a" 1 Fails) `Then` stoppedBy (StopsAfter 2) "b") `endsIn` [Gave 3 (Failed "a")]
    it "waits for the result of what was forked, or how else it ends" $ do
      Scoped (Await (act "a" 3 (Succeeds 7)) (act "b" 1 (Succeeds 1))) `endsIn` [Gave 3 (Succeeded (Number 7))]
      Scoped (Await (act "a" 3 Fails) (act "b" 1 (Succeeds 1)) `Else` act "c" 1 (Succeeds 1)) `endsIn` [Gave 3 (Failed "a")]

    it "stops what was forked when that is requested, which is no failure of the scope but of whoever awaits it" $ do
      Scoped (Retract (stoppedBy (StopsAfter 2) "a") (act "b" 1 (Succeeds 1)) `Else` act "c" 1 (Succeeds 7)) `endsIn` [Gave 4 (Succeeded (Number 7))]
      Scoped (Retract (stoppedBy (EndsAfter 2 (Succeeds 7)) "a") (act "b" 1 (Succeeds 1))) `endsIn` [Gave 3 (Succeeded (Number 7))]
      Scoped (Retract (stoppedBy (EndsAfter 2 Faults) "a") (act "b" 1 (Succeeds 1)) `Else` act "c" 1 (Succeeds 7)) `endsIn` [Gave 3 (Faulted (cleanupOf "a"))]
    it "fails to fork while all is being stopped" $
      Scoped (Fork (Do "a" [(script 2 (Succeeds 0)) {masking = Uninterruptible}] `Then` Fork (act "b" 1 Faults)) `Then` act "c" 1 (Succeeds 7))
        `endsIn` [Gave 2 (Succeeded (Number 7))]

  describe "Being asked to stop" $ do
    it "keeps the result of what completed although it was asked to stop" $
      Timeout 1 (stoppedBy (EndsAfter 2 (Succeeds 7)) "a") `endsIn` [Gave 3 (Succeeded (Number 7))]
    it "throws the fault of a cleanup" $
      Timeout 1 (stoppedBy (EndsAfter 2 Faults) "a") `endsIn` [Gave 3 (Faulted (cleanupOf "a"))]
    it "throws the fault of a cleanup through several operators" $
      Timeout 1 (Parallel (stoppedBy StopsAtOnce "a") (Timeout 5 (stoppedBy (EndsAfter 2 Faults) "b")))
        `endsIn` [Gave 3 (Faulted (cleanupOf "b"))]
    it "waits for what hears nothing" $
      Timeout 1 (Do "a" [(script 4 (Succeeds 7)) {masking = Uninterruptible}] `Then` act "b" 1 (Succeeds 0))
        `endsIn` [Gave 4 (Failed (timedOut 1))]

    it "throws the fault of a cleanup together with a stranger's cancellation" $ do
      (with [] (Parallel (stoppedBy StopsAtOnce "a") (stoppedBy (EndsAfter 3 Faults) "b"))) {patience = 2, caller = Stranger Asynchronous 1}
        `endsWith` [Gave 5 (Stopped (Just (cleanupOf "b")))]
    it "can be asked again by a stranger, and hears that after a cleanup" $ do
      (with [] (stoppedBy (EndsAfter 0 (Succeeds 7)) "a" `Then` stoppedBy StopsAtOnce "b")) {patience = 2, caller = Stranger Asynchronous 1}
        `endsWith` [Gave 3 (Stopped Nothing)]
      (with [] (stoppedBy (EndsAfter 2 (Succeeds 7)) "a")) {patience = 2, caller = Stranger Asynchronous 1}
        `endsWith` [Gave 4 (Stopped Nothing)]
    it "can have its own cleanup cut short by a stranger, but not that of a branch" $ do
      (with [] (stoppedBy (TidiesUp 5) "a")) {patience = 2, caller = Stranger Asynchronous 1} `endsWith` [Gave 3 (Stopped Nothing)]
      (with [] (Timeout 50 (stoppedBy (TidiesUp 5) "a"))) {patience = 2, caller = Stranger Asynchronous 1}
        `endsWith` [Gave 7 (Stopped Nothing)]

  describe "Conditions that change" $ do
    it "latches what a monitor has seen" $
      with
        [Change 2 "p" (At 1), Change 3 "p" (At 0)]
        (Monitor (Watched "p") (act "r" 2 (Succeeds 0)) (Do "t" [(script 10 (Succeeds 7)) {whenAsked = StopsAfter 2}]))
        `does` [ (0, "t" `Does` Begins)
               , (2, Becomes "p" (At 1))
               , (2, "t" `Does` Hears)
               , (3, Becomes "p" (At 0))
               , (4, "t" `Does` Stops)
               , (4, "r" `Does` Begins)
               , (6, "r" `Does` Ends (Succeeds 0))
               , (6, "t" `Does` Begins)
               , (16, "t" `Does` Ends (Succeeds 7))
               ]
    it "runs the recovery although a cleanup has failed, and throws that after it" $
      with [Change 1 "p" (At 1)] (Monitor (Watched "p") (act "r" 2 (Succeeds 0)) (stoppedBy (EndsAfter 1 Fails) "t"))
        `endsWith` [Gave 4 (Failed (cleanupOf "t"))]
    it "reads again after a branch was stopped" $
      with
        [Change 1 "p" (At 1), Change 2 "p" (At 0)]
        (RSelect (Watched "p") (act "l" 1 (Succeeds 1)) (Do "r" [(script 3 (Succeeds 2)) {whenAsked = StopsAfter 2}]))
        `endsWith` [Gave 6 (Succeeded (Number 2))]
    it "is not false when it is lost" $ do
      with [Change 1 "p" Lost] (RSelect (Watched "p") (act "l" 3 (Succeeds 1)) (act "r" 3 (Succeeds 2)))
        `endsWith` [Gave 1 (Failed noValue)]
      with [Change 1 "p" Faulting] (WhileHolding (Watched "p") (act "a" 3 (Succeeds 1)) `Else` WaitUntil (Watched "p"))
        `endsWith` [Gave 1 (Faulted "p")]
    it "skips the slots that a slow reading has missed" $
      WaitUntil (Polled 2 (Do "s" [script 0 (Succeeds 0), script 3 (Succeeds 0), script 0 (Succeeds 1)]))
        `endsIn` [Gave 6 (Succeeded Unit)]
    it "decides on a reading that began after it asked" $
      RSelect
        (Polled 2 (Do "s" [script 0 (Succeeds 1), script 1 (Succeeds 0), script 1 (Succeeds 1)]))
        (Do "l" [(script 9 (Succeeds 1)) {whenAsked = StopsAfter 2}, script 1 (Succeeds 2)])
        (act "r" 9 (Succeeds 3))
        `endsIn` [Gave 8 (Succeeded (Number 2))]

  describe "Signals made of others" $ do
    it "can need several to hold" $
      with [Change 1 "p" (At 1), Change 2 "q" (At 1)] (WaitUntil (And (Watched "p") (Watched "q")))
        `endsWith` [Gave 2 (Succeeded Unit)]
    it "remember that they were high" $
      with
        [Change 1 "p" (At 2), Change 2 "p" (At 1), Change 3 "p" (At 0)]
        (WithShared (Hysteresis False 0 2 (Watched "p")) (WaitUntil Shared `Then` WhileHolding Shared (act "a" 9 (Succeeds 7))))
        `endsWith` [Gave 3 (Failed doesNotHold)]
    it "do not follow a flicker" $
      with [Change 1 "p" (At 1), Change 2 "p" (At 0), Change 3 "p" (At 1)] (WaitUntil (Debounce 2 (Watched "p")))
        `endsWith` [Gave 5 (Succeeded Unit)]
    it "fail while a reading takes too long, and the operator waits for that" $
      WaitUntil (StaleAfter 2 (Polled 1 (stoppedBy (StopsAfter 3) "s"))) `endsIn` [Gave 5 (Failed (overdueBy 2))]
    it "are read once for all who share them" $
      WithShared
        (Polled 2 (Do "s" [script 0 (Succeeds 0), script 0 (Succeeds 0), script 0 (Succeeds 1)]))
        (Both (WaitUntil Shared) (act "b" 1 (Succeeds 0) `Then` WaitUntil Shared))
        `endsIn` [Gave 4 (Succeeded Unit)]
    it "stop together with those who share them, whose fault comes first" $
      Timeout 1 (WithShared (Polled 1 (stoppedBy (EndsAfter 0 Faults) "s")) (stoppedBy (EndsAfter 2 Faults) "b"))
        `endsIn` [Gave 3 (Faulted (cleanupOf "b"))]
 where
  act name n how = Do name [script n how]
  script n how = Script n how Unmasked StopsAtOnce
  -- Takes longer than anything else.
  stoppedBy response name = Do name [(script 50 (Succeeds 0)) {whenAsked = response}]
  with changes' p = World {conditions = [("p", At 0), ("q", At 0)], changes = changes', patience = 100, program = p, caller = Operator, slippage = 0}
  endsIn p = endsWith (with [] p)
  endsWith world ends' = fmap (Set.map end) (paths 10000 whatIsDone world) `shouldBe` Just (Set.fromList ends')
  does world events = fmap (Set.map timeline) (paths 10000 whatIsDone world) `shouldBe` Just (Set.singleton events)
