-- |
-- Lists of events for the tests of what is made of them.
module Viewer.Examples
  ( -- * Missions
    header
  , mission
  , mended
  , detailed
  , ended

    -- * Odd texts
  , oddEvents
  , oddTexts
  , textInAllPlaces
  , isHarmless

    -- * Of any size
  , long
  , nested
  , sideBySide
  , failing
  , fleet
  , mixed
  , interrupted
  ) where

import Data.Char (GeneralCategory (..), generalCategory)
import Data.Time.Calendar (fromGregorian)
import Data.Time.Clock (UTCTime (..))

import Behavior.Time (Seconds)
import Behavior.Trace
import Behavior.Trace.File (Header (..))

header :: Header
header = Header (UTCTime (fromGregorian 2026 1 31) (12 * 3600))

-- | A span that began and ended.
ended :: Int -> Parent -> String -> Seconds -> Maybe Int -> Seconds -> End -> [Event]
ended n parent name begin reaction end how = [Began s, Ended s end how]
 where
  s = Span n parent Named name begin reaction

-- | A survey is stopped when the battery is low, and begins again when it is charged. Some
-- events are lost.
mission :: [Event]
mission =
  [ Began missionSpan
  , Began enter
  , Began front
  , Ended front 2.4 (FailedWith "locked")
  , Began back
  , Ended back 6 Succeeded
  , Ended enter 6 Succeeded
  , Began survey
  , Began photo
  , Ended photo 9.4 (StoppedBy low)
  , Ended survey 9.4 (StoppedBy low)
  , Reacted (Reaction 8 (Inside 1) "monitor" 9.1 changes (Just stopped) (Just "recovery"))
  , Began recharge
  , Ended recharge 28 Succeeded
  , Reacted (Reaction 11 (Inside 1) "monitor" 28 [Change "batteryLow" (Just "True") "False"] Nothing (Just "task"))
  , Began again
  , Began photo2
  , Began (Span 15 UnknownParent Named "radio" 30 Nothing)
  , Ended photo2 31 (FaultedWith "camera: no such device")
  , Ended again 36.5 Succeeded
  , Began home
  , Lost 2
  ]
 where
  missionSpan = Span 1 Top Named "mission" 0 Nothing
  enter = Span 2 (Inside 1) Named "enter room" 0.4 Nothing
  front = Span 3 (Inside 2) Named "front door" 0.5 Nothing
  back = Span 4 (Inside 2) Named "back door" 2.4 Nothing
  survey = Span 5 (Inside 1) Named "survey" 6 Nothing
  photo = Span 6 (Inside 5) Named "photograph the north wall" 7 Nothing
  low = SignalChanged 8 changes
  stopped = StoppedBranch "task" 3.1 0.3 (StoppedBy low)
  changes = [Change "battery" (Just "100") "9.4", Change "batteryLow" (Just "False") "True"]
  recharge = Span 9 (Inside 1) Named "recharge" 9.4 (Just 8)
  again = Span 12 (Inside 1) Named "survey" 28 (Just 11)
  photo2 = Span 13 (Inside 12) Named "photograph the north wall" 28.5 Nothing
  home = Span 14 (Inside 1) Named "return home" 40 Nothing

-- | The same mission with a full battery and an open door. Its clock has another zero.
mended :: [Event]
mended =
  ended 3 (Inside 2) "front door" 100.5 Nothing 103.3 Succeeded
    ++ ended 2 (Inside 1) "enter room" 100.4 Nothing 104 Succeeded
    ++ ended 4 (Inside 1) "survey" 104 Nothing 116 Succeeded
    ++ ended 5 (Inside 1) "return home" 116 Nothing 117.5 Succeeded
    ++ ended 1 Top "mission" 100 Nothing 117.5 Succeeded

