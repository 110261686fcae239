{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The texts that describe events, one line each.
--
-- Names, values and failures are the user's texts: they are made inert first ('inert').
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Tracing.Text
  ( plainLine

    -- * Parts
  , reactionText
  , reactionParts
  , stoppedText
  , startedText
  , startsText
  , changesText
  , changedOnly
  , endText
  , howText
  , causeText
  , secondsText
  , millisecondsText
  , lostText

    -- * The user's texts
  , nameText
  , quotedText
  , inert
  , inertUpTo
  ) where

import Data.Char (GeneralCategory (..), generalCategory)
import Data.List (dropWhileEnd, intercalate, stripPrefix)
import Numeric (showEFloat, showFFloat)

import Behavior.Internal.Core.Seconds (Seconds (..))
import Behavior.Internal.Spans.Event

-- $setup
-- >>> import Behavior.Internal.Spans.Event
-- >>> let survey = Span 2 (Inside 1) Named "survey" 4 Nothing
-- >>> let changes = [Change "battery" (Just "100") "9.4", Change "batteryLow" (Just "False") "True"]
-- >>> let stopped = StoppedBranch "task" 3.1 0.3 (StoppedBy (SignalChanged 5 changes))
-- >>> let reaction = Reaction 5 (Inside 1) "monitor" 7.1 changes (Just stopped) (Just "recovery")

-- | The event as one line of text: when, and what.
--
-- >>> putStrLn (plainLine (Began survey))
-- 4.000 + survey
-- >>> putStrLn (plainLine (Ended survey 6.5 (FailedWith "locked")))
-- 6.500 - survey: failed after 2.5 s: locked
-- >>> putStrLn (plainLine (Reacted reaction))
-- 7.100 ! battery 9.4 (was 100) -> batteryLow True (was False) -> stopped its task after 3.1 s (took 0.3 s) -> recovery
-- >>> putStrLn (plainLine (Lost 3))
-- (3 events were lost here)
--
-- @since 0.1.0.0
plainLine :: Event -> String
plainLine (Began s) = millisecondsText (spanBegan s) ++ " + " ++ nameText (spanName s)
plainLine (Ended s t end) =
  millisecondsText t ++ " - " ++ nameText (spanName s) ++ ": " ++ endText (t - spanBegan s) end
plainLine (Reacted r) = millisecondsText (reactionTime r) ++ " ! " ++ reactionText [] Nothing r
plainLine (Lost n) = "(" ++ lostText n ++ " here)"

-- | What changed, what the operator stopped, and what it starts: see 'reactionParts'.
--
-- >>> putStrLn (reactionText [("drive", 5)] (Just "recharge") reaction)
-- battery 9.4 (was 100) -> batteryLow True (was False) -> stopped "drive" after 2.1 s (took 0.3 s) -> "recharge"
reactionText :: [(String, Seconds)] -> Maybe String -> Reaction -> String
reactionText spans started r = intercalate " -> " (changed ++ done)
 where
  (changed, done) = reactionParts spans started r

-- | Two lists: the changes, each with its cause before it; and what the operator stopped, and what it starts. The
-- arguments are the names of the spans that it stopped, each with the time when it began; and the name of the first
-- span that it started. Where there is none, the operator's own name of the branch is used, without quotation marks.
--
-- >>> snd (reactionParts [] Nothing reaction)
-- ["stopped its task after 3.1 s (took 0.3 s)","recovery"]
-- >>> let parts spans = head (snd (reactionParts spans Nothing reaction))
-- >>> parts [("drive", 5), ("film", 5)]
-- "stopped \"drive\", \"film\" after 2.1 s (took 0.3 s)"
-- >>> parts [("drive", 5), ("film", 6)]
-- "stopped \"drive\" after 2.1 s, \"film\" after 1.1 s (took 0.3 s)"
-- >>> fst (reactionParts [] Nothing reaction {reactionChanges = []})
-- ["monitor changed"]
-- >>> snd (reactionParts [] Nothing reaction {reactionStopped = Nothing})
-- ["starts recovery"]
--
-- How long stopping took is left out if it took no time: less than half a millisecond.
--
-- >>> snd (reactionParts [] Nothing reaction {reactionStopped = Just stopped {stoppingTook = 0}})
-- ["stopped its task after 3.1 s","recovery"]
reactionParts :: [(String, Seconds)] -> Maybe String -> Reaction -> ([String], [String])
reactionParts spans started r = (changed, maybe [] stopped (reactionStopped r) ++ startsText started r)
 where
  changed = case changedOnly (reactionChanges r) of
    [] -> [nameText (reactionOperator r) ++ " changed"]
    changes -> map changeText changes
  stopped b = [stoppedAfterText spans (reactionTime r) b ++ took b]
  took b = case stoppingTime (stoppingTook b) ++ although (stoppedEnd b) of
    [] -> ""
    remarks -> " (" ++ intercalate ", " remarks ++ ")"
  stoppingTime t = ["took " ++ secondsText t | millisecondsText t /= millisecondsText 0]
  although Succeeded = ["it completed nevertheless"]
  although (StoppedBy _) = []
  although end = ["it " ++ howText end]

-- | What was stopped, given the names of the spans.
--
-- >>> map (\names -> stoppedText names stopped) [[], ["drive"], ["drive", "film"]]
-- ["stopped its task","stopped \"drive\"","stopped \"drive\", \"film\""]
stoppedText :: [String] -> StoppedBranch -> String
stoppedText [] b = "stopped its " ++ nameText (stoppedName b)
stoppedText names _ = "stopped " ++ upToThree (map quotedText names)

-- The same, and how long the spans had run at that time: said once, if all had run equally long.
stoppedAfterText :: [(String, Seconds)] -> Seconds -> StoppedBranch -> String
stoppedAfterText spans time b = case map after spans of
  [] -> stoppedText [] b ++ afterText (stoppedAfter b)
  one : others
    | all (== one) others -> stoppedText (map fst spans) b ++ one
    | otherwise -> "stopped " ++ upToThree [quotedText name ++ after s | s@(name, _) <- spans]
 where
  -- A span can begin between the decision and its stop.
  after (_, began) = afterText (max 0 (time - began))
  afterText t = " after " ++ secondsText t

upToThree :: [String] -> String
upToThree texts = intercalate ", " known ++ concat [" and " ++ show (length more) ++ " more" | not (null more)]
 where
  (known, more) = splitAt 3 texts

-- | What was started, given the name of the span, if there is one, and that of the branch.
startedText :: Maybe String -> String -> String
startedText started branch = maybe (nameText branch) quotedText started

-- | The same, to follow the text of what was stopped. If nothing was stopped, it begins with \"starts\".
startsText :: Maybe String -> Reaction -> [String]
startsText started r =
  [ maybe "starts " (const "") (reactionStopped r) ++ startedText started branch
  | Just branch <- [reactionStarts r]
  ]

-- | The named values after a change, those that others are computed from first.
--
-- >>> changesText changes
-- "battery 9.4 (was 100) -> batteryLow True (was False)"
-- >>> changesText []
-- "a signal changed"
--
-- A value that did not change is left out where another one did.
--
-- >>> changesText (Change "outside" (Just "False") "False" : changes)
-- "battery 9.4 (was 100) -> batteryLow True (was False)"
-- >>> changesText [Change "outside" (Just "False") "False"]
-- "outside False"
changesText :: [Change] -> String
changesText changes = case changedOnly changes of
  [] -> "a signal changed"
  known -> intercalate " -> " (map changeText known)

-- | The changes whose value differs from the one before; or all, if no value differs.
changedOnly :: [Change] -> [Change]
changedOnly changes = if any differs changes then filter differs changes else changes

differs :: Change -> Bool
differs c = changeBefore c /= Just (changeAfter c)

changeText :: Change -> String
changeText c =
  nameText (changeSignal c) ++ " " ++ inertUpTo 200 (changeAfter c)
    ++ (if differs c then maybe "" was (changeBefore c) else "")
 where
  was value = " (was " ++ inertUpTo 200 value ++ ")"

-- | How a span ended that took this long, and why.
--
-- >>> endText 1.9 (FailedWith "locked")
-- "failed after 1.9 s: locked"
endText :: Seconds -> End -> String
endText took = endWith (" after " ++ secondsText took)

-- | How a span ended, and why.
--
-- >>> map howText [Succeeded, FailedWith "the behaviour failed: locked", StoppedBy (TimeLimit 2)]
-- ["succeeded","failed: locked","stopped: time limit of 2 s"]
howText :: End -> String
howText = endWith ""

endWith :: String -> End -> String
endWith after end = case end of
  Succeeded -> "succeeded" ++ after
  FailedWith why -> "failed" ++ after ++ because (withoutPrefix why)
  FaultedWith why -> "faulted" ++ after ++ because why
  StoppedBy cause -> "stopped" ++ after ++ ": " ++ causeText cause
 where
  because why = if null why then "" else ": " ++ inert why
  -- The texts of the library's own failures begin with it.
  withoutPrefix why = case stripPrefix "the behaviour failed" why of
    Just "" -> ""
    Just (':' : ' ' : reason) -> reason
    _ -> why

-- | Why a span was stopped. A branch that has only a position is called by its position.
--
-- >>> map (causeText . SiblingFinished) ["left", "2", "1, 3", "lidar"]
-- ["the left branch finished","branch 2 finished","branches 1, 3 finished","\"lidar\" finished"]
causeText :: Cause -> String
causeText cause = case cause of
  SignalChanged _ changes -> changesText changes
  SiblingFinished name -> siblingText name ++ " finished"
  SiblingFailed "sensor" -> "a sensor failed"
  SiblingFailed name -> siblingText name ++ " failed"
  TimeLimit limit -> "time limit of " ++ secondsText limit
  FromOutside why -> "cancelled from outside" ++ (if null why then "" else ": " ++ inert why)
  WasAbandoned -> "abandoned, it may still run"

siblingText :: String -> String
siblingText name
  | name `elem` ["left", "right"] = "the " ++ name ++ " branch"
  | name == "all" = "all branches"
  | [(_, "")] <- numbers = "branch " ++ name
  | all (`elem` "0123456789, ") name, not (null name) = "branches " ++ name
  | otherwise = quotedText name
 where
  numbers = reads name :: [(Int, String)]

-- | A duration, with three digits that count.
--
-- >>> map secondsText [0, 0.3, 3.14159, 0.000012345, 12345.6, 99.96]
-- ["0 s","0.3 s","3.14 s","0.0000123 s","12346 s","100 s"]
secondsText :: Seconds -> String
secondsText (Seconds s)
  | isNaN s || isInfinite s = show s ++ " s"
  | abs s >= 1e9 = showEFloat (Just 2) s " s"
  | s == 0 || abs s < 1e-9 = "0 s"
  | otherwise = withoutZeros (showFFloat (Just (max 0 (2 - magnitude))) s "") ++ " s"
 where
  magnitude = floor (logBase 10 (abs s)) :: Int
  withoutZeros digits
    | '.' `elem` digits = dropWhileEnd (== '.') (dropWhileEnd (== '0') digits)
    | otherwise = digits

-- | A number of seconds with three decimal places.
--
-- >>> map millisecondsText [3.1, -0.0001, 1e12]
-- ["3.100","0.000","1.000e12"]
millisecondsText :: Seconds -> String
millisecondsText (Seconds t)
  | isNaN t || isInfinite t = show t
  | abs t >= 1e9 = showEFloat (Just 3) t ""
  | abs t < 0.0005 = "0.000"
  | otherwise = showFFloat (Just 3) t ""

-- | How many events were lost.
--
-- >>> map lostText [1, 2]
-- ["1 event was lost","2 events were lost"]
lostText :: Int -> String
lostText 1 = "1 event was lost"
lostText n = show n ++ " events were lost"

-- | A name between quotation marks.
quotedText :: String -> String
quotedText name = "\"" ++ nameText name ++ "\""

-- | A name: 'inert', and of at most 200 characters.
--
-- >>> map nameText ["survey", ""]
-- ["survey","(no name)"]
nameText :: String -> String
nameText name = if null name then "(no name)" else inertUpTo 200 name

-- | The text on one line, without anything that a terminal or a page obeys: at most 1000
-- characters, line breaks and tabs as spaces, and U+FFFD for each control character, each
-- character that changes the direction of the text, and each that is not a character.
--
-- >>> inert "a\nb\ESC[2J\xD800"
-- "a b\65533[2J\65533"
inert :: String -> String
inert = inertUpTo 1000

-- | The same with at most that number of characters.
inertUpTo :: Int -> String -> String
inertUpTo limit text = case splitAt limit (map harmless (take (limit + 1) text)) of
  (known, []) -> known
  (known, _) -> take (limit - 1) known ++ "…"
 where
  harmless c
    | c >= ' ' && c < '\DEL' = c
    | c `elem` "\n\r\t" = ' '
    | otherwise = case generalCategory c of
        Control -> '\xFFFD'
        Format -> '\xFFFD'
        Surrogate -> '\xFFFD'
        NotAssigned | isNoncharacter c -> '\xFFFD'
        LineSeparator -> ' '
        ParagraphSeparator -> ' '
        _ -> c
  isNoncharacter c = (c >= '\xFDD0' && c <= '\xFDEF') || fromEnum c `mod` 0x10000 >= 0xFFFE
