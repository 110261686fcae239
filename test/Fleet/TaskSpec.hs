{-# LANGUAGE GADTs #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE RankNTypes #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Tasks on a fake database: started at least once, completed exactly once.
module Fleet.TaskSpec (spec) where

import Control.Exception (ErrorCall (..), finally, throwIO, try)
import Control.Monad (forever, replicateM_, void, when)
import Data.Aeson (Value (..))
import Data.Foldable (for_)
import Data.IORef
import Data.Maybe (isJust)
import Test.Hspec

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Fake
import Behavior.Fleet.Internal.Contract (Refusal (..), Request (..))
import Behavior.Fleet.Internal.Database (Database (..), Session (..))
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Parallel (firstOf)
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim (explore, randomly, simulate, well)
import Behavior.Time (now, sleepForever, sleepUntil, timeout)

spec :: Spec
spec = do
  describe "Tasks" $ do
    it "start in the order of their priorities, then of their submission" $
      carried (\fleet -> do
        for_ ["a", "b"] (submitting fleet defaultSubmitOptions)
        submitting fleet defaultSubmitOptions {taskPriority = 1} "c")
        `shouldReturn` ["c", "a", "b"]

    it "start only on a robot that is capable of all that they need" $ do
      let needing fleet what = submitting fleet defaultSubmitOptions {taskNeeds = what}
      carried (\fleet -> needing fleet ["arm"] "a" >> needing fleet ["lift"] "b" >> needing fleet ["arm", "lift"] "c")
        `shouldReturn` ["b"]

    it "do not start before their time, nor after their deadline" $ do
      (times, found) <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions {startAfter = Just 7} "a"
        submitting fleet defaultSubmitOptions {startAfter = Just 3, startWithin = Just 1} "b"
        begun <- newIORef []
        serves fleet 20 $ \work -> do
          time <- now
          pure () <$ modifyIORef' begun ((workKey work, time) :)
        (,) <$> readIORef begun <*> states fake
      times `shouldBe` [("a", 7)]
      found `shouldBe` [("a", Done), ("b", Dead)]

    it "are the same with the same key" $
      carried (\fleet -> replicateM_ 3 (submitting fleet defaultSubmitOptions "a")) `shouldReturn` ["a"]

    it "with the same key and another input are refused" $
      day (\_ fleet -> do
        submitting fleet defaultSubmitOptions "a"
        void (submit fleet orders "a" 2))
        `shouldThrow` errorCall
          "it failed: the key 'a' of the queue 'orders' is that of a task with another input or period"

    it "come back after growing pauses when they fail, and are dead when no pause is left" $ do
      (times, found, again) <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions {taskPauses = [1, 10]} "a"
        begun <- newIORef []
        serves fleet 30 $ \_ -> now >>= \time -> modifyIORef' begun (time :) >> failWith "it slips"
        dead <- map (\(_, _, task) -> task) <$> atomically (tasksThere fake)
        again <- retryTask fleet orders "a"
        serves fleet 5 $ \_ -> pure (pure ())
        (,,) <$> (reverse <$> readIORef begun) <*> pure dead <*> ((,) again <$> states fake)
      times `shouldBe` [0, 1, 11]
      found `shouldBe` [Task Dead 3 Nothing Nothing (replicate 3 "it slips")]
      again `shouldBe` (True, [("a", Done)])

    it "come back when they fault, and the fault is thrown" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        end <- tryAny (serves fleet 5 (\_ -> throwIO (ErrorCall "the arm")))
        there <- atomically (tasksThere fake)
        pure (either show show end, [(taskState task, taskReasons task) | (_, _, task) <- there])
      found `shouldBe` ("the arm", [(Later, ["the arm"])])

    it "that are stopped with their robot have failed" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        serves fleet 1 (\_ -> sleep 100 >> pure (pure ()))
        map (\(_, _, task) -> (taskState task, taskReasons task)) <$> atomically (tasksThere fake)
      found `shouldBe` [(Later, ["its robot was stopped"])]

    it "with a start that no robot waits for is given back, and that start does not count" $ do
      found <- day $ \fake fleet -> do
        -- (The answer comes when the robot has been stopped.)
        sleep 1
        submitting fleet defaultSubmitOptions "a"
        atomically (willAnswer fake [After 1])
        serves fleet 0.5 (\_ -> pure (pure ()))
        sleep 1
        map (\(_, _, task) -> (taskState task, taskStarts task)) <$> atomically (tasksThere fake)
      found `shouldBe` [(Waiting, 0)]

    it "that are started, and the answer is lost, are started no second time" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions {taskPauses = []} "a"
        begun <- newIORef (0 :: Int)
        atomically (willAnswer fake [DoneAndLost, DoneAndLost])
        serves fleet 30 (\work -> pure () <$ modifyIORef' begun (+ workStart work))
        (,) <$> readIORef begun <*> states fake
      found `shouldBe` (1, [("a", Done)])

    it "whose result is refused fails alone, of those that are completed together" $ do
      found <- day $ \fake fleet -> do
        let words' = queue "words" :: Queue Int String
            work n = sleep (1 + fromIntegral n / 10) >> pure (pure (if n == 3 then "\0" else "done"))
            serve n = withRobot fleet (Robot ("robot " ++ show (n :: Int)) []) (\robot -> serving robot words' work)
        for_ [1 .. 3] (\n -> submit fleet words' (show n) n)
        -- (The second and the third are ready while the first is being completed.)
        let slowly = sleep 1.05 >> atomically (willAnswer fake [After 1])
        void (timeout 3 (firstOf (map serve [1 .. 3]) `both` slowly)) ? pure ()
        map (\(_, key, task) -> (key, taskState task, taskReasons task)) <$> atomically (tasksThere fake)
      found
        `shouldBe` [ ("1", Done, [])
                   , ("2", Done, [])
                   , ("3", Later, ["a text has no character U+0000: \"\\NUL\""])
                   ]

    it "may take longer than their leases" $
      day (\fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        serves fleet 100 (\_ -> sleep 95 >> pure (pure ()))
        map (\(_, _, task) -> (taskState task, taskStarts task)) <$> atomically (tasksThere fake))
        `shouldReturn` [(Done, 1)]

    it "are stopped at two thirds of the term when the database is away, and started again" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        stays <- newIORef []
        let work _ = do
              begun <- now
              (sleep 20 >> pure (pure ())) `finally` (now >>= \over -> modifyIORef' stays ((begun, over) :))
            reachable = atomically . setReachable fake
        serves fleet 60 work `both` (sleep 1 >> reachable False >> sleep 20 >> reachable True)
        (,) <$> (reverse <$> readIORef stays) <*> states fake
      found `shouldSatisfy` \(stays, ends) -> case stays of
        [(0, lost), (again, over)] ->
          lost > 6 && lost < 7 && again > 20 && over == again + 20 && ends == [("a", Done)]
        _ -> False

    it "are found by the next poll when their notice was lost" $ do
      begun <- newIORef 0
      _ <- day $ \fake fleet -> do
        atomically (losingNotices fake True)
        let work _ = now >>= \time -> pure () <$ writeIORef begun time
        serves fleet 12 work `both` (sleep 1 >> submitting fleet defaultSubmitOptions "a")
      readIORef begun >>= (`shouldSatisfy` \time -> time > 1 && time < 6)

    it "do not begin when the answer comes too late" $ do
      begun <- newIORef []
      startAnsweredAfter 1.8 2 $ \_ fleet ->
        serves fleet 20 (\_ -> now >>= \time -> pure () <$ modifyIORef' begun (time :))
      -- (Started at 1.9 s, lost when the answer comes at 2.8 s, and started again at the next poll after 3.9 s.)
      readIORef begun >>= (`shouldSatisfy` \case [time] -> time > 3.9 && time < 6.5; _ -> False)

    it "are waited for by robots for as long as the database is away" $ do
      found <- day $ \fake fleet -> do
        let reachable = atomically . setReachable fake
            away = sleep 1 >> reachable False >> sleep 200 >> reachable True
        serves fleet 210 (\_ -> pure (pure ())) `both` (away >> submitting fleet defaultSubmitOptions "a")
        states fake
      found `shouldBe` [("a", Done)]

    it "have leases that count from before they were asked for" $ do
      stopped <- newIORef 0
      startAnsweredAfter 1.5 3 $ \fake fleet ->
        serves fleet 10 $ \_ -> do
          atomically (setReachable fake False)
          sleep 20 `finally` (now >>= writeIORef stopped)
          pure (pure ())
      readIORef stopped >>= (`shouldSatisfy` \time -> time >= 3 && time < 3.2)

    for_ [Busy, BadArgument "no"] $ \refusal ->
      it ("keep their leases while a resource of the same process cannot be kept: " ++ show refusal) $ do
        found <- simulate (do
          fake <- newFakeDatabase
          let answers :: Request r -> Behavior (Either Refusal r) -> Behavior (Either Refusal r)
              answers = \case Keep _ -> const (sleep 0.25 >> pure (Left refusal)); _ -> id
              holds fleet = failingOn isLeaseLost (holding fleet (resource "door") 30 (\_ -> sleep 40)) ? pure ()
          withFleet (through answers (fakeDatabase fake)) amy $ \fleet -> do
            submitting fleet defaultSubmitOptions "a"
            serves fleet 30 (\_ -> sleep 25 >> pure (pure ())) `both` holds fleet
            map (\(_, _, task) -> (taskState task, taskStarts task)) <$> atomically (tasksThere fake)) >>= well
        found `shouldBe` [(Done, 1)]

    it "are cancelled: at once while they wait, and a robot is stopped" $ do
      found <- day $ \fake fleet -> do
        for_ ["a", "b"] (submitting fleet defaultSubmitOptions)
        waiting <- cancelTask fleet orders "b"
        stopped <- newIORef 0
        let work _ = (sleep 40 >> pure (pure ())) `finally` (now >>= writeIORef stopped)
        serves fleet 50 work `both` (sleep 1 >> cancelTask fleet orders "a")
        (,,) waiting <$> states fake <*> readIORef stopped
      found `shouldBe` (Just Cancelled, [("a", Cancelled), ("b", Cancelled)], 1)

    it "are stopped at the next renewal when the database has given them to another robot" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        stopped <- newIORef []
        let work _ = (sleep 20 >> pure (pure ())) `finally` (now >>= \time -> modifyIORef' stopped (time :))
        -- (Its clock steps by more than the term.)
        serves fleet 60 work `both` (sleep 1 >> atomically (setClock fake (+ 20)))
        reverse <$> readIORef stopped
      found `shouldSatisfy` \case
        [first, second] -> first > 3 && first < 4 && second > 23
        _ -> False

    it "whose start is over when it reports its progress are stopped at once, and started again" $ do
      (found, ends) <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        stops <- newIORef []
        let work start = do
              sleep 2
              let says = reportProgress start (String "half") >> sleep 20
              pure () <$ says `finally` (now >>= \time -> modifyIORef' stops (time :))
            -- (Its clock steps by more than the term, and another process looks for what is over.)
            looks = withFleet (fakeDatabase fake) (Robot "bob" []) (\_ -> sleep 0.5)
            steps = sleep 1 >> atomically (setClock fake (+ 20)) >> looks
        serves fleet 60 work `both` steps
        (,) . reverse <$> readIORef stops <*> states fake
      found `shouldSatisfy` \case
        [first, second] -> first >= 2 && first < 2.1 && second > 23
        _ -> False
      ends `shouldBe` [("a", Done)]

    it "show their progress and their result to those who watch them" $ do
      found <- day $ \_ fleet -> do
        ticket <- submit fleet orders "a" 1
        let work start = reportProgress start (String "half") >> sleep 1 >> pure (pure ())
            half task = if taskState task == Running then Just <$> taskProgress task else Nothing
            done task = if taskState task == Done then Just (taskResult task) else Nothing
        watchingTask fleet ticket $ \task ->
          firstOf
            [ (,) <$> Signal.waitUntilJust (half <$> task) <*> Signal.waitUntilJust (done <$> task)
            , forever (serves fleet 100 work)
            ]
      found `shouldBe` (Just (String "half"), Just (Array mempty))

    it "give their result to those that wait for it, also elsewhere" $ do
      found <- day $ \_ fleet -> do
        let sums = queue "sums" :: Queue Int Int
        none <- isJust <$> findTask fleet sums "a"
        ticket <- submit fleet sums "a" 17
        Just same <- findTask fleet sums "a"
        firstOf
          [ (,,) none <$> waitForTask fleet ticket <*> waitForTask fleet same
          , forever (timeout 10 (serving fleet sums (pure . pure . (+ 1))))
          ]
      found `shouldBe` (False, 18, 18)

    it "that are dead or cancelled fail for those that wait for them, and are listed" $ do
      found <- day $ \_ fleet -> do
        for_ ["a", "b"] (submitting fleet defaultSubmitOptions {taskPauses = []})
        Just dead <- findTask fleet orders "a"
        Just cancelled <- findTask fleet orders "b"
        _ <- cancelTask fleet orders "b"
        serves fleet 5 (\_ -> failWith "it slips")
        ends <- traverse (tryAny . waitForTask fleet) [dead, cancelled]
        (,) (map (either show show) ends) . map (fmap taskReasons) <$> deadTasks fleet orders
      found
        `shouldBe` ( ["NotDone (Just Dead) [\"it slips\"]", "NotDone (Just Cancelled) []"]
                   , [("a", ["it slips"])]
                   )

    it "of several queues are started in turn" $ do
      found <- day $ \_ fleet -> do
        begun <- newIORef []
        let others = queue "others" :: Queue Int ()
            note' work = pure () <$ modifyIORef' begun (workKey work :)
        for_ ["a", "b", "c"] (submitting fleet defaultSubmitOptions)
        for_ ["d", "e", "f"] (\key -> submit fleet others key 1)
        void (timeout 5 (firstOf [servingWith fleet orders note', servingWith fleet others note'])) ? pure ()
        reverse <$> readIORef begun
      found `shouldBe` ["a", "d", "b", "e", "c", "f"]

    it "of several queues are started in turn, also while one always has a robot that waits" $ do
      begun <- newIORef []
      _ <- simulate (do
        fake <- newFakeDatabase
        withFleetOptions defaultFleetOptions {pollEvery = 1000} (fakeDatabase fake) amy $ \fleet ->
          withRobot fleet (Robot "bob" ["lift"]) $ \bob -> do
            let others = queue "others" :: Queue Int ()
                work start = do
                  modifyIORef' begun (workKey start :)
                  -- (When the database answers one of the two, the other one waits already.)
                  pure () <$ sleep (if workKey start == "b" then 0.019 else 0.009)
            for_ ["a", "b", "c", "d", "e", "f", "g", "h"] (submitting fleet defaultSubmitOptions)
            for_ ["1", "2"] (\key -> submit fleet others key 1)
            atomically (willAnswer fake (replicate 100 (After 0.01)))
            void (timeout 5 . firstOf $
              [servingWith fleet orders work, servingWith bob orders work, servingWith fleet others work]) ? pure ())
        >>= well
      sooner <- takeWhile (/= "2") . reverse <$> readIORef begun
      length sooner `shouldSatisfy` (< 6)

    it "that are periodic come again, until they are cancelled" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions {everyPeriod = Just 10} "a"
        begun <- newIORef []
        serves fleet 25 (\_ -> now >>= \time -> pure () <$ modifyIORef' begun (time :))
        _ <- cancelTask fleet orders "a"
        serves fleet 25 (\_ -> now >>= \time -> pure () <$ modifyIORef' begun (time :))
        (,) . reverse <$> readIORef begun <*> (map snd <$> states fake)
      found `shouldBe` ([0, 10, 20], [Done, Done, Done, Cancelled])

    it "have text without U+0000, and durations that are numbers" $ do
      let refused :: SubmitOptions -> String -> String -> Expectation
          refused chosen key why =
            day (\_ fleet -> submitting fleet chosen key) `shouldThrow` errorCall ("it failed: " ++ why)
      refused defaultSubmitOptions "a\0" "a text has no character U+0000: \"a\\NUL\""
      refused defaultSubmitOptions {taskPauses = [0 / 0]} "a" "a duration is a finite number of seconds, not NaN"
      refused defaultSubmitOptions {taskPauses = [-1]} "a" "a pause has 0 seconds to 10 years"
      refused defaultSubmitOptions {everyPeriod = Just 0.5} "a" "a period has 1 second to 10 years"
      refused defaultSubmitOptions {keepFor = -1} "a" "a task is kept for 0 seconds to 100 years"
      refused defaultSubmitOptions "" "a key has 1 to 200 characters"

    it "whose input is not what the robot expects have failed, and the robot goes on" $ do
      found <- day $ \fake fleet -> do
        let chosen = defaultSubmitOptions {taskPauses = []}
        _ <- submitWith chosen fleet (queue "orders" :: Queue String ()) "a" "seventeen"
        submitting fleet chosen "b"
        serves fleet 5 (\_ -> pure (pure ()))
        (,) <$> states fake <*> (map (taskReasons . snd) <$> deadTasks fleet orders)
      found
        `shouldBe` ( [("a", Dead), ("b", Done)]
                   , [ [ "its input is not what this robot expects: \
                         \parsing Int failed, expected Number, but encountered String"
                       ]
                     ]
                   )

  describe "What a task writes" $ do
    for_ [DoneAndLost, DoneWithoutAnswer, LostBefore, NoAnswer, LockNotFree] $ \answer ->
      it ("is there once, when the commit is answered so: " ++ show answer) $ do
        found <- day $ \fake fleet -> do
          submitting fleet defaultSubmitOptions "a"
          rows <- newTVarIO (0 :: Int)
          serves fleet 50 $ \_ -> do
            atomically (willAnswer fake [answer])
            pure (instead (modifyTVar' rows (+ 1)) (writing (\_ -> pure ())))
          (,) <$> readTVarIO rows <*> states fake
        found `shouldBe` (1, [("a", Done)])

    it "is not committed, if a lock is not free at four times" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions {taskPauses = []} "a"
        serves fleet 5 $ \_ -> do
          atomically (willAnswer fake (replicate 4 LockNotFree))
          pure (instead (pure ()) (writing (\_ -> pure ())))
        map (taskReasons . snd) <$> deadTasks fleet orders
      found `shouldBe` [["what the task writes could not be committed: a lock was not free in time"]]

    it "is not there, if its lease was lost" $ do
      found <- day $ \fake fleet -> do
        submitting fleet defaultSubmitOptions "a"
        rows <- newTVarIO (0 :: Int)
        isFirst <- newIORef True
        serves fleet 50 $ \_ -> do
          first <- readIORef isFirst
          when first $ writeIORef isFirst False >> runNewEpoch fake
          pure (instead (modifyTVar' rows (+ 1)) (writing (\_ -> pure ())))
        (,) <$> readTVarIO rows <*> states fake
      found `shouldBe` (1, [("a", Done)])

    it "is refused on a fake database, if that is not said what to do instead" $
      day (\_ fleet -> do
        submitting fleet defaultSubmitOptions "a"
        serves fleet 5 (\_ -> pure (writing (\_ -> pure ()))))
        `shouldThrow` errorCall
          "it faulted: writing: a fake database needs to know what is done instead: see 'instead'"

  it "A connection that is lost while a robot is stopped is not thrown" . void . explore (randomly 200) $ \simulated ->
    simulated (do
      fake <- newFakeDatabase
      withFleet (fakeDatabase fake) amy $ \fleet -> do
        submitting fleet defaultSubmitOptions "a"
        let work _ = do
              atomically (willAnswer fake [NoAnswer, NoAnswer])
              pure (instead (pure ()) (writing (\_ -> pure ())))
        -- (It is stopped at the same time.)
        serves fleet 0.4 work `both` (sleep 0.4 >> atomically (loseConnections fake))) >>= void . well

  it "Nor is one that is lost, as it is tried, while the fleet ends" . void . explore (randomly 300) $ \simulated ->
    simulated (do
      at <- fakeDatabase <$> newFakeDatabase
      (opened, asked) <- (,) <$> newTVarIO (0 :: Int) <*> newTVarIO (0 :: Int)
      let first count = atomically ((== 0) <$> readTVar count <* modifyTVar' count (+ 1))
          -- (The other one is not there: so this one is tried when it has been made.)
          lostLater session = session {ask = \what -> first asked >>= \is -> if is then ask session what else lost}
          lost = sleepUntil 1 >> throwIO (ConnectionLost "lost")
          one = at
            { opening = \limit use ->
                first opened >>= \is -> if is then opening at limit (use . lostLater) else sleepForever
            }
      withFleet one amy (\_ -> sleepUntil 1)) >>= void . well

  it "When one connection is lost, the other is tried at once" $ do
    reports <- newIORef []
    _ <- simulate (do
      fake <- newFakeDatabase
      let reported line = now >>= \time -> modifyIORef' reports ((time, line) :)
          chosen = defaultFleetOptions {pollEvery = 1000, onFleetReport = reported}
      withFleetOptions chosen (fakeDatabase fake) amy $ \fleet -> do
        sleep 1
        -- (It is frozen.)
        atomically (willAnswer fake [NoAnswer, NoAnswer])
        submitting fleet defaultSubmitOptions "a" `both` sleep 10) >>= well
    lost <- filter ((== "no connection for") . take 17 . snd) <$> readIORef reports
    reverse (map fst lost) `shouldSatisfy` \case
      [first, second] -> first >= 3 && first < 3.1 && second >= 5 && second < 5.2
      _ -> False

  it "What is asked is asked again when a lock was not free, without the loss of a connection" $ do
    reports <- newIORef []
    found <- simulate (do
      fake <- newFakeDatabase
      let chosen = defaultFleetOptions {noDatabaseAfter = 3, onFleetReport = \line -> modifyIORef' reports (line :)}
      withFleetOptions chosen (fakeDatabase fake) amy $ \fleet -> do
        sleep 1
        atomically (willAnswer fake (replicate 5 LockNotFree))
        submitting fleet defaultSubmitOptions "a"
        time <- now
        atomically (willAnswer fake (replicate 100 LockNotFree))
        (,) time <$> try (submitting fleet defaultSubmitOptions "b")) >>= well
    fst found `shouldSatisfy` \time -> time > 1.49 && time < 1.51
    snd found `shouldBe` Left (NoDatabase "the fake database" 3 "a lock was not free in time")
    readIORef reports `shouldReturn` []

  it "A robot has a name of 1 to 200 characters, and skills of 1 to 50, without U+0000" $ do
    let refused it' what = do
          let why = errorCall ("it failed: " ++ what)
              run act = simulate (newFakeDatabase >>= act . fakeDatabase) >>= well
          run (\db -> withFleet db it' (\_ -> pure ())) `shouldThrow` why
          run (\db -> withFleet db amy (\fleet -> withRobot fleet it' (\_ -> pure ()))) `shouldThrow` why
        name = "the name of a robot has 1 to 200 characters, and has no character U+0000: "
        skill = "a skill has 1 to 50 characters, and has no character U+0000: "
    refused (Robot "" []) (name ++ "\"\"")
    refused (Robot "a\0b" []) (name ++ "\"a\\NULb\"")
    refused (Robot (replicate 201 'r') []) (name ++ show (replicate 50 'r'))
    refused (Robot "amy" ["lift", ""]) (skill ++ "\"\"")
    refused (Robot "amy" ["a\0b"]) (skill ++ "\"a\\NULb\"")
    refused (Robot "amy" [replicate 51 's']) (skill ++ show (replicate 50 's'))

  it "What can be set is checked" $ do
    let refused chosen why = do
          run <- simulate $ do
            fake <- newFakeDatabase
            withFleetOptions chosen (fakeDatabase fake) amy (\_ -> pure ())
          well run `shouldThrow` errorCall ("it faulted: withFleetOptions: " ++ why)
    refused defaultFleetOptions {taskTerm = 0} "taskTerm is 0.0 s; allowed: 0.1 to 86400.0 s"
    refused defaultFleetOptions {pageAddress = Just "a\0b"}
      "pageAddress has the character U+0000; allowed: text without it"

  it "A database that was restored from a copy is refused, until there is a new epoch" $ do
    found <- day $ \fake fleet -> do
      copy <- atomically (copyDatabase fake)
      submitting fleet defaultSubmitOptions "a"
      serves fleet 1 (\_ -> pure (pure ()))
      atomically (restoreDatabase fake copy)
      sleep 1
      refused <- tryAny (submit fleet orders "b" 1)
      runNewEpoch fake
      submitting fleet defaultSubmitOptions "b"
      serves fleet 10 (\_ -> pure (pure ()))
      (,) (either show (const "") refused) <$> states fake
    found `shouldBe`
      ("RestoredFromCopy \"this database was restored from a copy: run behavior-fleet new-epoch\"", [("b", Done)])

  it "A task that is kept no more is not watched: that fails" $ do
    found <- day $ \_ fleet -> do
      ticket <- submitWith defaultSubmitOptions {keepFor = 0} fleet orders "a" 1
      serves fleet 10 (\_ -> pure (pure ()))
      either show (const "") <$> tryAny (watchingTask fleet ticket (Signal.waitUntil . fmap ((== Done) . taskState)))
    found `shouldBe` "NotDone Nothing []"

  it "A ticket of a database that was lost is that of no task of the restored one" $ do
    found <- day $ \fake fleet -> do
      copy <- atomically (copyDatabase fake)
      submitting fleet defaultSubmitOptions "first"
      serves fleet 1 (\_ -> pure (pure ()))
      mine <- submit fleet orders "mine" 1
      atomically (restoreDatabase fake copy)
      sleep 1
      let asks = map (fmap (either show (const "")) . tryAny)
      early <- sequence . asks $
        [waitForTask fleet mine, void (cancelTask fleet orders "mine"), void (retryTask fleet orders "mine")]
          ++ [void (findTask fleet orders "mine"), void (deadTasks fleet orders)]
      runNewEpoch fake
      mapM_ (submitting fleet defaultSubmitOptions) ["b", "c"]
      serves fleet 10 (\_ -> pure (pure ()))
      late <- sequence (asks [waitForTask fleet mine])
      (,,) (map (takeWhile (/= ' ')) early) late <$> states fake
    found `shouldBe` (replicate 5 "RestoredFromCopy", ["NotDone Nothing []"], [("b", Done), ("c", Done)])

amy :: Robot
amy = Robot "amy" ["lift"]

orders :: Queue Int ()
orders = queue "orders"

submitting :: Fleet -> SubmitOptions -> String -> Behavior ()
submitting fleet chosen key = void (submitWith chosen fleet orders key 1)

-- | A robot in a fleet, on a fake database.
day :: (FakeDatabase -> Fleet -> Behavior a) -> IO a
day = dayWith defaultFleetOptions

dayWith :: FleetOptions -> (FakeDatabase -> Fleet -> Behavior a) -> IO a
dayWith chosen act =
  simulate (newFakeDatabase >>= \fake -> withFleetOptions chosen (fakeDatabase fake) amy (act fake)) >>= well

-- | A day with that term, and with a task. Its start is asked for at 1 s, and answered after that long.
startAnsweredAfter :: Seconds -> Seconds -> (FakeDatabase -> Fleet -> Behavior ()) -> IO ()
startAnsweredAfter late lasts act =
  dayWith defaultFleetOptions {taskTerm = lasts} $ \fake fleet -> do
    sleep 1
    submitting fleet defaultSubmitOptions "a"
    atomically (willAnswer fake [After late])
    act fake fleet

-- | The database, where each request is answered so.
through :: (forall r. Request r -> Behavior (Either Refusal r) -> Behavior (Either Refusal r)) -> Database -> Database
through answers at = at {opening = \limit use -> opening at limit (use . over)}
 where
  over session = session {ask = \request -> answers request (ask session request)}

-- | Serves for that long.
serves :: Fleet -> Seconds -> (Work Int -> Behavior (Commit ())) -> Behavior ()
serves fleet seconds work = void (timeout seconds (servingWith fleet orders work)) ? pure ()

-- | The keys of the tasks that are started, in order, after these were submitted.
carried :: (Fleet -> Behavior ()) -> IO [String]
carried submits = day $ \_ fleet -> do
  submits fleet
  begun <- newIORef []
  serves fleet 20 (\work -> pure () <$ modifyIORef' begun (workKey work :))
  reverse <$> readIORef begun

states :: FakeDatabase -> Behavior [(String, TaskState)]
states fake = map (\(_, key, task) -> (key, taskState task)) <$> atomically (tasksThere fake)
