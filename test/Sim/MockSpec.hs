module Sim.MockSpec (spec) where

import Control.Concurrent.Async (mapConcurrently)
import Control.Exception (ErrorCall (..), IOException, mask_, uninterruptibleMask_)
import Control.Monad (replicateM, replicateM_)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef, writeIORef)
import Data.List (isInfixOf, sort)
import System.IO.Error (isUserError)
import Test.Hspec

import Behavior
import Behavior.Internal.Core.Failure (isCancellation, isFailure)
import Behavior.Internal.Seam.Runtime (Label (..), threadId, throwToAll, start, threadEnd)
import Behavior.Parallel (firstOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (SimOptions (..), Outcome (..), Run (..), Schedule (..), defaultSimOptions, simulate, simulateWith)
import qualified Behavior.Sim as Sim
import Behavior.Sim.Mock
import Behavior.Time (now, timeout)
import Support (Cancel (..), Ending (..), ending, guarded, leavingNothing)

-- | Time passes in simulations, except for two milliseconds on real threads.
spec :: Spec
spec = guarded $ do
  describe "A scripted action" $ do
    describe "in each call" calls
    describe "that takes time" takingTime
    describe "that receives a stop request" stopped
    describe "and its record" records
  describe "A scripted sensor" sensors
  describe "A scripted condition" $ do
    describe "that is polled" polled
    describe "that is watched" watched
    describe "that is set by hand" setting
  describe "A mock world" worlds
  describe "Rejected with an error" refusals

-- | The lines of a world's record.
timelineOf :: Mock -> IO [String]
timelineOf mock = lines . show <$> happened mock

-- | The end of a simulated run, and its time.
runSimulated :: Show a => Behavior a -> IO (String, Seconds)
runSimulated act = (\r -> (describedEnd (outcome r), finished r)) <$> simulate act

describedEnd :: Show a => Outcome a -> String
describedEnd end = case end of
  Returned a -> "returned " ++ show a
  Threw e
    | isFailure e -> "failed " ++ show e
    | isCancellation e -> "cancelled " ++ show e
    | otherwise -> "faulted " ++ show e
  Deadlock _ -> "deadlock"
  OutOfTime _ -> "out of time"
  _ -> "something else"

calls :: Spec
calls = do
  it "follows the script of that call, and repeats the last script" $ do
    mock <- newMock
    look <- action mock "look" [returning 'a', fails "dark", faults "bug", returning 'b']
    ends <- replicateM 5 (ending look)
    ends `shouldBe` [Gave 'a', FailedWith "FailedBecause \"dark\"", FaultedWith "bug", Gave 'b', Gave 'b']
    map entryKind . recordEntries <$> happened mock
      `shouldReturn` concatMap (\end -> [Begins, end]) [Succeeds, Fails "dark", Faults "bug", Succeeds, Succeeds]
    map entryCall . recordEntries <$> happened mock `shouldReturn` [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]

  it "uses each script exactly once, also with concurrent callers" $ do
    mock <- newMock
    ticket <- action mock "ticket" (map returning [1 :: Int ..])
    tickets <- mapConcurrently (const (replicateM 50 ticket)) "12345678"
    sort (concat tickets) `shouldBe` [1 .. 400]
    sort . map entryCall . filter ((== Succeeds) . entryKind) . recordEntries <$> happened mock
      `shouldReturn` [1 .. 400]
    counter <- sensor mock "count" (map returning [1 :: Int ..])
    counts <- mapConcurrently (const (replicateM 50 counter)) "12345678"
    sort (concat counts) `shouldBe` [1 .. 400]

  it "throws the user's exceptions, recorded as failures or faults" $ do
    mock <- newMock
    grasp <- action mock "grasp" [throws (FailedBecause "slippery"), throws (userError "no hand"), succeeds]
    grasp `shouldThrow` (== FailedBecause "slippery")
    grasp `shouldThrow` (isUserError :: IOException -> Bool)
    mock `shouldRecord` (exactly 1 (failureOf "grasp") <> exactly 1 (faultOf "grasp"))

  it "has separate scripts for each argument" $ do
    mock <- newMock
    open <- actionOn mock "open" $ \door ->
      if door == "front" then [fails "locked"] else [fails "stuck", returning door]
    ending (fallbackOver ["front", "back"] open) `shouldReturn` FailedWith "FailedBecause \"stuck\""
    fallbackOver ["front", "back"] open `shouldReturn` "back"
    map show . recordEntries <$> happened mock
      `shouldReturn` [ "open \"front\": begins"
                     , "open \"front\": fails, locked"
                     , "open \"back\": begins"
                     , "open \"back\": fails, stuck"
                     , "open \"front\": begins (call 2)"
                     , "open \"front\": fails, locked (call 2)"
                     , "open \"back\": begins (call 2)"
                     , "open \"back\": done (call 2)"
                     ]

takingTime :: Spec
takingTime = do
  it "ends when its time is over" $ do
    mock <- newMock
    walk <- action mock "walk" [succeeds `taking` 1 `taking` 1.5, fails "tired" `taking` 0.5]
    runSimulated (walk >> walk) `shouldReturn` ("failed FailedBecause \"tired\"", 3)
    timelineOf mock
      `shouldReturn` [ "0.0 s  walk: begins"
                     , "2.5 s  walk: done"
                     , "2.5 s  walk: begins (call 2)"
                     , "3.0 s  walk: fails, tired (call 2)"
                     ]

  it "has its effect when its time is over, and not when it is stopped" $
    for_ [(4, "returned True", 4), (6, "returned False", 5)] $ \(limit, end, t) -> do
      mock <- newMock
      low <- condition mock "low" [(0, True)]
      recharge <- action mock "recharge" [succeeds `taking` 5 `causing` set low False]
      runSimulated ((timeout limit recharge ? pure ()) >> reading low) `shouldReturn` (end, t)
      mock `shouldRecord` becoming "low" False `comesBefore` successOf "recharge"

  it "throws what its effect throws" $ do
    mock <- newMock
    press <- action mock "press" [succeeds `causing` failWith "no button"]
    ending press `shouldReturn` FailedWith "FailedBecause \"no button\""
    mock `shouldRecord` (eventually (failureOf "press") <> never (successOf "press"))

  it "never ends when it hangs, until it is stopped" $ do
    mock <- newMock
    wait <- action mock "wait" [hangs :: Script ()]
    runSimulated (timeout 3600 wait) `shouldReturn` ("failed TimedOut 3600.0", 3600)
    mock `shouldRecord` withinSeconds 3600 (interruptionOf "wait")
    forEver <- newMock >>= \another -> action another "wait" [hangs :: Script ()]
    runSimulated forEver >>= (`shouldBe` "deadlock") . fst

stopped :: Spec
stopped = do
  let stopping script = do
        mock <- newMock
        act <- action mock "act" [script]
        end <- runSimulated (timeout 1 act)
        (,) end . map (\e -> (entryTime e, entryKind e)) . recordEntries <$> happened mock

  it "stops at once" $
    stopping (succeeds `taking` 9)
      `shouldReturn` (("failed TimedOut 1.0", 1), [(0, Begins), (1, StopRequested), (1, Stops)])

  it "stops when its cleanup is over" $
    stopping (succeeds `taking` 9 `slowToStop` 2 `slowToStop` 0.5)
      `shouldReturn` (("failed TimedOut 1.0", 3.5), [(0, Begins), (1, StopRequested), (3.5, Stops)])

  it "may fail there" $
    stopping (succeeds `taking` 9 `failsStopping` "stuck" `slowToStop` 1)
      `shouldReturn` (("failed FailedBecause \"stuck\"", 2), [(0, Begins), (1, StopRequested), (2, Fails "stuck")])

  it "may fault there" $
    stopping (succeeds `taking` 9 `slowToStop` 1 `faultsStopping` "bug")
      `shouldReturn` (("faulted bug", 2), [(0, Begins), (1, StopRequested), (2, Faults "bug")])

  it "may complete anyway, at the same time as without the request" $
    stopping (completesAnyway (returning 'x' `taking` 9))
      `shouldReturn` (("returned 'x'", 9), [(0, Begins), (1, StopRequested), (9, Succeeds)])

  it "cannot be interrupted again" $
    for_ [(hangs `slowToStop` 5, 6, Stops), (completesAnyway (succeeds `taking` 9), 9, Succeeds)] $
      \(script, t, end) -> do
        mock <- newMock
        act <- action mock "act" [script]
        _ <- simulate $ do
          thread <- mask_ (start (Label "test" "act") act)
          replicateM_ 3 $ sleep 1 >> throwToAll (const (Cancel "again")) [threadId thread]
          atomically (threadEnd thread)
        map (\e -> (entryTime e, entryKind e)) . recordEntries <$> happened mock
          `shouldReturn` [(0, Begins), (1, StopRequested), (t, end)]

  it "does not begin when the request comes first" $ do
    mock <- newMock
    act <- action mock "act" [succeeds]
    _ <- simulate (begin mock >> firstOf [pure (), sleep 0.5 >> act])
    mock `shouldRecord` never (startOf "act")

  it "completes where its caller is masked uninterruptibly" $ do
    mock <- newMock
    act <- action mock "act" [succeeds `taking` 3]
    runSimulated (timeout 1 (uninterruptibleMask_ act)) `shouldReturn` ("failed TimedOut 1.0", 3)
    mock `shouldRecord` never (interruptionOf "act")

records :: Spec
records = do
  it "contains a success if and only if the action returned, under every schedule" $
    for_ [1 .. 300] $ \seed -> do
      mock <- newMock
      act <- action mock "act" [returning () `taking` 1, succeeds, completesAnyway (succeeds `taking` 2)]
      returned <- newIORef (0 :: Int)
      -- Masked, so that no exception arrives between the return and the counting.
      let counting = replicateM_ 3 . mask_ $ (act >> readIORef returned >>= writeIORef returned . (+ 1))
      _ <- simulateWith defaultSimOptions {scheduled = Seeded seed} (timeout 1 counting ? sleep 1)
      n <- readIORef returned
      mock `shouldRecord` exactly n (successOf "act")

  it "contains the end of each call that began, under every schedule" $
    for_ [1 .. 100] $ \seed -> do
      mock <- newMock
      act <- action mock "act" [succeeds, succeeds `taking` 1 `slowToStop` 1, fails "x"]
      _ <- simulateWith defaultSimOptions {scheduled = Seeded seed} (firstOf [act, act ? act, sleep 1])
      mock `shouldRecord` whenever (startOf "act") (eventually (endOf "act"))
      began <- countOf (startOf "act") <$> happened mock
      mock `shouldRecord` exactly began (endOf "act")

  it "is in the steps of a simulated run as well" $ do
    mock <- newMock
    act <- action mock "act" [fails "x" `taking` 2]
    low <- condition mock "low" [(0, False), (1, True)]
    ran <- simulate (act ? Signal.waitUntil (signal low))
    [(Sim.stepTime step, text) | step <- Sim.steps ran, Sim.Note text <- [Sim.stepKind step]]
      `shouldBe` [(0, "act: begins"), (2, "act: fails, x"), (2, "low: becomes True")]
    timelineOf mock
      `shouldReturn` ["0.0 s  low: is False", "0.0 s  act: begins", "1.0 s  low: becomes True", "2.0 s  act: fails, x"]

sensors :: Spec
sensors = do
  it "follows the script of that reading" $ do
    mock <- newMock
    camera <- sensor mock "camera" [returning 1, fails "dark", returning (2 :: Int)]
    replicateM 4 (ending camera) `shouldReturn` [Gave 1, FailedWith "FailedBecause \"dark\"", Gave 2, Gave 2]

  it "records a reading only when its value is different" $ do
    mock <- newMock
    range <- sensor mock "range" (map returning [9, 9, 8, 8, 8, 9, 5 :: Int])
    _ <- simulate (Signal.waitUntil ((== 5) <$> Signal.polling 1 range))
    timelineOf mock
      `shouldReturn` [ "0.0 s  range: becomes 9"
                     , "2.0 s  range: becomes 8"
                     , "5.0 s  range: becomes 9"
                     , "6.0 s  range: becomes 5"
                     ]

  it "can be late, and can fault" $ do
    mock <- newMock
    range <- sensor mock "range" [returning 'a' `taking` 3, faults "broken"]
    runSimulated (range >> range) `shouldReturn` ("faulted broken", 3)
    mock `shouldRecord` eventually (faultOf "range") <> becoming "range" 'a' `comesBefore` faultOf "range"

polled :: Spec
polled = do
  it "gives its value at each time" $ do
    mock <- newMock
    level <- condition mock "level" [(0, 'a'), (1, 'b'), (2, 'c')]
    let levelAfter n = sleep n >> reading level
    runSimulated (sequence [reading level, levelAfter 1, levelAfter 0.5, levelAfter 9])
      `shouldReturn` ("returned \"abbc\"", 10.5)

  it "is recorded at the times of its changes, whether it is read or not" $ do
    mock <- newMock
    _ <- condition mock "level" [(0, 'a'), (1, 'b'), (2, 'c'), (9, 'd')]
    act <- action mock "act" [succeeds `taking` 1.5]
    _ <- simulate (act >> act)
    timelineOf mock
      `shouldReturn` [ "0.0 s  level: is 'a'"
                     , "0.0 s  act: begins"
                     , "1.0 s  level: becomes 'b'"
                     , "1.5 s  act: done"
                     , "1.5 s  act: begins (call 2)"
                     , "2.0 s  level: becomes 'c'"
                     , "3.0 s  act: done (call 2)"
                     ]

  it "fails while there is no value" $
    for_ [(0, none), (1, "returned 'a'"), (2, none)] $ \(t, end) -> do
      mock <- newMock
      level <- partialCondition mock "level" [(1, Just 'a'), (2, Nothing)]
      runSimulated (begin mock >> sleep t >> reading level) `shouldReturn` (end, t)

  it "can change for ever" $ do
    mock <- newMock
    tick <- condition mock "tick" (zip (iterate (+ 1) 0) (cycle "ab"))
    runSimulated (begin mock >> sleep 1001 >> reading tick) `shouldReturn` ("returned 'b'", 1001)
    countOf (becoming "tick" 'a') <$> happened mock `shouldReturn` 501
 where
  none = "failed FailedBecause \"level has no value\""

watched :: Spec
watched = do
  it "wakes its operator at each change" $ do
    mock <- newMock
    low <- condition mock "low" [(0, False), (5, True), (8, False)]
    tidy <- action mock "tidy" [hangs `slowToStop` 1, returning 'x']
    recharge <- action mock "recharge" [succeeds `taking` 4]
    runSimulated (Signal.monitor (signal low) recharge tidy) `shouldReturn` ("returned 'x'", 10)
    timelineOf mock
      `shouldReturn` [ " 0.0 s  low: is False"
                     , " 0.0 s  tidy: begins"
                     , " 5.0 s  low: becomes True"
                     , " 5.0 s  tidy: stop requested"
                     , " 6.0 s  tidy: has stopped"
                     , " 6.0 s  recharge: begins"
                     , " 8.0 s  low: becomes False"
                     , "10.0 s  recharge: done"
                     , "10.0 s  tidy: begins (call 2)"
                     , "10.0 s  tidy: done (call 2)"
                     ]

  it "is up to date when it is read again, under every schedule" $
    for_ [1 .. 100] $ \seed -> do
      mock <- newMock
      low <- condition mock "low" [(0, True), (1, False), (3, True)]
      recharge <- action mock "recharge" [succeeds `taking` 2]
      tidy <- action mock "tidy" [succeeds `taking` 0.5]
      r <- simulateWith defaultSimOptions {scheduled = Seeded seed} (Signal.monitor (signal low) recharge tidy)
      finished r `shouldBe` 2.5
      mock `shouldRecord` exactly 1 (startOf "recharge")

  it "waits for its first value, and fails its operator when it has no value any more" $ do
    mock <- newMock
    level <- partialCondition mock "level" [(1, Just 'a'), (2, Nothing)]
    runSimulated (Signal.waitUntil ((== 'b') <$> signal level))
      `shouldReturn` ("failed FailedBecause \"level has no value any more\"", 2)

  it "starts no thread that outlives its operator, and none when it will not change" $ do
    mock <- newMock
    low <- condition mock "low" [(0, False), (3600, True)]
    leavingNothing (Signal.rSelect (signal low) (pure 'l') (pure 'r')) `shouldReturn` 'r'
    wet <- newMock >>= \another -> condition another "wet" [(0, True)]
    ran <- simulate (Signal.waitUntil (signal wet))
    [Sim.stepLabel step | step <- Sim.steps ran, Sim.stepKind step == Sim.Starts]
      `shouldNotContain` [Label "waitUntil" "clock"]
    cold <- newMock >>= \another -> condition another "cold" [(0, False), (1, True)]
    other <- simulate (Signal.waitUntil (signal cold))
    [Sim.stepLabel step | step <- Sim.steps other, Sim.stepKind step == Sim.Starts]
      `shouldContain` [Label "waitUntil" "clock"]

  it "works when the clock of the world was started late, with any rounding" $
    for_ [0.1, 0.7, 1 / 3, 1e6 + 0.1] $ \t -> do
      mock <- newMock
      low <- condition mock "low" [(0, False), (0.1, False), (0.2, False), (0.3, True)]
      runSimulated (sleep t >> begin mock >> Signal.waitUntil (signal low)) `shouldReturn` ("returned ()", t + 0.3)

setting :: Spec
setting = do
  it "has the value that was set, until its next change" $ do
    mock <- newMock
    door <- condition mock "door" [(0, "shut"), (2, "ajar")]
    runSimulated (sequence [set door "open" >> reading door, sleep 1 >> reading door, sleep 1 >> reading door])
      `shouldReturn` ("returned [\"open\",\"open\",\"ajar\"]", 2)

  it "wakes its watchers, and records only values that are different" $ do
    mock <- newMock
    wet <- condition mock "wet" [(0, False)]
    runSimulated (Signal.waitUntil (signal wet) `both` (set wet False >> sleep 1 >> set wet True))
      `shouldReturn` ("returned ()", 1)
    mock `shouldRecord` exactly 2 (anyOf [becoming "wet" False, becoming "wet" True])

  it "can lose its value" $ do
    mock <- newMock
    wet <- condition mock "wet" [(0, False)]
    runSimulated (Signal.waitUntil (signal wet) `both` (sleep 1 >> clear wet))
      `shouldReturn` ("failed FailedBecause \"wet has no value any more\"", 1)

worlds :: Spec
worlds = do
  it "has a clock that starts with the first record entry" $ do
    mock <- newMock
    act <- action mock "act" [succeeds]
    _ <- simulate (sleep 5 >> act >> sleep 1 >> note mock "over")
    map entryTime . recordEntries <$> happened mock `shouldReturn` [0, 0, 1]

  it "has a clock that can be started before that" $ do
    mock <- newMock
    act <- action mock "act" [succeeds]
    _ <- simulate (begin mock >> sleep 5 >> begin mock >> act)
    map entryTime . recordEntries <$> happened mock `shouldReturn` [5, 5]

  it "works on real threads" $ do
    mock <- newMock
    act <- action mock "act" [succeeds `taking` 0.002]
    low <- condition mock "low" [(0, False), (0.001, True)]
    begun <- now
    Signal.waitUntil (signal low) `both` act
    over <- now
    over - begun `shouldSatisfy` (>= 0.002)
    mock `shouldRecord` becoming "low" True `comesBefore` successOf "act"
    map entryTime . filter ((== "low") . entrySubject) . recordEntries <$> happened mock `shouldReturn` [0, 0.001]

  it "reports why a claim does not hold" $ do
    mock <- newMock
    act <- action mock "act" [succeeds]
    _ <- simulate act
    let report =
          [ "This does not hold: never \"act\" is done."
          , "It was so at 0.0 s:"
          , "    0.0 s  act: begins"
          , "  > 0.0 s  act: done"
          ]
        isReported claim = (mock `shouldRecord` claim) `shouldThrow` \(BrokenClaim why) -> lines why == report
    isReported (never (successOf "act"))
    -- Of several, the one that does not hold.
    isReported (eventually (startOf "act") <> never (successOf "act") <> exactly 2 (startOf "act"))

refusals :: Spec
refusals = do
  it "is an action without a script" $ do
    mock <- newMock
    (action mock "act" [] :: IO (Behavior ()))
      `refused` "action \"act\": at least one script is needed; the last one repeats for ever"
    (sensor mock "camera" [] :: IO (Behavior ()))
      `refused` "sensor \"camera\": at least one script is needed; the last one repeats for ever"
    open <- actionOn mock "open" (\_ -> [] :: [Script ()])
    open 'x' `refused` "action \"open 'x'\": at least one script is needed; the last one repeats for ever"

  it "is an invalid duration" $ do
    mock <- newMock
    action mock "act" [succeeds, succeeds `taking` (-1)]
      `refused` "action \"act\": a duration is zero or more seconds, not -1.0"
    action mock "act" [succeeds `taking` (0 / 0)]
      `refused` "action \"act\": a duration is zero or more seconds, not NaN"
    action mock "act" [succeeds `slowToStop` (-1)]
      `refused` "action \"act\": a duration is zero or more seconds, not -1.0"

  it "is a change at an invalid time, or out of order" $ do
    mock <- newMock
    let allowed = "condition \"low\": the times of the changes start from zero and increase; "
    condition mock "low" [(-1, True)] `refused` (allowed ++ "-1.0 is no such time")
    condition mock "low" [(0 / 0, True)] `refused` (allowed ++ "NaN is no such time")
    condition mock "low" [(0, True), (2, False), (2, True)] `refused` (allowed ++ "2.0 must not come after 2.0")

  it "is a name that is used twice" $ do
    mock <- newMock
    _ <- action mock "act" [succeeds]
    condition mock "act" [(0, 'x')] `refused` "condition \"act\": something else in this world has this name already"

  it "is a claim about an unknown name" $ do
    mock <- newMock
    _ <- action mock "act" [succeeds]
    begin mock
    (mock `shouldRecord` never (startOf "atc"))
      `shouldThrow` \(BrokenClaim why) -> "called \"atc\", only \"act\"" `isInfixOf` why
 where
  act `refused` why = act `shouldThrow` (== ErrorCall why)
