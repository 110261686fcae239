-- |
-- Comparing with the files in test/golden. With BEHAVIOR_GOLDEN=write they are written instead;
-- look at what changed.
module Viewer.Golden
  ( golden
  , goldenText
  , goldenSvg
  ) where

import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Lazy
import Data.List (sort)
import qualified Data.Text.Lazy as Text
import qualified Data.Text.Lazy.Encoding as Text
import System.Environment (lookupEnv)
import Test.Hspec

import Viewer.Xml

-- | The bytes are those of the file.
golden :: FilePath -> Lazy.ByteString -> Spec
golden = goldenBy (Lazy.split 10) -- A difference is reported by lines.

-- | The same for a text in UTF-8.
goldenText :: FilePath -> String -> Spec
goldenText name = golden name . Text.encodeUtf8 . Text.pack

-- | The same for a picture. (The order of attributes depends on the versions of other libraries.)
goldenSvg :: FilePath -> Text.Text -> Spec
goldenSvg name = goldenBy (fmap sorted . readXml . Text.unpack . Text.decodeUtf8) name . Text.encodeUtf8
 where
  sorted (Element tag attributes inside) = Element tag (sort attributes) (map sorted inside)
  sorted text = text

-- What the function makes of the bytes is what it makes of the file.
goldenBy :: (Eq a, Show a) => (Lazy.ByteString -> a) -> FilePath -> Lazy.ByteString -> Spec
goldenBy known name made = it ("is as in test/golden/" ++ name) $ do
  writes <- lookupEnv "BEHAVIOR_GOLDEN"
  if writes == Just "write"
    then Lazy.writeFile path made >> pendingWith "written"
    else do
      kept <- Lazy.fromStrict <$> Strict.readFile path
      known made `shouldBe` known kept
 where
  path = "test/golden/" ++ name
