{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What readers of a live page receive: the newest events, in chunks that are encoded once for all of them; and what
-- someone who comes late has to know. All of it takes bounded memory, but for the spans that run.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.History
  ( History
  , noHistory
  , Noted
  , noted
  , add
  , Limits (..)
  , defaultLimits

    -- * Reading
  , Chunk (..)
  , nextNumber
  , lostSoFar
  , chunksFrom
  , Snapshot (..)
  , snapshot
  ) where

import Data.ByteString.Builder (toLazyByteString)
import qualified Data.ByteString.Lazy as Bytes
import Data.Foldable (foldl', toList)
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import Data.IntSet (IntSet)
import qualified Data.IntSet as IntSet
import Data.Sequence (Seq (..), (|>))
import qualified Data.Sequence as Seq

import Behavior.Trace
import Behavior.Trace.Format (encodeEvent)

-- | The events so far, as far as they are kept. Each has a number, from 0.
data History = History
  { chunks :: !(Seq Chunk)
  -- ^ The oldest first.
  , eventsKept :: !Int
  , bytesKept :: !Int
  , nextNumber :: !Int
  -- ^ The number of the next event.
  , running :: !(IntMap (Parent, Bytes.ByteString))
  -- ^ The beginnings of the spans that have not ended, by their numbers.
  , inside :: !(IntMap IntSet)
  -- ^ Those of them that run in a span, by its number.
  , endedLast :: !(Seq Bytes.ByteString)
  , reactedLast :: !(Seq Bytes.ByteString)
  , lostSoFar :: !Int
  -- ^ How many events the trace has lost.
  }

-- | Events that readers receive together.
data Chunk = Chunk
  { firstNumber :: !Int
  , afterLast :: !Int
  , encoded :: !Bytes.ByteString
  -- ^ The events as in a file ("Behavior.Trace.Format"), with commas between them.
  }
  deriving (Eq, Show)

-- | How much is kept.
data Limits = Limits
  { mostEvents :: !Int
  , mostBytes :: !Int
  , mostEnded :: !Int
  , mostReactions :: !Int
  }

-- | 20,000 events or 16 MiB, whichever is less; and 200 spans that have ended, and 200 reactions.
defaultLimits :: Limits
defaultLimits = Limits {mostEvents = 20000, mostBytes = 16777216, mostEnded = 200, mostReactions = 200}

-- | Before the first event.
noHistory :: History
noHistory = History Seq.empty 0 0 0 IntMap.empty IntMap.empty Seq.empty Seq.empty 0

-- | An event as it is sent, and what it changes for someone who comes late.
data Noted = Noted !About !Bytes.ByteString

data About
  = Begins !Int !Parent
  | Ends !Int
  | Reacts
  | Loses !Int

-- | The event, encoded. (Evaluated, it keeps nothing of the event: a text takes a byte for each character there.)
noted :: Event -> Noted
noted event = Noted about (compact (Bytes.init (toLazyByteString (encodeEvent event))))
 where
  about = case event of
    Began s -> Begins (spanNumber s) (spanParent s)
    Ended s _ _ -> Ends (spanNumber s)
    Reacted _ -> Reacts
    Lost n -> Loses n

compact :: Bytes.ByteString -> Bytes.ByteString
compact = Bytes.fromStrict . Bytes.toStrict

-- | With one more chunk, of these events. (The newest chunk is kept, however large it is.)
add :: Limits -> [Noted] -> History -> History
add _ [] history = history
add limits events history =
  forgetting limits $ (foldl' (noting limits) history events)
    { chunks = chunks history |> chunk
    , eventsKept = eventsKept history + length events
    , bytesKept = bytesKept history + size chunk
    , nextNumber = afterLast chunk
    }
 where
  chunk = Chunk from (from + length events) $! compact (Bytes.intercalate (Bytes.singleton 44) (map line events))
  from = nextNumber history
  line (Noted _ bytes) = bytes

size :: Chunk -> Int
size = fromIntegral . Bytes.length . encoded

forgetting :: Limits -> History -> History
forgetting limits history = case chunks history of
  oldest :<| others@(_ :<| _)
    | eventsKept history > mostEvents limits || bytesKept history > mostBytes limits ->
        forgetting limits history
          { chunks = others
          , eventsKept = eventsKept history - (afterLast oldest - firstNumber oldest)
          , bytesKept = bytesKept history - size oldest
          }
  _ -> history

-- What one event changes for someone who comes late.
noting :: Limits -> History -> Noted -> History
noting limits history (Noted about line) = case about of
  Begins n parent -> beginning n parent history {running = IntMap.insert n (parent, line) (running history)}
  Ends n -> (ending n history) {endedLast = keep (mostEnded limits) (endedLast history)}
  Reacts -> history {reactedLast = keep (mostReactions limits) (reactedLast history)}
  Loses n -> history {lostSoFar = lostSoFar history + n}
 where
  keep most kept = let more = kept |> line in if Seq.length more > most then Seq.drop 1 more else more
  beginning n parent h = case parent of
    Inside p -> h {inside = IntMap.insertWith IntSet.union p (IntSet.singleton n) (inside h)}
    _ -> h

-- The span with this number has ended. After a loss there may be spans in it whose end was lost: these have, too.
ending :: Int -> History -> History
ending n history = foldl' (flip ending) alone (if lostSoFar history == 0 then [] else maybe [] IntSet.toList within)
 where
  within = IntMap.lookup n (inside history)
  alone =
    history
      { running = IntMap.delete n (running history)
      , inside = IntMap.delete n $ case IntMap.lookup n (running history) of
          Just (Inside p, _) -> IntMap.update (nonEmpty . IntSet.delete n) p (inside history)
          _ -> inside history
      }
  nonEmpty these = if IntSet.null these then Nothing else Just these

-- | The chunks from the event with this number on; nothing if not all of them are kept any more, or it is no number at
-- which a chunk begins.
chunksFrom :: Int -> History -> Maybe [Chunk]
chunksFrom number history
  | number == nextNumber history = Just []
  | otherwise = case toList (Seq.dropWhileL ((< number) . firstNumber) (chunks history)) of
      these@(first : _) | firstNumber first == number -> Just these
      _ -> Nothing

-- | What someone who comes late has to know: the beginnings of the spans that run, the last ends and the last
-- reactions, the oldest first (each encoded).
data Snapshot = Snapshot
  { runningNow :: [Bytes.ByteString]
  , lastEnded :: [Bytes.ByteString]
  , lastReacted :: [Bytes.ByteString]
  }
  deriving (Eq, Show)

-- | Spans that run, with those that they run in: these run, too.
snapshot :: History -> Snapshot
snapshot history =
  Snapshot
    { runningNow = map snd (IntMap.elems (running history))
    , lastEnded = toList (endedLast history)
    , lastReacted = toList (reactedLast history)
    }
