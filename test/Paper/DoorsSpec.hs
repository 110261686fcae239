-- |
-- The versions of the paper's long example, a robot that must enter a room by one of two doors
-- and never run out of battery: its actions, step by step.
module Paper.DoorsSpec (spec) where

import Control.Exception (throwIO)
import Data.Foldable (for_)
import Test.Hspec

import Behavior
import qualified Paper.Attempt as Attempt
import qualified Paper.BatteryLow as BatteryLow
import qualified Paper.EachDoor as EachDoor
import qualified Paper.EachDoorThreeTimes as EachDoorThreeTimes
import qualified Paper.FallbackOverList as FallbackOverList
import qualified Paper.FrontDoorFirst as FrontDoorFirst
import qualified Paper.FrontDoorUnless as FrontDoorUnless
import qualified Paper.Introduction as Introduction
import Paper.Stage
import Robot (backDoor, doTask, frontDoor, open, recharge)
import Support (Ending (..), Fault (..), guarded)
import World

spec :: Spec
spec = guarded $ do
  describe "Paper.FrontDoorFirst" frontDoorFirst
  describe "Paper.FrontDoorUnless" frontDoorUnless
  describe "Paper.BatteryLow" batteryLow
  describe "Paper.FallbackOverList" fallbackOverList
  describe "Paper.EachDoor" $ do
    inEveryVersion EachDoor.bt "do task"
    eachDoorOnce
  describe "Paper.EachDoorThreeTimes" $ do
    inEveryVersion EachDoorThreeTimes.bt "do task"
    eachDoorThreeTimes EachDoorThreeTimes.bt "do task"
  describe "Paper.Attempt" attempts
  describe "Paper.Introduction" $ do
    inEveryVersion Introduction.bt "perform task"
    eachDoorThreeTimes Introduction.bt "perform task"

-- As printed; its errors are in "Paper.ErrataSpec".
frontDoorFirst :: Spec
frontDoorFirst = do
  it "takes the back door when the front door is closed" $
    playing still [] FrontDoorFirst.bt
      `shouldReturn` (Gave (), [frontNotOpen, Did "open back door", passedBack, Did "do task"])
  it "passes through the front door, and closes it, if that opens at that moment" $
    playing still [During "pass through front door" (FrontDoor `doorBecomes` Open)] FrontDoorFirst.bt
      `shouldReturn` (Gave (), [passed, closed, Did "do task"])
  it "smashes the back door when that is locked" $
    playing still {backIs = Locked} [] FrontDoorFirst.bt
      `shouldReturn` ( Gave ()
                     , [ frontNotOpen
                       , FailedTo "open back door" "the back door is locked"
                       , Did "smash back door"
                       , passedBack
                       , Did "do task"
                       ]
                     )
  it "recharges first when the battery is low at the start" $
    playing still {chargedTo = 9} [] FrontDoorFirst.bt
      `shouldReturn` ( Gave ()
                     , [Did "recharge", frontNotOpen, Did "open back door", passedBack, Did "do task"]
                     )
  it "recharges when the battery drops in the back door, and begins again" $
    playing
      still
      [During "pass through back door" (untilInterrupted (batteryDropsTo 9))]
      FrontDoorFirst.bt
      `shouldReturn` ( Gave ()
                     , [ frontNotOpen
                       , Did "open back door"
                       , InterruptedIn "pass through back door"
                       , Did "recharge"
                       , frontNotOpen
                       , Did "open back door"
                       , passedBack
                       , Did "do task"
                       ]
                     )

