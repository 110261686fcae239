{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The meaning of the language, as a small-step relation.
--
-- A state consists of a clock, the levels of the conditions, and what remains of the
-- program. The rules define the steps that are possible; where there are several, any of
-- them may be taken. Time passes only when no step is possible.
--
-- Concurrent threads take their steps in any order. In particular there can be steps of
-- other threads between the end of a branch and the moment when its operator reads it, and
-- between a stop request and its receipt. All of them are in the same instant, which is
-- why ties are possible.
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

-- | The possible steps, each with its transition.
step :: State -> [(Transition, State)]
step (State r t) = case r of
  Over _ -> []
  _ ->
    [(transition, State r' t') | (Emits transition, t', r') <- steps t r]
      ++ [ (transition, State r t' {abandoned = abandoned t' ++ filter (not . over) threads})
         | (Emits transition, t', threads) <- oneOf (threadSteps t {abandoned = []}) (abandoned t)
         ]

-- | Time passes, up to the next time at which something is due; or to a later one, as long
-- as nothing gets late by the given number of ticks. Only for states in which no step is
-- possible.
pass :: Ticks -> State -> [State]
pass slip (State r t) = case (r, filter (> clock t) (dueTimes r ++ concat ofAbandoned)) of
  (Over _, _) -> []
  (_, []) -> []
  (_, coming) ->
    [ State (afterTimePassed r) t {clock = at, abandoned = map threadAfter (abandoned t)}
    | let next = minimum coming
    , at <- Set.toList (Set.fromList coming)
    , at == next || at < next + slip
    ]
 where
  ofAbandoned = [dueTimes live | Thread _ (Live _ live) <- abandoned t]

steps :: Now -> Running -> Steps Running
steps t = \case
  Starting p -> silently t (begin t p)
  Calling name scripts ->
    let n = Map.findWithDefault 0 name (calls t)
        script = scripts !! n
        called
          | n + 1 < length scripts = t {calls = Map.insert name (n + 1) (calls t)}
          | otherwise = t
     in [(Emits (Action name Begins), called, Acting name (clock t + takes script) script)]
  Acting name due script ->
    [(Emits (Action name (Ends (ends script))), t, Over (ended name (ends script))) | clock t >= due]
  Cleaning name due how ->
    [ (Emits (Action name (maybe Stops Ends how)), t, Over (maybe (Stopped Nothing) (ended (cleanupOf name)) how))
    | clock t >= due
    ]
  CleaningInterruptibly name due -> [(Emits (Action name Stops), t, Over (Stopped Nothing)) | clock t >= due]
  first `AndThen` second -> [(l, t', andThen t' r second) | (l, t', r) <- steps t first]
  first `OrElse` second -> [(l, t', orElse t' r second) | (l, t', r) <- steps t first]
  Sleeping due -> [over' | clock t >= due, over' <- silently t (Over (Succeeded Unit))]
  InSlot interval from p r -> [(l, t', inSlot t' interval from p r') | (l, t', r') <- steps t r]
  AwaitingSlot interval due p ->
    [begun | clock t >= due, begun <- silently t (inSlot t interval due p (continued t p))]
  Entering r -> silently t r
  Uninterruptibly (Over result) -> silently t (Over result)
  Uninterruptibly r -> [(l, t', Uninterruptibly r') | (l, t', r') <- steps t r]
  GivingUp due branch
    | over branch -> silently t (Over (outcome Race (Stopped Nothing) noSource [branch]))
    | otherwise ->
        [(l, t', GivingUp due branch') | (l, t', branch') <- threadSteps t branch]
          ++ [ gone
             | clock t >= due
             , gone <- silently t {abandoned = abandoned t ++ [branch]} (Over (Stopped Nothing))
             ]
  Delivering -> silently (withOneMore t) (Over (Succeeded Unit))
  Taking awaited p -> case Map.lookup messages (levels t) of
    Just (At n) | n > 0 -> silently t {levels = Map.insert messages (At (n - 1)) (levels t)} (Handling (Starting p))
    _ | awaited -> []
    _ -> silently t (Over (Succeeded Unit))
  Handling (Over result@(Succeeded _)) -> silently t (Over result)
  Handling (Over wrong) -> silently (withOneMore t) (Over wrong)
  Handling r -> [(l, t', Handling r') | (l, t', r') <- steps t r]
  Serving handler Nothing -> case Map.lookup messages (levels t) of
    Just (At n) | n > 0 -> silently t (Serving handler (Just (Waiting Race [inBranch (Taking True handler)])))
    _ -> []
   where
    inBranch = Thread "messageRule: handler" . Live NotStarted . Entering
  Serving handler (Just r) -> [(l, t', serving handler r') | (l, t', r') <- steps t r]
  Closing (Over result) -> silently t (Over result)
  Closing r -> [(l, t', Closing r') | (l, t', r') <- steps t r]
  Waiting operator threads ->
    case verdict operator threads of
      Just result -> silently t (conclude operator result noSource threads)
      Nothing -> []
      ++ concatMap (serve operator) (oneOf (threadSteps t) threads)
      ++ (if operator == Nursery then stopRequestedChildren threads else [])
  -- Readings that began before this step do not count.
  Opening p -> silently t (opened t p)
  Reacting p source v phase ->
    [(l, t', afterSensorStep t' p source' v phase) | (l, t', source') <- sourceSteps steps receive t source]
      ++ reactions t p source v phase
  Sharing source body ->
    case verdict Share [body] of
      Just result -> silently t (conclude Share result source [body])
      Nothing -> []
      ++ [(l, t', Sharing source' body) | (l, t', source') <- sourceSteps steps receive t source]
      ++ [(l, t', Sharing source' body') | (l, t', (source', body')) <- withSharedSource source (`threadSteps` body)]
  Concluding operator result source threads
    | allStopped source, all over threads -> silently t (Over (outcome operator result source threads))
    | otherwise ->
        [(l, t', concluding operator result source' threads) | (l, t', source') <- sourceSteps steps receive t source]
          ++ [ (l', t', concluding operator result source' threads')
             | (l, t', (source', threads')) <- branches
             , l' <- if operator == Nursery then refuse l else [l]
             ]
   where
    branches
      | operator == Share = withSharedSource source (\t' -> oneOf (threadSteps t') threads)
      | otherwise = [(l, t', (source, threads')) | (l, t', threads') <- oneOf (threadSteps t) threads]
  Forking p wanted ->
    (Refused, t, Over (FailedWith tooLate)) : case wanted of
      Nothing -> [(Forks Nothing p, t, Forked Nothing)]
      Just (stops, meanwhile) ->
        let k = length (takeWhile id (zipWith (==) [0 ..] (Map.keys (childResults t))))
            child = Forked (Just (k, stops, meanwhile))
         in [(Forks (Just k) p, t {childResults = Map.insert k Nothing (childResults t)}, child)]
  Forked Nothing -> silently t (Over (Succeeded Unit))
  Forked (Just (k, stops, meanwhile)) ->
    silently t (whenSuccessful ((if stops then StoppingChild else AwaitingChild) k) (begin t meanwhile))
  StoppingChild k (Over _) ->
    silently t {childStopRequests = Set.insert k (childStopRequests t)} (AwaitingChild k (Over (Succeeded Unit)))
  StoppingChild k r -> [(l, t', whenSuccessful (StoppingChild k) r') | (l, t', r') <- steps t r]
  AwaitingChild k (Over _) -> case Map.lookup k (childResults t) of
    Just (Just result) ->
      silently
        t {childResults = Map.delete k (childResults t), childStopRequests = Set.delete k (childStopRequests t)}
        (Over result)
    _ -> []
  AwaitingChild k r -> [(l, t', whenSuccessful (AwaitingChild k) r') | (l, t', r') <- steps t r]
  AsChild k r -> [(l, t', AsChild k r') | (l, t', r') <- steps t r]
  Changing (Change at condition level : others) end -> changing at condition level (Changing others end)
  Changing [] end -> if clock t >= end then silently t (Over (Succeeded timeIsUp)) else []
  Called _ (Over result) [] [] -> silently t (Over result)
  Called requests r coming stopTimes ->
    [(l, t', Called requests' (returning r r') coming stopTimes) | (l, t', requests', r') <- runningSteps t requests r]
      ++ case (coming, stopTimes) of
        (Change at condition level : others, _) -> changing at condition level (Called requests r others stopTimes)
        ([], at : others) | clock t >= at -> silently t (Called (requestedAgain requests) r [] others)
        _ -> []
  Returning result -> silently t (Over result)
  Over _ -> []
 where
  returning before = \case
    Over result@(Succeeded _) | before /= Returning result -> Returning result
    r -> r
  -- The steps of the threads that share the source.
  withSharedSource source ofThose =
    [ (l, t' {shared = drop 1 (shared t')}, (source', those))
    | (l, t', those) <- ofThose t {shared = source : shared t}
    , source' <- take 1 (shared t')
    ]
  changing at condition level others =
    [ (Emits (condition `Becomes` level), t {levels = Map.insert condition level (levels t)}, others)
    | clock t >= at
    ]
  serve Nursery (Forks wanted p, t', threads)
    | Nothing <- verdict Nursery threads = silently t' (Waiting Nursery (threads ++ [forked t' wanted p]))
    | otherwise = []
  serve Nursery (Refused, _, _) = []
  serve Nursery (l, t', threads) = [(l, t', Waiting Nursery (withoutCompleted threads))]
  serve operator (l, t', threads) = [(l, t', Waiting operator threads)]
  -- A fork fails while the nursery stops its branches.
  refuse = \case
    Forks _ _ -> []
    Refused -> [Emits Silent]
    l -> [l]
  -- Requests the stop of the children whose handles have requested it.
  stopRequestedChildren threads =
    [ ( Emits Silent
      , t {childStopRequests = Set.delete k (childStopRequests t)}
      , Waiting Nursery (map (\c -> if isChild k c then requestStop c else c) threads)
      )
    | Nothing <- [verdict Nursery threads]
    , k <- Set.toList (childStopRequests t)
    , any (isChild k) threads
    ]
  isChild k = \case
    Thread _ (Live _ (AsChild k' _)) -> k == k'
    _ -> False
  forked t' = \case
    Nothing -> thread t' "scoped: fork"
    Just k -> Thread "scoped: fork" . Live NotStarted . AsChild k . Starting
  withoutCompleted = \case
    main : others -> main : filter (not . harmless) others
    [] -> []
  harmless child = case endOf child of
    Just (Succeeded _) -> True
    Just (Stopped Nothing) -> True
    _ -> False

-- | With another message; if there is no room, the oldest is dropped.
withOneMore :: Now -> Now
withOneMore t = t {levels = Map.adjust more messages (levels t)}
 where
  more = \case
    At n -> At (min roomForMessages (n + 1))
    level -> level

-- | Applies the function unless it has ended without success.
whenSuccessful :: (Running -> Running) -> Running -> Running
whenSuccessful next = \case
  Over (Succeeded value) -> next (Over (Succeeded value))
  Over wrong -> Over wrong
  r -> next r

-- * Stop requests

requestedAgain :: Request -> Request
requestedAgain = \case
  Requested -> RequestedTwice
  Pending -> PendingAndRequested
  _ -> Requested

-- | What is left to receive after one request was received. 'Nothing': there is no request.
afterReceiving :: Request -> Maybe Request
afterReceiving = \case
  Requested -> Just Received
  RequestedTwice -> Just Requested
  Pending -> Just Received
  PendingTwice -> Just Pending
  PendingAndRequested -> Just Requested
  _ -> Nothing

-- | Whether a request is received before any other step.
isPending :: Request -> Bool
isPending = (`elem` [Pending, PendingTwice, PendingAndRequested])

-- | The steps of what runs in a thread, with the requests that are left after each.
runningSteps :: Now -> Request -> Running -> [(Effect, Now, Request, Running)]
runningSteps t requests r
  | isPending requests, not (null received) = received
  | otherwise = [(l, t', startedRequest, r') | (l, t', r') <- steps t r] ++ received
 where
  received =
    [ (Emits transition, t, requests', r')
    | Just requests' <- [afterReceiving requests]
    , (transition, r') <- receive t r
    ]
  startedRequest = if requests == NotStarted then NoRequest else requests

-- | The possible results of receiving a stop request now. None: it cannot be received.
receive :: Now -> Running -> [(Transition, Running)]
receive t = \case
  Starting _ -> stopped
  Opening _ -> stopped
  Calling _ _ -> stopped
  Acting name due script
    | uninterruptible (masking script) -> []
    | otherwise -> [(Action name ReceivesStop, respond name (onStop script))]
   where
    uninterruptible = \case
      Unmasked -> False
      Masked -> clock t >= due
      Uninterruptible -> True
  Cleaning {} -> []
  CleaningInterruptibly name due
    | clock t < due -> [(Action name ReceivesStop, Over (Stopped Nothing))]
    | otherwise -> []
  first `AndThen` second -> fmap (\r -> andThen t r second) <$> receive t first
  first `OrElse` second -> fmap (\r -> orElse t r second) <$> receive t first
  StoppingChild k r -> childStopping (StoppingChild k) r
  AwaitingChild k r -> childStopping (AwaitingChild k) r
  AsChild k r -> fmap (AsChild k) <$> receive t r
  Sleeping _ -> stopped
  InSlot interval from p r -> fmap (inSlot t interval from p) <$> receive t r
  AwaitingSlot {} -> stopped
  Entering _ -> stopped
  Uninterruptibly _ -> []
  Delivering -> stopped
  Taking awaited _
    | awaited, Just (At 0) <- Map.lookup messages (levels t) -> stopped
    | otherwise -> []
  -- (The handler runs unmasked: so a request that came while it masked itself is received at its end.)
  Handling (Over (Succeeded _)) -> [(Silent, Handling (Over (Stopped Nothing)))]
  Handling (Over _) -> []
  Handling r -> fmap Handling <$> receive t r
  Serving handler r -> maybe stopped (fmap (fmap (serving handler)) . receive t) r
  Closing _ -> []
  GivingUp _ _ -> []
  Waiting (Abandon most) threads ->
    [ (Silent, case some of [] -> Over (Stopped Nothing); branch : _ -> GivingUp (clock t + most) (requestStop branch))
    | some <- started threads
    ]
  Waiting operator threads -> [(Silent, conclude operator (Stopped Nothing) noSource some) | some <- started threads]
  Reacting _ source _ phase ->
    [(Silent, conclude React (Stopped Nothing) source some) | some <- started (threadsOf phase)]
  Sharing source body -> [(Silent, conclude Share (Stopped Nothing) source some) | some <- started [body]]
  Concluding operator _ source threads
    | allStopped source, all over threads -> [(Silent, Over (outcome operator (Stopped Nothing) source threads))]
    | otherwise -> []
  Forking _ _ -> stopped
  Forked _ -> stopped
  Changing _ _ -> stopped
  Called {} -> []
  Returning _ -> stopped
  Over _ -> []
 where
  stopped = [(Silent, Over (Stopped Nothing))]
  childStopping around = \case
    Over _ -> stopped
    r -> fmap (whenSuccessful around) <$> receive t r
  respond name = \case
    StopsAtOnce -> Over (Stopped Nothing)
    StopsAfter n -> Cleaning name (clock t + n) Nothing
    CleansUpInterruptibly n -> CleaningInterruptibly name (clock t + n)
    EndsAfter n how -> Cleaning name (clock t + n) (Just how)
  -- The request may also arrive between the starts of two branches.
  started threads = case reverse threads of
    Thread _ (Live NotStarted _) : others -> threads : started (reverse others)
    _ -> [threads]

-- * Branches

threadSteps :: Now -> Thread -> Steps Thread
threadSteps t (Thread label state) = case state of
  -- The work is done, and a stop request can still arrive.
  Live requests (Returning result) -> returning Finished requests result
  Live requests (AsChild k (Returning result)) -> returning (FinishedChild k) requests result
  Live requests r -> [(l, t', becomes requests' r') | (l, t', requests', r') <- runningSteps t requests r]
  Finished result -> [publishes t result]
  FinishedChild k result ->
    [publishes t {childResults = Map.insert k (Just (answer (asOutcome result))) (childResults t)} result]
  Ended _ -> []
 where
  returning finished requests result =
    [over' | not (isPending requests), over' <- threadSteps t (Thread label (finished result))]
      ++ [(Emits Silent, t, Thread label (finished (Stopped Nothing))) | Just _ <- [afterReceiving requests]]
  becomes requests = \case
    Over result@(Succeeded _) -> Thread label (Live requests (Returning result))
    AsChild k (Over result@(Succeeded _)) -> Thread label (Live requests (AsChild k (Returning result)))
    AsChild k (Over result) -> Thread label (FinishedChild k (asOutcome result))
    Over result -> Thread label (Finished (asOutcome result))
    r -> Thread label (Live requests r)
  publishes t' result = (Emits (IsOver label), t', Thread label (Ended (asOutcome result)))
  answer = \case
    Stopped _ -> FailedWith childStopped
    result -> result

-- * Reactive operators

reactions :: Now -> Program -> Source -> View -> Phase -> Steps Running
reactions t p source v phase = case phase of
  Choosing mode -> case reading mode of
    Nothing -> []
    Just (Left wrong) -> silently t (conclude React wrong source [])
    Just (Right seen) -> react seen
  Idling old -> case reading Reread of
    Just (Left wrong) -> silently t (conclude React wrong source [])
    Just (Right seen) | differs old seen -> react seen
    _ -> []
  Following old branch ->
    inThread (Following old) branch
      -- The end of the branch has priority over the signal.
      ++ case (endOf branch, reading Reread) of
        (Just result, _) -> silently t (conclude React result source [branch])
        (_, Just (Left wrong)) -> silently t (stopping (Conclude wrong) source branch)
        (_, Just (Right seen@(value, t', source')))
          | differs old seen -> silently t' (stopping (response p (valueOf p value)) source' branch)
        _ -> []
  Stopping next branch -> case endOf branch of
    Just result -> silently t (afterStop next result branch)
    Nothing -> inThread (Stopping next) branch
  Recovering before recovery -> case endOf recovery of
    Just result -> silently t (recovered before result recovery)
    Nothing -> inThread (Recovering before) recovery
  AwaitingSensors -> []
  Restarting -> silently t (restarted t p source)
 where
  inThread inPlace branch = [(l, t', Reacting p source v (inPlace branch')) | (l, t', branch') <- threadSteps t branch]
  differs old (value, _, _) = valueOf p value /= old
  -- The condition of a rule for messages also holds while the rule handles one.
  reading mode = case phase of
    Following 1 (Thread _ (Live _ (Serving _ (Just (Waiting _ [Thread _ (Live _ (Handling _))]))))) ->
      fmap (\(value, t', source') -> (value, t' {levels = levels t}, source'))
        <$> readSource t {levels = Map.insert messages (At 1) (levels t)} mode v source
    _ -> readSource t mode v source
  react (seen, t', source') = silently t' $ case response p value of
    Run act -> Reacting p source' v (Following value (started t' act))
    RunToEnd recovery -> recover Nothing (requestStopOfSource source') recovery
    Idle -> Reacting p source' v (Idling value)
    Conclude result -> conclude React result source' []
   where
    value = valueOf p seen
    started now' act = case p of
      MessageRule {} | value == 1 -> Thread (nameOf p value) (Live NotStarted (Serving act Nothing))
      _ -> thread now' (nameOf p value) act
  -- The sensors keep running if the signal is read again after the branch has stopped.
  stopping next source' branch = Reacting p (keepOrStop source') v (Stopping next (requestStop branch))
   where
    keepOrStop = case next of
      Run _ -> id
      Idle -> id
      _ -> requestStopOfSource
  afterStop next result branch = case (next, result) of
    (Conclude concluded, Stopped _) -> conclude React concluded source []
    (Conclude _, _) -> conclude React result source [branch]
    (RunToEnd _, Succeeded _) -> conclude React result source []
    (RunToEnd recovery, Stopped _) -> recover Nothing source recovery
    (RunToEnd recovery, _) -> recover (Just branch) source recovery
    (_, Stopped _) -> Reacting p source (viewOf t source) (Choosing Reread)
    _ -> conclude React result source [branch]
  recover before source' recovery = Reacting p source' v (Recovering before (recoveryThread recovery))
  recoveryThread recovery = case p of
    OnMessage _ _ -> Thread (recoveryOf p) (Live NotStarted (Entering (Taking False recovery)))
    _ -> thread t (recoveryOf p) recovery
  beginsAgain = case p of
    Monitor {} -> True
    OnMessage _ _ -> True
    _ -> False
  recovered before result recovery = case (before >>= endOf, result) of
    (Just wrong, _) -> conclude React wrong source (maybe id (:) before [recovery])
    (_, Succeeded _) | beginsAgain -> afterSensorStep t p source v AwaitingSensors
    _ -> conclude React result source [recovery]

-- | The operator after a step of its sensors.
afterSensorStep :: Now -> Program -> Source -> View -> Phase -> Running
afterSensorStep t p source v phase = case phase of
  AwaitingSensors
    | not (null (pollerFaults source)) -> conclude React (FailedWith "a sensor faulted") source []
    | allStopped source, any usesShared (signals p) -> Reacting p source v Restarting
    | allStopped source -> restarted t p source
  _ -> Reacting p source v phase

-- | The operator, with restarted sensors.
restarted :: Now -> Program -> Source -> Running
restarted t p source = Reacting p fresh (viewOf t fresh) (Choosing Reread)
 where
  fresh = startSource t source
