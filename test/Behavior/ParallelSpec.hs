{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE ScopedTypeVariables #-}

module Behavior.ParallelSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (asyncThreadId)
import Control.Exception
import Control.Monad (forM, replicateM, unless, void, when)
import Data.Foldable (for_, traverse_)
import qualified Data.Map as Map
import System.IO.Unsafe (unsafeInterleaveIO)
import Test.Hspec hiding (parallel)
import Test.QuickCheck hiding (Failure, within)

import Behavior
import Behavior.Parallel (allOf, firstOf, fork, scoped)
import Support

spec :: Spec
spec = guarded $ do
  describe "Which outcome, when several things happened" $ do
    for_ [parallel', both', firstOf', allOf', scoped'] outcomes
    ties
  describe "parallel and both" $ do
    starting
    laws
  describe "firstOf and allOf" many
  describe "All that has to stop" together

-- Which outcome ---------------------------------------------------------------

-- | What becomes of a branch. The first three end by themselves; the others when
-- they are asked to stop.
data Fate
  = Completes
  | FailsAlone
  | FaultsAlone
  | Stops
  | StopsFailing
  | StopsFaulting
  | CompletesAllTheSame
  deriving (Bounded, Enum, Eq, Show)

instance Arbitrary Fate where
  arbitrary = arbitraryBoundedEnum

saying :: Fate -> String
saying = \case
  Completes -> "succeeds"
  FailsAlone -> "fails"
  FaultsAlone -> "faults"
  Stops -> "is stopped"
  StopsFailing -> "is stopped and its cleanup fails"
  StopsFaulting -> "is stopped and its cleanup faults"
  CompletesAllTheSame -> "is stopped but completes"

endsAlone, isFaulty :: Fate -> Bool
endsAlone = (`elem` [Completes, FailsAlone, FaultsAlone])
isFaulty = (`elem` [FaultsAlone, StopsFaulting])

-- | A branch, whose name is in all that it throws, and which gives a number.
data Actor = Actor
  { name :: String
  , number :: Int
  , fate :: Fate
  }
  deriving (Show)

actors :: [Fate] -> [Actor]
actors = zipWith3 Actor (map (: []) ['a' ..]) [1 ..]

-- | What of the actors' ends ends the operator.
data Kind = Race | Gather | Nursery

data Operator = Operator
  { called :: String
  , kind :: Kind
  , forcesTies :: Bool
  -- ^ Whether it can be made to look only when it is to.
  , members :: (String, String)
  , gives :: [Int] -> [Int]
  , apply :: [Behavior Int] -> Behavior [Int]
  }

parallel', both', firstOf', allOf', scoped' :: Operator
parallel' = Operator "parallel" Race False ("left", "right") (const []) (pairwise parallel)
both' = Operator "both" Gather False ("left", "right") (const []) (pairwise both)
firstOf' = Operator "firstOf" Race True ("the first", "the second") id (fmap pure . firstOf)
allOf' = Operator "allOf" Gather True ("the first", "the second") id allOf
scoped' = Operator "scoped" Nursery False ("the body", "the fork") id $ \case
  body : forked -> scoped $ \nursery -> traverse_ (fork nursery) (take 1 forked) >> pure <$> body
  [] -> pure []

pairwise :: (Behavior Int -> Behavior Int -> Behavior ()) -> [Behavior Int] -> Behavior [Int]
pairwise operator = \case
  left : right : _ -> [] <$ operator left right
  _ -> pure []

-- | The actors by whose own end the operator comes to its verdict.
deciding :: Kind -> [Actor] -> [Actor]
deciding Race = filter (endsAlone . fate)
deciding Gather = filter ((`elem` [FailsAlone, FaultsAlone]) . fate)
deciding Nursery = \case
  body : forked -> filter (endsAlone . fate) [body] ++ deciding Gather forked
  [] -> []

-- | Section 2 of the design, "Which outcome, when several things happened". All
-- that is there is there when the operator looks.
predicted :: Kind -> Bool -> [Actor] -> Ending [Int]
predicted which isCancelled cast =
  case (isCancelled, [show (Fault (name a)) | a <- cast, isFaulty (fate a)]) of
    -- 1. Was the caller cancelled?
    (True, []) -> CancelledBy (show theCancel)
    (True, leftmost : _) -> CancelledWithFault (show theCancel) leftmost
    -- 2. Did a branch fault? The leftmost.
    (False, leftmost : _) -> FaultedWith leftmost
    -- 3. Did a branch complete or fail? On a tie the left one.
    (False, _) -> case deciding which cast of
      decisive : _
        | FailsAlone <- fate decisive -> FailedWith (show (Failure (name decisive)))
        | otherwise -> Gave [number decisive]
      [] -> Gave (map number cast)

theCancel :: Cancel
theCancel = Cancel "the caller"

-- | Whether the actors can meet such fates: somebody must stop those who have to be
-- stopped, and nobody can be cancelled for whom nothing is left to wait for.
possible :: Kind -> Bool -> [Actor] -> Bool
possible which isCancelled cast
  | isCancelled = not allAlone
  | otherwise = allAlone || not (null (deciding which cast))
 where
  allAlone = all (endsAlone . fate) cast

-- | Whether it is a tie: then the operator must look when all of them have ended.
isTie :: Kind -> [Actor] -> Bool
isTie which cast = length (deciding which cast) > 1

-- | In which order those end who end by themselves.
data Order = FromTheLeft | FromTheRight
  deriving (Bounded, Enum)

-- | Plays it, and says how the operator ended.
enact :: Operator -> Bool -> [Actor] -> IO (Ending [Int])
enact = enactIn FromTheLeft

-- | The same, and those who end by themselves do so in that order.
--
-- Where ties can be forced ('forcesTies') the operator gets its behaviours in a list
-- whose end, which it comes to before it first looks, is there only when all have
-- ended who end by themselves. Otherwise they end in an order in which only the last
-- one decides. Those who are stopped wait, in their cleanup, until all of them have
-- heard of it, and the caller has still not returned; and if the caller is to be
-- cancelled as well as somebody decides, that is when it happens.
enactIn :: Order -> Operator -> Bool -> [Actor] -> IO (Ending [Int])
enactIn order operator isCancelled cast = do
  stage <- forM cast $ \actor ->
    (,,,) actor <$> newGate <*> newGate <*> newEmptyMVar
  mayEnd <- newGate
  looking <- newGate
  let act (actor, cue, cleaning, there) = case fate actor of
        Completes -> alone (pure (number actor))
        FailsAlone -> alone (throwIO (Failure (name actor)))
        FaultsAlone -> alone (throwIO (Fault (name actor)))
        Stops -> stopped throwIO
        StopsFailing -> stopped (const (throwIO (Failure (name actor))))
        StopsFaulting -> stopped (const (throwIO (Fault (name actor))))
        CompletesAllTheSame -> stopped (const (pure (100 + number actor)))
       where
        alone end = enter >> pass cue >> end
        stopped end =
          (enter >> hang) `catch` \(e :: SomeAsyncException) -> do
            uninterruptibleMask_ (open cleaning >> pass mayEnd)
            end e
        enter = myThreadId >>= putMVar there
      onStage = for_ stage $ \(_, _, _, there) -> readMVar there
      endAlone which = for_ (ordered stage) $ \(actor, cue, _, there) ->
        when (which actor) $ open cue >> readMVar there >>= awaitOver
      ordered = case order of
        FromTheLeft -> id
        FromTheRight -> reverse
      isDeciding actor = name actor `elem` map name (deciding (kind operator) cast)
      toBeStopped = [cleaning | (actor, _, cleaning, _) <- stage, not (endsAlone (fate actor))]
  atTheEnd <- unsafeInterleaveIO $ do
    onStage
    endAlone (endsAlone . fate)
    open looking
    pure []
  let list
        | forcesTies operator = map act stage ++ atTheEnd
        | otherwise = map act stage
  launching (leavingNothing (apply operator list)) $ \caller -> do
    if forcesTies operator
      then pass looking
      else do
        onStage
        awaitIdle (asyncThreadId caller)
        endAlone (\actor -> endsAlone (fate actor) && not (isDeciding actor))
        endAlone isDeciding
    let decided = any isDeciding cast
    when (isCancelled && not decided) $ throwTo (asyncThreadId caller) theCancel
    unless (null toBeStopped) $ do
      traverse_ pass toBeStopped
      when (isCancelled && decided) $ throwing (asyncThreadId caller) theCancel
      stillRunning caller
      open mayEnd
    awaitEnd caller

-- | An example for each cell of the table of fates.
outcomes :: Operator -> Spec
outcomes operator = describe (called operator) $ do
  for_ [(one, other, isCancelled) | one <- all', other <- all', isCancelled <- [False, True]] $
    \(one, other, isCancelled) -> do
      let cast = actors [one, other]
          end = case predicted (kind operator) isCancelled cast of
            Gave numbers -> Gave (gives operator numbers)
            bad -> bad
      when (possible (kind operator) isCancelled cast && (forcesTies operator || not (isTie (kind operator) cast))) $
        it (sentence one other isCancelled) $
          for_ orders $ \order -> enactIn order operator isCancelled cast `shouldReturn` end
  when (forcesTies operator) $
    it "ends as the design says, however many behaviours there are" $
      property $ \isCancelled ->
        forAll (actors <$> (choose (1, 6) >>= \n -> vectorOf n arbitrary)) $ \cast ->
          possible (kind operator) isCancelled cast
            ==> ioProperty (allAre (predicted (kind operator) isCancelled cast) <$> traverse (\order -> enactIn order operator isCancelled cast) orders)
 where
  orders = [minBound .. maxBound]
  allAre end = conjoin . map (=== end)
  all' = [minBound .. maxBound]
  sentence one other isCancelled =
    fst (members operator) ++ " " ++ saying one ++ ", " ++ snd (members operator) ++ " " ++ saying other
      ++ (if isCancelled then ", and the caller is cancelled" else "")

-- | Nothing outside can make 'parallel', 'both' and 'scoped' look only when both behaviours
-- have ended. But with one capability, when one transaction wakes both, they come
-- before the caller in the queue of those who may run, unless the end of a time
-- slice falls between them. So it is a tie nearly always; an operator for which the
-- right one counts gives the other outcome nearly always. (For 'firstOf' and 'allOf'
-- ties are forced, above.)
ties :: Spec
ties = do
  it "parallel: the left one's end counts when both have ended" $ do
    mostly parallel (pure ()) failed (Gave ())
    mostly parallel failed (pure ()) (FailedWith (show Failed))
    mostly parallel (failWith "left") (failWith "right") (FailedWith (show (FailedBecause "left")))
  it "both: the left one's failure counts when both have failed" $
    mostly both (failWith "left") (failWith "right") (FailedWith (show (FailedBecause "left")))
  it "scoped: of those forked, the failure of the first forked counts when both have failed" $
    mostly forking (failWith "left") (failWith "right") (FailedWith (show (FailedBecause "left")))
  it "parallel and both: also when both have ended before it is waited for" $
    for_ [parallel, both] $ \operator -> onOneCapability $ do
      ends <- replicateM 50 (ending (operator (failWith "left") (failWith "right" :: IO ()) :: IO ()))
      length (filter (== FailedWith (show (FailedBecause "left"))) ends) `shouldSatisfy` (> 25)
 where
  forking :: Behavior a -> Behavior b -> Behavior ()
  forking one other = scoped $ \nursery -> fork nursery one >> fork nursery other >> hang
  mostly operator left right end = onOneCapability $ do
    ends <- replicateM 50 $ do
      leftThere <- newEmptyMVar
      rightThere <- newEmptyMVar
      cue <- newGate
      let act there final = myThreadId >>= putMVar there >> pass cue >> final
      launching (operator (act leftThere left) (act rightThere right)) $ \caller -> do
        traverse readMVar [leftThere, rightThere] >>= traverse_ awaitIdle
        awaitIdle (asyncThreadId caller)
        open cue
        awaitEnd caller
    length (filter (== end) ends) `shouldSatisfy` (> 25)
  onOneCapability act =
    bracket (getNumCapabilities <* setNumCapabilities 1) setNumCapabilities (const act)

-- parallel and both -----------------------------------------------------------

starting :: Spec
starting = do
  for_ [("parallel", parallel), ("both", both)] $ \(operator, apply') ->
    it (operator ++ " runs both at the same time") $ do
      left <- newGate
      right <- newGate
      apply' (open left >> pass right) (open right >> pass left)

  it "parallel ends when one has ended, whichever it is, and the other has been stopped" $
    for_ [id, flip] $ \turned -> do
      inside <- newGate
      (end, done) <- observing $ \notebook ->
        turned parallel ((open inside >> hang) `onException` note notebook "stopped") (pass inside)
      (end, done) `shouldBe` (Gave (), ["stopped"])

  it "both ends when both have ended, whichever is the first" $
    for_ [id, flip] $ \turned -> do
      first <- newEmptyMVar
      second <- newGate
      launching (turned both (myThreadId >>= putMVar first) (pass second)) $ \caller -> do
        readMVar first >>= awaitOver
        stillRunning caller
        open second
        awaitEnd caller `shouldReturn` Gave ()

  it "both throws the failure of the first to fail, whichever it is" $
    for_ [id, flip] $ \turned -> do
      inside <- newGate
      let first = pass inside >> failWith "first"
          second = (open inside >> hang) `onException` failWith "second"
      ending (turned both first second) `shouldReturn` FailedWith (show (FailedBecause "first"))

  it "parallel and both start what they are given each time that they run" $ do
    (_, done) <- observing $ \notebook -> do
      let twice = both (note notebook 'l') (note notebook 'r')
      twice >> twice
    length done `shouldBe` 4

laws :: Spec
laws = do
  it "||| is parallel, looser than ? and tighter than >>" $ do
    -- failed ? (act ||| hang) would be the same; (failed ? hang) ||| act tells.
    observing (\notebook -> note notebook 'l' ? note notebook 'm' ||| hang >> note notebook 'r')
      `shouldReturn` (Gave (), "lr")
    observing (\notebook -> hang ||| failed ? note notebook 'm' >> note notebook 'r')
      `shouldReturn` (Gave (), "mr")

  it "parallel is firstOf of two, and both allOf of two" $
    forAllCasts $ \cast ->
      (===)
        <$> (voided <$> enact parallel' False cast)
        <*> (voided <$> enact firstOf' False cast)
  it "both is allOf of two" $
    forAllCasts $ \cast ->
      (===)
        <$> (voided <$> enact both' False cast)
        <*> (voided <$> enact allOf' False cast)

  it "parallel is symmetric except on ties" $ forAllCasts (symmetric parallel')
  it "both is symmetric except on ties" $ forAllCasts (symmetric both')

  it "parallel has a behaviour that never ends for its identity, but for the result" $
    property $ \a ->
      sameAs (\notebook -> play notebook a ||| hang) (\notebook -> void (play notebook a))
        .&&. sameAs (\notebook -> hang ||| play notebook a) (\notebook -> void (play notebook a))

  it "both has pure for its identity, but for the result" $
    property $ \a ->
      sameAs (\notebook -> both (play notebook a) (pure ())) (\notebook -> void (play notebook a))
        .&&. sameAs (\notebook -> both (pure ()) (play notebook a)) (\notebook -> void (play notebook a))

  it "parallel and both are associative, when there is no tie" $
    property $ \a ->
      forAll (elements [0, 1, 2 :: Int]) $ \place ->
        let among others notebook = [if n == place then void (play notebook a) else others | n <- [0 .. 2]]
         in sameAs (foldl1 parallel . among hang) (foldr1 parallel . among hang)
              .&&. sameAs (foldl1 both . among (pure ())) (foldr1 both . among (pure ()))
 where
  forAllCasts law =
    forAll (actors <$> vectorOf 2 arbitrary) $ \cast ->
      all (\which -> possible which False cast && not (isTie which cast)) [Race, Gather]
        ==> ioProperty (law cast)
  symmetric operator cast =
    if length (filter (isFaulty . fate) cast) == 2
      then pure (property True) -- the leftmost fault is a tie, too
      else property <$> ((===) <$> enact operator False cast <*> enact operator False (reverse cast))
  voided = \case
    Gave _ -> Gave ()
    FailedWith e -> FailedWith e
    FaultedWith e -> FaultedWith e
    CancelledBy e -> CancelledBy e
    CancelledWithFault cause e -> CancelledWithFault cause e

-- firstOf and allOf -----------------------------------------------------------

many :: Spec
many = do
  it "firstOf fails on nothing, and allOf gives nothing" $ do
    (firstOf [] :: IO ()) `shouldThrow` (== Failed)
    allOf [] `shouldReturn` ([] :: [()])

  it "firstOf and allOf of one are that one" $
    property $ \a ->
      sameAs (\notebook -> firstOf [play notebook a]) (`play` a)
        .&&. sameAs (\notebook -> allOf [play notebook a]) (\notebook -> pure <$> play notebook a)

  it "firstOf gives the result of the first to end, wherever it is" $
    for_ [0 .. 9] $ \winner ->
      firstOf [if n == winner then pure n else hang | n <- [0 .. 9 :: Int]] `shouldReturn` winner

  it "firstOf is satisfied with a failure, unless the behaviours have a ? of their own" $ do
    ending (firstOf [hang, failed, hang :: IO ()]) `shouldReturn` FailedWith (show Failed)
    firstOf [failed ? hang, failed ? pure 'b', hang] `shouldReturn` 'b'

  it "allOf gives each result in its place, in whatever order they end" $
    property $
      forAll (shuffle [0 .. 5 :: Int]) $ \order -> ioProperty $ do
        gates <- replicateM 6 newGate
        threads <- replicateM 6 newEmptyMVar
        let act n = (myThreadId >>= putMVar (threads !! n)) >> pass (gates !! n) >> pure n
        launching (allOf (map act [0 .. 5])) $ \caller -> do
          for_ order $ \n -> open (gates !! n) >> readMVar (threads !! n) >>= awaitOver
          (=== Gave [0 .. 5]) <$> awaitEnd caller

  it "allOf keeps the shape of what it is given" $ do
    allOf (Just (pure 'a')) `shouldReturn` Just 'a'
    allOf (Nothing :: Maybe (IO ())) `shouldReturn` Nothing
    allOf (Map.fromList [('a', pure 1), ('b', pure (2 :: Int))])
      `shouldReturn` Map.fromList [('a', 1), ('b', 2)]

  it "allOf stops the rest at a failure, wherever it is" $
    for_ [0 .. 9] $ \loser -> do
      (end, done) <- observing $ \notebook -> do
        others <- replicateM 9 newGate
        let act n
              | n == loser = traverse_ pass others >> failed
              | otherwise = (open (others !! min n (n - fromEnum (n > loser))) >> hang) `onException` note notebook ()
        void (allOf (map act [0 .. 9]))
      (end, length done) `shouldBe` (FailedWith (show Failed), 9)

  it "firstOf and allOf run a thousand at the same time" $ do
    gates <- replicateM 1000 newGate
    let everybodyIsThere n = open (gates !! n) >> pass (gates !! (999 - n)) >> pure n
    allOf (map everybodyIsThere [0 .. 999]) `shouldReturn` [0 .. 999]
    firstOf (replicate 999 hang ++ [pure 'z']) `shouldReturn` 'z'

-- All that has to stop --------------------------------------------------------

-- | Each operator with so many hanging branches, which all run when the gates that
-- they open are open.
groups :: [(String, Int, [Behavior ()] -> Behavior ())]
groups =
  [ ("parallel", 2, foldr1 parallel)
  , ("both", 2, foldr1 both)
  , ("firstOf", 4, firstOf)
  , ("allOf", 4, void . allOf)
  , ("scoped", 4, \acts -> scoped $ \nursery -> traverse_ (fork nursery) (drop 1 acts) >> sequence_ (take 1 acts))
  ]

together :: Spec
together = do
  for_ groups $ \(operator, size, apply') ->
    it (operator ++ ": hears of it at once, so that cleanups can wait for each other") $ do
      inside <- replicateM size newGate
      heard <- replicateM size newGate
      let act n =
            uninterruptibly (open (inside !! n) >> hang) $
              open (heard !! n) >> traverse_ pass heard
      cancelling (apply' (map act [0 .. size - 1])) (traverse_ pass inside)
        `shouldReturn` CancelledBy (show theCancel)

  for_ groups $ \(operator, size, apply') ->
    it (operator ++ ": hears of it also if one of them cannot be interrupted just now") $
      for_ [0 .. size - 1] $ \deaf -> do
        inside <- replicateM size newGate
        heard <- replicateM size newGate
        let act n
              | n == deaf = do
                  uninterruptibleMask_ $ open (inside !! n) >> for_ (others n) pass
                  hang
              | otherwise = (open (inside !! n) >> hang) `onException` open (heard !! n)
            others n = [gate | (k, gate) <- zip [0 ..] heard, k /= n]
        cancelling (apply' (map act [0 .. size - 1])) (traverse_ pass inside)
          `shouldReturn` CancelledBy (show theCancel)

  for_ groups $ \(operator, size, apply') ->
    it (operator ++ ": hears of it at once when one of them ends the operator") $ do
      inside <- replicateM size newGate
      heard <- replicateM size newGate
      let act 0 = traverse_ pass (drop 1 inside) >> failed
          act n =
            uninterruptibly (open (inside !! n) >> hang) $
              open (heard !! n) >> traverse_ pass (drop 1 heard)
      ending (apply' (map act [0 .. size - 1])) `shouldReturn` FailedWith (show Failed)
