{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Whether a trace shows what really happened. In random programs, which receive exceptions at random
-- moments while their signals change, each named behaviour keeps its own record: when it began, when and how it
-- ended; so does the thread that changes the signals. Expected: each span has that beginning and that end,
-- within its parent's; what it says it was stopped by had really happened before; and the values of a reaction
-- are those that its signals had together when it decided.
module Truth (attack) where

import Control.Concurrent
import Control.Exception
import Control.Monad (forM, forM_, forever, unless, void, when)
import Data.IORef
import qualified Data.IntMap.Strict as IntMap
import Data.List (isInfixOf, isSuffixOf, sortOn, stripPrefix)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, listToMaybe, maybeToList)
import GHC.Conc (getUncaughtExceptionHandler, setUncaughtExceptionHandler)
import System.Timeout (timeout)
import Text.Read (readMaybe)

import Attack
import Behavior
import Behavior.Message (onMessage, withInbox)
import Behavior.Parallel (allOf, decide, firstOf, fork, pinned, requestStop, scoped)
import Behavior.STM (TVar, atomically, newTVarIO, readTVar, readTVarIO, writeTVar)
import qualified Behavior.Signal as Signal
import Behavior.Time (now)
import qualified Behavior.Time as Time
import Behavior.Trace

attack :: IO ()
attack = do
  kinds <- truth 4711 1000
  promise
    ("stopped by " ++ show kinds)
    ( all
        (`Map.member` kinds)
        ["SiblingFinished", "SiblingFailed", "TimeLimit", "FromOutside", "SignalChanged", "WasAbandoned"]
    )

