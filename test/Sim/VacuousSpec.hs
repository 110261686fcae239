{-# LANGUAGE LambdaCase #-}

-- |
-- Tests that would pass because they test nothing: each is an error that says what to do.
module Sim.VacuousSpec (spec) where

import Control.Concurrent (threadDelay)
import Control.Concurrent.STM (newTVarIO, readTVar, writeTVar)
import Control.Exception (AsyncException (ThreadKilled), ErrorCall (..), finally, throwIO)
import Control.Monad (forever, void, when)
import Data.Foldable (for_)
import Data.IORef (modifyIORef, newIORef, readIORef, writeIORef)
import Data.List (isInfixOf)
import Test.Hspec hiding (parallel)
import Test.QuickCheck (Args (chatty), Result (output), quickCheckWithResult, stdArgs, (==>))

import Behavior
import Behavior.Message (handleNext, messageRule, onMessage, withInbox)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Sim.Mock
import Behavior.Sim.QuickCheck (underSchedules)
import Behavior.Time (checkpoint, cleanupWithin, timeout, timeoutAt)
import Behavior.Trace (named)
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "A world that a run does not own" worlds
  describe "An exploration that shows nothing" explorations
  describe "The report of an exploration" coverage

worlds :: Spec
worlds = do
  for_ usesOutside $ \(how, use) ->
    it ("cannot be used in a simulation after it was used outside: " ++ how) $ do
      (world, drive, low) <- rover
      use world low
      run <- simulate (drive >> begin world)
      explain (outcome run) `shouldSatisfy` ("started outside of the simulation" `isInfixOf`)
      -- The run is not judged here; but its record cannot be read either.
      (world `shouldRecord` never (startOf "drive")) `shouldThrow` saying "started outside of the simulation"
  it "ends a simulation that may not use it, also if the behaviour catches that" $
    for_ [void, both (pure ()) . void, (>> failed), (>> sleep 100)] $ \goesOn -> do
      (world, drive, _) <- rover
      begin world
      run <- simulateWith defaultSimOptions {endAt = 50} (goesOn (tryAny drive))
      explain (outcome run) `shouldSatisfy` ("started outside of the simulation" `isInfixOf`)
  it "ends a simulation in which a claim does not hold, also if the behaviour catches that" $ do
    (world, drive, _) <- rover
    run <- simulate (tryAny (drive >> (world `shouldRecord` never (startOf "drive"))))
    explain (outcome run) `shouldSatisfy` ("never \"drive\" begins" `isInfixOf`)
  it "cannot be used in another simulation" $ do
    (world, drive, _) <- rover
    void (simulate drive)
    again <- simulate drive
    explain (outcome again) `shouldSatisfy` ("started in another simulation" `isInfixOf`)
    happened world `shouldThrow` saying "started in another simulation"
  it "cannot be used outside after a simulation; but its record can be read there, again and again" $ do
    (world, drive, low) <- rover
    void (simulate drive)
    world `shouldRecord` exactly 1 (successOf "drive")
    map entryTime . recordEntries <$> happened world `shouldReturn` [0, 0, 4]
    reading low `shouldThrow` saying "only read its record"
  it "cannot be followed in a simulation through a signal that is shared outside" $ do
    (_, _, low) <- rover
    run <- Signal.withShared (signal low) (simulate . Signal.waitUntil)
    explain (outcome run) `shouldSatisfy` ("opened outside of this simulation" `isInfixOf`)
  for_ handlers $ \(name, handling) ->
    it ("cannot be followed in a simulation through an inbox that is opened outside: " ++ name) $ do
      (world, _, _) <- rover
      orders <- driver world "orders" [(1, "tea")]
      run <- withInbox 9 orders (simulate . handling)
      explain (outcome run) `shouldBe`
        "it faulted: " ++ name ++ ": this inbox was opened in another run, so its driver does not deliver in this one; \
        \open it inside of the simulation: simulate (withInbox ...)"
  it "is one that was not used at all, of which no claim is made" $ do
    (world, drive, _) <- rover
    void (simulate (pure () ? drive))
    for_ [never (startOf "drive"), always (running "drive")] $ \claim ->
      (world `shouldRecord` claim) `shouldThrow` saying "begin it: simulate (begin world"
    happened world `shouldThrow` saying "begin it: simulate (begin world"
  it "can begin with nothing else, so that such a claim is made" $ do
    (world, drive, _) <- rover
    void (simulate (begin world >> pure () ? drive))
    world `shouldRecord` never (startOf "drive")
  it "fails an exploration that uses one world in all its runs, also if the property catches that" $
    for_ [id, \property simulating -> property simulating `catchAny` \_ -> pure ()] $ \whole ->
      for_ [id, void . tryAny, both (pure ()) . tryAny] $ \caught -> do
        (_, drive, _) <- rover
        tryExplore (randomly 5) (whole (\simulating -> void (simulating (caught drive))))
          `shouldFailWith` "started in another simulation"
  it "fails a property of QuickCheck, also if that catches it" $ do
    (_, drive, _) <- rover
    tested <- quickCheckWithResult stdArgs {chatty = False} . underSchedules $ \simulating ->
      True <$ tryAny (simulating drive)
    output tested `shouldContain` "started in another simulation"
  it "fails an exploration whose property has used it outside of the simulation" $ do
    tryExplore (randomly 5) (\simulating -> do
        (world, _, _) <- rover
        begin world
        void (simulating (sleep 1)))
      `shouldFailWith` "started outside of the simulation"
    tryExplore (randomly 5) (\simulating -> do
        world <- newMock
        orders <- driver world "orders" [(1, "tea")]
        withInbox 9 orders $ \inbox -> void (simulating (onMessage inbox (\_ -> pure (pure ())) (sleep 60))))
      `shouldFailWith` "started outside of the simulation"
  it "has a record that no other exploration can be judged by" $ do
    kept <- newIORef Nothing
    _ <- explore (randomly 1) $ \simulating -> do
      (world, drive, _) <- rover
      writeIORef kept (Just world)
      void (simulating drive)
      world `shouldRecord` exactly 1 (successOf "drive")
    old <- readIORef kept >>= maybe (fail "no world") pure
    -- Outside of explorations it can be read.
    old `shouldRecord` exactly 1 (successOf "drive")
    for_ [id, \property simulating -> property simulating `catchAny` \_ -> pure ()] $ \whole ->
      tryExplore (randomly 2) (whole (\simulating -> do
          void (simulating (sleep 1))
          old `shouldRecord` exactly 1 (successOf "drive")))
        `shouldFailWith` "made in another test"
  it "is not used by what only the unwinding of a run does with it" $ do
    (world, drive, _) <- rover
    void (simulateWith defaultSimOptions {endAt = 1} (sleep 5 `finally` drive))
    (world `shouldRecord` never (startOf "drive")) `shouldThrow` saying "nothing has used this world"
  it "is used again and again in reality" $ do
    world <- newMock
    wave <- action world "wave" [succeeds]
    wave >> runBehavior wave
    world `shouldRecord` exactly 2 (successOf "wave")
 where
  handlers =
    [ ("onMessage", \inbox -> onMessage inbox (\_ -> pure (pure ())) (sleep 60))
    , ("handleNext", \inbox -> handleNext inbox (\_ -> pure (pure ())) ||| sleep 60)
    , ("messageRule", \inbox -> do
        rule <- messageRule inbox (\_ -> pure (pure ()))
        Signal.teleoReactive [rule, (pure True, sleep 60)])
    ]
  usesOutside =
    [ ("begin", \world _ -> begin world)
    , ("a note", \world _ -> note world "ready")
    , ("a reading", \_ low -> void (reading low))
    , ("a change", \_ low -> set low True)
    ]

explorations :: Spec
explorations = do
  for_ plans $ \(name, plan, why) ->
    it ("is refused: " ++ name) $
      explore plan (\simulated -> void (simulated (sleep 1))) `shouldThrow` (== ErrorCall ("explore: " ++ why))
  for_ [randomly 3, exhaustively 1, replaying NonPreemptive, (randomly 1) {planSearch = Shrink NonPreemptive}] $
    \plan ->
      it ("is refused, when its property simulates nothing: " ++ show (planSearch plan)) $
        explore plan (\_ -> pure ()) `shouldThrow` saying "the property has simulated nothing"
  for_
    [ ("endAt", -1, \t o -> o {endAt = t})
    , ("endAt", 0 / 0, \t o -> o {endAt = t})
    , ("timerSlip", -1, \t o -> o {timerSlip = t})
    , ("realTimeLimit", -1, \t o -> o {realTimeLimit = t})
    ]
    $ \(name, t, with) -> it ("is refused, when a run has the " ++ name ++ " " ++ show t) $
        simulateWith (with t defaultSimOptions) (sleep 1)
          `shouldThrow` (== ErrorCall (name ++ ": a duration is zero or more seconds, not " ++ show t))
  it "fails, when its property catches that a run is not valid, or that it simulates twice" $ do
    let caught property simulating = property simulating `catchAny` \_ -> pure ()
    tryExplore (randomly 2) (caught (\simulating -> void (simulating (threadDelay 10000000))))
      `shouldFailWith` "threadDelay"
    tryExplore (randomly 2) (caught (\simulating -> simulating (pure ()) >> void (simulating (pure ()))))
      `shouldFailWith` "simulates only once"
  it "fails, when its property returns an error that nothing has evaluated" $
    tryExplore (randomly 2) (\simulating -> error "late" <$ simulating (pure ())) `shouldFailWith` "late"
  it "fails, when a claim that is checked inside of a run does not hold, also if the property ignores how that ended" $
    for_ [id, (? pure ()), void . tryAny] $ \ignoring -> do
      let property simulating = do
            (world, drive, _) <- rover
            void . simulating . ignoring $ drive >> (world `shouldRecord` never (startOf "drive"))
      tryExplore (randomly 2) property `shouldFailWith` "never \"drive\" begins"
  it "is refused, when its limit is negative" $
    simulateWith defaultSimOptions {livelockLimit = -1} (pure ()) `shouldThrow` saying "livelockLimit"
  it "is refused, when its property simulates nothing under one of the schedules" $ do
    runs <- newIORef (0 :: Int)
    let thrice simulated = modifyIORef runs (+ 1) >> readIORef runs >>= \n -> when (n < 3) (void (simulated (sleep 1)))
    explore (randomly 3) thrice `shouldThrow` saying "the property has simulated nothing"
  it "is a counterexample, when its property fails before it simulates" $ do
    found <- tryExplore (randomly 3) (\_ -> fail "no world")
    either (show . failingException) show found `shouldBe` "user error (no world)"
  it "is a failed test of QuickCheck, unless the test is discarded" $ do
    result <- quickCheckWithResult stdArgs {chatty = False} (underSchedules (\_ -> pure True))
    output result `shouldContain` "the property has simulated nothing"
    gaveUp <- quickCheckWithResult stdArgs {chatty = False} (underSchedules (\_ -> pure (False ==> True)))
    output gaveUp `shouldContain` "Gave up!"
 where
  plans =
    [ ("randomly (-3)", randomly (-3), "a random plan has at least 1 schedule, and not -3")
    , ("randomly 0", randomly 0, "a random plan has at least 1 schedule, and not 0")
    , ("exhaustively (-1)", exhaustively (-1), "an exhaustive plan has at least 0 pre-emptions, and not -1")
    , ( "Exhaustive 1 0"
      , (randomly 1) {planSearch = Exhaustive 1 0}
      , "an exhaustive plan has at least 1 schedule, and not 0"
      )
    ]

coverage :: Spec
coverage = do
  it "names the scripted actions that no schedule has started" $ do
    report <- exploring (\drive _ _ -> drive)
    reportNeverStarted report `shouldBe` ["charge", "honk"]
    show report `shouldContain` "; never started: \"charge\", \"honk\""
  it "names none, when each has been started under some schedule, with any argument" $ do
    report <- exploring (\drive honk charge -> (drive ||| honk) >> charge 'x')
    reportNeverStarted report `shouldBe` []
    show report `shouldNotContain` "never"
  it "names an action also when one has been started whose name begins like it" $ do
    report <- explore (randomly 2) $ \simulating -> do
      world <- newMock
      _ <- action world "drive" [succeeds]
      home <- action world "drive home" [succeeds]
      void (simulating home)
    reportNeverStarted report `shouldBe` ["drive"]
  it "names an action also when a behaviour of that name has been started" $ do
    report <- explore (randomly 2) $ \simulating -> do
      world <- newMock
      _ <- action world "drive" [succeeds]
      void (simulating (begin world >> named "drive" (pure ())))
    reportNeverStarted report `shouldBe` ["drive"]
  it "knows an action that only some schedules start" $ do
    -- The right branch honks, unless it is stopped before.
    report <- exploring (\_ honk _ -> parallel (pure ()) honk)
    reportNeverStarted report `shouldBe` ["charge", "drive"]
  it "knows an action that was made in the run" $ do
    report <- explore (randomly 3) $ \simulated -> void . simulated $ do
      world <- newMock
      begin world
      void (action world "late" [succeeds])
    reportNeverStarted report `shouldBe` ["late"]
  it "has the names of what was started: behaviours, actions, branches, rules" $ do
    report <- exploring $ \drive honk _ ->
      named "mission" (Signal.teleoReactive [(pure False, honk), (pure True, drive)] ||| sleep 4)
    reportStarted report
      `shouldBe` ["drive", "mission", "parallel: left", "parallel: right", "teleoReactive: rule 2"]
  for_ branches $ \(mission, unreached) ->
    it ("names the branches that no schedule has started: " ++ unwords unreached) $ do
      report <- explore (randomly 3 `endingAt` 9) (\simulated -> void (simulated mission))
      reportNeverStarted report `shouldBe` unreached
  it "knows a rule and a recovery that only some schedules start" $ do
    report <- explore (randomly 50) $ \simulated -> void . simulated $ do
      first <- newTVarIO True
      let isFirst = Signal.watching (readTVar first)
          rules = Signal.teleoReactive [(isFirst, sleep 1), (not <$> isFirst, pure ())]
      both (atomically (writeTVar first False)) (both rules (Signal.monitor isFirst (sleep 1) (pure ())))
    reportNeverStarted report `shouldBe` []
  it "distinguishes operators by the names of the behaviours around them" $ do
    let charging = Signal.monitor (pure False) (pure ()) (pure ())
        stopping low = Signal.insteadWhen (pure low) (pure ()) (pure ())
    report <- explore (randomly 3) $ \simulated ->
      void . simulated . named "mission" $
        charging >> named "out" (stopping True >> charging) >> both (named "home" (stopping False)) charging
    reportNeverStarted report
      `shouldBe` [ "monitor: recovery (mission)"
                 , "insteadWhen: emergency (mission > home)"
                 , "insteadWhen: branch (mission > out)"
                 , "monitor: recovery (mission > out)"
                 ]
    show report `shouldContain` "; never started: \"monitor: recovery (mission)\", "
  it "names a branch once, however often its operator runs, and however deep a name is repeated" $ do
    let rounds n = when (n > (0 :: Int)) . named "round" $ Signal.monitor (pure False) nop nop >> rounds (n - 1)
    report <- explore (randomly 3) (\simulated -> void (simulated (rounds 20)))
    reportNeverStarted report `shouldBe` ["monitor: recovery (round)"]
  it "survives names that throw or have no end" $ do
    let unreached name = named name (Signal.monitor (pure False) (pure ()) (pure ()))
    report <- explore (randomly 3) $ \simulated ->
      void (simulated (unreached (error "no name") >> unreached (cycle "ab")))
    map (take 30) (reportNeverStarted report)
      `shouldBe` ["monitor: recovery (<its text t", "monitor: recovery (abababababa"]
  it "names no branch of an operator that no schedule has started" $ do
    report <- explore (randomly 3) $ \simulated ->
      void (simulated (Signal.rSelect (pure True) (pure ()) (Signal.monitor (pure False) (pure ()) (pure ()))))
    reportNeverStarted report `shouldBe` ["rSelect: right"]
  it "has how runs have ended, but for those that have returned" $ do
    let ends mission = explore (randomly 20 `endingAt` 9) (\simulated -> void (simulated mission))
        table =
          [ (fail "broken", ("faulted", 20))
          , (failed, ("failed", 20))
          , (throwIO ThreadKilled, ("cancelled", 20))
          , (Signal.waitUntil (pure False), ("deadlocked", 20))
          , (sleep 10, ("out of time", 20))
          ]
    for_ table $ \(mission, end) -> do
      report <- ends mission
      reportEnds report `shouldBe` [end]
      show report `shouldContain` ("; 20 " ++ fst end)
    livelocked <- explore (replaying NonPreemptive) $ \simulated -> void (simulated (forever checkpoint))
    reportEnds livelocked `shouldBe` [("livelocked", 1)]
    -- The right branch fails, unless it is stopped before.
    some <- ends (pure () ||| failed)
    map fst (reportEnds some) `shouldBe` ["failed"]
    map snd (reportEnds some) `shouldSatisfy` all (< 20)
    (reportEnds <$> ends (sleep 8)) `shouldReturn` []
  it "counts one schedule as one" $ do
    report <- explore (replaying NonPreemptive) (\simulated -> void (simulated (pure ())))
    show report `shouldBe` "1 schedule of 1 point in all"
 where
  branches =
    [ (Signal.rSelect (pure True) (pure ()) (pure ()), ["rSelect: right"])
    , (Signal.rSelect (pure False) (pure ()) (pure ()), ["rSelect: left"])
    , (Signal.monitor (pure False) (pure ()) (pure ()), ["monitor: recovery"])
    , (Signal.monitor (pure True) (sleep 1) (pure ()), ["monitor: task"])
    , (monitor (pure False) (pure ()) (pure ()), ["monitor: recovery"])
    , (Signal.insteadWhen (pure False) (pure ()) (pure ()), ["insteadWhen: emergency"])
    , (Signal.insteadWhen (pure True) (pure ()) (pure ()), ["insteadWhen: branch"])
    , ( Signal.teleoReactive [(pure False, nop), (pure True, nop), (pure True, nop)]
      , ["teleoReactive: rule 1", "teleoReactive: rule 3"]
      )
    , (Signal.whileHolding (pure False) (pure ()), ["whileHolding: branch"])
    , (Signal.stoppedWhile (pure True) (pure ()), ["stoppedWhile: branch"])
    , (Signal.pausedWhile (pure False) (pure ()) (pure ()) (pure ()), ["pausedWhile: pause"])
    , (withInbox 1 (\_ -> pure nop) (\inbox -> onMessage inbox (\() -> pure (pure ())) nop), ["onMessage: handler"])
    , (timeout 0 (pure ()), ["timeout: branch"])
    , (timeoutAt 0 (pure ()), ["timeoutAt: branch"])
    , (void (cleanupWithin 0 (pure ())), ["cleanupWithin: branch"])
    , (Signal.switch (pure 'x') (const nop) >> timeout 1 (sleep 2) ? Signal.waitUntil (pure True) >> (nop ||| nop), [])
    ]
  nop = pure () :: Behavior ()
  exploring mission = explore (randomly 20) $ \simulated -> do
    (world, drive, _) <- rover
    honk <- action world "honk" [succeeds]
    charge <- actionOn world "charge" (\place -> [succeeds | place == 'x'])
    void (simulated (begin world >> mission drive honk charge))

-- | A world, an action that takes four seconds, and a condition.
rover :: IO (Mock, Behavior (), Condition Bool)
rover = do
  world <- newMock
  low <- condition world "low" [(0, False)]
  drive <- action world "drive" [succeeds `taking` 4]
  pure (world, drive, low)

saying :: String -> ErrorCall -> Bool
saying text (ErrorCall why) = text `isInfixOf` why

-- | The exploration has a counterexample, whose exception has this text.
shouldFailWith :: IO (Either Counterexample Report) -> String -> Expectation
shouldFailWith exploring text =
  exploring >>= \case
    Right report -> expectationFailure ("it holds: " ++ show report)
    Left found -> show (failingException found) `shouldSatisfy` (text `isInfixOf`)