frontDoorUnless :: Spec
frontDoorUnless = do
  it "enters by the front door, closes it and does the task" $
    playing still [] FrontDoorUnless.bt
      `shouldReturn` (Gave (), [Did "open front door", passed, closed, Did "do task"])
  it "does not open the front door when it is open" $
    playing still {frontIs = Open} [] FrontDoorUnless.bt
      `shouldReturn` (Gave (), [passed, closed, Did "do task"])
  it "takes the back door when the front door is locked, and leaves it open" $
    playing still {frontIs = Locked} [] FrontDoorUnless.bt
      `shouldReturn` (Gave (), [frontLocked, Did "open back door", passedBack, Did "do task"])
  it "takes the back door when it cannot pass through the front door" $
    playing still [During "pass through front door" (failing "somebody stands there")] FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [ Did "open front door"
                       , FailedTo "pass through front door" "somebody stands there"
                       , Did "open back door"
                       , passedBack
                       , Did "do task"
                       ]
                     )
  it "takes the back door when it cannot close the front door" $
    playing still [During "close front door" (failing "it is stuck")] FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [ Did "open front door"
                       , passed
                       , FailedTo "close front door" "it is stuck"
                       , Did "open back door"
                       , passedBack
                       , Did "do task"
                       ]
                     )
  it "smashes the back door when that is locked too" $
    playing still {frontIs = Locked, backIs = Locked} [] FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [ frontLocked
                       , FailedTo "open back door" "the back door is locked"
                       , Did "smash back door"
                       , passedBack
                       , Did "do task"
                       ]
                     )
  it "fails when everything fails" $
    playing still {frontIs = Locked, backIs = Sealed} [] FrontDoorUnless.bt
      `shouldReturn` ( failedBecause "the back door is sealed"
                     , [ frontLocked
                       , FailedTo "open back door" "the back door is sealed"
                       , FailedTo "smash back door" "the back door is sealed"
                       ]
                     )
  it "fails when it cannot pass through the back door either" $
    playing
      still {frontIs = Locked}
      [During "pass through back door" (failing "somebody stands there")]
      FrontDoorUnless.bt
      `shouldReturn` ( failedBecause "somebody stands there"
                     , [ frontLocked
                       , Did "open back door"
                       , FailedTo "pass through back door" "somebody stands there"
                       ]
                     )
  it "tries nothing else when the task fails" $
    playing still [During "do task" (failing "too heavy")] FrontDoorUnless.bt
      `shouldReturn` ( failedBecause "too heavy"
                     , [Did "open front door", passed, closed, FailedTo "do task" "too heavy"]
                     )
  it "does not take a fault for a failure" $
    playing still [During "open front door" (\_ -> throwIO (Fault "short circuit"))] FrontDoorUnless.bt
      `shouldReturn` ( FaultedWith "Fault \"short circuit\""
                     , [FaultedIn "open front door" "Fault \"short circuit\""]
                     )
  it "recharges first when the battery is low at the start" $
    playing still {chargedTo = 9} [] FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [Did "recharge", Did "open front door", passed, closed, Did "do task"]
                     )
  it "recharges when the battery drops in the front door, and begins again" $
    playing
      still
      [During "pass through front door" (untilInterrupted (batteryDropsTo 9))]
      FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [ Did "open front door"
                       , InterruptedIn "pass through front door"
                       , Did "recharge"
                       , passed -- it is open now
                       , closed
                       , Did "do task"
                       ]
                     )
  it "recharges repeatedly if necessary, also during the task" $
    playing
      still
      [ During "open front door" (untilInterrupted (batteryDropsTo 5))
      , During "do task" (untilInterrupted (batteryDropsTo 0))
      ]
      FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [ InterruptedIn "open front door"
                       , Did "recharge"
                       , Did "open front door"
                       , passed
                       , closed
                       , InterruptedIn "do task"
                       , Did "recharge"
                       , Did "open front door"
                       , passed
                       , closed
                       , Did "do task"
                       ]
                     )
  it "recharges to the end, even if the battery is no longer low" $
    playing still {chargedTo = 9} [During "recharge" (batteryDropsTo 50)] FrontDoorUnless.bt
      `shouldReturn` ( Gave ()
                     , [Did "recharge", Did "open front door", passed, closed, Did "do task"]
                     )
  it "fails when recharging fails, and tries nothing else" $
    playing still {chargedTo = 9} [During "recharge" (failing "no current")] FrontDoorUnless.bt
      `shouldReturn` (failedBecause "no current", [FailedTo "recharge" "no current"])

