{-# LANGUAGE LambdaCase #-}

-- |
-- Traces of real threads. The names of spans say where they are in the text of a random program, whose
-- threads receive exceptions at random moments. Expected: each span has the parent that its name
-- says, ends once and before its parent does; traces do not mix; nothing is kept.
module Traces (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM_, replicateM_, unless, void, when)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.List (isInfixOf, isPrefixOf)
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)
import GHC.Stats (gc, gcdetails_live_bytes, getRTSStats)
import System.Mem (performMajorGC)
import System.Timeout (timeout)

import Attack
import Behavior
import Behavior.Message (handleNext, onMessage, withInbox)
import Behavior.Parallel (allOf, firstOf, fork, pinned, requestStop, scoped)
import qualified Behavior.Signal as Signal
import qualified Behavior.Time as Time
import Behavior.Trace

attack :: IO ()
attack = bracket getUncaughtExceptionHandler setUncaughtExceptionHandler $ \_ -> do
  -- (What 'Time.abandoning' reports is expected here.)
  setUncaughtExceptionHandler (\_ -> pure ())
  storms
  sideBySide
  threadsOfUsers
  sameResults
  memory
  deadlocks

-- | Random programs. In the name of a span, what is before the last slash is the name of the span
-- around it. What may be abandoned has a tilde in its name; what runs in a thread of 'forkIO' begins
-- with a question mark.
storms :: IO ()
storms = do
  below <- randomBelow 4711
  forM_ [1 .. 1500 :: Int] $ \k -> do
    nested <- newIORef []
    let leaf p = do
          kind <- below 7
          d <- below 500
          pure . named p $ case kind of
            0 -> threadDelay d
            1 -> failed
            2 -> threadDelay d >> failed
            3 -> threadDelay 3600000000 `onException` uninterruptibleMask_ (named (p ++ "/cleanup") (threadDelay d))
            4 -> replicateM_ 20 (named (p ++ "/step") yield)
            5 -> throwIO (Boom k)
            _ -> threadDelay 3600000000
        tree :: Int -> String -> IO (IO ())
        tree 0 p = leaf p
        tree n p = do
          which <- below 22
          let sub x = p ++ "/" ++ (case which of 16 -> "~"; 18 -> "adopted/"; _ -> "") ++ x
          a <- tree (n - 1) (sub "a")
          b <- tree (n - 1) (sub "b")
          let reading = named (sub "reading") (pure False)
              sensor = Signal.polling 0.0005 reading
          pure . named p $ case which of
            0 -> parallel a b
            1 -> both a b
            2 -> a ? b
            3 -> firstOf [a, b]
            4 -> void (allOf [a, b])
            5 -> scoped (\nursery -> named (sub "body") (pure ()) >> fork nursery a >>= \c -> b `finally` requestStop c)
            6 -> Signal.monitor sensor a b
            7 -> monitor reading a b
            8 -> void (Time.timeout 0.0003 a) ? b
            9 -> Signal.withShared (not <$> sensor) (`Signal.whileHolding` parallel a b)
            10 -> mask_ (parallel a b)
            11 -> uninterruptibleMask_ (named (sub "masked") (pure ())) >> attempt 2 a
            12 ->
              let finishing inbox = onMessage inbox (\() -> a >> pure (pure ())) b
              in withInbox 3 (\deliver -> pure () <$ deliver ()) finishing
            13 -> withInbox 3 (\deliver -> pure () <$ deliver ()) (\inbox -> handleNext inbox (\() -> pure () <$ a)) ? b
            14 -> a `finally` Time.cleanupWithin 0.0003 b
            15 -> pinned (parallel a b)
            16 -> Time.abandoning 0.0001 (parallel a b)
            17 -> withTrace [EachEvent (\e -> atomicModifyIORef' nested (\es -> ((p, e) : es, ())))] (parallel a b)
            18 -> adopt >>= \here -> insideThread (here (named (p ++ "/adopted") (parallel a b)))
            19 -> insideThread (named "?" (named "?/inner" yield)) >> a
            20 -> Signal.insteadWhen (not <$> sensor) a b
            _ -> (a `catch` (\(Boom _) -> pure ())) >> b
    depth <- below 4
    behavior <- tree depth "r"
    waits <- mapM (\_ -> below 800) [1 .. 3 :: Int]
    inner <- below 900
    detailed <- (== 0) <$> below 2
    events <- newIORef []
    let keep = EachEvent (\e -> atomicModifyIORef' events (\es -> (e : es, ())))
    let exception i = if even (k + i) then toException (Boom (-i)) else toException ThreadKilled
        throwing t = forM_ (zip [1 ..] waits) $ \(i, w) -> forkIO (threadDelay w >> throwTo t (exception i))
    _ <- endsWithin 20000 ("storm " ++ show k) throwing $
        withTraceOptions defaultTraceOptions {withOperators = detailed} [keep] (timeout inner behavior)
    awaitNoThreads ("storm " ++ show k)
    whole <- reverse <$> readIORef events
    check ("storm " ++ show k) "" whole
    -- What a nested trace has received is a part of it. (One in an abandoned branch may outlive it.)
    parts <- reverse <$> readIORef nested
    forM_ parts $ \(at, e) ->
      unless ("~" `isInfixOf` at) $
        promise ("storm " ++ show k ++ ": of the nested trace alone: " ++ show e) (any (sameAs e) whole)
 where
  sameAs (Ended s t end) = \case Ended s' t' end' -> (spanNumber s, t, end) == (spanNumber s', t', end'); _ -> False
  sameAs (Began s) = \case Began s' -> spanNumber s == spanNumber s'; _ -> False
  sameAs _ = const True

-- | Runs the action in a thread of 'forkIO', which has ended when this returns.
insideThread :: IO () -> IO ()
insideThread act = mask $ \restore -> do
  box <- newEmptyMVar
  thread <- forkIOWithUnmask (\unmask -> try (unmask act) >>= putMVar box)
  end <-
    restore (readMVar box) `catch` \e ->
      uninterruptibleMask_ (forkIO (throwTo thread e) >> readMVar box >> throwIO (e :: SomeException))
  either (\e -> throwIO (e :: SomeException)) pure end

awaitNoThreads :: String -> IO ()
awaitNoThreads what = go (2000 :: Int)
 where
  go n = liveThreadCount >>= \left -> unless (left == 0) $ do
    when (n == 0) . void $ broken (what ++ ": " ++ show left ++ " threads were left")
    threadDelay 1000 >> go (n - 1)

-- | Judges the events of a run whose spans have paths for names.
check :: String -> String -> [Event] -> IO ()
check what root events = do
  begun <- newIORef IntMap.empty
  open <- newIORef IntMap.empty
  ended <- newIORef IntMap.empty
  let wrong text e = broken (what ++ ": " ++ text ++ ": " ++ show e)
      -- The innermost span with a name around this one.
      namedParent s = case spanParent s of
        Inside n -> readIORef begun >>= \known -> case IntMap.lookup n known of
          Just around | spanKind around == Named -> pure (Right (spanName around))
          Just around -> namedParent around
          Nothing -> pure (Left "a parent that has not begun")
        Top -> pure (Right root)
        UnknownParent -> pure (Left "unknown")
      expected name = reverse (drop 1 (dropWhile (/= '/') (reverse name)))
  forM_ events $ \e -> case e of
    Began s -> do
      known <- readIORef begun
      when (IntMap.member (spanNumber s) known) $ wrong "began twice" e
      writeIORef begun (IntMap.insert (spanNumber s) s known)
      modifyIORef' open (IntMap.insert (spanNumber s) ())
      when (spanKind s == Named) $ namedParent s >>= \case
        Right parent -> unless (parent == expected (spanName s)) $ wrong ("in " ++ show parent) e
        Left "unknown" -> unless ("?" == spanName s || "~" `isInfixOf` spanName s) $ wrong "unknown parent" e
        Left text -> wrong text e
      case spanParent s of
        Inside n -> readIORef open >>= \openSpans -> unless (IntMap.member n openSpans) $ wrong "its parent has ended" e
        _ -> pure ()
    Ended s _ how -> do
      let abandoned = how == StoppedBy WasAbandoned
      over <- readIORef ended
      when (IntMap.member (spanNumber s) over) $ wrong "ended twice" e
      writeIORef ended (IntMap.insert (spanNumber s) s over)
      began <- IntMap.lookup (spanNumber s) <$> readIORef begun
      unless (began == Just s) $ wrong ("began as " ++ show began) e
      modifyIORef' open (IntMap.delete (spanNumber s))
      left <- readIORef open
      known <- readIORef begun
      -- (What is abandoned may end by itself at the same time.)
      forM_ (IntMap.keys left) $ \n ->
        when (fmap spanParent (IntMap.lookup n known) == Just (Inside (spanNumber s)) && not abandoned) $
        wrong ("ended before " ++ show (IntMap.lookup n known)) e
    Lost _ -> wrong "lost" e
    Reacted _ -> pure ()
  left <- readIORef open
  known <- readIORef begun
  -- (What was abandoned may still run when its trace has ended.)
  forM_ (IntMap.keys left) $ \n -> forM_ (IntMap.lookup n known) $ \s ->
    unless ("~" `isInfixOf` spanName s || spanKind s /= Named || spanParent s == UnknownParent) $
      wrong "it never ended" s

-- | Two traces at the same time: each gets its own spans, all of them.
sideBySide :: IO ()
sideBySide = forM_ [1 .. 30 :: Int] $ \_ -> do
  boxes <- mapM one ["left", "right"]
  mapM_ takeMVar boxes
 where
  one side = do
    box <- newEmptyMVar
    _ <- forkIO $ do
      events <- newIORef []
      withTrace [EachEvent (\e -> modifyIORef' events (e :))] . named side . replicateM_ 50 $
        both (named (side ++ "/a") yield) (parallel (named (side ++ "/b") yield) (named (side ++ "/c") yield))
      es <- reverse <$> readIORef events
      let own = \case
            Began s -> side `isPrefixOf` spanName s
            Ended s _ _ -> side `isPrefixOf` spanName s
            _ -> False
      forM_ es $ \e -> unless (own e) $ broken ("the trace " ++ side ++ " has " ++ show e)
      check side "" es
      putMVar box ()
    pure box

-- | A thread of 'forkIO' is in the newest trace, with an unknown parent. An adopted one that outlives
-- its trace harms nothing.
threadsOfUsers :: IO ()
threadsOfUsers = do
  events <- newIORef []
  gate <- newEmptyMVar
  over <- newEmptyMVar
  withTrace [EachEvent (\e -> modifyIORef' events (e :))] . named "r" $ do
    here <- adopt
    _ <- forkIO (here (readMVar gate >> replicateM_ 10 (named "late" yield)) `finally` putMVar over ())
    insideThread (named "alone" (pure ()))
  alone <- filter (\case Began s -> spanName s == "alone"; _ -> False) <$> readIORef events
  promise ("a thread of forkIO: " ++ show alone) ([spanParent s | Began s <- alone] == [UnknownParent])
  withTrace [EachEvent (\e -> modifyIORef' events (e :))] (putMVar gate () >> takeMVar over)
  es <- readIORef events
  promise "a span in an adopted thread after the end of its trace" (null [() | Ended s _ _ <- es, spanName s == "late"])

-- | GHC detects a deadlock in a trace as it does outside, and the trace goes on. (Nothing else may run,
-- and no other thread may refer to this one.)
deadlocks :: IO ()
deadlocks = do
  events <- newIORef []
  end <- withTrace [EachEvent (\e -> modifyIORef' events (e :))] $ do
    named "before" (threadDelay 30000)
    end <- try (named "stuck" (newEmptyMVar >>= takeMVar)) :: IO (Either BlockedIndefinitelyOnMVar ())
    end <$ named "after" (pure ())
  promise "a deadlock was hidden" (either (const True) (const False) end)
  names <- (\es -> [spanName s | Ended s _ _ <- reverse es]) <$> readIORef events
  promise ("after a deadlock the trace has " ++ show names) (names == ["before", "stuck", "after"])

-- | Names and exceptions that cannot be evaluated, failures, faults, cancellations and masking states:
-- all is as without a trace.
sameResults :: IO ()
sameResults = forM_ (zip [1 :: Int ..] programs) $ \(k, program) -> do
  without <- outcome k program
  forM_ [False, True] $ \detailed -> do
    let options = defaultTraceOptions {withOperators = detailed}
    with <- outcome k (withTraceOptions options [EachEvent (\_ -> pure ())] program)
    promise ("program " ++ show k ++ ": " ++ without ++ ", and in a trace " ++ with) (with == without)
 where
  outcome k program =
    inThread 5000 ("program " ++ show k) (try program >>= either shown pure) >>= either shown pure
  -- (An exception may itself be undefined.)
  shown :: SomeException -> IO String
  shown e =
    try (evaluate (let text = kind e in length text `seq` text))
      >>= either (fmap ("undefined: " ++) . shown) pure
  kind e
    | Just (BehaviorFailed _ f) <- fromException e = "failure " ++ (f `seq` "")
    | Just (StoppedWithFault a b) <- fromException e = "stopped (" ++ kind a ++ ") with (" ++ kind b ++ ")"
    | Just (SomeAsyncException a) <- fromException e = "cancellation " ++ takeWhile (/= '\n') (show a)
    | Just (ErrorCall _) <- fromException e = "error"
    | otherwise = "fault " ++ takeWhile (/= '\n') (show e)
  cancelled act = do
    self <- myThreadId
    forkIO (threadDelay 5000 >> throwTo self ThreadKilled) >> act
  programs =
    [ "ok" <$ named undefined (both (pure ()) (pure ()))
    , "ok" <$ named (cycle "ab") (both (pure ()) (pure ()))
    , "ok" <$ named ('a' : undefined) (parallel (pure ()) (pure ()))
    , named "a" (throwIO (undefined :: SomeException))
    , named "a" (throwIO (SomeException (undefined :: ErrorCall)))
    , "ok" <$ named "a" (both (throwIO (SomeException (undefined :: BehaviorFailed))) (pure ()))
    , "ok" <$ both (named "a" (throwIO (undefined :: SomeException))) (pure ())
    , named "a" (throwIO (BehaviorFailed [] (undefined :: Failed)))
    , named "a" (throwIO (ErrorCall undefined))
    , named undefined failed
    , named (cycle "a") failed ? pure "recovered"
    , named "a" (failWith undefined) `catch` \case FailedBecause _ -> pure "caught"; Failed -> pure "no"
    , named "a" (named "b" (throwIO Failed)) `catch` \case Failed -> pure "caught"; _ -> pure "no"
    , either (\e -> "tried " ++ kind e) id <$> tryAny (named "a" (throwIO (Boom 1)))
    , either (\e -> "tried " ++ kind e) id <$> tryAny (named "a" failed)
    , named "a" (throwIO ThreadKilled) ? pure "recovered"
    , named "a" (throwIO (StoppedWithFault (toException ThreadKilled) (toException (Boom 2)))) ? pure "recovered"
    , "ok" <$ Time.timeout 0.01 (named "a" (Time.sleep 3600 `finally` throwIO (Boom 3)))
    , (Time.timeout 0.01 (named "a" (Time.sleep 3600)) >> pure "no") ? pure "timed out"
    , show <$> timeout 5000 (named "a" (both (Time.sleep 3600) (Time.sleep 3600)))
    , "ok" <$ parallel (threadDelay 3000 >> pure ()) (named "a" (Time.sleep 3600) `onException` throwIO (Boom 4))
    , show <$> named "a" getMaskingState
    , show <$> mask_ (named "a" getMaskingState)
    , show <$> uninterruptibleMask_ (named "a" getMaskingState)
    , show <$> mask_ (named "a" (firstOf [named "b" getMaskingState]))
    , show <$> mask (\restore -> named "a" (restore (named "b" getMaskingState)))
    , show <$> (named "a" (throwIO (Boom 5)) `catch` \(Boom _) -> named "b" getMaskingState)
    , show <$> (named "a" failed ? named "b" getMaskingState)
    , mask_ (withTrace [] (show <$> named "a" getMaskingState))
    , "ok" <$ cancelled (named "a" (threadDelay 5000000))
    , "late" <$ mask_ (cancelled (named "a" (uninterruptibleMask_ (threadDelay 30000))) >> named "b" (pure ()))
    , named "a" (throwIO (AssertionFailed (cycle "loop"))) `catch` \(AssertionFailed _) -> pure "caught"
    ]

-- | Tens of thousands of threads in a trace, and as many exceptions, leave nothing.
memory :: IO ()
memory = do
  let burst = withTrace [] . named "r" $ adopt >>= \here -> replicateM_ 8000 $ do
        insideThread (here (named "x" (pure ())))
        insideThread (named "y" (pure ()))
        both (named "a" yield) (named "b" yield)
        void (try (named "c" (throwIO (Boom 1))) :: IO (Either Boom ()))
  burst
  before <- live
  burst
  after <- live
  promise ("after " ++ show before ++ " bytes there are " ++ show after) (after < before + 200000)
 where
  live = performMajorGC >> gcdetails_live_bytes . gc <$> getRTSStats
