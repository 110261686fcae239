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
    for_ [parallelOperator, bothOperator, firstOfOperator, allOfOperator, scopedOperator] outcomes
    ties
  describe "parallel and both" $ do
    starting
    laws
  describe "firstOf and allOf" many
  describe "Branches that have to stop" together

-- Which outcome ---------------------------------------------------------------

-- | What a branch does. With the first three plans it ends by itself; with the others
-- when its stop is requested.
data Plan
  = Completes
  | FailsAlone
  | FaultsAlone
  | Stops
  | StopsFailing
  | StopsFaulting
  | CompletesWhenStopped
  deriving (Bounded, Enum, Eq, Show)

instance Arbitrary Plan where
  arbitrary = arbitraryBoundedEnum

describePlan :: Plan -> String
describePlan = \case
  Completes -> "succeeds"
  FailsAlone -> "fails"
  FaultsAlone -> "faults"
  Stops -> "is stopped"
  StopsFailing -> "is stopped and its cleanup fails"
  StopsFaulting -> "is stopped and its cleanup faults"
  CompletesWhenStopped -> "is stopped but completes"

endsAlone, isFaulty :: Plan -> Bool
endsAlone = (`elem` [Completes, FailsAlone, FaultsAlone])
isFaulty = (`elem` [FaultsAlone, StopsFaulting])

-- | A branch, whose name is in all exceptions that it throws, and whose result is a
-- number.
data TestBranch = TestBranch
  { name :: String
  , number :: Int
  , plan :: Plan
  }
  deriving (Show)

testBranches :: [Plan] -> [TestBranch]
testBranches = zipWith3 TestBranch (map (: []) ['a' ..]) [1 ..]

-- | Which ends of branches end the operator.
data Kind = Race | Gather | Nursery

data Operator = Operator
  { called :: String
  , kind :: Kind
  , forcesTies :: Bool
  -- ^ Whether the test can determine when the operator first reads the outcomes.
  , members :: (String, String)
  , gives :: [Int] -> [Int]
  , apply :: [Behavior Int] -> Behavior [Int]
  }

parallelOperator, bothOperator, firstOfOperator, allOfOperator, scopedOperator :: Operator
parallelOperator = Operator "parallel" Race False ("left", "right") (const []) (pairwise parallel)
bothOperator = Operator "both" Gather False ("left", "right") (const []) (pairwise both)
firstOfOperator = Operator "firstOf" Race True ("the first", "the second") id (fmap pure . firstOf)
allOfOperator = Operator "allOf" Gather True ("the first", "the second") id allOf
scopedOperator = Operator "scoped" Nursery False ("the body", "the fork") id $ \case
  body : forked -> scoped $ \nursery -> traverse_ (fork nursery) (take 1 forked) >> pure <$> body
  [] -> pure []

pairwise :: (Behavior Int -> Behavior Int -> Behavior ()) -> [Behavior Int] -> Behavior [Int]
pairwise operator = \case
  left : right : _ -> [] <$ operator left right
  _ -> pure []

-- | The branches whose own end decides the operator's outcome.
deciding :: Kind -> [TestBranch] -> [TestBranch]
deciding Race = filter (endsAlone . plan)
deciding Gather = filter ((`elem` [FailsAlone, FaultsAlone]) . plan)
deciding Nursery = \case
  body : forked -> filter (endsAlone . plan) [body] ++ deciding Gather forked
  [] -> []

-- | Section 2 of the design, "Which outcome, when several things happened". Everything
-- has happened before the operator reads the outcomes.
predicted :: Kind -> Bool -> [TestBranch] -> Ending [Int]
predicted which isCancelled branches =
  case (isCancelled, [show (Fault (name a)) | a <- branches, isFaulty (plan a)]) of
    -- 1. Was the caller cancelled?
    (True, []) -> CancelledBy (show theCancel)
    (True, leftmost : _) -> CancelledWithFault (show theCancel) leftmost
    -- 2. Did a branch fault? The leftmost.
    (False, leftmost : _) -> FaultedWith leftmost
    -- 3. Did a branch complete or fail? On a tie the left one.
    (False, _) -> case deciding which branches of
      decisive : _
        | FailsAlone <- plan decisive -> FailedWith (show (Failure (name decisive)))
        | otherwise -> Gave [number decisive]
      [] -> Gave (map number branches)