-- | All kinds of spans, ends and causes; a branch that runs beside another; reactions that stop or
-- start nothing.
detailed :: [Event]
detailed =
  [ Began patrol
  , Reacted (Reaction 3 (Inside 2) "whenever" 0.25 [Change "door" Nothing "open"] Nothing (Just "greet"))
  , Ended (Span 4 (Inside 2) Branch "left" 0.25 (Just 3)) 5 Succeeded
  , Ended (Span 5 (Inside 2) Branch "right" 0.25 Nothing) 5.5 (StoppedBy (SiblingFinished "left"))
  , Ended (Span 6 (Inside 5) Named "grip" 1 Nothing) 5.25 (FaultedWith "motor 3 is gone")
  , Ended (Span 7 (Inside 5) Named "arm" 5.25 Nothing) 5.5 (StoppedBy (SiblingFailed "camera"))
  , Reacted (Reaction 8 (Inside 2) "stopWhen" 5.5 [] (Just (StoppedBranch "task" 5.25 0 Succeeded)) Nothing)
  , Ended (Span 2 (Inside 1) Operator "both" 0.25 Nothing) 5.5 (FailedWith "")
  , Ended (Span 9 (Inside 1) Named "dock" 6 Nothing) 6 (StoppedBy (FromOutside "ctrl-c"))
  , Ended (Span 10 (Inside 1) Named "upload" 6 Nothing) 9 (StoppedBy WasAbandoned)
  , Ended (Span 11 (Inside 1) Named "wait" 6 (Just 3)) (1 / 0) (StoppedBy (TimeLimit (1 / 0)))
  , Ended patrol 7 (StoppedBy (SignalChanged 12 [Change "stop" (Just "no") "yes"]))
  ]
 where
  patrol = Span 1 Top Named "patrol" 0 Nothing

-- | Texts that must do no harm.
oddTexts :: [String]
oddTexts =
  [ "</script><script>alert(1)</script>"
  , "<img src=x onerror=alert(1)>"
  , "\" onload=\"alert(1)"
  , "]]> &amp; &#0; <!-- "
  , ""
  , "two\nlines\r\nand a\ttab"
  , "\ESC[2J\ESC]0;title\BEL\x9B\&31mred"
  , "\NUL\SOH\DEL\x85"
  , "\xD800 \xDFFF \xFFFE \xFFFF \x1FFFF"
  , "\x202E\&right to left\x2066\x200B\x2028\xFEFF\xE0041"
  , "\x4E16\x754C \xD55C\xAD6D\xC5B4 \x1F916 e\x301\x301\x301 T\252re"
  , "\\'{}[]"
  ]

-- | A mission with these texts, and a long one, in all places.
oddEvents :: [Event]
oddEvents = textInAllPlaces (oddTexts ++ [replicate 1000000 'x'])

-- | Each text in each place where a user's text can be.
textInAllPlaces :: [String] -> [Event]
textInAllPlaces = concat . zipWith one [0 ..]
 where
  one :: Int -> String -> [Event]
  one k text =
    within 1 Top Named 0 Nothing 1 (FailedWith text)
      ++ within 2 (Inside (7 * k + 1)) Branch 0.5 Nothing 0.75 (StoppedBy (SiblingFinished text))
      ++ within 3 Top Named 1 Nothing 2 (StoppedBy (SignalChanged (7 * k + 4) changes))
      ++ [Reacted (Reaction (7 * k + 4) Top text (start + 1.9) changes (Just stopped) (Just text))]
      ++ within 5 Top Named 2 (Just (7 * k + 4)) 2.5 (FaultedWith text)
      ++ within 6 Top Named 2.5 Nothing 3 (StoppedBy (SiblingFailed text))
      ++ within 7 Top Named 3 Nothing 3.5 (StoppedBy (FromOutside text))
   where
    within n parent kind begin reaction end how = [Began s, Ended s (start + end) how]
     where
      s = Span (7 * k + n) parent kind text (start + begin) reaction
    changes = [Change text (Just (text ++ "0")) text]
    stopped = StoppedBranch text 0.9 0.1 (FaultedWith text)
    start = 4 * fromIntegral k :: Seconds

-- | No terminal acts on the character.
isHarmless :: Char -> Bool
isHarmless c = generalCategory c `notElem` [Control, Format, Surrogate, LineSeparator, ParagraphSeparator]

