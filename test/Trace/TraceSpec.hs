{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Traces on real threads: names, parents, causes, and paths of failures.
module Trace.TraceSpec (spec) where

import Control.Concurrent (forkIO, myThreadId, yield)
import Control.Concurrent.Async (asyncThreadId, wait, withAsync)
import Control.Concurrent.STM (newTVarIO, readTVar, readTVarIO, retry, writeTVar)
import Control.Exception
import Control.Monad (void)
import Data.Foldable (for_, traverse_)
import Data.IORef (modifyIORef', newIORef, readIORef, writeIORef)
import Data.List (isPrefixOf)
import Data.Maybe (fromMaybe, listToMaybe)
import GHC.Conc (ThreadStatus (..), threadStatus)
import System.IO.Unsafe (unsafePerformIO)
import Test.Hspec

import Behavior
import Behavior.Internal.Seam.Runtime (liveThreadCount)
import Behavior.Internal.Spans.Place (Place (trace), Receiver (..), Trace (traceClock), inPlace, myPlace, withReceiver)
import Behavior.Internal.Spans.Span (abandonableIn, endOf)
import Behavior.Parallel (allOf, await, decide, firstOf, fork, requestStop, scoped, tryAwait)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (SimOptions (scheduled), Run (events), Schedule (..), defaultSimOptions, simulateWith)
import Behavior.Time (abandoning, cleanupWithin, timeout)
import Behavior.Trace
import Memory (inConstantMemory)
import Places
import Support hiding (End, Ending (..), Failure, ThreadEvent (..), notes, within)
import qualified Support
import Trace.Traced

spec :: Spec
spec = guarded $ do
  describe "named" naming
  describe "The parent of a span" parents
  describe "A span that was stopped says why:" causes
  describe "A reaction" reactions
  describe "withTrace" tracing

naming :: Spec
naming = do
  for_ [("without a trace", False), ("in a trace", True)] $ \(situation, isOn) -> describe situation $ do
    let traced :: Behavior a -> Behavior a
        traced act = if isOn then withTrace [] act else act
    it "gives the result, and throws what the behaviour throws" $ do
      traced (named "n" (pure 'a')) `shouldReturn` 'a'
      ending (traced (named "n" (throwIO (Fault "bug") :: IO Char)))
        `shouldReturn` Support.FaultedWith (show (Fault "bug"))
      traced (named "n" (failWith "locked" :: IO ())) `shouldThrow` (== FailedBecause "locked")
      traced (named "n" (throwIO (Cancel "caller") :: IO ())) `shouldThrow` (== Cancel "caller")

    it "keeps the caller's masking state" $
      for_ [(id, Unmasked), (mask_, MaskedInterruptible), (uninterruptibleMask_, MaskedUninterruptible)] $
        \(inState, state) ->
          inState (traced (named "n" (named "m" getMaskingState))) `shouldReturn` state

  it "is a tail call without a trace: a million, one in the other, in constant memory" $
    inConstantMemory 1000000 $ \step ->
      let loop n = named "n" (step >> if n > (1000000 :: Int) then pure () else loop (n + 1)) in loop 0

  it "takes constant memory in a trace, if what is in a loop has the name" $
    inConstantMemory 100000 $ \step -> withTrace [] . for_ [0 .. 100000 :: Int] . const $ named "n" step

  it "adds the path to a failure, once, which is caught as before" $ do
    let locked = named "mission" (named "enter room" (named "front door" (failWith "locked")))
    (_, seen) <- (,) () <$> try (withTrace [] locked)
    either failurePath (\() -> []) seen `shouldBe` ["mission", "enter room", "front door"]
    either displayException (\() -> "") (seen :: Either BehaviorFailed ())
      `shouldBe` "mission > enter room > front door: the behaviour failed: locked"
    either show (\() -> "") seen `shouldBe` "mission > enter room > front door: FailedBecause \"locked\""
    withTrace [] locked `shouldThrow` (== FailedBecause "locked")
    withTrace [] (locked ? pure ()) `shouldReturn` ()
    plain <- try locked
    either failurePath (\() -> ["none"]) plain `shouldBe` []

  it "can be shown with its path, whatever the texts of the names are" $
    for_ [(throw (Fault "no name"), "<its text"), ('b' : throw ThreadKilled, "b<its text"), (cycle "b", "bbbb")] $
      \(name, expected) -> do
        failure <- try (withTrace [] (named "a" (named name (failWith "locked"))))
        for_ (either (\e -> [show e, displayException (e :: BehaviorFailed)]) (\() -> []) failure) $ \text -> do
          text `shouldStartWith` ("a > " ++ expected)
          text `shouldContain` ": "
          text `shouldContain` "locked"

  it "adds the path also to what a branch, or a time limit, fails with" $ do
    seen <- try (withTrace [] (named "a" (both hang (named "b" failed))))
    either failurePath (\() -> []) seen `shouldBe` ["a", "b"]
    limited <- try (withTrace [] (named "a" (timeout 0.001 (named "b" hang))))
    either failurePath (\() -> []) limited `shouldBe` ["a"]

parents :: Spec
parents = do
  for_ places $ \place ->
    it ("is right in " ++ placeName place) $ do
      (_, seen) <- traceOf (named "outer" (placed place (named "inner" (pure ()))))
      parentsOf seen `shouldContain` [("inner", Just (if placeName place `elem` ownName then "name" else "outer"))]
      checkSpans seen

  it "is right in a sensor's reading, in a cleanup, and in what a failure leads to" $ do
    readings <- newTVarIO (0 :: Int)
    let reading = named "read" (atomically (readTVar readings >>= \n -> n <$ writeTVar readings (n + 1)))
    (_, seen) <- traceOf . named "outer" $ do
      Signal.waitUntil ((> 2) <$> Signal.polling 0.001 reading)
      begun <- newGate
      named "task" (Support.open begun >> hang) `finally` named "cleanup" (pure ()) ||| pass begun
      named "try" failed ? named "recover" (pure ())
      hanging <- newGate
      (Support.open hanging >> hang) `onException` cleanupWithin 1 (named "park" (pure ())) ||| pass hanging
    for_ ["read", "task", "cleanup", "try", "recover", "park"] $ \name ->
      parentsOf seen `shouldContain` [(name, Just "outer")]
    checkSpans seen

  it "is that of the scope, for what is forked" $ do
    (_, seen) <- traceOf . named "outer" . scoped $ \nursery -> do
      child <- named "starts" (fork nursery (named "child" (pure ())))
      atomically (await child)
    parentsOf seen `shouldContain` [("child", Just "outer")]

  it "is right in operators within operators" $ do
    let nest = foldr (\n inner -> named ("level " ++ show n) (inner ||| hang)) (pure ()) [1 .. 10 :: Int]
    (_, seen) <- traceOf nest
    let parent n = if n == 1 then Nothing else Just ("level " ++ show (n - 1))
    parentsOf seen `shouldBe` [("level " ++ show n, parent n) | n <- [1 .. 10 :: Int]]
    checkSpans seen

  it "is unknown in a thread that this library does not start, unless it is adopted" $ do
    done <- newGate
    adopted <- newGate
    (_, seen) <- traceOf . named "outer" $ do
      _ <- forkIO (named "stray" (named "inside" (pure ())) >> Support.open done)
      pass done
      here <- adopt
      _ <- forkIO (here (named "adopted" (pure ())) >> Support.open adopted)
      pass adopted
    [spanParent s | Began s <- seen, spanName s == "stray"] `shouldBe` [UnknownParent]
    parentsOf seen `shouldContain` [("inside", Just "stray")]
    parentsOf seen `shouldContain` [("adopted", Just "outer")]

  it "is in the trace around it, of two that are made at the same time" $ do
    inOne <- newGate
    inOther <- newGate
    let half mine theirs name =
          snd <$> traceOf (named name (Support.open mine >> pass theirs >> named (name ++ "'s") (pure ())))
    seen <- allOf [half inOne inOther "one", half inOther inOne "other"]
    map parentsOf seen
      `shouldBe` [[("one", Nothing), ("one's", Just "one")], [("other", Nothing), ("other's", Just "other")]]

  it "is in both traces, of a trace inside another" $ do
    inner <- newIORef []
    (_, outerSeen) <- traceOf . named "outer" $ do
      (_, seen) <- traceOf (named "inner" (both (named "deep" (pure ())) (pure ())))
      modifyIORef' inner (const seen)
    innerSeen <- readIORef inner
    parentsOf outerSeen `shouldBe` [("outer", Nothing), ("inner", Just "outer"), ("deep", Just "inner")]
    parentsOf innerSeen `shouldBe` [("inner", Nothing), ("deep", Just "inner")]
    checkSpans outerSeen
    checkSpans innerSeen
 where
  ownName = ["named", "named, in a trace"]

causes :: Spec
causes = do
  cause "the left sibling finished" (\begun stoppable -> pass begun ||| stoppable) (SiblingFinished "left")
  cause
    "the right sibling failed"
    (\begun stoppable -> both stoppable (pass begun >> failed) ? pure ())
    (SiblingFailed "right")
  cause
    "the right sibling of parallel failed"
    (\begun stoppable -> (stoppable ||| (pass begun >> failed)) ? pure ())
    (SiblingFailed "right")
  cause "the third sibling finished" (\begun stoppable -> firstOf [stoppable, hang, pass begun]) (SiblingFinished "3")
  cause
    "the second sibling failed"
    (\begun stoppable -> void (allOf [stoppable, pass begun >> failed]) ? pure ())
    (SiblingFailed "2")
  cause "a time limit" (\_ stoppable -> timeout 0.1 stoppable ? pure ()) (TimeLimit 0.1)
  let onResult ends = listToMaybe [pure () | Just (Right ()) <- ends]
      onFailure ends = listToMaybe [pure () | Just (Left _) <- ends]
  cause
    "decide was certain because of a result"
    (\begun stoppable -> decide onResult [stoppable, pass begun, hang])
    (SiblingFinished "2")
  cause
    "decide was certain because of a failure"
    (\begun stoppable -> decide onFailure [stoppable, hang, pass begun >> failed])
    (SiblingFailed "3")
  cause
    "what is forked ends with its scope"
    (\begun stoppable -> scoped (\nursery -> fork nursery stoppable >> pass begun))
    (SiblingFinished "body")
  let stopped begun c = pass begun >> requestStop c >> untilStopped c
  cause
    "requestStop"
    (\begun stoppable -> scoped (\nursery -> fork nursery stoppable >>= stopped begun))
    (FromOutside "requestStop")
  cause
    "a cancellation from outside, also deep inside"
    (\begun stoppable -> cancelledFrom begun (both hang (firstOf [stoppable])))
    (FromOutside (show (Cancel "user")))
  cause
    "the outermost reason, for what is nested"
    (\_ stoppable -> timeout 0.1 (both hang (firstOf [stoppable])) ? pure ())
    (TimeLimit 0.1)

  it "a signal changed: with the values that the operator read" $ do
    level <- newTVarIO (100 :: Int)
    let battery = Signal.named "battery" (Signal.watching (readTVar level))
        low = Signal.named "battery low" ((< 10) <$> battery)
    (_, seen) <- traceOf $ Signal.insteadWhen low (pure ()) (named "drive" (atomically (writeTVar level 9) >> hang))
    [c | Ended s _ (StoppedBy c) <- seen, spanName s == "drive"]
      `shouldBe` [ SignalChanged
                    (reactionIn seen)
                    [Change "battery" (Just "100") "9", Change "battery low" (Just "False") "True"]
                 ]

  it "it was abandoned, and what begins in it later has no parent" $ do
    mayEnd <- newGate
    over <- newGate
    living <- liveThreadCount
    (_, seen) <- traceOf . named "outer" $ do
      begun <- newGate
      let deep = named "deep" (Support.open begun >> pass mayEnd)
          stuck = named "stuck" deep >> named "later" (pure ()) >> Support.open over
      abandoning 0.001 (uninterruptibleMask_ stuck) ||| pass begun
      Support.open mayEnd
      pass over
    [(spanName s, c) | Ended s _ (StoppedBy c) <- seen] `shouldBe` [("deep", WasAbandoned), ("stuck", WasAbandoned)]
    [spanParent s | Began s <- seen, spanName s == "later"] `shouldBe` [UnknownParent]
    checkSpans seen
    eventually ((== living) <$> liveThreadCount)

  it "it was abandoned, though a branch that it runs in is abandoned, too" $ do
    mayEnd <- newGate
    over <- newGate
    living <- liveThreadCount
    (_, seen) <- traceOf . named "outer" $ do
      begun <- newGate
      let deep = named "deep" (Support.open begun >> pass mayEnd)
          inner = abandoning 0.01 (uninterruptibleMask_ deep) `finally` Support.open over
      abandoning 0.001 inner ||| pass begun
      pass over
    [(spanName s, c) | Ended s _ (StoppedBy c) <- seen] `shouldBe` [("deep", WasAbandoned)]
    checkSpans seen
    Support.open mayEnd
    eventually ((== living) <$> liveThreadCount)

  it "it was abandoned, also at the moment when it begins" $ do
    seen <- newIORef []
    abandon <- newIORef (pure ())
    let receive event = do
          case event of
            Began s | spanName s == "stuck" -> readIORef abandon >>= forkIO >>= untilNotRunning
            _ -> pure ()
          modifyIORef' seen (event :)
    withTrace [] . named "outer" $ do
      place <- myPlace >>= maybe (throwIO (Fault "there is no trace")) pure
      mask_ . inPlace (Just place {trace = withReceiver (Receiver 1 False receive) (trace place)}) $ do
        (stuck, abandoned) <- abandonableIn ((\here -> inPlace here (named "stuck" (pure ()))) <$> myPlace)
        writeIORef abandon abandoned
        stuck
    eventually ((== 2) . length <$> readIORef seen)
    reported <- reverse <$> readIORef seen
    [event | event <- reported, Began _ <- [event]] `shouldBe` take 1 reported
    [(spanName s, end) | Ended s _ end <- drop 1 reported] `shouldBe` [("stuck", StoppedBy WasAbandoned)]
 where
  cause what act expected =
    it what $ do
      begun <- newGate
      (_, seen) <- traceOf (act begun (named "stoppable" (Support.open begun >> hang)))
      [c | Ended s _ (StoppedBy c) <- seen, spanName s == "stoppable"] `shouldBe` [expected]
  untilNotRunning thread =
    threadStatus thread >>= \status ->
      if status == ThreadRunning then yield >> untilNotRunning thread else pure ()
  untilStopped child = atomically (void (tryAwait child >>= maybe retry pure))
  cancelledFrom begun act = try (cancellingSelf (pass begun) act) >>= either (\(Cancel _) -> pure ()) pure

-- | Runs the behaviour in a trace that was changed, with this receiver.
receivedBy :: (Trace -> Trace) -> (Event -> IO ()) -> Behavior a -> Behavior a
receivedBy change receive act = withTrace [] $ do
  place <- myPlace >>= maybe (throwIO (Fault "there is no trace")) pure
  mask $ \restore ->
    inPlace (Just place {trace = withReceiver (Receiver 1 False receive) (change (trace place))}) (restore act)

reactions :: Spec
reactions = do
  it "says what was stopped, after how long, and what it started" $ do
    level <- newTVarIO (100 :: Int)
    let low = Signal.named "low" ((< 10) <$> Signal.watching (readTVar level))
        recharge = named "recharge" (atomically (writeTVar level 100))
        drive = named "drive" $ do
          n <- atomically (readTVar level <* writeTVar level 5)
          if n == 100 then hang else pure ()
    once <- newTVarIO False
    let task = readTVarIO once >>= \again -> if again then pure () else atomically (writeTVar once True) >> drive
    (_, seen) <- traceOf (named "mission" (Signal.monitor low recharge task))
    let found = [r | Reacted r <- seen]
    [(reactionOperator r, reactionChanges r, stoppedName <$> reactionStopped r, reactionStarts r) | r <- found]
      `shouldBe` [ ("monitor", [Change "low" (Just "False") "True"], Just "task", Just "recovery")
                 , ("monitor", [Change "low" (Just "True") "False"], Nothing, Just "task")
                 ]
    [spanReaction s | Began s <- seen, spanName s == "recharge"] `shouldBe` map (Just . reactionNumber) (take 1 found)
    [reactionParent r | r <- found]
      `shouldBe` [Inside n | _ <- found, Began s <- seen, spanName s == "mission", let n = spanNumber s]

  it "reaches all receivers, whatever interrupts the operator: they are called masked" $ do
    states <- newIORef []
    low <- newTVarIO False
    receivedBy id (const (getMaskingState >>= \state -> modifyIORef' states (state :))) $
      let fly = named "fly" (atomically (writeTVar low True) >> hang)
       in Signal.insteadWhen (Signal.watching (readTVar low)) (named "land" (pure ())) fly
    length <$> readIORef states `shouldReturn` 5
    readIORef states >>= (`shouldSatisfy` notElem Unmasked)

  it "is reported, although the operator is cancelled when the branch has just stopped" $ do
    stopped <- newIORef False
    seen <- newIORef []
    low <- newTVarIO False
    -- The clock is read by the operator, before it stops the branch and after that.
    let clock = readIORef stopped >>= \is -> if is then myThreadId >>= (`throwTo` Cancel "caller") else pure ()
        fly = (atomically (writeTVar low True) >> hang) `finally` writeIORef stopped True
    receivedBy
      (\t -> t {traceClock = 0 <$ clock})
      (\event -> modifyIORef' seen (event :))
      (Signal.insteadWhen (Signal.watching (readTVar low)) (pure ()) fly)
      `shouldThrow` (== Cancel "caller")
    found <- readIORef seen
    [reactionOperator r | Reacted r <- found] `shouldBe` ["insteadWhen"]

  it "loses no cancellation of the operator that comes while it looks how the branch has ended" $ do
    looking <- newGate
    goingOn <- newGate
    let thrown = unsafePerformIO (toException (userError "jammed") <$ (open looking >> pass goingOn))
    withThread (endOf (Left thrown :: Either SomeException ())) $ \operator -> do
      pass looking
      throwing (asyncThreadId operator) (Cancel "caller")
      open goingOn
      awaitEnd operator `shouldReturn` Support.CancelledBy (show (Cancel "caller"))

  it "is not reported when an operator only begins" $ do
    (_, seen) <-
      traceOf (Signal.monitor (pure False) (pure ()) (pure ()) >> Signal.rSelect (pure True) (pure ()) (pure ()))
    [() | Reacted _ <- seen] `shouldBe` []

  it "is reported when an operator ends at its first reading" $ do
    (_, seen) <- traceOf (Signal.waitUntil (Signal.named "calm" (pure True)))
    [(reactionChanges r, reactionStopped r, reactionStarts r) | Reacted r <- seen]
      `shouldBe` [([Change "calm" Nothing "True"], Nothing, Nothing)]

  it "has the values of the transaction that decided, whatever changes them afterwards" $
    for_ [1 .. 200] $ \seed -> do
      run <- simulateWith defaultSimOptions {scheduled = Seeded seed} $ do
        level <- newTVarIO (0 :: Int)
        let high = (> 0) <$> Signal.named "level" (Signal.watching (readTVar level))
            set = atomically . writeTVar level
            later n = sleep 1 >> set n >> sleep 9
        firstOf [Signal.rSelect high (sleep 9) (sleep 9), later 1, later 0, later 2, later 0]
      [c | Reacted r <- events run, c <- reactionChanges r, (changeBefore c == Just "0") == (changeAfter c == "0")]
        `shouldBe` []

  it "shows two signals of the same name, each with its own values" $ do
    left <- newTVarIO (1 :: Int)
    right <- newTVarIO (2 :: Int)
    let wheel = Signal.named "wheel" . Signal.watching . readTVar
        bothStopped = (\l r -> l == 0 && r == 0) <$> wheel left <*> wheel right
    let changing = atomically (mapM_ (`writeTVar` 0) [left, right]) >> hang
    (_, seen) <- traceOf (Signal.insteadWhen bothStopped (pure ()) changing)
    [reactionChanges r | Reacted r <- seen] `shouldBe` [[Change "wheel" (Just "1") "0", Change "wheel" (Just "2") "0"]]

  it "gives a condition without a name a name" $ do
    level <- newTVarIO False
    let changing = atomically (writeTVar level True) >> hang
    (_, seen) <- traceOf (Signal.insteadWhen (Signal.watching (readTVar level)) (pure ()) changing)
    [reactionChanges r | Reacted r <- seen] `shouldBe` [[Change "condition" (Just "False") "True"]]

  it "shows names and values wherever the trace begins" $ do
    let begun = summary . snd <$> tracedWith defaultTraceOptions {withOperators = True} reacting
        summary seen = ([reactionChanges r | Reacted r <- seen], parentsOf seen)
        inPlaceOf wrapped = do
          seen <- newTVarIO ([], [])
          () <- wrapped (begun >>= atomically . writeTVar seen)
          readTVarIO seen
    expected <- begun
    fst expected
      `shouldBe` [ [Change "battery" (Just "100") "5", Change "low" (Just "False") "True"]
                 , [Change "condition" (Just "False") "True"]
                 , [Change "battery" (Just "1") "0"]
                 ]
    for_ places $ \place ->
      (,) (placeName place) <$> inPlaceOf (placed place) `shouldReturn` (placeName place, expected)
    inPlaceOf (\act -> newTVarIO [()] >>= (`resumable` const act)) `shouldReturn` expected
    inPlaceOf (\act -> withTrace [] (named "outer" (adopt >>= \here -> withAsync (here act) wait)))
      `shouldReturn` expected

  it "shows names and values also of signals that were shared before the trace began" $
    for_
      [ ("a signal", id)
      , ("a filter", Signal.debounce 0)
      , ("a filter that remembers", fmap (> 0) . Signal.changes)
      ]
      $ \(_ :: String, filtered) -> for_ [Signal.watching . readTVar, Signal.polling 0.001 . readTVarIO] $ \source -> do
        let watched level =
              Signal.named "low" (filtered ((< 10) <$> Signal.named "battery" (source level)))
            drive level low = Signal.insteadWhen low (pure ()) (atomically (writeTVar level 5) >> hang)
            changed (_, seen) = [reactionChanges r | Reacted r <- seen]
        level <- newTVarIO (100 :: Int)
        inside <- changed <$> Signal.withShared (watched level) (traceOf . drive level)
        atomically (writeTVar level 100)
        outside <- changed <$> traceOf (Signal.withShared (watched level) (drive level))
        inside `shouldBe` [[Change "battery" (Just "100") "5", Change "low" (Just "False") "True"]]
        outside `shouldBe` inside

  it "names of ordered rules those whose conditions have changed, and decide" $ do
    run <- simulateWith defaultSimOptions $ do
      danger <- newTVarIO (0 :: Int)
      order <- newTVarIO 0
      rain <- newTVarIO 0
      let rule name variable =
            Signal.named name ((> 0) <$> Signal.named (name ++ " level") (Signal.watching (readTVar variable)))
          steps =
            [ [(order, 1)]
            , [(rain, 5), (danger, 1)]
            , [(order, 2), (rain, 7)]
            , [(danger, 0)]
            , [(order, 0)]
            , [(rain, 0)]
            ]
          changing = for_ steps $ \sets ->
            sleep 1 >> atomically (traverse_ (uncurry writeTVar) sets)
      Signal.teleoReactive
        [ (rule "danger" danger, hang)
        , (rule "order" order, hang)
        , ((> 0) <$> Signal.watching (readTVar rain), hang)
        , (pure True, hang)
        ]
        ||| (changing >> sleep 1)
    let changedTo :: String -> Int -> Int -> [Change]
        changedTo name was now =
          [ Change (name ++ " level") (Just (show was)) (show now)
          , Change name (Just (show (was > 0))) (show (now > 0))
          ]
    [(reactionChanges r, reactionStarts r) | Reacted r <- events run]
      `shouldBe` [ (changedTo "order" 0 1, Just "rule 2")
                 , (changedTo "danger" 0 1, Just "rule 1")
                 , (changedTo "danger" 1 0, Just "rule 2")
                 , (changedTo "order" 2 0, Just "rule 3")
                 , ([Change "condition 3" (Just "True") "False"], Just "rule 4")
                 ]

-- | Three operators, each of which reacts to one change.
reacting :: Behavior ()
reacting = do
  level <- newTVarIO (100 :: Int)
  let watched = Signal.watching (readTVar level)
      battery = Signal.named "battery" watched
      falling n = atomically (writeTVar level n) >> hang
  Signal.insteadWhen (Signal.named "low" ((< 10) <$> battery)) (pure ()) (falling 5)
  Signal.insteadWhen ((< 3) <$> watched) (pure ()) (falling 1)
  Signal.teleoReactive [((< 1) <$> battery, pure ()), (pure True, falling 0)]

tracing :: Spec
tracing = do
  it "has no operators and branches, unless they are asked for" $ do
    let act = named "n" (both (pure ()) (pure ()))
    (_, seen) <- traceOf act
    [spanName s | Began s <- seen] `shouldBe` ["n"]
    (_, detailed) <- tracedWith defaultTraceOptions {withOperators = True} act
    take 2 [spanName s | Began s <- detailed] `shouldBe` ["n", "both"]
    drop 2 [spanName s | Began s <- detailed] `shouldMatchList` ["both: left", "both: right"]
    checkSpans detailed

  it "numbers spans from 1" $ do
    (_, seen) <- traceOf (named "a" (pure ()) >> named "b" (pure ()))
    [spanNumber s | Began s <- seen] `shouldBe` [1, 2]

  it "refuses a time that is negative or NaN, and runs nothing" $
    for_ [-1, 0 / 0] $ \wrong ->
      withTraceOptions defaultTraceOptions {waitAtEnd = wrong} [] (throwIO (Fault "ran") :: IO ())
        `shouldThrow` \(ErrorCall text) -> "withTrace: waitAtEnd: " `isPrefixOf` text

-- | The number of the first reaction.
reactionIn :: [Event] -> Int
reactionIn seen = fromMaybe 0 (listToMaybe [reactionNumber r | Reacted r <- seen])