theCancel :: Cancel
theCancel = Cancel "the caller"

-- | Whether the plans can be carried out together: something must stop the branches that
-- end only when stopped, and a caller can be cancelled only while it waits for a branch.
possible :: Kind -> Bool -> [TestBranch] -> Bool
possible which isCancelled branches
  | isCancelled = not allAlone
  | otherwise = allAlone || not (null (deciding which branches))
 where
  allAlone = all (endsAlone . plan) branches

-- | Whether it is a tie: then the operator must read the outcomes when all have ended.
isTie :: Kind -> [TestBranch] -> Bool
isTie which branches = length (deciding which branches) > 1

-- | The order in which those branches end that end by themselves.
data Order = FromTheLeft | FromTheRight
  deriving (Bounded, Enum)

-- | Runs the operator on these branches, and returns how it ended.
runBranches :: Operator -> Bool -> [TestBranch] -> IO (Ending [Int])
runBranches = runBranchesIn FromTheLeft

-- | Like 'runBranches', with the order in which those branches end that end by themselves.
--
-- Where ties can be forced ('forcesTies') the operator gets its behaviours in a lazy list.
-- The operator evaluates the list to its end before it first reads the outcomes, and that
-- end is available only when all branches that end by themselves have ended. Otherwise
-- they end in an order in which only the last one decides. Stopped branches wait, in their
-- cleanups, until all of them have received their stop requests and the caller has still
-- not returned; if the caller is cancelled although a branch decides, it is cancelled then.
runBranchesIn :: Order -> Operator -> Bool -> [TestBranch] -> IO (Ending [Int])
runBranchesIn order operator isCancelled branches = do
  gated <- forM branches $ \branch ->
    (,,,) branch <$> newGate <*> newGate <*> newEmptyMVar
  mayEnd <- newGate
  mayRead <- newGate
  let act (branch, mayGo, cleaning, there) = case plan branch of
        Completes -> alone (pure (number branch))
        FailsAlone -> alone (throwIO (Failure (name branch)))
        FaultsAlone -> alone (throwIO (Fault (name branch)))
        Stops -> stopped throwIO
        StopsFailing -> stopped (const (throwIO (Failure (name branch))))
        StopsFaulting -> stopped (const (throwIO (Fault (name branch))))
        CompletesWhenStopped -> stopped (const (pure (100 + number branch)))
       where
        alone end = enter >> pass mayGo >> end
        stopped end =
          (enter >> hang) `catch` \(e :: SomeAsyncException) -> do
            uninterruptibleMask_ (open cleaning >> pass mayEnd)
            end e
        enter = myThreadId >>= putMVar there
      awaitAllStarted = for_ gated $ \(_, _, _, there) -> readMVar there
      endAlone which = for_ (ordered gated) $ \(branch, mayGo, _, there) ->
        when (which branch) $ open mayGo >> readMVar there >>= awaitOver
      ordered = case order of
        FromTheLeft -> id
        FromTheRight -> reverse
      isDeciding branch = name branch `elem` map name (deciding (kind operator) branches)
      toBeStopped = [cleaning | (branch, _, cleaning, _) <- gated, not (endsAlone (plan branch))]
  atTheEnd <- unsafeInterleaveIO $ do
    awaitAllStarted
    endAlone (endsAlone . plan)
    open mayRead
    pure []
  let list
        | forcesTies operator = map act gated ++ atTheEnd
        | otherwise = map act gated
  withThread (leavingNothing (apply operator list)) $ \caller -> do
    if forcesTies operator
      then pass mayRead
      else do
        awaitAllStarted
        awaitIdle (asyncThreadId caller)
        endAlone (\branch -> endsAlone (plan branch) && not (isDeciding branch))
        endAlone isDeciding
    let decided = any isDeciding branches
    when (isCancelled && not decided) $ throwTo (asyncThreadId caller) theCancel
    unless (null toBeStopped) $ do
      traverse_ pass toBeStopped
      when (isCancelled && decided) $ throwing (asyncThreadId caller) theCancel
      stillRunning caller
      open mayEnd
    awaitEnd caller

