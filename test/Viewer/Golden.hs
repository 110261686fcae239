-- |
-- Comparing with the files in test/golden. With BEHAVIOR_GOLDEN=write they are written instead;
-- look at what changed.
module Viewer.Golden
  ( golden
  , goldenText
  ) where

import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Lazy
import qualified Data.Text.Lazy as Text
import qualified Data.Text.Lazy.Encoding as Text
import System.Environment (lookupEnv)
import Test.Hspec

-- | The bytes are those of the file.
golden :: FilePath -> Lazy.ByteString -> Spec
golden name made = it ("is as in test/golden/" ++ name) $ do
  writes <- lookupEnv "BEHAVIOR_GOLDEN"
  if writes == Just "write"
    then Lazy.writeFile path made >> pendingWith "written"
    else do
      kept <- Lazy.fromStrict <$> Strict.readFile path
      -- (A difference is reported by lines.)
      Lazy.split 10 made `shouldBe` Lazy.split 10 kept
 where
  path = "test/golden/" ++ name

-- | The same for a text in UTF-8.
goldenText :: FilePath -> String -> Spec
goldenText name = golden name . Text.encodeUtf8 . Text.pack
