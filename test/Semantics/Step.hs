{-# LANGUAGE LambdaCase #-}

-- |
-- The meaning of the language, as a small-step relation.
--
-- A state is a clock, what the conditions are at, and how far the program has come.
-- The rules say what may happen next; where several may, any of them does. Time
-- passes only when nothing else can happen.
--
-- What runs side by side takes its steps in any order. In particular a branch that
-- has ended is not seen by its operator at once, a branch that was asked to stop
-- does not hear it at once, and in between others take their steps: all this is
-- \"the same instant\" and is where ties come from.
module Semantics.Step
  ( step
  , pass
  ) where

import qualified Data.Map.Strict as Map
import qualified Data.Set as Set

import Semantics.Begin
import Semantics.Program
import Semantics.Sense
import Semantics.Source
import Semantics.State
import Semantics.Verdict

-- | What may happen next.
step :: State -> [(Transition, State)]
step (State r t) = [(event, State r' t') | (Happens event, t', r') <- steps t r]

-- | Time passes, up to the next moment at which something can happen; or to a later one, as
-- long as that makes nothing late by the given number of ticks. Only for states in which
-- nothing else can happen.
pass :: Ticks -> State -> [State]
pass slip (State r t) = case filter (> clock t) (moments r) of
  [] -> []
  coming ->
    [ State (afterwards r) t {clock = at}
    | let next = minimum coming
    , at <- Set.toList (Set.fromList coming)
    , at == next || at < next + slip
    ]

steps :: Now -> Running -> Steps Running
steps t = \case
  Starting p -> silently t (begin t p)
  Calling name scripts ->
    let n = Map.findWithDefault 0 name (calls t)
        script = scripts !! n
        called
          | n + 1 < length scripts = t {calls = Map.insert name (n + 1) (calls t)}
          | otherwise = t
     in [(Happens (name `Does` Begins), called, Acting name (clock t + takes script) script)]
  Acting name until' script ->
    [(Happens (name `Does` Ends (ends script)), t, Over (ended name (ends script))) | clock t >= until']
  Cleaning name until' how ->
    [ (Happens (name `Does` maybe Stops Ends how), t, Over (maybe (Stopped Nothing) (ended (cleanupOf name)) how))
    | clock t >= until'
    ]
  Tidying name until' -> [(Happens (name `Does` Stops), t, Over (Stopped Nothing)) | clock t >= until']
  first `AndThen` second -> [(l, t', andThen t' r second) | (l, t', r) <- steps t first]
  first `OrElse` second -> [(l, t', orElse t' r second) | (l, t', r) <- steps t first]
  Looking operator threads ->
    case verdict operator threads of
      Just result -> silently t (conclude operator result nothing threads)
      Nothing -> []
      ++ concatMap (serve operator) (oneOf (threadSteps t) threads)
      ++ (if operator == Nursery then retract threads else [])
  -- A reading that begins before it looks does not count.
  Opening p -> silently t (opened t p)
  Reacting p source v phase ->
    [(l, t', reacting t' p source' v phase) | (l, t', source') <- sourceSteps steps hear t source]
      ++ reactions t p source v phase
  Sharing source body ->
    case verdict Share [body] of
      Just result -> silently t (conclude Share result source [body])
      Nothing -> []
      ++ [(l, t', Sharing source' body) | (l, t', source') <- sourceSteps steps hear t source]
      ++ [(l, t', Sharing source' body') | (l, t', (source', body')) <- lending source (`threadSteps` body)]
  Concluding operator result source threads
    | rested source, all over threads -> silently t (Over (outcome operator result source threads))
    | otherwise ->
        [(l, t', concluding operator result source' threads) | (l, t', source') <- sourceSteps steps hear t source]
          ++ [ (l', t', concluding operator result source' threads')
             | (l, t', (source', threads')) <- branches
             , l' <- if operator == Nursery then refuse l else [l]
             ]
   where
    branches
      | operator == Share = lending source (\t' -> oneOf (threadSteps t') threads)
      | otherwise = [(l, t', (source, threads')) | (l, t', threads') <- oneOf (threadSteps t) threads]
  Forking p wanted ->
    (Refused, t, Over (Failed tooLate)) : case wanted of
      Nothing -> [(Forks Nothing p, t, Forked Nothing)]
      Just (stops, meanwhile) ->
        let k = length (takeWhile id (zipWith (==) [0 ..] (Map.keys (answers t))))
         in [(Forks (Just k) p, t {answers = Map.insert k Nothing (answers t)}, Forked (Just (k, stops, meanwhile)))]
  Forked Nothing -> silently t (Over (Succeeded Unit))
  Forked (Just (k, stops, meanwhile)) ->
    silently t (whenSuccessful ((if stops then Retracting else Obtaining) k) (begin t meanwhile))
  Retracting k (Over _) ->
    silently t {retracted = Set.insert k (retracted t)} (Obtaining k (Over (Succeeded Unit)))
  Retracting k r -> [(l, t', whenSuccessful (Retracting k) r') | (l, t', r') <- steps t r]
  Obtaining k (Over _) -> case Map.lookup k (answers t) of
    Just (Just result) ->
      silently t {answers = Map.delete k (answers t), retracted = Set.delete k (retracted t)} (Over result)
    _ -> []
  Obtaining k r -> [(l, t', whenSuccessful (Obtaining k) r') | (l, t', r') <- steps t r]
  Answering k r -> [(l, t', Answering k r') | (l, t', r') <- steps t r]
  Changing (Change at condition level : others) end -> changing at condition level (Changing others end)
  Changing [] end -> if clock t >= end then silently t (Over (Succeeded timeIsUp)) else []
  Called _ (Over result) [] [] -> silently t (Over result)
  Called asks r coming asking ->
    [(l, t', Called asks' (returning r r') coming asking) | (l, t', asks', r') <- running' t asks r]
      ++ case (coming, asking) of
        (Change at condition level : others, _) -> changing at condition level (Called asks r others asking)
        ([], at : others) | clock t >= at -> silently t (Called (askedAgain asks) r [] others)
        _ -> []
  Returning result -> silently t (Over result)
  Over _ -> []
 where
  returning before = \case
    Over result@(Succeeded _) | before /= Returning result -> Returning result
    r -> r
  -- The steps of those among whom a source is shared.
  lending source ofThose =
    [ (l, t' {shared = drop 1 (shared t')}, (source', those))
    | (l, t', those) <- ofThose t {shared = source : shared t}
    , source' <- take 1 (shared t')
    ]
  changing at condition level others =
    [ (Happens (condition `Becomes` level), t {levels = Map.insert condition level (levels t)}, others)
    | clock t >= at
    ]
  serve Nursery (Forks wanted p, t', threads)
    | Nothing <- verdict Nursery threads = silently t' (Looking Nursery (threads ++ [forked t' wanted p]))
    | otherwise = []
  serve Nursery (Refused, _, _) = []
  serve Nursery (l, t', threads) = [(l, t', Looking Nursery (withoutCompleted threads))]
  serve operator (l, t', threads) = [(l, t', Looking operator threads)]
  -- While all is being stopped to fork fails.
  refuse = \case
    Forks _ _ -> []
    Refused -> [Happens Silent]
    l -> [l]
  -- It asks a child to stop that was retracted.
  retract threads =
    [ (Happens Silent, t {retracted = Set.delete k (retracted t)}, Looking Nursery (map (\c -> if isChild k c then ask c else c) threads))
    | Nothing <- [verdict Nursery threads]
    , k <- Set.toList (retracted t)
    , any (isChild k) threads
    ]
  isChild k = \case
    Thread _ (Living _ (Answering k' _)) -> k == k'
    _ -> False
  forked t' = \case
    Nothing -> thread t' "scoped: fork"
    Just k -> Thread "scoped: fork" . Living Unborn . Answering k . Starting
  withoutCompleted = \case
    main : others -> main : filter (not . harmless) others
    [] -> []
  harmless child = case endOf child of
    Just (Succeeded _) -> True
    Just (Stopped Nothing) -> True
    _ -> False

-- | What comes after it if it has not gone wrong.
whenSuccessful :: (Running -> Running) -> Running -> Running
whenSuccessful next = \case
  Over (Succeeded value) -> next (Over (Succeeded value))
  Over wrong -> Over wrong
  r -> next r

-- * Being asked to stop

askedAgain :: Request -> Request
askedAgain = \case
  Asked -> AskedTwice
  Pending -> PendingAndAsked
  _ -> Asked

-- | What is left to hear once a request was heard. Nothing: there is none.
heard :: Request -> Maybe Request
heard = \case
  Asked -> Just Heard
  AskedTwice -> Just Asked
  Pending -> Just Heard
  PendingTwice -> Just Pending
  PendingAndAsked -> Just Asked
  _ -> Nothing

-- | Whether a request is heard before anything else is done.
isPending :: Request -> Bool
isPending = (`elem` [Pending, PendingTwice, PendingAndAsked])

-- | The steps of what runs in a thread, with what is left to hear after each.
running' :: Now -> Request -> Running -> [(Action, Now, Request, Running)]
running' t asks r
  | isPending asks, not (null heard') = heard'
  | otherwise = [(l, t', born, r') | (l, t', r') <- steps t r] ++ heard'
 where
  heard' = [(Happens event, t, asks', r') | Just asks' <- [heard asks], (event, r') <- hear t r]
  born = if asks == Unborn then Unasked else asks

-- | What may become of it if it hears the request now. None: it cannot.
hear :: Now -> Running -> [(Transition, Running)]
hear t = \case
  Starting _ -> stopped
  Opening _ -> stopped
  Calling _ _ -> stopped
  Acting name until' script
    | deaf (masking script) -> []
    | otherwise -> [(name `Does` Hears, respond name (whenAsked script))]
   where
    deaf = \case
      Unmasked -> False
      Masked -> clock t >= until'
      Uninterruptible -> True
  Cleaning {} -> []
  Tidying name until'
    | clock t < until' -> [(name `Does` Hears, Over (Stopped Nothing))]
    | otherwise -> []
  first `AndThen` second -> fmap (\r -> andThen t r second) <$> hear t first
  first `OrElse` second -> fmap (\r -> orElse t r second) <$> hear t first
  Retracting k r -> within' (Retracting k) r
  Obtaining k r -> within' (Obtaining k) r
  Answering k r -> fmap (Answering k) <$> hear t r
  Looking operator threads -> [(Silent, conclude operator (Stopped Nothing) nothing some) | some <- started threads]
  Reacting _ source _ phase -> [(Silent, conclude React (Stopped Nothing) source some) | some <- started (threadsOf phase)]
  Sharing source body -> [(Silent, conclude Share (Stopped Nothing) source some) | some <- started [body]]
  Concluding operator _ source threads
    | rested source, all over threads -> [(Silent, Over (outcome operator (Stopped Nothing) source threads))]
    | otherwise -> []
  Forking _ _ -> stopped
  Forked _ -> stopped
  Changing _ _ -> stopped
  Called {} -> []
  Returning _ -> stopped
  Over _ -> []
 where
  stopped = [(Silent, Over (Stopped Nothing))]
  within' around = \case
    Over _ -> stopped
    r -> fmap (whenSuccessful around) <$> hear t r
  respond name = \case
    StopsAtOnce -> Over (Stopped Nothing)
    StopsAfter n -> Cleaning name (clock t + n) Nothing
    TidiesUp n -> Tidying name (clock t + n)
    EndsAfter n how -> Cleaning name (clock t + n) (Just how)
  -- Between the starts of two branches, too.
  started threads = case reverse threads of
    Thread _ (Living Unborn _) : others -> threads : started (reverse others)
    _ -> [threads]

-- * Branches

threadSteps :: Now -> Thread -> Steps Thread
threadSteps t (Thread label life) = case life of
  -- It has done all that it does, and can still be stopped.
  Living asks (Returning result) -> returning Finished asks result
  Living asks (Answering k (Returning result)) -> returning (FinishedChild k) asks result
  Living asks r -> [(l, t', becomes asks' r') | (l, t', asks', r') <- running' t asks r]
  Finished result -> [ends' t result]
  FinishedChild k result -> [ends' t {answers = Map.insert k (Just (answer (asOutcome result))) (answers t)} result]
  Ended _ -> []
 where
  returning finished asks result =
    [over' | not (isPending asks), over' <- threadSteps t (Thread label (finished result))]
      ++ [(Happens Silent, t, Thread label (finished (Stopped Nothing))) | Just _ <- [heard asks]]
  becomes asks = \case
    Over result@(Succeeded _) -> Thread label (Living asks (Returning result))
    Answering k (Over result@(Succeeded _)) -> Thread label (Living asks (Answering k (Returning result)))
    Answering k (Over result) -> Thread label (FinishedChild k (asOutcome result))
    Over result -> Thread label (Finished (asOutcome result))
    r -> Thread label (Living asks r)
  ends' t' result = (Happens (IsOver label), t', Thread label (Ended (asOutcome result)))
  answer = \case
    Stopped _ -> Failed childStopped
    result -> result

-- * Reactive operators

reactions :: Now -> Program -> Source -> View -> Phase -> Steps Running
reactions t p source v phase = case phase of
  Choosing moment -> case look t moment v source of
    Nothing -> []
    Just (Left wrong) -> silently t (conclude React wrong source [])
    Just (Right seen) -> obey seen
  Idling old -> case look t Later v source of
    Just (Left wrong) -> silently t (conclude React wrong source [])
    Just (Right seen) | differs old seen -> obey seen
    _ -> []
  Following old branch ->
    inThread (Following old) branch
      -- A branch that has ended by itself is looked at first.
      ++ case (endOf branch, look t Later v source) of
        (Just result, _) -> silently t (conclude React result source [branch])
        (_, Just (Left wrong)) -> silently t (switching (Conclude wrong) source branch)
        (_, Just (Right seen@(value, t', source')))
          | differs old seen -> silently t' (switching (reaction p (valueOf p value)) source' branch)
        _ -> []
  Preempting next branch -> case endOf branch of
    Just result -> silently t (switched next result branch)
    Nothing -> inThread (Preempting next) branch
  Recovering before recovery -> case endOf recovery of
    Just result -> silently t (recovered before result recovery)
    Nothing -> inThread (Recovering before) recovery
  Resting -> []
  Beginning -> silently t (beginning t p source)
 where
  inThread inPlace branch = [(l, t', Reacting p source v (inPlace branch')) | (l, t', branch') <- threadSteps t branch]
  differs old (value, _, _) = valueOf p value /= old
  obey (seen, t', source') = silently t' $ case reaction p value of
    Run act -> Reacting p source' v (Following value (thread t' (nameOf p value) act))
    RunToEnd recovery -> recover Nothing (askSource source') recovery
    Idle -> Reacting p source' v (Idling value)
    Conclude result -> conclude React result source' []
   where
    value = valueOf p seen
  -- Unless there will be nothing to sense, the sensors go on.
  switching next source' branch = Reacting p (alike source') v (Preempting next (ask branch))
   where
    alike = case next of
      Run _ -> id
      Idle -> id
      _ -> askSource
  switched next result branch = case (next, result) of
    (Conclude result', Stopped _) -> conclude React result' source []
    (Conclude _, _) -> conclude React result source [branch]
    (RunToEnd _, Succeeded _) -> conclude React result source []
    (RunToEnd recovery, Stopped _) -> recover Nothing source recovery
    (RunToEnd recovery, _) -> recover (Just branch) source recovery
    (_, Stopped _) -> Reacting p source (viewOf t source) (Choosing Later)
    _ -> conclude React result source [branch]
  recover before source' recovery = Reacting p source' v (Recovering before (thread t "monitor: recovery" recovery))
  recovered before result recovery = case (before >>= endOf, result) of
    (Just wrong, _) -> conclude React wrong source (maybe id (:) before [recovery])
    (_, Succeeded _) -> reacting t p source v Resting
    _ -> conclude React result source [recovery]

-- | An operator whose sensors have taken a step.
reacting :: Now -> Program -> Source -> View -> Phase -> Running
reacting t p source v phase = case phase of
  Resting
    | not (null (faultsOf source)) -> conclude React (Failed "a sensor faulted") source []
    | rested source, any borrows (signals p) -> Reacting p source v Beginning
    | rested source -> beginning t p source
  _ -> Reacting p source v phase

-- | It begins once more.
beginning :: Now -> Program -> Source -> Running
beginning t p source = Reacting p fresh (viewOf t fresh) (Choosing Later)
 where
  fresh = startedAt t source
