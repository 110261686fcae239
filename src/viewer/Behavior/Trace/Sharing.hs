-- |
-- Equal texts of a trace, kept in memory once.
module Behavior.Trace.Sharing
  ( Texts
  , noTexts
  , sharing
  ) where

import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map

import Behavior.Internal.Trace.Event (traverseTexts)
import Behavior.Trace

-- | The texts that were seen last.
type Texts = Map String String

-- | No text was seen yet.
noTexts :: Texts
noTexts = Map.empty

-- | The event, with the texts that are known in the place of equal ones; and the texts that are known then: a
-- few thousand at most. (A text takes some hundred bytes, and each name is in two events at least.)
sharing :: Texts -> Event -> (Event, Texts)
sharing known event = case run (traverseTexts share event) known of Shared shared known' -> (shared, known')

share :: String -> Sharing String
share text = Sharing $ \known -> case Map.lookup text known of
  Just same -> Shared same known
  Nothing -> Shared text (Map.insert text text (if Map.size known < 4096 then known else noTexts))

-- Evaluates each part of the event: what is not evaluated would keep the other text.
newtype Sharing a = Sharing {run :: Texts -> Shared a}

data Shared a = Shared !a !Texts

instance Functor Sharing where
  fmap f (Sharing a) = Sharing $ \known -> case a known of Shared x known' -> Shared (f x) known'

instance Applicative Sharing where
  pure x = Sharing (Shared x)
  Sharing f <*> Sharing a = Sharing $ \known -> case f known of
    Shared g known' -> case a known' of Shared x known'' -> Shared (g x) known''
