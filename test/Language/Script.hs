{-# OPTIONS_GHC -O1 #-}
{-# LANGUAGE DeriveTraversable #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE PatternSynonyms #-}

-- |
-- Programs whose leaves are actions that take time: for the specification, and for the traces.
--
-- An action has a name, and a script for each call: how many ticks it takes, how it then
-- ends, and how it responds to a stop request. A condition is a variable that the
-- environment sets at given times.
module Language.Script
  ( -- * Programs
    Program
      ( ..
      , Then, Else, Attempt, FallbackOver, Parallel, Both, FirstOf, AllOf
      , Decide, RSelect, Monitor, InsteadWhen, Switch, TeleoReactive, WaitUntil, WhileHolding
      , Timeout, CleanupWithin, Abandoning, Retrying, Every, OnMessage, HandleNext, MessageRule
      , WithShared, Scoped, Fork, Await, StopChild
      )
  , Signal
  , SignalOf (..)
  , Choice (..)
  , Value (..)
  , Name
  , Condition
  , Ticks

    -- * What actions do
  , Script (..)
  , Masking (..)
  , Ending (..)
  , OnStop (..)

    -- * The parts of a program
  , parts
  , signals
  , usesShared
  , usesMessages
  , depth
  , programName

    -- * What is observed of actions
  , ActionEvent (..)
  , cleanupOf
  , number
  , holds
  ) where

import Data.Foldable (toList)
import Data.Functor.Const (Const (..))
import Data.Ord (comparing)

import Language.Operator (Choice (..), Ticks, holds)
import qualified Language.Operator as O
import Language.Same (unlessSame)

type Name = String

type Condition = Name

data Program
  = -- | The n-th call follows the n-th script; the last script repeats.
    Do Name [Script]
  | -- | Returns the value.
    Pure Value
  | -- | Takes time.
    Sleep Ticks
  | -- | Delivers a message.
    Deliver
  | Op (O.Operator Signal Program)
  deriving (Eq)

instance Ord Program where
  compare = unlessSame (comparing content)
   where
    content = \case
      Do name scripts -> Left (Left (name, scripts))
      Pure value -> Left (Right value)
      Sleep n -> Right (Left (Just n))
      Deliver -> Right (Left Nothing)
      Op o -> Right (Right o)

-- | As it is written, with the patterns below.
instance Show Program where
  showsPrec d = \case
    Do name scripts -> showParen (d > 10) $ showString "Do " . showsPrec 11 name . showString " " . showsPrec 11 scripts
    Sleep n -> showParen (d > 10) $ showString "Sleep " . showsPrec 11 n
    Deliver -> showString "Deliver"
    Pure value -> showParen (d > 10) $ showString "Pure " . showsPrec 11 value
    Op o -> showsPrec d o

type Signal = SignalOf Program

-- | A signal's value is a number; as a condition it 'holds' or not.
data SignalOf p
  = Watched Condition
  | -- | The reading is the result of the part, which runs once in each period.
    Polled Ticks p
  | -- | One where both hold, otherwise zero.
    And (SignalOf p) (SignalOf p)
  | -- | One where it is high, otherwise zero. The lower threshold comes first.
    Hysteresis Bool Int Int (SignalOf p)
  | Debounce Ticks (SignalOf p)
  | Throttle Ticks (SignalOf p)
  | StaleAfter Ticks (SignalOf p)
  | -- | The signal of the nearest 'WithShared' around it.
    Shared
  deriving (Eq, Ord, Show, Functor, Foldable, Traversable)

data Value
  = Unit
  | Number Int
  | Several [Value]
  deriving (Eq, Ord, Show)

-- | One call of an action.
data Script = Script
  { takes :: Ticks
  , ends :: Ending
  , masking :: Masking
  , onStop :: OnStop
  }
  deriving (Eq, Ord, Show)

data Masking
  = -- | A stop request is received at any moment.
    Unmasked
  | -- | A stop request is received while the action blocks.
    Masked
  | -- | No stop request is received.
    Uninterruptible
  deriving (Eq, Ord, Show, Enum, Bounded)

data Ending
  = Succeeds Int
  | Fails
  | Faults
  deriving (Eq, Ord, Show)

-- | What an action does after it has received a stop request.
data OnStop
  = StopsAtOnce
  | -- | Stops after a cleanup of the given number of ticks.
    StopsAfter Ticks
  | -- | Likewise, but another stop request ends the cleanup.
    CleansUpInterruptibly Ticks
  | -- | Does not stop, but ends after the given number of ticks: it completes, or its
    -- cleanup fails or faults.
    EndsAfter Ticks Ending
  deriving (Eq, Ord, Show)

data ActionEvent
  = Begins
  | -- | It has ended without stopping, by itself or by its cleanup.
    Ends Ending
  | -- | It has received a stop request (and has stopped, if it stops at once).
    ReceivesStop
  | -- | It has stopped, after a cleanup.
    Stops
  deriving (Eq, Ord, Show)

pattern Then, Else, Parallel, Both, OnMessage, Await, StopChild :: Program -> Program -> Program
pattern Then a b = Op (O.Then a b)
pattern Else a b = Op (O.Else a b)
pattern Parallel a b = Op (O.Parallel a b)
pattern Both a b = Op (O.Both a b)
pattern OnMessage a b = Op (O.OnMessage a b)
pattern Await a b = Op (O.Await a b)
pattern StopChild a b = Op (O.StopChild a b)

pattern HandleNext, Scoped, Fork :: Program -> Program
pattern HandleNext a = Op (O.HandleNext a)
pattern Scoped a = Op (O.Scoped a)
pattern Fork a = Op (O.Fork a)

pattern Attempt, Timeout, CleanupWithin, Abandoning, Every :: Int -> Program -> Program
pattern Attempt a b = Op (O.Attempt a b)
pattern Timeout a b = Op (O.Timeout a b)
pattern CleanupWithin a b = Op (O.CleanupWithin a b)
pattern Abandoning a b = Op (O.Abandoning a b)
pattern Every a b = Op (O.Every a b)

pattern Retrying :: [Ticks] -> Program -> Program
pattern Retrying a b = Op (O.Retrying a b)

pattern FallbackOver, FirstOf, AllOf :: [Program] -> Program
pattern FallbackOver a = Op (O.FallbackOver a)
pattern FirstOf a = Op (O.FirstOf a)
pattern AllOf a = Op (O.AllOf a)

pattern Decide :: Choice -> [Program] -> Program -> Program
pattern Decide a b c = Op (O.Decide a b c)

pattern RSelect, Monitor, InsteadWhen :: Signal -> Program -> Program -> Program
pattern RSelect a b c = Op (O.RSelect a b c)
pattern Monitor a b c = Op (O.Monitor a b c)
pattern InsteadWhen a b c = Op (O.InsteadWhen a b c)

pattern Switch :: Signal -> [Program] -> Program
pattern Switch a b = Op (O.Switch a b)

pattern TeleoReactive :: [(Signal, Program)] -> Program
pattern TeleoReactive a = Op (O.TeleoReactive a)

pattern MessageRule :: Signal -> Program -> Program -> Signal -> Program -> Program
pattern MessageRule a b c d e = Op (O.MessageRule a b c d e)

pattern WaitUntil :: Signal -> Program
pattern WaitUntil a = Op (O.WaitUntil a)

pattern WhileHolding, WithShared :: Signal -> Program -> Program
pattern WhileHolding a b = Op (O.WhileHolding a b)
pattern WithShared a b = Op (O.WithShared a b)

{-# COMPLETE
  Do, Pure, Sleep, Then, Else, Attempt, FallbackOver, Retrying, Every, Parallel, Both, FirstOf, AllOf, Decide, RSelect
  , Monitor, InsteadWhen, Switch, TeleoReactive, WaitUntil, WhileHolding, Timeout, CleanupWithin, Abandoning
  , OnMessage, HandleNext, MessageRule, WithShared, Scoped, Fork, Await, StopChild, Deliver
  #-}

-- * The parts of a program

-- | The direct parts of a program, those of its signals first.
parts :: Program -> [Program]
parts = \case
  Op o -> getConst (O.traverseBoth (Const . toList) (Const . pure) o)
  _ -> []

-- | The signals of its operator.
signals :: Program -> [Signal]
signals = \case
  Op o -> getConst (O.traverseBoth (Const . pure) (const (Const [])) o)
  _ -> []

-- | Whether a signal uses a shared one.
usesShared :: SignalOf p -> Bool
usesShared = \case
  Shared -> True
  Watched _ -> False
  Polled _ _ -> False
  And a b -> usesShared a || usesShared b
  Hysteresis _ _ _ s -> usesShared s
  Debounce _ s -> usesShared s
  Throttle _ s -> usesShared s
  StaleAfter _ s -> usesShared s

-- | Whether it delivers or handles messages.
usesMessages :: Program -> Bool
usesMessages p = case p of
  Deliver -> True
  Op o | O.receives o -> True
  _ -> any usesMessages (parts p)

depth :: Program -> Int
depth p = maximum (0 : map ((+ 1) . depth) (parts p))

-- | The name of its operator, if that has one.
programName :: Program -> Maybe String
programName = \case
  Op o -> O.operatorName o
  _ -> Nothing

-- | The name in the failure or fault of an action's cleanup.
cleanupOf :: Name -> String
cleanupOf name = name ++ "'s cleanup"

-- | A result as a signal's value.
number :: Value -> Int
number (Number n) = n
number _ = 0
