{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE DeriveTraversable #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- The operators of the library, as plain data: what all random programs have in common.
--
-- A program is made of operators and leaves; each use has leaves and signals of its own
-- ("Language.Script", "Language.Primitive"). A new operator is a constructor, and a line in 'traverseBoth', 'shapes',
-- 'run' and, if it has branches or a signal, 'operatorName'; in the other functions if it concerns them.
module Language.Operator
  ( Operator (..)
  , Choice (..)
  , Ticks
  , traverseBoth
  , operatorName
  , forks
  , abandons
  , receives
  , atOnce

    -- * Random operators
  , Around (..)
  , outside
  , aroundPartsOf
  , operators
  , oftenSeveral

    -- * Smaller operators
  , Smaller (..)
  , smaller
  , shrinkOperator

    -- * Numbers for leaves
  , Numbered (..)
  , numbered

    -- * The library's operators
  , Language (..)
  , Environment (..)
  , environmentWith
  , noEnvironment
  , run
  , holds
  ) where

import Control.Exception (ErrorCall (..), throwIO)
import Control.Monad (void)
import Data.Maybe (catMaybes, fromMaybe, isNothing)
import Test.QuickCheck (Gen, choose, frequency, suchThat, vectorOf)

import Behavior
import Behavior.Message (Inbox, handleNext, messageRule, onMessage)
import Behavior.Parallel (Child, allOf, await, decide, firstOf, fork, requestStop, scoped)
import Behavior.STM (atomically)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Time (abandoning, cleanupWithin, every, retrying, timeout)

-- | A time, or a duration.
type Ticks = Int

-- | An operator with signals @s@ and parts @p@.
data Operator s p
  = -- | @>>@
    p `Then` p
  | -- | @?@
    p `Else` p
  | Attempt Int p
  | FallbackOver [p]
  | Retrying [Ticks] p
  | Every Ticks p
  | Parallel p p
  | Both p p
  | FirstOf [p]
  | AllOf [p]
  | -- | What is chosen runs the last part, or fails.
    Decide Choice [p] p
  | RSelect s p p
  | Monitor s p p
  | InsteadWhen s p p
  | -- | The number is the index of the branch, from zero; larger numbers select the last
    -- branch.
    Switch s [p]
  | TeleoReactive [(s, p)]
  | WaitUntil s
  | WhileHolding s p
  | Timeout Ticks p
  | CleanupWithin Ticks p
  | -- | The part may go on when the operator has ended; so it uses no scope and no shared signal around it.
    Abandoning Ticks p
  | -- | What handles each message, and the task that runs meanwhile.
    OnMessage p p
  | -- | Waits for a message.
    HandleNext p
  | -- | Three ordered rules: the second has each message handled.
    MessageRule s p p s p
  | -- | The part may follow the signal, as the shared one.
    WithShared s p
  | Scoped p
  | -- | Forks into the nearest 'Scoped' around it.
    Fork p
  | -- | Forks the first, runs the second, and waits for the result of the first.
    Await p p
  | -- | Likewise, but requests the stop of the first before it waits.
    StopChild p p
  deriving (Eq, Ord, Show, Functor, Foldable, Traversable)

-- | How 'Decide' chooses.
data Choice
  = -- | When that many have succeeded. It fails when too few are left.
    AtLeast Int
  | -- | When the first has ended: it fails as that has, if it has.
    FirstEnd
  | -- | Never.
    NoChoice
  deriving (Eq, Ord, Show)

-- | From left to right, as in a term; each signal before what depends on it.
traverseBoth :: Applicative f => (s -> f s') -> (p -> f p') -> Operator s p -> f (Operator s' p')
traverseBoth signal part = \case
  Then a b -> Then <$> part a <*> part b
  Else a b -> Else <$> part a <*> part b
  Attempt n a -> Attempt n <$> part a
  FallbackOver as -> FallbackOver <$> traverse part as
  Retrying delays a -> Retrying delays <$> part a
  Every n a -> Every n <$> part a
  Parallel a b -> Parallel <$> part a <*> part b
  Both a b -> Both <$> part a <*> part b
  FirstOf as -> FirstOf <$> traverse part as
  AllOf as -> AllOf <$> traverse part as
  Decide choice as b -> Decide choice <$> traverse part as <*> part b
  RSelect s a b -> RSelect <$> signal s <*> part a <*> part b
  Monitor s a b -> Monitor <$> signal s <*> part a <*> part b
  InsteadWhen s a b -> InsteadWhen <$> signal s <*> part a <*> part b
  Switch s as -> Switch <$> signal s <*> traverse part as
  TeleoReactive rules -> TeleoReactive <$> traverse (\(s, a) -> (,) <$> signal s <*> part a) rules
  WaitUntil s -> WaitUntil <$> signal s
  WhileHolding s a -> WhileHolding <$> signal s <*> part a
  Timeout n a -> Timeout n <$> part a
  CleanupWithin n a -> CleanupWithin n <$> part a
  Abandoning n a -> Abandoning n <$> part a
  OnMessage a b -> OnMessage <$> part a <*> part b
  HandleNext a -> HandleNext <$> part a
  MessageRule r a b s c -> MessageRule <$> signal r <*> part a <*> part b <*> signal s <*> part c
  WithShared s a -> WithShared <$> signal s <*> part a
  Scoped a -> Scoped <$> part a
  Fork a -> Fork <$> part a
  Await a b -> Await <$> part a <*> part b
  StopChild a b -> StopChild <$> part a <*> part b

-- | The name that labels and spans have, if it has branches or a signal.
operatorName :: Operator s p -> Maybe String
operatorName = \case
  Parallel _ _ -> Just "parallel"
  Both _ _ -> Just "both"
  FirstOf _ -> Just "firstOf"
  AllOf _ -> Just "allOf"
  Decide {} -> Just "decide"
  RSelect {} -> Just "rSelect"
  Monitor {} -> Just "monitor"
  InsteadWhen {} -> Just "insteadWhen"
  Switch _ _ -> Just "switch"
  TeleoReactive _ -> Just "teleoReactive"
  WaitUntil _ -> Just "waitUntil"
  WhileHolding _ _ -> Just "whileHolding"
  Timeout _ _ -> Just "timeout"
  CleanupWithin _ _ -> Just "cleanupWithin"
  Abandoning _ _ -> Just "abandoning"
  OnMessage _ _ -> Just "onMessage"
  MessageRule {} -> Just "teleoReactive"
  WithShared _ _ -> Just "withShared"
  Scoped _ -> Just "scoped"
  _ -> Nothing

-- | Whether it stands in a scope only.
forks :: Operator s p -> Bool
forks = \case
  Fork _ -> True
  Await _ _ -> True
  StopChild _ _ -> True
  _ -> False

-- | Whether what it runs may go on when it has ended.
abandons :: Operator s p -> Bool
abandons = \case
  Abandoning _ _ -> True
  _ -> False

-- | Whether it handles messages.
receives :: Operator s p -> Bool
receives = \case
  OnMessage _ _ -> True
  HandleNext _ -> True
  MessageRule {} -> True
  _ -> False

-- | Whether all its branches run at once. (Those of the others run one after the other.)
atOnce :: Operator s p -> Bool
atOnce = \case
  Parallel _ _ -> True
  Both _ _ -> True
  FirstOf _ -> True
  AllOf _ -> True
  Decide {} -> True
  WithShared _ _ -> True
  Scoped _ -> True
  _ -> False

-- * Random operators

-- | What is around a part of a program.
data Around = Around
  { inScope :: Bool
  -- ^ Whether it may fork.
  , sharing :: Bool
  -- ^ Whether there is a shared signal.
  }
  deriving (Eq, Show)

-- | Nothing is around a whole program.
outside :: Around
outside = Around {inScope = False, sharing = False}

-- | What is around the parts of the operator. (A fork must not leave a 'WithShared', which it would outlive.)
aroundPartsOf :: Operator s p -> Around -> Around
aroundPartsOf o around = case o of
  WithShared _ _ -> Around {inScope = False, sharing = True}
  Scoped _ -> around {inScope = True}
  Abandoning _ _ -> outside
  _ -> around

-- | An operator of the wanted kind, which may stand there, with signals and parts from the generators.
operators :: (Operator () () -> Bool) -> Around -> (Around -> Gen s) -> (Around -> Gen p) -> Gen (Operator s p)
operators wanted around signal part = do
  shape <- shapes around `suchThat` wanted
  traverseBoth (\() -> signal around) (\() -> part (aroundPartsOf shape around)) shape

shapes :: Around -> Gen (Operator () ())
shapes around =
  frequency $
    [ (4, pure (Then () ()))
    , (3, pure (Else () ()))
    , (1, (`Attempt` ()) <$> choose (0, 3))
    , (1, FallbackOver <$> oftenSeveral (pure ()))
    , (2, (`Retrying` ()) <$> (choose (0, 2) >>= \k -> vectorOf k (choose (0, 3))))
    , (1, (`Every` ()) <$> choose (1, 4))
    , (2, pure (Parallel () ()))
    , (2, pure (Both () ()))
    , (2, FirstOf <$> oftenSeveral (pure ()))
    , (2, AllOf <$> oftenSeveral (pure ()))
    , (3, (\choice as -> Decide choice as ()) <$> choices <*> oftenSeveral (pure ()))
    , (4, pure (RSelect () () ()))
    , (5, pure (Monitor () () ()))
    , (3, pure (InsteadWhen () () ()))
    , (2, Switch () . (() :) <$> (choose (0, 2) >>= \k -> vectorOf k (pure ())))
    , (2, TeleoReactive <$> oftenSeveral (pure ((), ())))
    , (1, pure (WaitUntil ()))
    , (2, pure (WhileHolding () ()))
    , (2, (`Timeout` ()) <$> frequency [(1, pure 0), (9, choose (1, 6))])
    , (1, (`CleanupWithin` ()) <$> choose (0, 4))
    , (2, (`Abandoning` ()) <$> choose (0, 3))
    , (2, pure (OnMessage () ()))
    , (1, pure (HandleNext ()))
    , (2, pure (MessageRule () () () () ()))
    , (2, pure (WithShared () ()))
    , (2, pure (Scoped ()))
    ]
      ++ concat [[(4, pure (Fork ())), (3, pure (Await () ())), (2, pure (StopChild () ()))] | inScope around]
 where
  choices = frequency [(8, AtLeast <$> choose (0, 3)), (2, pure FirstEnd), (1, pure NoChoice)]

-- | Up to three.
oftenSeveral :: Gen a -> Gen [a]
oftenSeveral one = frequency [(1, pure 0), (4, pure 1), (10, choose (2, 3))] >>= \k -> vectorOf k one

-- * Smaller operators

-- | A thing, and what it is with one of its parts made smaller.
data Smaller a = Smaller a [a]
  deriving (Functor)

instance Applicative Smaller where
  pure a = Smaller a []
  Smaller f fs <*> Smaller a as = Smaller (f a) (map ($ a) fs ++ map f as)

-- | A part that the function makes smaller.
smaller :: (a -> [a]) -> a -> Smaller a
smaller shrinks a = Smaller a (shrinks a)

-- | The operator with a part less, or with a smaller part or signal.
shrinkOperator :: (s -> [s]) -> (p -> [p]) -> Operator s p -> [Operator s p]
shrinkOperator signal part o = fewer ++ others
 where
  Smaller _ others = traverseBoth (smaller signal) (smaller part) o
  fewer = case o of
    Attempt n a -> [Attempt (n - 1) a | n > 1]
    FallbackOver as -> FallbackOver <$> without as
    Retrying delays a -> (`Retrying` a) <$> without delays
    FirstOf as -> FirstOf <$> without as
    AllOf as -> AllOf <$> without as
    Decide choice as b -> (\some -> Decide choice some b) <$> without as
    TeleoReactive rules -> TeleoReactive <$> without rules
    _ -> []
  without xs = [take n xs ++ drop (n + 1) xs | n <- [0 .. length xs - 1]]

-- * Numbers for leaves

-- | What is made with the numbers from the given one on; and the next number.
newtype Numbered a = Numbered (Int -> (Int, a))
  deriving (Functor)

instance Applicative Numbered where
  pure a = Numbered (\n -> (n, a))
  Numbered f <*> Numbered a = Numbered $ \n ->
    let (n', g) = f n
        (n'', b) = a n'
     in (n'', g b)

-- | With numbers from 1 on.
numbered :: Numbered a -> a
numbered (Numbered a) = snd (a 1)

-- * The library's operators

-- | How the signals and parts of an operator run. Each part has a position in the program.
data Language at s p a = Language
  { runPart :: Environment at a -> at -> p -> Behavior a
  , inBranch :: String -> at -> at
  -- ^ The position in the branch with this label, of the operator with that position.
  , signalOf :: Environment at a -> at -> s -> Signal Int
  -- ^ Its sensors have that position.
  , reactsTo :: Signal Int -> Signal Int
  -- ^ The whole signal to which an operator reacts ('WithShared' does not).
  , tick :: Seconds
  , results :: Maybe [a] -> a
  -- ^ What an operator returns that has several results, or none.
  }

-- | What the parts of a program get from the operators around them.
data Environment at a = Environment
  { forking :: (at -> Behavior a) -> Behavior (Child a)
  -- ^ Forks into the nearest scope.
  , nearest :: Signal Int
  -- ^ The nearest shared signal.
  , inbox :: Inbox ()
  }

-- | What a whole program gets that has an inbox, or none.
environmentWith :: Inbox () -> Environment at a
environmentWith box =
  Environment
    { forking = \_ -> throwIO (ErrorCall "a fork outside every scope")
    , nearest = pure 0
    , inbox = box
    }

noEnvironment :: Environment at a
noEnvironment = environmentWith (error "a program without messages has no inbox")

-- | Runs the operator. Its first position is that of what runs in its own thread; the second is its own.
run :: Language at s p a -> Environment at a -> at -> at -> Operator s p -> Behavior a
run language around outer own o = case o of
  Then a b -> inPlace a >> inPlace b
  Else a b -> inPlace a ? inPlace b
  Attempt n a -> attempt n (inPlace a)
  FallbackOver as -> fallbackOver as inPlace
  Retrying delays a -> retrying (map ticks delays) (inPlace a)
  Every n a -> every (ticks n) (inPlace a)
  Parallel a b -> none <$ parallel (branch "left" a) (branch "right" b)
  Both a b -> none <$ both (branch "left" a) (branch "right" b)
  FirstOf as -> firstOf (each as)
  AllOf as -> several <$> allOf (each as)
  Decide choice as b -> decide (chosenFrom choice (inPlace b)) (each as)
  RSelect s a b -> Signal.rSelect (condition s) (branch "left" a) (branch "right" b)
  Monitor s a b -> Signal.monitor (condition s) (void (branch "recovery" a)) (branch "task" b)
  InsteadWhen s a b -> Signal.insteadWhen (condition s) (branch "emergency" a) (branch "branch" b)
  Switch s as -> Signal.switch (level s) (\n -> branch "branch" (as !! max 0 (min n (length as - 1))))
  TeleoReactive rules ->
    Signal.teleoReactive [(condition s, branch ("rule " ++ show n) a) | (n, (s, a)) <- zip [1 :: Int ..] rules]
  WaitUntil s -> none <$ Signal.waitUntil (condition s)
  WhileHolding s a -> Signal.whileHolding (condition s) (branch "branch" a)
  Timeout n a -> timeout (ticks n) (branch "branch" a)
  CleanupWithin n a -> fromMaybe none <$> cleanupWithin (ticks n) (branch "branch" a)
  Abandoning n a -> abandoning (ticks n) (branch "branch" a)
  OnMessage a b -> onMessage (inbox around) (\() -> pure () <$ branch "handler" a) (branch "task" b)
  HandleNext a -> handleNext (inbox around) (\() -> pure <$> inPlace a)
  MessageRule r a b s c -> do
    let handler = runPart language around (inBranch language "messageRule: handler" (labelled "rule 2")) b
    rule <- messageRule (inbox around) (\() -> pure () <$ handler)
    Signal.teleoReactive [(condition r, branch "rule 1" a), rule, (condition s, branch "rule 3" c)]
  WithShared s a -> Signal.withShared (opened s) (\signal -> branchIn around {nearest = signal} "body" a)
  Scoped a -> scoped $ \nursery ->
    branchIn around {forking = \forked -> fork nursery (forked (labelled "fork"))} "body" a
  Fork a -> none <$ child a
  Await a b -> child a >>= \c -> inPlace b >> atomically (await c)
  StopChild a b -> child a >>= \c -> inPlace b >> requestStop c >> atomically (await c)
 where
  inPlace = runPart language around outer
  branch = branchIn around
  branchIn around' name = runPart language around' (labelled name)
  child a = forking around (\at -> runPart language around at a)
  labelled name = inBranch language (maybe "" (++ ": ") (operatorName o) ++ name) own
  each as = [branch (show n) a | (n, a) <- zip [1 :: Int ..] as]
  opened = signalOf language around (labelled "polling")
  level = reactsTo language . opened
  condition s = holds <$> level s
  several = results language . Just
  none = results language Nothing
  ticks n = fromIntegral n * tick language

-- | A number as a condition.
holds :: Int -> Bool
holds = (> 0)

-- | What 'Decide' runs, given these ends; if it has chosen.
chosenFrom :: Choice -> Behavior a -> [Maybe (Either BehaviorFailed b)] -> Maybe (Behavior a)
chosenFrom choice chosen ends = case choice of
  AtLeast m
    | succeeded >= m -> Just chosen
    | succeeded + length (filter isNothing ends) < m -> Just (failWith "too few have succeeded")
  FirstEnd | end : _ <- catMaybes ends -> Just (either throwIO (const chosen) end)
  _ -> Nothing
 where
  succeeded = length [() | Just (Right _) <- ends]