-- | An example for each cell of the table of plans.
outcomes :: Operator -> Spec
outcomes operator = describe (called operator) $ do
  for_ [(one, other, isCancelled) | one <- everyPlan, other <- everyPlan, isCancelled <- [False, True]] $
    \(one, other, isCancelled) -> do
      let branches = testBranches [one, other]
          end = case predicted (kind operator) isCancelled branches of
            Gave numbers -> Gave (gives operator numbers)
            bad -> bad
      let isDetermined = forcesTies operator || not (isTie (kind operator) branches)
      when (possible (kind operator) isCancelled branches && isDetermined) $
        it (sentence one other isCancelled) $
          for_ orders $ \order -> runBranchesIn order operator isCancelled branches `shouldReturn` end
  when (forcesTies operator) $
    it "ends as the design states, for any number of behaviours" $
      property $ \isCancelled ->
        forAll (testBranches <$> (choose (1, 6) >>= \n -> vectorOf n arbitrary)) $ \branches ->
          possible (kind operator) isCancelled branches
            ==> ioProperty $
              allAre (predicted (kind operator) isCancelled branches)
                <$> traverse (\order -> runBranchesIn order operator isCancelled branches) orders
 where
  orders = [minBound .. maxBound]
  allAre end = conjoin . map (=== end)
  everyPlan = [minBound .. maxBound]
  sentence one other isCancelled =
    fst (members operator) ++ " " ++ describePlan one ++ ", " ++ snd (members operator) ++ " " ++ describePlan other
      ++ (if isCancelled then ", and the caller is cancelled" else "")

-- | A test cannot make 'parallel', 'both' and 'scoped' read the outcomes only when both
-- behaviours have ended. But with one capability, when one transaction wakes both, they
-- come before the caller in the run queue, unless a time slice ends between them. So
-- nearly every round is a tie, and an operator for which the right one counts gives the
-- other outcome in nearly every round. (For 'firstOf' and 'allOf' ties are forced, above.)
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
  it "scoped: the scoped behaviour's end counts when what it has forked has failed, too" $
    mostly (\own forked -> scoped (\nursery -> fork nursery forked >> own)) (pure ()) failed (Gave ())
  it "parallel and both: also when both have ended before the operator waits" $
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
      mayGo <- newGate
      let act there final = myThreadId >>= putMVar there >> pass mayGo >> final
      withThread (operator (act leftThere left) (act rightThere right)) $ \caller -> do
        traverse readMVar [leftThere, rightThere] >>= traverse_ awaitIdle
        awaitIdle (asyncThreadId caller)
        open mayGo
        awaitEnd caller
    length (filter (== end) ends) `shouldSatisfy` (> 25)

-- parallel and both -----------------------------------------------------------

starting :: Spec
starting = do
  for_ [("parallel", parallel), ("both", both)] $ \(operator, operate) ->
    it (operator ++ " runs both at the same time") $ do
      left <- newGate
      right <- newGate
      operate (open left >> pass right) (open right >> pass left)

  it "parallel ends when one has ended, whichever it is, and the other has been stopped" $
    for_ [id, flip] $ \turned -> do
      inside <- newGate
      (end, done) <- observing $ \entries ->
        turned parallel ((open inside >> hang) `onException` note entries "stopped") (pass inside)
      (end, done) `shouldBe` (Gave (), ["stopped"])

  it "both ends when both have ended, whichever is the first" $
    for_ [id, flip] $ \turned -> do
      first <- newEmptyMVar
      second <- newGate
      withThread (turned both (myThreadId >>= putMVar first) (pass second)) $ \caller -> do
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
    (_, done) <- observing $ \entries -> do
      let twice = both (note entries 'l') (note entries 'r')
      twice >> twice
    length done `shouldBe` 4