batteryLow :: Spec
batteryLow = do
  for_ [(9 :: Int, True), (10, False)] $ \(percent, low) ->
    it ("is " ++ show low ++ " at " ++ show percent ++ " percent") $
      playing still {chargedTo = fromIntegral percent} [] BatteryLow.batteryLow `shouldReturn` (Gave low, [])
  it "can be watched" $
    playing
      still
      [During "do task" (untilInterrupted (batteryDropsTo 9))]
      (monitor BatteryLow.batteryLow recharge doTask)
      `shouldReturn` (Gave (), [InterruptedIn "do task", Did "recharge", Did "do task"])

fallbackOverList :: Spec
fallbackOverList = do
  it "ends with the first door that opens" $
    playing still [] (FallbackOverList.fallback [frontDoor, backDoor] open)
      `shouldReturn` (Gave (), [Did "open front door"])
  it "tries the next door when one does not open" $
    playing still {frontIs = Locked} [] (FallbackOverList.fallback [frontDoor, backDoor] open)
      `shouldReturn` (Gave (), [frontLocked, Did "open back door"])

attempts :: Spec
attempts = do
  it "tries the given number of times" $
    playing still {frontIs = Locked} [] (Attempt.attempt (3 :: Int) (open frontDoor))
      `shouldReturn` (FailedWith (show Failed), [frontLocked, frontLocked, frontLocked])
  it "ends when a try succeeds" $
    playing still {frontIs = Jammed 1} [] (Attempt.attempt (3 :: Int) (open frontDoor))
      `shouldReturn` (Gave (), [FailedTo "open front door" "the front door is jammed", Did "open front door"])
  it "tries nothing when the number is zero" $
    playing still [] (Attempt.attempt (0 :: Int) (open frontDoor))
      `shouldReturn` (FailedWith (show Failed), [])

-- | The tests for all versions that find the doors and try each.
inEveryVersion :: Behavior () -> String -> Spec
inEveryVersion bt task = do
  it "enters by the front door, closes it and does the task" $
    playing still [] bt
      `shouldReturn` (Gave (), [found, Did "open front door", passed, closed, Did task])
  it "recharges first when the battery is low at the start" $
    playing still {chargedTo = 9} [] bt
      `shouldReturn` ( Gave ()
                     , [Did "recharge", found, Did "open front door", passed, closed, Did task]
                     )
  it "recharges when the battery drops in the front door, and begins again" $
    playing
      still
      [During "pass through front door" (untilInterrupted (batteryDropsTo 9))]
      bt
      `shouldReturn` ( Gave ()
                     , [ found
                       , Did "open front door"
                       , InterruptedIn "pass through front door"
                       , Did "recharge"
                       , found
                       , Did "open front door"
                       , passed
                       , closed
                       , Did task
                       ]
                     )
  it "recharges during the task, and then enters the room again" $
    playing still [During task (untilInterrupted (batteryDropsTo 9))] bt
      `shouldReturn` ( Gave ()
                     , [ found
                       , Did "open front door"
                       , passed
                       , closed
                       , InterruptedIn task
                       , Did "recharge"
                       , found
                       , Did "open front door"
                       , passed
                       , closed
                       , Did task
                       ]
                     )
  it "fails when it finds no doors" $
    playing still [During "find doors" (failing "too dark")] bt
      `shouldReturn` (failedBecause "too dark", [FailedTo "find doors" "too dark"])
  it "tries no other door when the task fails" $
    playing still [During task (failing "too heavy")] bt
      `shouldReturn` ( failedBecause "too heavy"
                     , [found, Did "open front door", passed, closed, FailedTo task "too heavy"]
                     )
  it "does not take a fault for a failure" $
    playing still [During "open front door" (\_ -> throwIO (Fault "short circuit"))] bt
      `shouldReturn` ( FaultedWith "Fault \"short circuit\""
                     , [found, FaultedIn "open front door" "Fault \"short circuit\""]
                     )

