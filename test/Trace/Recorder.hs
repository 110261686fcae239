{-# LANGUAGE LambdaCase #-}

-- |
-- Runs programs of the specification, and records what their trace must be.
--
-- Some parts of a program have names. Each part records when it is entered and left, in which
-- thread, and where it is: that follows from the program alone, through the arguments of functions. The
-- events of the trace are recorded between those, as they are emitted.
module Trace.Recorder
  ( Record (..)
  , Entry (..)
  , Owner (..)
  , PartEnd (..)
  , recordedRun
  , nameOf
  , isStop
  ) where

import Control.Concurrent (myThreadId)
import Control.Exception (Exception (..), SomeException (..), mask, throwIO, try)
import Data.Bits (shiftR, xor)
import Data.IORef

import Behavior.Internal.Core.Failure (Behavior, BehaviorFailed (..), StoppedWithFault (..), isCancellation)
import qualified Behavior.Internal.Signal.Source as Signal
import Behavior.Internal.Spans.Event (Event)
import Behavior.Internal.Spans.Place hiding (around)
import Behavior.Internal.Spans.Span (named)
import Behavior.Sim (Run (events), Schedule)
import Semantics.Path (Seen)
import Semantics.Program hiding (number)
import Semantics.Run

-- | A run, and what was recorded.
data Record = Record
  { world :: World
  , seen :: Either String Seen
  , whole :: Run Value
  , entries :: [(Int, Entry)]
  -- ^ Numbered from 0.
  }

-- | Parts and operators are numbered together. Each entry has its thread.
data Entry
  = -- | A part, and whether it has a name.
    Entered String Int Owner Program Bool
  | HasLeft String Int PartEnd
  | -- | The operator at the top of a part.
    Operates String Int Owner Program
  | HasOperated String Int PartEnd
  | IsSet Condition Level
  | -- | An event, received where only named spans count ('False'), or all ('True').
    Received Bool String Event
  deriving (Show)

-- | In what a part is: in the named part, or in the operator, with this number; and in which branch.
data Owner = Owner
  { ownerNumber :: Maybe Int
  , ownerBranch :: Maybe String
  }
  deriving (Eq, Show)

-- | How a part ended.
data PartEnd = PartReturned | PartFailed String | PartFaulted String | PartStopped
  deriving (Eq, Show)

-- | The name of the part with this number.
nameOf :: Int -> String
nameOf n = "part " ++ show n

-- | Runs the world's program under the schedule; the number determines which parts have names. The
-- function is applied to the whole behaviour.
recordedRun :: (Behavior Value -> Behavior Value) -> Int -> Schedule -> World -> IO Record
recordedRun around salt how w = do
  written <- newIORef []
  lastPart <- newIORef 0
  let write entry = modifyIORef' written (entry :)
      self = show <$> myThreadId
      part = atomicModifyIORef' lastPart (\n -> (n + 1, n + 1))
      -- A part, or an operator.
      noting :: IO () -> (PartEnd -> IO ()) -> Behavior a -> Behavior a
      noting entered left act = do
        entered
        -- Masked, so that a pending stop request does not replace a fault.
        mask $ \restore -> do
          end <- try (restore act)
          left (howOf end)
          either (\e -> throwIO (e :: SomeException)) pure end
      within here p isNamed act = do
        n <- part
        thread <- self
        noting (write (Entered thread n here p isNamed)) (write . HasLeft thread n) $
          if isNamed then named (nameOf n) (act (Owner (Just n) Nothing)) else act here
      operating here p run = case programName p of
        Nothing -> run here here
        Just _ -> do
          n <- part
          thread <- self
          noting (write (Operates thread n here p)) (write . HasOperated thread n) $
            run here (Owner (Just n) Nothing)
      chance p = do
        n <- readIORef lastPart
        -- (7919 is a prime, and larger than any program: so each salt has other names.)
        pure (scrambled (salt * 7919 + n) `mod` 8 < (case p of Do _ _ -> 6; _ -> 3))
      receiver detail =
        Receiver
          { firstNumber = 1
          , needsDetail = detail
          , receiveEvent = \e -> self >>= \thread -> write (Received detail thread e)
          }
      instrument =
        Instrument
          { root = Owner Nothing Nothing
          , branchOf = \label here -> here {ownerBranch = Just label}
          , aroundAll = \act -> mask $ \restore ->
              myPlace >>= \case
                Nothing -> restore (around act)
                Just place ->
                  let inBoth = withReceiver (receiver True) (withReceiver (receiver False) (trace place))
                   in inPlace (Just place {trace = inBoth}) (restore (around act))
          , aroundPart = \here p run -> chance p >>= \isNamed -> within here p isNamed (\inner -> operating inner p run)
          , aroundCleanup = \here act -> chance (Pure Unit) >>= \isNamed -> within here (Pure Unit) isNamed (const act)
          , whenSet = \condition level -> write (IsSet condition level)
          , ofSignal = \case
              Nothing -> Signal.named "level"
              Just condition -> Signal.named condition
          }
  (it, run) <- observedWith instrument how w
  Record w it run . zip [0 ..] . ofRun (length (events run)) . reverse <$> readIORef written
 where
  -- Without what a run that was cut off does when it is unwound.
  ofRun :: Int -> [Entry] -> [Entry]
  ofRun count = \case
    Received True thread e : later -> if count == 0 then [] else Received True thread e : ofRun (count - 1) later
    entry : later -> entry : ofRun count later
    [] -> []

howOf :: Either SomeException a -> PartEnd
howOf = \case
  Right _ -> PartReturned
  Left e
    | Just (BehaviorFailed _ failure) <- fromException e -> PartFailed (displayException failure)
    | Just (StoppedWithFault _ fault) <- fromException e -> PartFaulted (text fault)
    | isCancellation e -> PartStopped
    | otherwise -> PartFaulted (text e)
 where
  -- (Of the exception alone: newer versions of GHC add where it was thrown.)
  text :: SomeException -> String
  text (SomeException e) = displayException e

-- | Whether the part was stopped; the exceptions that are thrown to a plain thread may have a
-- synchronous type.
isStop :: PartEnd -> Bool
isStop = (`elem` [PartStopped, PartFaulted "EnoughOfThis"])

-- | A number that looks random, and is the same for the same number: twice the first step of a usual hash.
scrambled :: Int -> Int
scrambled n = abs (step (step n))
 where
  step k = let m = (k `xor` (k `shiftR` 15)) * 0x2c1b3c6d in m `xor` (m `shiftR` 12)