-- | That many random programs, from this seed. Gives by what spans were stopped, and how often.
truth :: Int -> Int -> IO (Map.Map String Int)
truth seed0 count = bracket getUncaughtExceptionHandler setUncaughtExceptionHandler $ \_ -> do
  -- (What 'Time.abandoning' reports is expected here.)
  setUncaughtExceptionHandler (\_ -> pure ())
  below <- randomBelow seed0
  kinds <- newIORef Map.empty
  forM_ [1 .. count] $ \k -> do
    world <- World <$> newIORef [] <*> newIORef [] <*> newIORef [] <*> forM [0, 1 :: Int] (\_ -> newTVarIO 0)
    program <- below 5 >>= \depth -> randomProgram below world depth "r"
    waits <- mapM (\_ -> below 5000) [1 .. 3 :: Int]
    limit <- below 5000
    detailed <- (== 0) <$> below 2
    pause <- (\i -> [30, 100, 300] !! i) <$> below 3
    received <- newIORef []
    let what = "truth " ++ show (seed0, k)
        keep = EachEvent (\e -> modifyIORef' received (e :))
        throwing thread (i, w) = forkIO $ do
          threadDelay w
          let e = if odd (k + i) then toException (Boom (-i)) else toException ThreadKilled
          t <- now
          add (outside world) (t, displayException e)
          throwTo thread e
    changing <- forkIO . forM_ [1 ..] $ \n -> do
      forM_ (zip [0 ..] (variables world)) (uncurry (change world n))
      threadDelay pause
    _ <- endsWithin 20000 what (forM_ (zip [1 :: Int ..] waits) . throwing) $
      withTraceOptions defaultTraceOptions {withOperators = detailed} [keep] (timeout limit program)
    killThread changing
    events <- reverse <$> readIORef received
    awaitNoThreads what
    modifyIORef' kinds (Map.unionWith (+) (Map.fromListWith (+) [(kindOf c, 1) | Ended _ _ (StoppedBy c) <- events]))
    -- (A recovery that ends at once, and whose condition stays true, makes more than is compared, or than a queue has
    -- room for.)
    unless (length events > 4000) $ compared world events >>= mapM_ (\wrong -> broken (what ++ ": " ++ wrong))
  readIORef kinds
 where
  kindOf = \case
    SiblingFailed "sensor" -> "SiblingFailed \"sensor\""
    c -> takeWhile (/= ' ') (show c)

-- | What really happened.
data World = World
  { runs :: IORef [Run]
  , outside :: IORef [(Time.Seconds, String)]
  -- ^ The exceptions that were thrown from outside, each with a time before that.
  , writes :: IORef [Write]
  , variables :: [TVar Int]
  }

-- | A run of a named behaviour.
data Run = Run {runName :: String, runBegan :: Time.Seconds, runEnded :: Time.Seconds, runEnd :: How}
  deriving (Show)

data How = Returned | Failure | Fault | Cancelled
  deriving (Eq, Show)

-- | The number of a variable, what was written, and times before and after that.
data Write = Write {variable :: Int, written :: Int, before :: Time.Seconds, after :: Time.Seconds}

add :: IORef [a] -> a -> IO ()
add list a = atomicModifyIORef' list (\as -> (a : as, ()))

change :: World -> Int -> Int -> TVar Int -> IO ()
change world n i v = uninterruptibleMask_ $ do
  t <- now
  atomically (writeTVar v n)
  now >>= add (writes world) . Write i n t

-- | A behaviour with a name that records how it ran.
recorded :: World -> String -> IO a -> IO a
recorded world name act = mask $ \restore -> named name $ do
  began <- now
  end <- try (restore act)
  ended <- now
  add (runs world) (Run name began ended (either how (const Returned) end))
  either throwIO pure end
 where
  how :: SomeException -> How
  how e
    | isJust (fromException e :: Maybe BehaviorFailed) = Failure
    | Just (StoppedWithFault _ _) <- fromException e = Fault
    | isJust (fromException e :: Maybe SomeAsyncException) = Cancelled
    | otherwise = Fault

-- | The last part of a name is the operator's name of the branch, and a word for what the branch is. What may be
-- abandoned has a tilde in its name.
randomProgram :: (Int -> IO Int) -> World -> Int -> String -> IO (IO ())
randomProgram below world = tree
 where
  tree :: Int -> String -> IO (IO ())
  tree 0 p = leaf p
  tree n p = do
    which <- below 20
    i <- below 2
    polled <- (== 0) <$> below 3
    let child name = tree (n - 1) (p ++ "/" ++ name)
        v = variables world !! i
        s = "s" ++ show i
        signal = Signal.named s (if polled then Signal.polling 0.0004 (readTVarIO v) else Signal.watching (readTVar v))
        isOdd = Signal.named (s ++ " odd") (odd <$> signal)
        two f a b = f <$> child a <*> child b
        limit = 0.0007
    recorded world p <$> case which of
      0 -> two parallel "left" "right"
      1 -> two both "left" "right"
      2 -> two (?) "first" "second"
      3 -> two (\a b -> firstOf [a, b]) "1" "2"
      4 -> two (\a b -> void (allOf [a, b])) "1" "2"
      5 -> two (\a b -> scoped (\nursery -> fork nursery a >> b)) "fork 1" "body"
      6 ->
        let body nursery a b = fork nursery a >>= \c -> Time.sleep 0.0003 >> requestStop c >> b
        in two (\a b -> scoped (\nursery -> body nursery a b)) "fork 1" "body"
      7 -> two (Signal.monitor isOdd) "recovery" "task"
      8 -> two (Signal.rSelect isOdd) "left" "right"
      9 -> two (\a b -> Signal.switch ((`mod` 3) <$> signal) (\m -> if m == 0 then a else b)) "branch" "branch"
      10 -> two (\a b -> Signal.teleoReactive [(isOdd, a), (not <$> isOdd, b)]) "rule 1" "rule 2"
      11 -> (\a -> Signal.whileHolding (Signal.named "even" (even <$> signal)) a ? pure ()) <$> child "branch"
      12 -> two (Signal.insteadWhen (Signal.named "late" ((> 12) <$> signal))) "emergency" "branch"
      13 ->
        let whenBothEnd ends = if length (filter isJust ends) == 2 then Just (pure ()) else Nothing
        in two (\a b -> decide whenBothEnd [a, b]) "1" "2"
      14 -> (\a -> Time.timeout limit a ? pure ()) <$> child "branch"
      15 ->
        let delivers deliver = forever (deliver () >> Time.sleep 0.0006)
        in two (\a b -> withInbox 3 delivers (\inbox -> onMessage inbox (\() -> pure () <$ a) b)) "handler" "task"
      16 -> two (\a b -> a `finally` Time.cleanupWithin limit (b ? pure ())) "first" "branch"
      17 -> Time.abandoning 0.0001 <$> child "~branch"
      18 -> two (\a b -> pinned (Signal.withShared isOdd (\shared -> Signal.monitor shared a b))) "recovery" "task"
      _ -> two (Signal.rSelect (dying <$> isOdd <*> signal)) "left" "right"
  -- A sensor that faults.
  dying b n = if n > 2 then throw (Boom 1) else b
  leaf p = do
    kind <- below 8
    d <- below 900
    pure . recorded world p $ case kind of
      0 -> threadDelay d
      1 -> threadDelay d >> failed
      2 -> Time.sleep 3600 `onException` uninterruptibleMask_ (threadDelay d)
      3 -> Time.sleep 3600 `catch` (\(_ :: SomeException) -> pure ())
      4 -> threadDelay d >> when (d > 800) (throwIO (Boom 2))
      5 -> Time.sleep 3600 `onException` when (d > 600) (throwIO (Boom 3))
      _ -> Time.sleep 3600

-- | What the trace shows wrongly.
compared :: World -> [Event] -> IO (Maybe String)
compared world events = do
  real <- readIORef (runs world)
  thrown <- readIORef (outside world)
  changes <- readIORef (writes world)
  let begun = IntMap.fromList [(spanNumber s, s) | Began s <- events]
      ends = [(s, t, end) | Ended s t end <- events]
      reactions = Map.fromListWith (++) [(reactionNumber r, [r]) | Reacted r <- events]
      -- Runs of the same name come one after the other.
      runsOf = Map.map (sortOn runBegan) (Map.fromListWith (++) [(runName r, [r]) | r <- real])
      spansOf =
        Map.map
          (sortOn spanNumber)
          (Map.fromListWith (++) [(spanName s, [s]) | Began s <- events, spanKind s == Named])
      runOf =
        IntMap.fromList
          [ one
          | (name, ss) <- Map.toList spansOf
          , one <- zip (map spanNumber ss) (Map.findWithDefault [] name runsOf)
          ]
      around s = case spanParent s of
        Inside n | Just o <- IntMap.lookup n begun -> o : around o
        _ -> []
      endsOf = IntMap.fromListWith (++) [(spanNumber s, [(t, end)]) | (s, t, end) <- ends]
      isLoose s = or [spanParent o == UnknownParent || "~" `isInfixOf` spanName o | o <- s : around s]
      wrong :: Show x => String -> x -> [String]
      wrong text what = [text ++ ": " ++ show what]
      spans = [w | Began s <- events, w <- ofSpan s]
      ofSpan s = concat
        [ wrong "it has not one end" (s, found)
        | let found = IntMap.findWithDefault [] (spanNumber s) endsOf
        , length found /= 1
        , not (null found && isLoose s)
        ]
        ++ concat
          [ wrong "it is not within its parent" (s, o)
          | not (isLoose s)
          , o <- take 1 (around s)
          , not (within s o)
          ]
        ++ (if spanKind s == Named && not (isLoose s) then ofNamed s else [])
      within s o = spanBegan o <= spanBegan s && and [t <= t' | (t, _) <- theEnd s, (t', _) <- theEnd o]
      theEnd s = IntMap.findWithDefault [] (spanNumber s) endsOf
      ofNamed s = case IntMap.lookup (spanNumber s) runOf of
        Nothing -> wrong "it never ran" s
        Just r ->
          concat [wrong "its beginning" (s, r) | spanBegan s > runBegan r]
            ++ concat [wrong "its end" (s, t, r) | (t, _) <- theEnd s, t < runEnded r]
            ++ concat [wrong "how it ended" (s, end, r) | (_, end) <- theEnd s, not (agree end (runEnd r))]
            ++ concat
              [ wrong "its cause" (s, c, r, around s)
              | runEnd r == Cancelled
              , (_, StoppedBy c) <- theEnd s
              , not (true s r c)
              ]
      agree end h = case end of
        Succeeded -> h == Returned
        FailedWith _ -> h == Failure
        FaultedWith _ -> h == Fault
        StoppedBy _ -> h == Cancelled
      -- The named spans of a branch of this operator, and how they really ended.
      siblings o name =
        [ r
        | s <- Map.findWithDefault [] (spanName o ++ "/" ++ name) spansOf
        , take 1 (filter ((== Named) . spanKind) (around s)) == [o]
        , r <- maybeToList (IntMap.lookup (spanNumber s) runOf)
        ]
      namedAround = filter ((== Named) . spanKind) . around
      true s r = \case
        SiblingFinished name -> anySibling s r name [Returned]
        SiblingFailed "sensor" -> or [variable w < 2 && written w > 2 && before w <= runEnded r | w <- changes]
        SiblingFailed name -> anySibling s r name [Failure, Fault]
        TimeLimit limit -> limit == 0.0007 && or [runEnded r >= spanBegan o + limit | o <- namedAround s]
        FromOutside "<<timeout>>" -> True
        FromOutside "requestStop" -> or ["/fork 1" `isInfixOf` spanName o | o <- s : namedAround s]
        FromOutside text -> or [t <= runEnded r && text' == text | (t, text') <- thrown]
        SignalChanged n cs -> case Map.lookup n reactions of
          Just [x] ->
            reactionChanges x == cs
              && reactionTime x <= runEnded r
              && reactionParent x `elem` (map (Inside . spanNumber) (around s) ++ [Top])
          Just _ -> False
          Nothing -> True -- it may have been cancelled before it could tell
        WasAbandoned -> False
      anySibling s r name hows =
        or
          [ runEnd b `elem` hows && runEnded b <= runEnded r
          | o <- namedAround s
          , part <- parts name
          , b <- siblings o part
          ]
      parts name = if ", " `isInfixOf` name then words (filter (/= ',') name) else [name]
      ofReactions = [w | Reacted r <- events, w <- ofReaction r]
      ofReaction r =
        concat [wrong "values that were not together" r | not (together (reactionChanges r))]
          ++ concat
            [ wrong "a value that its signal did not have" (r, c)
            | c <- reactionChanges r
            , Just i <- [stripPrefix "s" (changeSignal c) >>= readMaybe]
            , Just x <- [readMaybe (changeAfter c)]
            , not (had i x (maybe 0 spanBegan (parent r)) (reactionTime r))
            ]
          ++ concat
            [ wrong "it started something else" (r, s)
            | Just name <- [reactionStarts r]
            , Began s <- events
            , spanKind s == Named
            , spanReaction s == Just (reactionNumber r)
            , not (("/" ++ name) `isSuffixOf` spanName s)
            , not ("~" `isInfixOf` spanName s)
            ]
      parent r = case reactionParent r of
        Inside n -> IntMap.lookup n begun
        _ -> Nothing
      -- It was written before the second time, and not overwritten before the first.
      had i x from to =
        (x == 0 || or [before w <= to | w <- changes, variable w == i, written w == x])
          && and [after w >= from | w <- changes, variable w == i, written w == x + 1]
      together cs =
        and
          [ odd x == (changeAfter o == "True")
          | (c, o) <- zip cs (drop 1 cs)
          , changeSignal o == changeSignal c ++ " odd"
          , Just x <- [readMaybe (changeAfter c) :: Maybe Int]
          ]
      lostRuns =
        [ wrongRun
        | (name, rs) <- Map.toList runsOf
        , let known = length (Map.findWithDefault [] name spansOf)
        , length rs > known
        , not ("~" `isInfixOf` name)
        , wrongRun <- wrong "runs without a span" (name, length rs, known)
        ]
      doubled = [n | (n, _ : _ : _) <- Map.toList reactions]
      twice = concat [wrong "reactions that came twice" doubled | not (null doubled)]
  pure (listToMaybe (spans ++ ofReactions ++ lostRuns ++ twice))

awaitNoThreads :: String -> IO ()
awaitNoThreads what = go (5000 :: Int)
 where
  go n = liveThreadCount >>= \left -> unless (left == 0) $ do
    when (n == 0) . void $ broken (what ++ ": " ++ show left ++ " threads were left")
    threadDelay 1000 >> go (n - 1)