laws :: Spec
laws = do
  it "||| is parallel, looser than ? and tighter than >>" $ do
    observing (\entries -> note entries 'l' ? note entries 'm' ||| hang >> note entries 'r')
      `shouldReturn` (Gave (), "lr")
    observing (\entries -> hang ||| failed ? note entries 'm' >> note entries 'r')
      `shouldReturn` (Gave (), "mr")

  it "parallel is firstOf of two" $
    forAllBranches $ \branches ->
      (===)
        <$> (voided <$> runBranches parallelOperator False branches)
        <*> (voided <$> runBranches firstOfOperator False branches)
  it "both is allOf of two" $
    forAllBranches $ \branches ->
      (===)
        <$> (voided <$> runBranches bothOperator False branches)
        <*> (voided <$> runBranches allOfOperator False branches)

  it "parallel is symmetric except on ties" $ forAllBranches (symmetric parallelOperator)
  it "both is symmetric except on ties" $ forAllBranches (symmetric bothOperator)

  it "parallel has a behaviour that never ends as its identity, except for the result" $
    property $ \a ->
      sameAs (\entries -> play entries a ||| hang) (\entries -> void (play entries a))
        .&&. sameAs (\entries -> hang ||| play entries a) (\entries -> void (play entries a))

  it "both has pure as its identity, except for the result" $
    property $ \a ->
      sameAs (\entries -> both (play entries a) (pure ())) (\entries -> void (play entries a))
        .&&. sameAs (\entries -> both (pure ()) (play entries a)) (\entries -> void (play entries a))

  it "parallel and both are associative, when there is no tie" $
    property $ \a ->
      forAll (elements [0, 1, 2 :: Int]) $ \place ->
        let among others entries = [if n == place then void (play entries a) else others | n <- [0 .. 2]]
         in sameAs (foldl1 parallel . among hang) (foldr1 parallel . among hang)
              .&&. sameAs (foldl1 both . among (pure ())) (foldr1 both . among (pure ()))
 where
  forAllBranches law =
    forAll (testBranches <$> vectorOf 2 arbitrary) $ \branches ->
      all (\which -> possible which False branches && not (isTie which branches)) [Race, Gather]
        ==> ioProperty (law branches)
  symmetric operator branches =
    if length (filter (isFaulty . plan) branches) == 2
      then pure (property True) -- two faults are a tie, too
      else property
        <$> ((===) <$> runBranches operator False branches <*> runBranches operator False (reverse branches))
  voided = \case
    Gave _ -> Gave ()
    FailedWith e -> FailedWith e
    FaultedWith e -> FaultedWith e
    CancelledBy e -> CancelledBy e
    CancelledWithFault cause e -> CancelledWithFault cause e

-- firstOf and allOf -----------------------------------------------------------

