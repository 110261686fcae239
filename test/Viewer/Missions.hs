-- |
-- What happens in the pictures of "Viewer.PictureSpec".
module Viewer.Missions
  ( -- * Missions
    leg
  , legs
  , watering
  , doors
  , locked
  , buttoned
  , emergency
  , surveyed
  , ruled
  , crowded
  , crowdedBy
  , robots
  , waited
  , beside
  , untilButton
  , wateredAgain

    -- * Other events
  , withoutReason
  , isInterruption
  , withChange
  , isReaction
  , byOperator
  , succeeding
  , notBed
  , isLater
  , renamedTo
  , renamed
  ) where

import Behavior.Time (Seconds)
import Behavior.Trace
import Viewer.Examples

-- | One after the other, a second each.
legs :: Int -> [Event]
legs n = concat [leg k ("leg " ++ [toEnum (96 + k)]) | k <- [1 .. n]]

-- | One of them, with that name.
leg :: Int -> String -> [Event]
leg k name = ended k Top name (fromIntegral k) Nothing (fromIntegral k + 1) Succeeded

-- | Beds are watered; the robot recharges, and goes on.
watering :: [Event]
watering =
  ended 1 Top "mission" 0 Nothing 37.5 Succeeded
    ++ ended 2 (Inside 1) "water" 0 Nothing 16 (StoppedBy low)
    ++ concat [bed (2 + k) 2 k (4.5 * fromIntegral (k - 1)) | k <- [1 .. 3]]
    ++ ended 6 (Inside 2) "water bed 4" 13.5 Nothing 16 (StoppedBy low)
    ++ [Reacted (Reaction 7 (Inside 1) "monitor" 16 changes (Just stopped) (Just "recovery"))]
    ++ ended 8 (Inside 1) "recharge" 16 (Just 7) 24 Succeeded
    ++ [Reacted (Reaction 9 (Inside 1) "monitor" 24 charged Nothing (Just "task"))]
    ++ ended 10 (Inside 1) "water" 24 (Just 9) 37.5 Succeeded
    ++ concat [bed (7 + k) 10 k (24 + 4.5 * fromIntegral (k - 4)) | k <- [4 .. 6]]
 where
  low = SignalChanged 7 changes
  stopped = StoppedBranch "task" 16 0 (StoppedBy low)
  charged = [Change "battery" (Just "18") "100", Change "batteryLow" (Just "True") "False"]
  changes = [Change "battery" (Just "50") "18", Change "batteryLow" (Just "False") "True"]
  bed :: Int -> Int -> Int -> Seconds -> [Event]
  bed n parent k begin = ended n (Inside parent) ("water bed " ++ show k) begin Nothing (begin + 4.5) Succeeded

-- | Doors are locked; the robot is interrupted when it smashes one.
doors :: [Event]
doors =
  locked
    ++ ended 4 (Inside 1) "smash back door" 2 Nothing 2.55 (StoppedBy low)
    ++ [Reacted (Reaction 5 (Inside 1) "monitor" 2.55 changes (Just stopped) (Just "recovery"))]
    ++ ended 6 (Inside 1) "recharge" 2.55 (Just 5) 4.5 Succeeded
 where
  low = SignalChanged 5 changes
  stopped = StoppedBranch "task" 2.55 0 (StoppedBy low)
  changes = [Change "battery" (Just "10") "9"]

-- | The doors are locked.
locked :: [Event]
locked =
  ended 1 Top "mission" 0 Nothing 10 Succeeded
    ++ ended 2 (Inside 1) "open front door" 0 Nothing 1 (FailedWith "the front door is locked")
    ++ ended 3 (Inside 1) "open back door" 1 Nothing 2 (FailedWith "the back door is locked")

-- | The red button ends a mission.
buttoned :: [Event]
buttoned =
  ended 1 Top "mission" 0 Nothing 7 Succeeded
    ++ ended 2 (Inside 1) "load" 0 Nothing 2 Succeeded
    ++ ended 3 (Inside 1) "drive" 2 Nothing 6 cause
    ++ [Reacted (Reaction 4 (Inside 1) "insteadWhen" 6 changes (Just stopped) (Just "emergency"))]
 where
  cause = StoppedBy (SignalChanged 4 changes)
  stopped = StoppedBranch "branch" 4 0 cause
  changes = [Change "red button" (Just "False") "True"]

