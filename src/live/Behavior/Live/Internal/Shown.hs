{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What a live page shows: the events go in, and come out in chunks. No user's code waits for that but the trace's sink.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Shown
  ( Shown (..)
  , newShown
  , receive
  , publishing
  , finish
  , allHaveRead
  ) where

import Control.Concurrent.STM
import Control.Exception (evaluate)
import Control.Monad (when, (>=>))
import Data.Bifunctor (bimap)
import Data.Text (Text)
import System.Timeout (timeout)

import Behavior.Internal.Core.Seconds (Seconds)
import Behavior.Internal.Spans.Event (traverseTexts)
import Behavior.Live.Internal.History
import Behavior.Live.Internal.Protocol
import Behavior.Trace (Event (Lost))

-- | What is shown, and to how many.
data Shown = Shown
  { run :: Run
  , clock :: History -> IO Seconds
  -- ^ What time it is, relative to the zero of the run, if this is known.
  , token :: Maybe Text
  , onlyHere :: Bool
  -- ^ Whether only this machine reaches it.
  , limits :: Limits
  , pending :: TVar (Int, [Noted])
  -- ^ Those that are in no chunk yet, the newest first; and how many.
  , inHand :: TVar Int
  -- ^ How many have come, but are not there yet.
  , history :: TVar History
  , isOver :: TVar Bool
  -- ^ Whether no more events come.
  , isComplete :: TVar Bool
  -- ^ Whether all that have come are in chunks, too.
  , readers :: TVar Int
  }

-- | With nothing in it: how much is kept, the run, its clock, the token, and whether only this machine reaches it.
newShown :: Limits -> Run -> (History -> IO Seconds) -> Maybe Text -> Bool -> IO Shown
newShown most this time secret here =
  Shown this time secret here most
    <$> newTVarIO (0, [])
    <*> newTVarIO 0
    <*> newTVarIO noHistory
    <*> newTVarIO False
    <*> newTVarIO False
    <*> newTVarIO 0

-- | Takes the next events of the trace, whose times are relative to the zero of the run; when too many of those before
-- are in no chunk yet, it waits (so what is too much is counted as lost by the trace). Of each text a page needs no
-- more than its first 1,000 characters.
receive :: Shown -> [Event] -> IO ()
receive shown events = do
  atomically (writeTVar (inHand shown) (length events))
  go events
 where
  -- (A few at a time: as texts they take many times the memory.)
  go [] = pure ()
  go rest = do
    let (some, others) = splitAt 500 rest
    these <- traverse (traverseTexts shortened >=> evaluate . noted) some
    goesOn <- atomically $ do
      ends <- readTVar (isOver shown)
      if ends then pure False else True <$ append (length these) (reverse these)
    when goesOn (go others)
  append n these = do
    (count, before) <- readTVar (pending shown)
    check (count < mostEvents (limits shown))
    writeTVar (pending shown) (count + n, these ++ before)
    modifyTVar' (inHand shown) (subtract n)

-- (Evaluated to its end, so that nothing longer is kept.)
shortened :: String -> IO String
shortened text = short <$ evaluate (length short)
 where
  short = case splitAt 1000 text of
    (whole, []) -> whole
    (some, _) -> some ++ "..."

-- | Makes chunks of them, at most one in 50 ms. It ends when the run is over, and all is in chunks.
publishing :: Shown -> IO ()
publishing shown = do
  (events, ends) <- atomically $ do
    (_, events) <- readTVar (pending shown)
    ends <- readTVar (isOver shown)
    check (ends || not (null events))
    (events, ends) <$ writeTVar (pending shown) (0, [])
  before <- readTVarIO (history shown)
  after <- evaluate (add (limits shown) (reverse events) before)
  atomically (writeTVar (history shown) after)
  if ends && null events
    then atomically (writeTVar (isComplete shown) True)
    else timeout 50000 (atomically (readTVar (isOver shown) >>= check)) >> publishing shown

-- | Says that the run is over. Events that are in hand are lost, and counted.
finish :: Shown -> IO ()
finish shown = atomically $ do
  writeTVar (isOver shown) True
  n <- readTVar (inHand shown)
  when (n > 0) $ modifyTVar' (pending shown) (bimap (+ 1) (noted (Lost n) :))

-- | Waits until there is no reader any more.
allHaveRead :: Shown -> IO ()
allHaveRead shown = atomically (readTVar (readers shown) >>= check . (== 0))