many :: Spec
many = do
  it "firstOf fails on an empty list, and allOf gives an empty list" $ do
    (firstOf [] :: IO ()) `shouldThrow` (== Failed)
    allOf [] `shouldReturn` ([] :: [()])

  it "firstOf and allOf of one behaviour are that behaviour" $
    property $ \a ->
      sameAs (\entries -> firstOf [play entries a]) (`play` a)
        .&&. sameAs (\entries -> allOf [play entries a]) (\entries -> pure <$> play entries a)

  it "firstOf gives the result of the first to end, wherever it is" $
    for_ [0 .. 9] $ \winner ->
      firstOf [if n == winner then pure n else hang | n <- [0 .. 9 :: Int]] `shouldReturn` winner

  it "firstOf ends with the first failure, unless the behaviours have a ? of their own" $ do
    ending (firstOf [hang, failed, hang :: IO ()]) `shouldReturn` FailedWith (show Failed)
    firstOf [failed ? hang, failed ? pure 'b', hang] `shouldReturn` 'b'

  it "allOf gives each result in its place, in whatever order they end" $
    property $
      forAll (shuffle [0 .. 5 :: Int]) $ \order -> ioProperty $ do
        gates <- replicateM 6 newGate
        threads <- replicateM 6 newEmptyMVar
        let act n = (myThreadId >>= putMVar (threads !! n)) >> pass (gates !! n) >> pure n
        withThread (allOf (map act [0 .. 5])) $ \caller -> do
          for_ order $ \n -> open (gates !! n) >> readMVar (threads !! n) >>= awaitOver
          (=== Gave [0 .. 5]) <$> awaitEnd caller

  it "allOf keeps the shape of its container" $ do
    allOf (Just (pure 'a')) `shouldReturn` Just 'a'
    allOf (Nothing :: Maybe (IO ())) `shouldReturn` Nothing
    allOf (Map.fromList [('a', pure 1), ('b', pure (2 :: Int))])
      `shouldReturn` Map.fromList [('a', 1), ('b', 2)]

  it "allOf stops the rest at a failure, wherever it is" $
    for_ [0 .. 9] $ \loser -> do
      (end, done) <- observing $ \entries -> do
        others <- replicateM 9 newGate
        let act n
              | n == loser = traverse_ pass others >> failed
              | otherwise = (open (others !! min n (n - fromEnum (n > loser))) >> hang) `onException` note entries ()
        void (allOf (map act [0 .. 9]))
      (end, length done) `shouldBe` (FailedWith (show Failed), 9)

  it "firstOf and allOf run a thousand at the same time" $ do
    gates <- replicateM 1000 newGate
    let awaitOpposite n = open (gates !! n) >> pass (gates !! (999 - n)) >> pure n
    allOf (map awaitOpposite [0 .. 999]) `shouldReturn` [0 .. 999]
    firstOf (replicate 999 hang ++ [pure 'z']) `shouldReturn` 'z'

-- All that has to stop --------------------------------------------------------

-- | Each operator with the number of hanging branches that it gets, all of which run when
-- the gates that they open are open.
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
  for_ groups $ \(operator, size, operate) ->
    it (operator ++ ": all stop requests are made at once, so that cleanups can wait for each other") $ do
      inside <- replicateM size newGate
      received <- replicateM size newGate
      let act n =
            uninterruptibly (open (inside !! n) >> hang) $
              open (received !! n) >> traverse_ pass received
      cancelling (operate (map act [0 .. size - 1])) (traverse_ pass inside)
        `shouldReturn` CancelledBy (show theCancel)

  for_ groups $ \(operator, size, operate) ->
    it (operator ++ ": the others receive their stop requests while one is uninterruptible") $
      for_ [0 .. size - 1] $ \uninterruptible -> do
        inside <- replicateM size newGate
        received <- replicateM size newGate
        let act n
              | n == uninterruptible = do
                  uninterruptibleMask_ $ open (inside !! n) >> for_ (others n) pass
                  hang
              | otherwise = (open (inside !! n) >> hang) `onException` open (received !! n)
            others n = [gate | (k, gate) <- zip [0 ..] received, k /= n]
        cancelling (operate (map act [0 .. size - 1])) (traverse_ pass inside)
          `shouldReturn` CancelledBy (show theCancel)

  for_ groups $ \(operator, size, operate) ->
    it (operator ++ ": all stop requests are made at once when one branch ends the operator") $ do
      inside <- replicateM size newGate
      received <- replicateM size newGate
      let act 0 = traverse_ pass (drop 1 inside) >> failed
          act n =
            uninterruptibly (open (inside !! n) >> hang) $
              open (received !! n) >> traverse_ pass (drop 1 received)
      ending (operate (map act [0 .. size - 1])) `shouldReturn` FailedWith (show Failed)
