{-# LANGUAGE LambdaCase #-}

-- |
-- What must hold for the trace of a recorded run.
module Trace.Rules
  ( mistakes
  , properties
  ) where

import Data.List (group, isInfixOf, isPrefixOf, nub, sort, stripPrefix)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, isJust, isNothing, listToMaybe, maybeToList)

import Behavior.Internal.Spans.Event
import qualified Behavior.Sim as Sim
import Semantics.Path (Seen (..))
import Semantics.Program
  ( Level (..)
  , Program (..)
  , Transition (IsOver)
  , World (changes, conditions)
  , holds
  , programName
  )
import qualified Semantics.Program as Program
import Trace.Recorder

-- | What is wrong with the trace of the run; nothing if all is as it must be.
mistakes :: Record -> [String]
mistakes record = concat [[name ++ ": " ++ what | what <- rule (indexed record)] | (name, rule) <- properties]

-- | The rules, and what is wrong by each.
properties :: [(String, Indexed -> [String])]
properties =
  [ ("once, and within its parent", structure)
  , ("only named spans", sameAmongNamed)
  , ("parents are those of the program", parents)
  , ("ends are those of the program", endings)
  , ("branches end as in the specification", asSpecified)
  , ("causes", causes)
  , ("reactions", reactionsOf)
  , ("values", values)
  ]

-- | A record, and where things are in it. A place in it is the number of an entry.
data Indexed = Indexed
  { recorded :: Record
  , complete :: Bool
  -- ^ Whether the run was not cut off.
  , begun :: Map Int (Int, String, Span)
  -- ^ By the number of a span: where it began, in which thread.
  , over :: Map Int (Int, String, Span, Double, End)
  , reacted :: Map Int (Int, Reaction)
  , threadsBranch :: Map String Span
  -- ^ The branch that runs in a thread.
  , spanOf :: Map Int Int
  -- ^ By the number of a part with a name, or of an operator: its span.
  , partOf :: Map Int (Owner, Program)
  -- ^ By the number of a span.
  }