eachDoorOnce :: Spec
eachDoorOnce = do
  it "takes the back door when the front door is locked, and closes it" $
    playing still {frontIs = Locked} [] EachDoor.bt
      `shouldReturn` ( Gave ()
                     , [found, frontLocked, Did "open back door", passedBack, Did "close back door", Did "do task"]
                     )
  it "takes the back door when it cannot close the front door" $
    playing still [During "close front door" (failing "it is stuck")] EachDoor.bt
      `shouldReturn` ( Gave ()
                     , [ found
                       , Did "open front door"
                       , passed
                       , FailedTo "close front door" "it is stuck"
                       , Did "open back door"
                       , passedBack
                       , Did "close back door"
                       , Did "do task"
                       ]
                     )
  it "fails with the last door's failure when none opens" $
    playing still {frontIs = Locked, backIs = Sealed} [] EachDoor.bt
      `shouldReturn` ( failedBecause "the back door is sealed"
                     , [found, frontLocked, FailedTo "open back door" "the back door is sealed"]
                     )

eachDoorThreeTimes :: Behavior () -> String -> Spec
eachDoorThreeTimes bt task = do
  it "tries the front door three times before it takes the back door" $
    playing still {frontIs = Locked} [] bt
      `shouldReturn` ( Gave ()
                     , [ found
                       , frontLocked
                       , frontLocked
                       , frontLocked
                       , Did "open back door"
                       , passedBack
                       , Did "close back door"
                       , Did task
                       ]
                     )
  it "takes the front door when it opens at the third try" $
    playing still {frontIs = Jammed 2} [] bt
      `shouldReturn` ( Gave ()
                     , [ found
                       , FailedTo "open front door" "the front door is jammed"
                       , FailedTo "open front door" "the front door is jammed"
                       , Did "open front door"
                       , passed
                       , closed
                       , Did task
                       ]
                     )
  it "tries the whole entering three times, not only the opening" $
    playing
      still
      [ During "pass through front door" (failing "somebody stands there")
      , During "pass through front door" (failing "somebody stands there")
      ]
      bt
      `shouldReturn` ( Gave ()
                     , [ found
                       , Did "open front door"
                       , FailedTo "pass through front door" "somebody stands there"
                       , Did "open front door"
                       , FailedTo "pass through front door" "somebody stands there"
                       , Did "open front door"
                       , passed
                       , closed
                       , Did task
                       ]
                     )
  it "fails with the last door's failure when none opens" $
    playing still {frontIs = Locked, backIs = Sealed} [] bt
      `shouldReturn` ( failedBecause "the back door is sealed"
                     , [found, frontLocked, frontLocked, frontLocked]
                         ++ replicate 3 (FailedTo "open back door" "the back door is sealed")
                     )
  it "starts to count again after it has recharged" $
    playing
      still {frontIs = Locked}
      [ During "open front door" (\_ -> pure ())
      , During "open front door" (\_ -> pure ())
      , During "open front door" (untilInterrupted (batteryDropsTo 9))
      ]
      bt
      `shouldReturn` ( Gave ()
                     , [found, frontLocked, frontLocked, InterruptedIn "open front door", Did "recharge"]
                         ++ [found, frontLocked, frontLocked, frontLocked]
                         ++ [Did "open back door", passedBack, Did "close back door", Did task]
                     )

found, passed, passedBack, closed, frontLocked, frontNotOpen :: Step
found = Did "find doors"
passed = Did "pass through front door"
passedBack = Did "pass through back door"
closed = Did "close front door"
frontLocked = FailedTo "open front door" "the front door is locked"
frontNotOpen = FailedTo "pass through front door" "the front door is not open"