-- | The red button ends a mission; then the motors are switched off.
emergency :: [Event]
emergency = map startingEmergency buttoned ++ ended 5 (Inside 1) "motors off" 6 (Just 4) 7 Succeeded
 where
  startingEmergency event = case event of
    Reacted r -> Reacted r {reactionStarts = Just "emergency"}
    _ -> event

-- | The wind ends a survey: the drone goes down, and then flies home.
surveyed :: [Event]
surveyed =
  ended 1 Top "mission" 0 Nothing 9 Succeeded
    ++ ended 2 (Inside 1) "survey" 0 Nothing 7 Succeeded
    ++ ended 3 (Inside 2) "film" 0 Nothing 6 (StoppedBy (SignalChanged 4 wind))
    ++ [Reacted (Reaction 4 (Inside 2) "insteadWhen" 6 wind (Just stopped) (Just "emergency"))]
    ++ ended 5 (Inside 2) "go down" 6 (Just 4) 7 Succeeded
    ++ ended 6 (Inside 1) "fly home" 7 Nothing 9 Succeeded
 where
  wind = [Change "strong wind" (Just "False") "True"]
  stopped = StoppedBranch "branch" 6 0 (StoppedBy (SignalChanged 4 wind))

-- | Ordered rules: a patrol is interrupted by a detection, of which a photograph is made. The rule takes that many
-- seconds to stop, after it has waited.
ruled :: Seconds -> [Event]
ruled took =
  ended 1 Top "mission" 0 Nothing 20 Succeeded
    ++ ended 2 (Inside 1) "patrol" 0 Nothing 6 (StoppedBy (SignalChanged 3 seen))
    ++ [Reacted (Reaction 3 (Inside 1) "teleoReactive" 6 seen (Just patrol) (Just "rule 1"))]
    ++ ended 4 (Inside 1) "photograph" 6 (Just 3) 9 Succeeded
    ++ [Reacted (Reaction 5 (Inside 1) "teleoReactive" 12 gone (Just photograph) (Just "rule 2"))]
    ++ ended 6 (Inside 1) "patrol" (12 + took) (Just 5) 20 Succeeded
 where
  patrol = StoppedBranch "rule 2" 6 0 (StoppedBy (SignalChanged 3 seen))
  photograph = StoppedBranch "rule 1" 6 took (StoppedBy (SignalChanged 5 gone))
  seen = [Change "detections" (Just "0") "1"]
  gone = [Change "detections" (Just "1") "0"]

-- | Five interruptions within two seconds, in a minute.
crowded :: [Event]
crowded = crowdedBy 5 0.4

-- | That many interruptions in a minute, with so much time from one to the next.
crowdedBy :: Int -> Seconds -> [Event]
crowdedBy n apart = ended 1 Top "mission" 0 Nothing 60 Succeeded ++ concatMap one [1 .. n]
 where
  one k =
    ended (3 * k) (Inside 1) ("go " ++ show k) (at (k - 1)) (startedBy k) (at k) (cause k)
      ++ [Reacted (Reaction (3 * k + 1) (Inside 1) "switch" (at k) (changes k) (Just (stopped k)) (Just "branch"))]
  startedBy k = if k > 1 then Just (3 * k - 2) else Nothing
  stopped k = StoppedBranch "branch" 0.4 0 (cause k)
  cause k = StoppedBy (SignalChanged (3 * k + 1) (changes k))
  at k = if k == 0 then 0 else 30 + apart * fromIntegral k
  changes k = [Change "obstacle" (Just (show k)) (show (k + 1))]

-- | Several robots side by side, each of which is interrupted.
robots :: Int -> [Event]
robots n = ended 1 Top "mission" 0 Nothing 6 Succeeded ++ concatMap robot [1 .. n]
 where
  robot k =
    ended (10 * k) (Inside 1) ("robot " ++ show k) 0 Nothing 6 Succeeded
      ++ ended (10 * k + 1) (Inside (10 * k)) "drive" 0 Nothing (2 + at k) (cause k)
      ++ [Reacted (reaction k)]
      ++ ended (10 * k + 3) (Inside (10 * k)) "charge" (2 + at k) (Just (10 * k + 2)) (4 + at k) Succeeded
      ++ ended (10 * k + 4) (Inside (10 * k)) "drive" (4 + 2 * at k) Nothing 6 Succeeded
  reaction k = Reaction (10 * k + 2) (Inside (10 * k)) "monitor" (2 + at k) low (Just (stopped k)) (Just "recovery")
  stopped k = StoppedBranch "task" (2 + at k) 0 (cause k)
  cause k = StoppedBy (SignalChanged (10 * k + 2) low)
  at k = 0.3 * fromIntegral (k `mod` 4) :: Seconds
  low = [Change "battery low" (Just "False") "True"]

