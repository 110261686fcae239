-- |
-- A recording as a tree of text.
module Behavior.Trace.Tree
  ( renderTree
  ) where

import qualified Data.IntMap.Strict as IntMap
import Data.List (sortOn)
import Data.Maybe (listToMaybe)

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Recording
import Behavior.Trace.Siblings

-- $setup
-- >>> import Behavior.Trace
-- >>> import Behavior.Trace.Recording

-- | A line for each span and each reaction: when it began, how long it took, its name, how it ended
-- and why. A span's line comes before those of what ran in it, which are indented. An interruption
-- has an exclamation mark.
--
-- >>> let mission = Span 1 Top Named "mission" 0 Nothing
-- >>> let door = Span 2 (Inside 1) Named "front door" 1.5 Nothing
-- >>> putStr (renderTree (recording [Began mission, Ended door 2 (FailedWith "locked"), Ended mission 4 Succeeded]))
--   begin [s]  took [s]
--       0.000     4.000  mission: succeeded
--       1.500     0.500    front door: failed: locked
--
-- @since 0.1.0.0
renderTree :: Recording -> String
renderTree recorded = unlines (heading : inOrder (map (reaction 0) loose ++ map (branch 0) (recordingRoots r)) remark)
 where
  r = withSiblings recorded
  heading = row "begin [s]" "took [s]" ""
  branch :: Int -> Node -> Part
  branch depth node =
    ( spanBegan s
    , (row (millisecondsText (spanBegan s)) (millisecondsText took) (indented depth (title node)) :)
        . inOrder
          ( map (reaction (depth + 1)) (IntMap.findWithDefault [] (spanNumber s) inside)
              ++ map (branch (depth + 1)) (nodeChildren node)
          )
    )
   where
    s = nodeSpan node
    took = nodeUntil r node - spanBegan s
  reaction depth x =
    ( reactionTime x
    , (row (millisecondsText (reactionTime x)) "" (indented depth ("! " ++ described x)) :)
    )
  described x = reactionText [(spanName s, spanBegan s) | s <- stopped] (spanName <$> listToMaybe started) x
   where
    (stopped, started) = IntMap.findWithDefault ([], []) (reactionNumber x) involved
  involved = reactionSpans r
  (loose, inside) = reactionsInside r
  remark = [lostRemark (recordingLost r) | recordingLost r /= 0]

-- When it was, and its lines, before those that follow. (Lists of lines would be copied at each level.)
type Part = (Seconds, [String] -> [String])

inOrder :: [Part] -> [String] -> [String]
inOrder parts rest = foldr snd rest (sortOn fst parts)

title :: Node -> String
title node = nameText (spanName s) ++ ": " ++ outcomeText (snd <$> nodeEnd node) ++ kind ++ origin
 where
  s = nodeSpan node
  kind = case spanKind s of
    Named -> ""
    Operator -> " [operator]"
    Branch -> " [branch]"
  origin = if spanParent s == UnknownParent then " [it is not known what it ran in]" else ""

row :: String -> String -> String -> String
row begin took text = padLeft 11 begin ++ padLeft 10 took ++ (if null text then "" else "  " ++ text)

-- Deep trees stay on the screen.
indented :: Int -> String -> String
indented depth text
  | depth <= 40 = replicate (2 * depth) ' ' ++ text
  | otherwise = replicate 80 ' ' ++ "(" ++ show depth ++ " deep) " ++ text

padLeft :: Int -> String -> String
padLeft n text = replicate (n - length text) ' ' ++ text
