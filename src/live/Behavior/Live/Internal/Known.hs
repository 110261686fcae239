{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What a hub knows of a robot, from the messages of its live page: what runs, and the last interruption. It is bounded,
-- whatever the robot says.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Known
  ( -- * What is known
    Known (..)
  , Interruption (..)
  , Change (..)
  , Stopped (..)
  , nothingKnown
  , learn

    -- * What it does
  , Doing (..)
  , doing
  ) where

import Control.Applicative (optional)
import Control.Monad (mfilter)
import Data.Aeson (Object, Value, eitherDecode, parseJSON, withObject, (.!=), (.:), (.:?))
import Data.Aeson.Types (Parser, parseEither)
import qualified Data.ByteString.Lazy as Bytes
import Data.Foldable (foldl')
import Data.IntMap.Strict (IntMap)
import qualified Data.IntMap.Strict as IntMap
import qualified Data.IntSet as IntSet
import Data.Maybe (fromMaybe, mapMaybe)
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior.Internal.Nesting (hasMoreDigitsThan, nestsDeeperThan)

-- | Times are seconds, relative to the zero of the robot's run.
data Known = Known
  { running :: !(IntMap Running)
  -- ^ The spans that run, by their numbers.
  , interruption :: !(Maybe Interruption)
  -- ^ The last one.
  , stoppedBy :: !(IntMap Stopped)
  -- ^ The outermost named span that a reaction stopped, by the reaction's number.
  , startedBy :: !(IntMap Text)
  -- ^ The name of the first one that it started.
  , timeThere :: !Double
  -- ^ What time it was at the robot when it last said so.
  , hasGaps :: !Bool
  -- ^ Whether events were lost.
  , isOver :: !Bool
  -- ^ Whether its run is over.
  , refused :: !(Maybe Text)
  -- ^ Why it says nothing else.
  }
  deriving (Eq, Show)

-- | What it runs in, its name if it has one, and when it began.
data Running = Running !(Maybe Int) !(Maybe Text) !Double
  deriving (Eq, Show)

-- | The number of a span, its name, and when it began.
data Stopped = Stopped !Int !Text !Double
  deriving (Eq, Show)

-- | A reaction that stopped something.
data Interruption = Interruption
  { reaction :: !Int
  , reactedAt :: !Double
  , changes :: ![Change]
  , operator :: !Text
  , stops :: !Text
  , after :: !Double
  , starts :: !(Maybe Text)
  }
  deriving (Eq, Show)

-- | A signal, its value before, and after.
data Change = Change !Text !(Maybe Text) !Text
  deriving (Eq, Show)

-- | Of a robot of which nothing has come.
nothingKnown :: Known
nothingKnown = Known IntMap.empty Nothing IntMap.empty IntMap.empty 0 False False Nothing

-- | What is known after a message; or why it is none.
learn :: Bytes.ByteString -> Known -> Either String Known
learn bytes known
  | nestsDeeperThan 20 bytes || hasMoreDigitsThan 400 bytes =
      Left "it nests too deep, or has a number that is too long"
  | otherwise = eitherDecode bytes >>= parseEither (withObject "a message" message)
 where
  message o = do
    kind <- o .: "message"
    now <- o .:? "now" >>= maybe (pure (timeThere known)) seconds
    case kind :: Text of
      "snapshot" -> do
        news <- concat <$> traverse (newsAt o) ["ended", "reacted", "running"]
        gaps <- (/= (0 :: Int)) <$> o .: "lost"
        pure (foldl' (flip noting) nothingKnown {timeThere = now, hasGaps = gaps} news)
      "events" -> foldl' (flip noting) known <$> newsAt o "events"
      "beat" -> pure known {timeThere = now}
      "over" -> pure known {timeThere = now, isOver = True}
      "refused" -> (\why -> known {refused = Just why}) <$> (o .: "why" >>= short)
      _ -> pure known
  newsAt o part = o .: part >>= traverse event :: Parser [News]

-- | What an event changes. Of a span: its number, and the reaction that started it; and then that which stopped it.
data News
  = Begins !Int !Running !(Maybe Int)
  | Ends !Int !Running !(Maybe Int) !(Maybe Int)
  | Interrupts !Interruption
  | Loses
  | Other

-- Only of what is kept the fields are read.
event :: Object -> Parser News
event o = do
  kind <- o .: "event"
  case kind :: Text of
    "began" -> Begins <$> o .: "number" <*> this <*> o .:? "reaction"
    "ended" -> do
      cause <- o .: "end" >>= (.:? "cause")
      Ends <$> o .: "number" <*> this <*> o .:? "reaction" <*> maybe (pure Nothing) (.:? "reaction") cause
    "reacted" -> o .:? "stopped" >>= maybe (pure Other) (fmap Interrupts . interrupting)
    "lost" -> pure Loses
    _ -> pure Other
 where
  -- (The parent of one in no other is a text.)
  this = Running <$> (o .: "parent" >>= optional . parseJSON) <*> named <*> (o .: "began" >>= seconds)
  named = do
    kind <- o .: "kind"
    if kind == ("named" :: Text) then Just <$> (o .: "name" >>= short) else pure Nothing
  interrupting stopped =
    Interruption
      <$> o .: "number"
      <*> (o .: "time" >>= seconds)
      <*> (o .:? "changes" .!= [] >>= traverse change . take 10)
      <*> (o .: "operator" >>= short)
      <*> (stopped .: "name" >>= short)
      <*> (stopped .: "after" >>= seconds)
      <*> (o .:? "starts" >>= traverse short)
  change c =
    Change <$> (c .: "signal" >>= short) <*> (c .:? "before" >>= traverse short) <*> (c .: "after" >>= short)

-- (One that is not finite is written as a text.)
seconds :: Value -> Parser Double
seconds value = fromMaybe 0 . mfilter ((< 1e15) . abs) <$> optional (parseJSON value)

-- A page shows no more of a text. (Evaluated, and copied, so that the rest of a longer one is not kept.)
short :: Text -> Parser Text
short text = pure $! if Text.compareLength text 200 == GT then Text.copy (Text.take 200 text) <> "…" else text

noting :: News -> Known -> Known
noting news known = case news of
  Begins n this by ->
    started this by $ if isFull then known else known {running = IntMap.insert n this (running known)}
  Ends n this@(Running _ name began) by cause ->
    started this by known
      { running = if hasGaps known then without n else IntMap.delete n (running known)
      , stoppedBy = case (cause, name) of
          (Just r, Just text) -> newest (IntMap.insertWith outermost r (Stopped n text began) (stoppedBy known))
          _ -> stoppedBy known
      }
  Interrupts it -> known {interruption = Just it}
  Loses -> known {hasGaps = True}
  Other -> known
 where
  started this by k = case (this, by) of
    (Running _ (Just name) _, Just r) ->
      k {startedBy = newest (IntMap.insertWith (\_ first -> first) r name (startedBy k))}
    _ -> k
  -- (What runs in it has ended too, if its end was lost.)
  without n = IntMap.filterWithKey (\m _ -> n `notElem` takeWhile (>= n) (ancestors (running known) m)) (running known)
  isFull = IntMap.size (running known) >= mostRunning
  outermost new@(Stopped n _ _) old@(Stopped m _ _) = if n < m then new else old
  newest these = if IntMap.size these > 50 then IntMap.deleteMin these else these

-- | The most spans that are known to run; of more, those that began later are not.
mostRunning :: Int
mostRunning = 2000

-- | An innermost named span that runs: its name and those of the named ones that it runs in, the outermost first.
data Doing = Doing ![Text] !Double
  deriving (Eq, Show)

-- | What the robot does, in the order in which it began.
doing :: Known -> [Doing]
doing known = [Doing (reverse (names n)) began | (n, Running _ (Just _) began) <- IntMap.toAscList these, isInnermost n]
 where
  these = running known
  isInnermost n = not (IntSet.member n around)
  around = foldl' with IntSet.empty [ancestors these parent | Running (Just parent) (Just _) _ <- IntMap.elems these]
  with seen path = foldl' (flip IntSet.insert) seen (takeWhile (`IntSet.notMember` seen) path)
  names n = mapMaybe nameOf (take 50 (ancestors these n))
  nameOf n = IntMap.lookup n these >>= \(Running _ name _) -> name

-- | The number, and those of the spans that it runs in, the innermost first. (Each is smaller than the one before it.)
ancestors :: IntMap Running -> Int -> [Int]
ancestors these n = n : case IntMap.lookup n these of
  Just (Running (Just parent) _ _) | parent < n -> ancestors these parent
  _ -> []
