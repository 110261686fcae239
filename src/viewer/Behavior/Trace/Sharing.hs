-- |
-- Equal texts of a trace, kept in memory once.
module Behavior.Trace.Sharing
  ( Texts
  , noTexts

    -- * Parsers that share texts
  , Sharing
  , runSharing
  , parsed
  , shared
  ) where

import Data.Aeson.Types (Parser)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Text (Text)
import qualified Data.Text as Text

-- | The texts that were seen last.
type Texts = Map Text String

-- | No text was seen yet.
noTexts :: Texts
noTexts = Map.empty

-- | A parser that is given the texts that are known, and returns those that are known then: a few thousand at most.
newtype Sharing a = Sharing (Texts -> Parser (Shared a))

-- Evaluated, so that the JSON that it is made of is not kept.
data Shared a = Shared !a !Texts

instance Functor Sharing where
  fmap f (Sharing p) = Sharing (fmap (\(Shared a known) -> Shared (f a) known) . p)

instance Applicative Sharing where
  pure a = Sharing (pure . Shared a)
  Sharing p <*> Sharing q = Sharing $ \known -> do
    Shared f known' <- p known
    Shared a known'' <- q known'
    pure (Shared (f a) known'')

instance Monad Sharing where
  Sharing p >>= f = Sharing $ \known -> do
    Shared a known' <- p known
    let Sharing q = f a
    q known'

-- | Parses, given the texts that are known.
runSharing :: Texts -> Sharing a -> Parser (a, Texts)
runSharing known (Sharing p) = (\(Shared a known') -> (a, known')) <$> p known

-- | The parser of what contains no text of the user.
parsed :: Parser a -> Sharing a
parsed p = Sharing $ \known -> (`Shared` known) <$> p

-- | The text, or the equal one that is known. Its characters take some hundred bytes, and each name is in two events at
-- least; so they are made when they are needed.
shared :: Text -> Sharing String
shared text = Sharing $ \known -> pure $ case Map.lookup text known of
  Just same -> Shared same known
  Nothing -> Shared new (Map.insertWith const text new (if Map.size known < 4096 then known else noTexts))
 where
  new = Text.unpack text