-- | An order comes after a while.
waited :: [Event]
waited =
  ended 1 Top "mission" 0 Nothing 10 Succeeded
    ++ ended 2 (Inside 1) "drive" 0 Nothing 2 Succeeded
    ++ [Reacted (Reaction 3 (Inside 1) "waitUntil" 7 [Change "order" (Just "False") "True"] Nothing Nothing)]
    ++ ended 4 (Inside 1) "carry" 7 Nothing 10 Succeeded

-- | Two parts side by side; one of them ends at that time.
beside :: Seconds -> [Event]
beside t =
  ended 1 Top "mission" 0 Nothing 10 Succeeded
    ++ ended 2 (Inside 1) "look" 0 Nothing t Succeeded
    ++ ended 3 (Inside 1) "listen" 0 Nothing 5 (StoppedBy (SiblingFinished "left"))

-- | A patrol beside a wait for the red button, for which the trace has these reactions; the patrol takes that many
-- seconds to stop.
untilButton :: Seconds -> [Reaction] -> [Event]
untilButton took waits =
  ended 1 Top "mission" 0 Nothing (20 + took) Succeeded
    ++ ended 2 (Inside 1) "patrol" 0 Nothing (20 + took) (StoppedBy (SiblingFinished "left"))
    ++ ended 8 (Inside 2) "whistle" 1 Nothing 2 (StoppedBy (SiblingFinished "left"))
    ++ ended 9 (Inside 2) "gate" 18 Nothing (20 + took) (StoppedBy (SiblingFinished "left"))
    ++ map Reacted waits

-- | Beds are watered; after an interruption, from the first one on.
wateredAgain :: [Event]
wateredAgain =
  ended 1 Top "mission" 0 Nothing 30 Succeeded
    ++ ended 2 (Inside 1) "water" 0 Nothing 12 (StoppedBy (SignalChanged 9 [Change "low" Nothing "True"]))
    ++ ended 3 (Inside 2) "bed 1" 0 Nothing 5 Succeeded
    ++ ended 4 (Inside 2) "bed 2" 5 Nothing 10 Succeeded
    ++ ended 5 (Inside 1) "water" 15 Nothing 30 Succeeded
    ++ ended 6 (Inside 5) "bed 1" 15 Nothing 20 Succeeded
    ++ ended 7 (Inside 5) "bed 2" 20 Nothing 25 Succeeded

-- | Without the text of its failure.
withoutReason :: Event -> Event
withoutReason event = case event of
  Ended s t (FailedWith _) -> Ended s t (FailedWith "")
  _ -> event

-- | A reaction that stopped something.
isInterruption :: Event -> Bool
isInterruption event = case event of
  Reacted Reaction {reactionStopped = Just _} -> True
  _ -> False

-- | A reaction with this value too.
withChange :: Change -> Event -> Event
withChange change event = case event of
  Reacted r -> Reacted r {reactionChanges = reactionChanges r ++ [change]}
  _ -> event

-- | Any reaction.
isReaction :: Event -> Bool
isReaction event = case event of
  Reacted _ -> True
  _ -> False

-- | A reaction of the operator with this name.
byOperator :: String -> Event -> Event
byOperator operator event = case event of
  Reacted r -> Reacted r {reactionOperator = operator}
  _ -> event

-- | The end of a span is that it succeeded.
succeeding :: Event -> Event
succeeding event = case event of
  Ended s t _ -> Ended s t Succeeded
  _ -> event

-- | An event of any other span.
notBed :: String -> Event -> Bool
notBed bed event = case event of
  Began s -> spanName s /= bed
  Ended s _ _ -> spanName s /= bed
  _ -> True

-- | An event of a span that began after the interruption of 'wateredAgain'.
isLater :: Event -> Bool
isLater event = case event of
  Began s -> spanBegan s > 12
  Ended s _ _ -> spanBegan s > 12
  _ -> False

-- | A span has this name.
renamedTo :: String -> Event -> Event
renamedTo name event = case event of
  Began s -> Began s {spanName = name}
  Ended s t end -> Ended s {spanName = name} t end
  _ -> event

-- | So that many spans have the same name.
renamed :: Event -> Event
renamed event = case event of
  Began s -> Began (short s)
  Ended s t end -> Ended (short s) t end
  _ -> event
 where
  short s = s {spanName = ["ab" !! (spanNumber s `mod` 2)]}