indexed :: Record -> Indexed
indexed record =
  Indexed
    { recorded = record
    , complete = either (const False) (const True) (seen record) && finishes
    , begun = starts
    , over =
        Map.fromList
          [ (spanNumber s, (at, thread, s, realToFrac t, end'))
          | (at, Received True thread (Ended s t end')) <- entries record
          ]
    , reacted = Map.fromList [(reactionNumber r, (at, r)) | (at, Received True _ (Reacted r)) <- entries record]
    , threadsBranch = Map.fromList (reverse [(thread, s) | (_, thread, s) <- Map.elems starts, spanKind s == Branch])
    , spanOf = Map.fromList bound
    , partOf = Map.fromList [(s, it) | (part, s) <- bound, it <- maybeToList (Map.lookup part whats)]
    }
 where
  finishes = case Sim.outcome (whole record) of
    Sim.OutOfTime _ -> False
    Sim.Deadlock _ -> False
    _ -> True
  starts = Map.fromList [(spanNumber s, (at, thread, s)) | (at, Received True thread (Began s)) <- entries record]
  byName = Map.fromList [(spanName s, spanNumber s) | (_, _, s) <- Map.elems starts, spanKind s == Named]
  bound =
    [(part, s) | (_, Entered _ part _ _ True) <- entries record, s <- maybeToList (Map.lookup (nameOf part) byName)]
      ++ go (entries record)
  -- An operator's span is the first that begins in its thread, if nothing else comes before.
  go = \case
    (_, Operates thread n _ _) : later -> maybe id (\s -> ((n, s) :)) (firstIn thread later) (go later)
    _ : later -> go later
    [] -> []
  firstIn thread later = case filter ((== Just thread) . threadOf . snd) later of
    (_, Received True _ (Began s)) : _ | spanKind s == Operator -> Just (spanNumber s)
    -- (Those who receive named spans only come first.)
    _ -> Nothing
  threadOf = \case
    Received False _ _ -> Nothing
    Received True thread _ -> Just thread
    Entered thread _ _ _ _ -> Just thread
    HasLeft thread _ _ -> Just thread
    Operates thread _ _ _ -> Just thread
    HasOperated thread _ _ -> Just thread
    IsSet _ _ -> Nothing
  whats = Map.fromList $ concatMap what (entries record)
  what = \case
    (_, Entered _ n here p _) -> [(n, (here, p))]
    (_, Operates _ n here p) -> [(n, (here, p))]
    _ -> []

-- | Each span begins once, and ends once, within its parent.
structure :: Indexed -> [String]
structure x = concat (twice : map each (Map.elems (begun x)))
 where
  twice =
    [ "more than once: " ++ show e
    | detail <- [True, False]
    , e : _ : _ <- group (sort [key | (_, Received d _ received) <- es, d == detail, key <- identity received])
    ]
      ++ ["not begun: " ++ show s | (_, Received True _ (Ended s _ _)) <- es, spanNumber s `Map.notMember` begun x]
      ++ ["lost: " ++ show n | (_, Received _ _ (Lost n)) <- es]
      ++ ["events of the run differ" | complete x, [e | (_, Received True _ e) <- es] /= Sim.events run]
      ++ ["a number both of a span and of a reaction" | any (`Map.member` begun x) (Map.keys (reacted x))]
  es = entries (recorded x)
  run = whole (recorded x)
  identity = \case
    Began s -> [(0 :: Int, spanNumber s)]
    Ended s _ _ -> [(1, spanNumber s)]
    Reacted r -> [(2, reactionNumber r)]
    Lost _ -> []
  each (at, thread, s) = case Map.lookup (spanNumber s) (over x) of
    Nothing -> ["has not ended: " ++ show s | complete x]
    Just (end', thread', s', t, _) ->
      ["the end contains another span: " ++ show (s, s') | s' /= s]
        ++ ["ends before it begins: " ++ show s | t < realToFrac (spanBegan s) || end' < at]
        ++ ["ends in another thread: " ++ show s | thread /= thread']
        ++ case spanParent s of
          UnknownParent -> ["unknown parent: " ++ show s]
          Top -> []
          Inside p -> case (Map.lookup p (begun x), Map.lookup p (over x)) of
            (Nothing, _) -> ["no such parent: " ++ show s]
            (Just (at', _, parent), ended) ->
              ["begins before its parent: " ++ show s | at < at' || spanBegan s < spanBegan parent]
                ++ ["ends after its parent: " ++ show s | Just (end'', _, _, t', _) <- [ended], end' > end'' || t > t']

-- | A receiver of named spans only has the same ones, and their parents are the nearest ones with names.
sameAmongNamed :: Indexed -> [String]
sameAmongNamed x =
  [ "differs: " ++ show (expected, given)
  | (expected, given) <-
      padded
        [e' | (_, Received True _ e) <- es, Just e' <- [shownAmongNamed e]]
        [e | (_, Received False _ e) <- es]
  , expected /= given
  ]
 where
  es = entries (recorded x)
  padded as bs =
    take (max (length as) (length bs)) (zip (map Just as ++ repeat Nothing) (map Just bs ++ repeat Nothing))
  shownAmongNamed = \case
    Began s | spanKind s == Named -> Just (Began (nearest s))
    Ended s t end' | spanKind s == Named -> Just (Ended (nearest s) t end')
    Reacted r -> Just (Reacted r {reactionParent = fst (up (reactionParent r))})
    _ -> Nothing
  nearest s =
    let (p, reaction) = up (spanParent s)
     in s {spanParent = p, spanReaction = orElse (spanReaction s) reaction}
  orElse (Just a) _ = Just a
  orElse Nothing b = b
  up = \case
    Inside n
      | Just (_, _, s) <- Map.lookup n (begun x) -> case spanKind s of
          Named -> (Inside n, Nothing)
          _ ->
            let (p, reaction) = up (spanParent s)
             in (p, spanReaction s `orElse` reaction)
    p -> (p, Nothing)

-- | The parent of each span is what the program says.
parents :: Indexed -> [String]
parents x =
  [ "no part of the program: " ++ show s
  | (_, _, s) <- Map.elems (begun x)
  , spanKind s /= Branch
  , spanNumber s `Map.notMember` partOf x
  ]
    ++ [ "the parent of " ++ show s ++ " is not that of " ++ show (here, p)
       | (n, (here, p)) <- Map.toList (partOf x)
       , Just (_, thread, s) <- [Map.lookup n (begun x)]
       , not (fits here thread (spanParent s))
       ]
    ++ [ "another name: " ++ show s
       | (n, (_, p)) <- Map.toList (partOf x)
       , Just (_, _, s) <- [Map.lookup n (begun x)]
       , spanKind s == Operator
       , Just (spanName s) /= programName p
       ]
    ++ concat
      [ case (spanName s, spanParent s) of
          ("plain thread", Top) -> []
          (name, Inside p)
            | Just (_, thread', o) <- Map.lookup p (begun x)
            , spanKind o == Operator
            , (spanName o ++ ": ") `isPrefixOf` name
            , thread' /= thread ->
                []
          _ -> ["a branch of no operator: " ++ show s]
      | (_, thread, s) <- Map.elems (begun x)
      , spanKind s == Branch
      ]
    ++ [ "no span, but it was not stopped: " ++ show (n, p)
       | (_, HasLeft _ n how) <- es
       , not (isStop how)
       , n `Map.notMember` spanOf x
       , Just (p, True) <- [Map.lookup n parts]
       ]
    ++ [ "no span of an operator: " ++ show (n, p)
       | (_, HasOperated _ n PartReturned) <- es
       , n `Map.notMember` spanOf x
       , Just p <- [Map.lookup n operators]
       , not (isDecide p)
       ]
 where
  es = entries (recorded x)
  parts = Map.fromList [(n, (p, isNamed)) | (_, Entered _ n _ p isNamed) <- es]
  operators = Map.fromList [(n, p) | (_, Operates _ n _ p) <- es]
  isDecide = \case Decide {} -> True; _ -> False
  fits here thread parent = case ownerBranch here of
    Nothing -> parent == ownerOf here && (isNothing (ownerNumber here) || ownerThread here == Just thread)
    Just label -> case parent of
      Inside b
        | Just (_, thread', s) <- Map.lookup b (begun x) ->
            spanKind s == Branch && spanName s == label && spanParent s == ownerOf here && thread == thread'
      _ -> False
  ownerThread here = (\(_, thread, _) -> thread) <$> ownerSpan here
  ownerSpan here = ownerNumber here >>= (`Map.lookup` spanOf x) >>= (`Map.lookup` begun x)
  ownerOf here = case ownerNumber here of
    Nothing -> Top
    Just n -> maybe UnknownParent Inside (Map.lookup n (spanOf x))

-- | Each span has ended as the part of the program has.
endings :: Indexed -> [String]
endings x =
  [ "the end of " ++ show s ++ ": " ++ show end' ++ ", but its part: " ++ show how
  | (n, how) <- lefts
  , Just s <- [Map.lookup n (spanOf x)]
  , Just (_, _, _, _, end') <- [Map.lookup s (over x)]
  , not (agree end' how || isStop how || isDecided s end')
  ]
    ++ [ "the end of " ++ show s ++ ": " ++ show end' ++ ", but its program: " ++ show how
       | (_, Entered thread n here _ _) <- es
       , Just label <- [ownerBranch here]
       , not (": polling" `isInfixOf` label)
       , isFirst thread n
       , Just s <- [Map.lookup thread (threadsBranch x)]
       , Just how <- [Map.lookup n leftBy]
       , Just (_, _, _, _, end') <- [Map.lookup (spanNumber s) (over x)]
       , not (agree end' how || (how == PartReturned && (isStopped end' || end' == FaultedWith "EnoughOfThis")))
       ]
 where
  es = entries (recorded x)
  lefts = [(n, how) | (_, HasLeft _ n how) <- es] ++ [(n, how) | (_, HasOperated _ n how) <- es]
  leftBy = Map.fromList [(n, how) | (_, HasLeft _ n how) <- es]
  firsts = Map.fromList (reverse [(thread, n) | (_, Entered thread n _ _ _) <- es])
  isFirst thread n = Map.lookup thread firsts == Just n
  -- What decide has chosen runs after it.
  isDecided s end' = end' == Succeeded && case Map.lookup s (partOf x) of
    Just (_, Decide {}) -> fmap (\(_, _, o) -> spanKind o) (Map.lookup s (begun x)) == Just Operator
    _ -> False
  agree end' how = case (end', how) of
    (Succeeded, PartReturned) -> True
    (FailedWith text, PartFailed text') -> text == text'
    (FaultedWith text, PartFaulted text') -> text == text'
    (StoppedBy _, PartStopped) -> True
    _ -> False

-- | The limit of an operator that stops its branch when its time is up.
timeLimit :: Program -> Maybe Program.Ticks
timeLimit = \case
  Timeout n _ -> Just n
  CleanupWithin n _ -> Just n
  _ -> Nothing

isStopped :: End -> Bool
isStopped = \case StoppedBy _ -> True; _ -> False

-- | The ends of branches, at the times that the specification has been compared with.
asSpecified :: Indexed -> [String]
asSpecified x = case seen (recorded x) of
  Right s
    | complete x
    , let expected = sort [(t, label) | (t, IsOver label) <- timeline s]
    , expected /= traced ->
        ["expected " ++ show expected ++ ", but in the trace: " ++ show traced]
  _ -> []
 where
  -- (A thread emits the end of its branch before it publishes it; others may run between.)
  traced =
    sort
      [ (round t, spanName s)
      | (_, Received True _ (Ended s t _)) <- entries (recorded x)
      , spanKind s == Branch
      , not (isWorker (spanName s))
      ]

-- | Whether a branch with this label belongs to a signal; or it is the thread of the whole program.
isWorker :: String -> Bool
isWorker label =
  any
    (`isInfixOf` label)
    ["plain thread", ": polling", ": clock", ": staleAfter", ": debounce", ": throttle", ": hysteresis"]

-- | Why each branch was stopped.
causes :: Indexed -> [String]
causes x =
  [ "several causes in one thread: " ++ show (thread, cs)
  | (thread, cs) <- Map.toList byThread
  , length (nub cs) > 1
  ]
    ++ [ "the cause of " ++ show s ++ " is not possible: " ++ show cause
       | (thread, cs) <- Map.toList byThread
       , Just s <- [Map.lookup thread (threadsBranch x)]
       , cause <- nub cs
       , not (possible s cause)
       ]
 where
  byThread = Map.fromListWith (++) [(thread, [c]) | (_, thread, _, _, StoppedBy c) <- Map.elems (over x)]
  possible s cause = case spanParent s of
    Inside p | Just (_, thread', o) <- Map.lookup p (begun x) -> own s o cause || inherited thread' cause
    _ -> cause `elem` [FromOutside "Enough", FromOutside "EnoughOfThis"]
  -- What stopped the operator stops its branches.
  inherited thread cause = case Map.lookup thread byThread of
    Just cs -> cause `elem` cs
    Nothing -> case Map.lookup thread (threadsBranch x) of
      Just s -> possible s cause
      Nothing -> False
  siblings o =
    [ (at, name, end')
    | (at, _, s, _, end') <- Map.elems (over x)
    , spanKind s == Branch
    , spanParent s == Inside (spanNumber o)
    , name <- maybeToList (stripPrefix (spanName o ++ ": ") (spanName s))
    ]
  times = Map.fromList [(at, t) | (at, _, _, t, _) <- Map.elems (over x)]
  own s o cause =
    let name = fromMaybe "" (stripPrefix (spanName o ++ ": ") (spanName s))
        itsEnd = maybe maxBound (\(at, _, _, _, _) -> at) (Map.lookup (spanNumber s) (over x))
        others = [(at, n, e) | (at, n, e) <- siblings o, at < itsEnd]
        finishedNow n = [at | (at, n', e) <- others, n' == n, n' /= name, e == Succeeded]
        failedNow n = [at | (at, n', e) <- others, n' == n, n' /= name, wrong e]
        begunLater =
          [ b
          | (_, _, b) <- Map.elems (begun x)
          , spanParent b == Inside (spanNumber o)
          , not (isWorker (spanName b))
          , any (realToFrac (spanBegan b) >) (Map.lookup itsEnd times)
          ]
        operatorEnd = (\(_, _, _, _, e) -> e) <$> Map.lookup (spanNumber o) (over x)
        itsProgram = snd <$> Map.lookup (spanNumber o) (partOf x)
        -- None to the left of it had ended, or failed, at an earlier time. (At the same time the order of the
        -- events is not that in which the ends were published.)
        leftmost n ats counts =
          not (null ats)
            && and
              [ not (Map.lookup at times < Map.lookup at' times && position n' < position n && counts e)
              | at' <- take 1 ats
              , (at, n', e) <- others
              , n' /= name
              ]
        operatorAgrees endsSo = maybe True (\e -> endsSo e || isStopped e || isFault e) operatorEnd
     in case (spanName o, cause) of
          (op, SiblingFinished n)
            | op `elem` ["parallel", "firstOf"] ->
                leftmost n (finishedNow n) (not . isStopped) && operatorAgrees (== Succeeded)
          (op, SiblingFailed n)
            | op `elem` ["parallel", "firstOf"] ->
                leftmost n (failedNow n) (not . isStopped) && operatorAgrees isFailed
            | op `elem` ["both", "allOf"] -> leftmost n (failedNow n) wrong && operatorAgrees isFailed
          ("decide", SiblingFinished ns) ->
            all (\n -> finishedNow n ++ failedNow n /= []) (inList ns) && not (all (null . finishedNow) (inList ns))
          ("decide", SiblingFailed ns) -> not (any (null . failedNow) (inList ns))
          ("scoped", SiblingFinished "body") -> not (null (finishedNow "body"))
          ("scoped", SiblingFailed n)
            | n == "body" -> not (null (failedNow n))
            | Just k <- stripPrefix "fork " n ->
                any (\(_, n', e) -> n' == "fork" && wrong e) others
                  && read k <= length (filter (\(_, n', _) -> n' == "fork") (siblings o))
          ("scoped", FromOutside "requestStop") -> name == "fork"
          ("withShared", SiblingFinished n) -> not (null (finishedNow n))
          ("withShared", SiblingFailed n) -> not (null (failedNow n))
          (_, TimeLimit limit) -> case itsProgram >>= timeLimit of
            Just n ->
              let isLate (_, _, _, t, _) = t >= realToFrac (spanBegan o) + fromIntegral n
               in -- (It may not have ended: a run is cut off at some time.)
                  limit == fromIntegral n && maybe (not (complete x)) isLate (Map.lookup (spanNumber s) (over x))
            _ -> False
          (op, _)
            | op `notElem` ["parallel", "firstOf", "both", "allOf", "decide", "scoped", "withShared"] -> case cause of
                SignalChanged n these ->
                  let isIts r = reactionParent r == Inside (spanNumber o) && reactionOperator r == op
                   in maybe False (\(_, r) -> isIts r && reactionChanges r == these) (Map.lookup n (reacted x))
                SiblingFinished n -> not (null (finishedNow n))
                -- Nothing begins after the failure of a sensor. (What had been started begins at the same time,
                -- and may even end by itself.)
                SiblingFailed "sensor"
                  | isNothing (itsProgram >>= timeLimit) && null begunLater ->
                      operatorEnd /= Just Succeeded || any (\(_, _, e) -> e == Succeeded) (siblings o)
                SiblingFailed n -> not (null (failedNow n))
                _ -> False
          _ -> False
  inList = map (filter (/= ' ')) . splitAtCommas
  splitAtCommas text = case break (== ',') text of
    (n, _ : rest) -> n : splitAtCommas rest
    (n, []) -> [n]
  position n = if n `elem` ["left", "body"] then 0 else maybe 1 fst (listToMaybe (reads n)) :: Int
  isFailed = \case FailedWith _ -> True; _ -> False
  isFault = \case FaultedWith _ -> True; _ -> False
  wrong e = isFailed e || isFault e

-- | Reactions belong to their operators, and have stopped and started what they say.
reactionsOf :: Indexed -> [String]
reactionsOf x =
  concatMap each (Map.elems (reacted x))
    ++ [ "started by no such reaction: " ++ show s
       | (at, _, s) <- Map.elems (begun x)
       , Just n <- [spanReaction s]
       , not (maybe False (\(at', r) -> at' < at && hasStarted r s) (Map.lookup n (reacted x)))
       ]
 where
  hasStarted r s =
    spanKind s == Branch
      && spanParent s == reactionParent r
      && Just (spanName s) == (((reactionOperator r ++ ": ") ++) <$> reactionStarts r)
  each (at, r) = case reactionParent r of
    Inside p
      | Just (_, _, o) <- Map.lookup p (begun x)
      , spanKind o == Operator
      , spanName o == reactionOperator r ->
          let branches name =
                [ (s, at')
                | (at', _, s) <- Map.elems (begun x)
                , spanKind s == Branch
                , spanParent s == Inside p
                , spanName s == spanName o ++ ": " ++ name
                ]
              started name = [s | (s, at') <- branches name, spanReaction s == Just (reactionNumber r), at' > at]
           in ["started nothing: " ++ show r | complete x, Just name <- [reactionStarts r], length (started name) /= 1]
                ++ [ "stopped no such branch: " ++ show r
                   | Just b <- [reactionStopped r]
                   , null
                      [ s
                      | (s, _) <- branches (stoppedName b)
                      , spanBegan s == reactionTime r - stoppedAfter b
                      , Just (at', _, _, t, e) <- [Map.lookup (spanNumber s) (over x)]
                      , e == stoppedEnd b
                      , at' < at
                      , t == realToFrac (reactionTime r + stoppingTook b)
                      , not (isStopped e) || stoppedByIt r e
                      ]
                   ]
                ++ ["out of time: " ++ show r | reactionTime r < spanBegan o || any isNegative (reactionStopped r)]
    _ -> ["in no such operator: " ++ show r]
  isNegative b = stoppedAfter b < 0 || stoppingTook b < 0
  stoppedByIt r = \case
    StoppedBy (SignalChanged n _) -> n == reactionNumber r
    _ -> False

-- | The values of a reaction are those with which its operator decided.
values :: Indexed -> [String]
values x =
  concat
    [ ["no change of its value: " ++ show r | not (decides p r)]
        ++ [ "not the value at that time: " ++ show (r, c)
           | direct p
           , c <- reactionChanges r
           , changeSignal c /= "level"
           , not (held at r c)
           ]
    | (at, r) <- Map.elems (reacted x)
    , Inside n <- [reactionParent r]
    , Just (_, p) <- [Map.lookup n (partOf x)]
    ]
 where
  es = entries (recorded x)
  decides p r = case [(changeBefore c, changeAfter c) | c <- reactionChanges r, changeSignal c == "level"] of
    [(before, after)]
      | not (isTeleoReactive p), now <- holds (read after), was <- holds . read <$> before -> case p of
          RSelect {} -> maybe True (\b -> (stoppedName b == "left") /= now && was == Just (not now)) (reactionStopped r)
          Monitor {} -> if isJust (reactionStopped r) then now else now == (reactionStarts r /= Just "task")
          InsteadWhen {} -> now
          WhileHolding {} -> not now
          WaitUntil _ -> now
          Switch _ _ -> isNothing (reactionStopped r) || before /= Just after
          _ -> True
    levels -> case p of
      -- (Equal changes are reported once.)
      TeleoReactive _ ->
        not (null levels) && (not (direct p) || and [holds (read was) /= holds (read now) | (Just was, now) <- levels])
      -- (What its signal is, MessagesSpec says.)
      OnMessage _ _ -> null levels
      _ -> isJust (timeLimit p) && null levels
  isTeleoReactive = \case TeleoReactive _ -> True; _ -> False
  direct p = programName p /= Just "onMessage" && not (any (`isInfixOf` show (Program.signals p)) notDirect)
  notDirect = ["Debounce", "Throttle", "Hysteresis", "Shared"]
  -- The numbers of the spans before and after say where in the record the operator decided.
  held at r c =
    let n = reactionNumber r
        from = maximum (0 : [at' | (k, (at', _, _)) <- Map.toList (begun x), k < n])
        to = minimum (at : [at' | (k, (at', _, _)) <- Map.toList (begun x), k > n])
        t = round (reactionTime r) :: Int
        known = [one | one@(since, _, _, _, _) <- history (changeSignal c), since < to]
        current = [show l | (_, fromTime, toPlace, toTime, At l) <- known, toPlace > from, fromTime <= t, toTime >= t]
     in changeAfter c `elem` current && maybe True (`elem` [show l | (_, _, _, _, At l) <- known]) (changeBefore c)
  -- When a condition had which level: places in the record, and times.
  history condition =
    let first = fromMaybe NoValue (lookup condition (conditions (world (recorded x))))
        later = [(at, t, l) | ((at, c, l), t) <- zip [(at, c, l) | (at, IsSet c l) <- es] times, c == condition]
        sets = (-1, 0, first) : later
        times = scanl1 max [t | Program.Change t _ _ <- changes (world (recorded x))]
     in zipWith (\(at, t, l) (at', t', _) -> (at, t, at', t', l)) sets (drop 1 sets ++ [(maxBound, maxBound, NoValue)])