-- | A mission of about that number of spans: rounds of a few steps, some of which fail, some of
-- which are stopped.
long :: Int -> [Event]
long n = Began root : concatMap roundOf [1 .. rounds] ++ [Ended root (at (rounds + 1)) Succeeded]
 where
  rounds = max 1 ((n + 6) `div` 7)
  root = Span 1 Top Named "patrol" 0 Nothing
  at k = 7 * fromIntegral k :: Seconds
  roundOf k = Began r : concatMap step [1 .. 6] ++ reaction ++ [Ended r (at k + 6.9) (how r)]
   where
    base = 10 * k
    r = Span base (Inside 1) Named ("round " ++ show k) (at k) Nothing
    isStopped = k `mod` 97 == 40
    how _ = Succeeded
    step j
      | j == 3 && k `mod` 211 == 100 = beginAndEnd j (FailedWith ("door " ++ show k ++ " locked"))
      | j == 4 && isStopped = beginAndEnd j (StoppedBy (SignalChanged (base + 9) changes))
      | j == 5 && k `mod` 1009 == 500 = beginAndEnd j (FaultedWith "no such device")
      | otherwise = beginAndEnd j Succeeded
    beginAndEnd j end = [Began (inner j), Ended (inner j) (at k + fromIntegral j + 0.8) end]
    inner j =
      Span (base + j) (Inside base) Named (names !! (j - 1)) (at k + fromIntegral j) (startedBy j)
    startedBy j = if j == 5 && isStopped then Just (base + 9) else Nothing
    names = ["drive", "look", "open door", "photograph", "store", "wait"]
    changes = [Change "battery" (Just "100") (show (k `mod` 10))]
    stopped = StoppedBranch "photograph" 0.8 0 (StoppedBy (SignalChanged (base + 9) changes))
    reaction =
      [ Reacted (Reaction (base + 9) (Inside base) "monitor" (at k + 4.8) changes (Just stopped) (Just "store"))
      | isStopped
      ]

-- | Spans that are each in the one before.
nested :: Int -> [Event]
nested n = map Began spans ++ [Ended s (fromIntegral (2 * n - spanNumber s)) Succeeded | s <- reverse spans]
 where
  spans = [Span k (if k == 1 then Top else Inside (k - 1)) Named "again" (fromIntegral k) Nothing | k <- [1 .. n]]

-- | Spans that run at the same time.
sideBySide :: Int -> [Event]
sideBySide n = map Began spans ++ [Ended s (10 + fromIntegral (spanNumber s)) Succeeded | s <- spans]
 where
  spans = [Span k Top Named ("robot " ++ show k) (0.001 * fromIntegral k) Nothing | k <- [1 .. n]]

-- | One after the other, all of which fail.
failing :: Int -> [Event]
failing n =
  [ Ended (Span k Top Named "try" (fromIntegral k) Nothing) (fromIntegral k + 0.9) (FailedWith "nothing there")
  | k <- [1 .. n]
  ]

-- | Fifty at the same time, with steps one after the other.
fleet :: Int -> [Event]
fleet n =
  [Began (robot k) | k <- [1 .. 50]]
    ++ [Ended (step k j) (fromIntegral j + 0.99) Succeeded | k <- [1 .. 50], j <- [1 .. n `div` 50]]
 where
  robot k = Span k Top Named ("robot " ++ show k) 0 Nothing
  step k j = Span (50 * j + k) (if k <= 30 then Inside k else UnknownParent) Named "step" (fromIntegral j) Nothing

-- | One after the other, with all outcomes in turn.
mixed :: Int -> [Event]
mixed n =
  [ Ended (Span k Top Named "try" (fromIntegral k) Nothing) (fromIntegral k + 1) end
  | (k, end) <- zip [1 .. n] (cycle outcomes)
  ]
 where
  outcomes = [Succeeded, FailedWith "no", FaultedWith "no", StoppedBy WasAbandoned, FailedWith "no", Succeeded]

-- | One after the other. The next is started by what stopped the one before.
interrupted :: Int -> [Event]
interrupted n = concatMap one [1 .. n]
 where
  one k =
    [ Began (s k)
    , Ended (s k) (fromIntegral k + 1) (StoppedBy (SignalChanged (2 * k + 1) [change]))
    , Reacted (Reaction (2 * k + 1) Top "select" (fromIntegral k + 0.9) [change] (Just stopped) (Just "a"))
    ]
   where
    change = Change "obstacle" (Just (show k)) (show (k + 1))
    stopped = StoppedBranch "a" 0.9 0.1 (StoppedBy (SignalChanged (2 * k + 1) [change]))
  s k = Span (2 * k) Top Named ("a" ++ show k) (fromIntegral k) (if k == 1 then Nothing else Just (2 * k - 1))
