-- |
-- What readers of a live page receive.
module Live.HistorySpec (spec) where

import qualified Data.ByteString.Lazy as Bytes
import Data.Foldable (foldl')
import Data.List (sort)
import Data.Maybe (fromMaybe)
import Test.Hspec hiding (after)
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior.Live.Internal.History
import Behavior.Trace
import Behavior.Trace.Format
import Viewer.Examples (ended, interrupted, mission, nested, sideBySide)

spec :: Spec
spec = do
  describe "Someone who comes late" $ do
    prop "knows each span that runs, and those that it runs in" $
      forAll (elements [mission, nested 30, sideBySide 20]) $ \events -> forAll (choose (0, length events)) $ \n ->
        let seen = take n events
            begun = [spanNumber s | Began s <- seen]
            over = [spanNumber s | Ended s _ _ <- seen]
         in map numberOf (runningNow (snapshot (after 7 seen))) === sort (filter (`notElem` over) begun)
    it "knows the last ends and reactions" $ do
      let events = interrupted 3000
          s = snapshot (after 50 events)
      lastReacted s `shouldBe` lastOf 200 [line e | e@(Reacted _) <- events]
      lastEnded s `shouldBe` lastOf 200 [line e | e@Ended {} <- events]
    it "does not take a span for running whose end was lost, once one around it has ended" $ do
      let events = take 30 (nested 30) ++ [Lost 5] ++ take 2 (drop 1 (ended 1 Top "on" 0 Nothing 9 Succeeded))
      runningNow (snapshot (after 5 events)) `shouldBe` []
      lostSoFar (after 5 events) `shouldBe` 5

  describe "The events that are kept" $ do
    prop "are within both limits, but for the newest chunk" . forAll sizes $ \(events, bytes, each) ->
      let limits = few {mostEvents = events, mostBytes = bytes}
          history = foldl' (flip (add limits . map noted)) noHistory (inChunks each (interrupted 400))
          kept = fromMaybe [] (firstKept history)
          weight = sum (map (Bytes.length . encoded) kept)
       in counterexample (show (map firstNumber kept)) $
            length kept === 1 .||. (sum (map count kept) <= events .&&. fromIntegral weight <= bytes)
    prop "come to a reader once each, in order, wherever it begins" . forAll (choose (1, 40)) $ \each ->
      let events = interrupted 200
       in forAll (elements (takeWhile (<= length events) [0, each ..])) $ \n ->
            fmap (Bytes.intercalate (Bytes.singleton 44) . map encoded) (chunksFrom n (after each events))
              === Just (Bytes.intercalate (Bytes.singleton 44) (map line (drop n events)))
    it "are not given from where they are not kept any more, nor from within a chunk, nor from the future" $ do
      let history = foldl' (flip (add few {mostEvents = 20} . map noted)) noHistory (inChunks 10 (interrupted 100))
      map (fmap (map firstNumber) . (`chunksFrom` history)) [0, nextNumber history - 5, nextNumber history + 10]
        `shouldBe` [Nothing, Nothing, Nothing]
      chunksFrom (nextNumber history) history `shouldBe` Just []
 where
  sizes = (,,) <$> choose (1, 300) <*> choose (100, 50000) <*> choose (1, 60)
  few = defaultLimits
  count c = afterLast c - firstNumber c
  -- The oldest that is kept.
  firstKept h = case [found | n <- [0 .. nextNumber h - 1], Just found@(_ : _) <- [chunksFrom n h]] of
    these : _ -> Just these
    [] -> Nothing
  numberOf bytes = case decodeEvent bytes of
    Right (Began s) -> spanNumber s
    _ -> 0

after :: Int -> [Event] -> History
after each = foldl' (flip (add defaultLimits . map noted)) noHistory . inChunks each

inChunks :: Int -> [a] -> [[a]]
inChunks each events = case splitAt each events of
  ([], _) -> []
  (these, others) -> these : inChunks each others

lastOf :: Int -> [a] -> [a]
lastOf n these = drop (length these - n) these

-- As it is in a chunk.
line :: Event -> Bytes.ByteString
line = head . maybe [] (map encoded) . chunksFrom 0 . (\e -> add defaultLimits [noted e] noHistory)
