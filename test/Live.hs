-- |
-- The live page. (A program of its own: it waits for clocks and sockets, while others need the processors.)
module Main (main) where

import Test.Hspec

import qualified Live.FollowingSpec
import qualified Live.HistorySpec
import qualified Live.HubSpec
import qualified Live.ServerSpec

main :: IO ()
main = hspec . describe "The live page" $ do
  Live.HistorySpec.spec
  Live.ServerSpec.spec
  describe "A trace file" Live.FollowingSpec.spec
  describe "Many robots" Live.HubSpec.spec
