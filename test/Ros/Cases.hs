{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Small missions, whose outcome is the same with a fake robot, with a bridge in another process, and with a real one.
-- (@test/robots/actions.py@ has the same servers.)
module Ros.Cases
  ( Host (..)
  , Case (..)
  , cases
  , impatient
  , servers
  ) where

import Control.Exception (SomeException, throwIO)
import Control.Monad (void)
import Data.Aeson (Value (..), object, (.=))
import Data.Maybe (fromMaybe)

import Behavior
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Action
import Behavior.Ros.Fake
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time (now)
import Ros.Stage (failureOrFault, fibonacci, patient)

-- | A link to the robot, and what cuts it and mends it.
data Host = Host
  { to :: Ros
  , cut :: Behavior ()
  , mend :: Behavior ()
  }

data Case = Case
  { title :: String
  , mission :: Host -> Behavior [String]
  , outcome :: [String]
  }

cases :: [Case]
cases =
  [ Case "a goal gives its result" (\host -> sequence [send host "/brief" good]) ["[1000003]"]
  , Case "a goal shows its feedback" (\host -> sequence [interruptedAtWork host "/fast" good]) ["done"]
  , Case "a goal that its server rejects" (\host -> sequence [send host "/picky" bad, mayRun host]) ["Rejected", "0"]
  , Case "a goal that its server aborts" (\host -> sequence [send host "/picky" hard, mayRun host]) ["Aborted", "0"]
  , Case "a goal after one that was stopped"
      (\host -> sequence [interruptedAtWork host "/fast" good, mayRun host, interruptedAtWork host "/fast" good])
      ["done", "0", "done"]
  , Case "a goal that is stopped as soon as it was sent"
      (\host -> sequence [interruptedAtOnce host "/fast" good, mayRun host, interruptedAtWork host "/fast" good])
      ["done", "0", "done"]
  , Case "a goal that does not stop, and others after it"
      ( \host ->
          sequence
            [ interruptedAtWork host "/stubborn" good
            , mayRun host
            , send host "/stubborn" good
            , send host "/brief" good
            , untilNoneRuns host
            , interruptedAtWork host "/stubborn" good
            , untilNoneRuns host
            ]
      )
      ["NotConfirmed", "1", "StillMoving", "[1000003]", "0", "NotConfirmed", "0"]
  , Case "a recovery, before which the task's goal has ended"
      ( \host -> do
          said <- newTVarIO []
          low <- newTVarIO False
          let say it = atomically (modifyTVar' said (it :))
              atWork = atomically . writeTVar low . null =<< readTVarIO said
              recovery = do
                mayRun host >>= say
                send host "/brief" good >>= say
                atomically (writeTVar low False)
              task = readTVarIO said >>= \before -> if null before then working host "/fast" good atWork else pure Null
          Signal.monitor (Signal.watching (readTVar low)) recovery (void task)
          reverse <$> readTVarIO said
      )
      ["0", "[1000003]"]
  , Case "two goals at once on two servers"
      ( \host -> do
          said <- newTVarIO []
          let say it = atomically (modifyTVar' said (++ [it]))
          both (send host "/picky" good >>= say) (send host "/brief" hard >>= say)
          (\texts -> [text | text <- ["[1000003]", "[1000015]"], text `elem` texts]) <$> readTVarIO said
      )
      ["[1000003]", "[1000015]"]
  , Case "all goals of a server are stopped"
      ( \host -> do
          end <- ended (working host "/fast" good (stopAll (to host) (fibonacci "/fast") >> Signal.waitUntil never))
          sequence [pure end, mayRun host]
      )
      ["CancelledByOther", "0"]
  , Case "all goals of a server are stopped, and one of them does not stop"
      ( \host -> do
          begun <- now
          end <- interruptedAtWork host "/stubborn" good
          stopAllAtLast host "/stubborn"
          -- (The goal takes at least three seconds.)
          hasEnded <- (>= begun + 3) <$> now
          ([end, show hasEnded] ++) <$> sequence [mayRun host]
      )
      ["NotConfirmed", "True", "0"]
  , Case "a link that is lost, and is there again"
      ( \host -> do
          end <- ended (working host "/steady" good (cut host))
          before <- mayRun host
          mend host
          Signal.waitUntil (linkUp (to host))
          ([end, before] ++) <$> sequence [send host "/steady" good, untilNoneRuns host, send host "/brief" good]
      )
      ["LinkLost", "1", "StillMoving", "0", "[1000003]"]
  ]
 where
  never = pure False
  -- (Orders that no other goal of the real servers has. Of these /picky rejects the second, and aborts the third.)
  (good, bad, hard) = (1000003, 1000002, 1000015)

-- | A goal with that order, and what comes of it.
send :: Host -> String -> Int -> Behavior String
send host name order = ended (goal (to host) (fibonacci name) (wanted order))

-- | The behaviour runs when the goal's server works on it.
working :: Host -> String -> Int -> Behavior () -> Behavior Value
working host name order act =
  goalWith (to host) (fibonacci name) (wanted order) $ \feedback ->
    Signal.waitUntil ((== object ["sequence" .= [order]]) <$> feedback) >> act

-- | It is stopped when its server works on it.
interruptedAtWork :: Host -> String -> Int -> Behavior String
interruptedAtWork host name order = do
  started <- newTVarIO False
  done . firstOf $
    [ void (working host name order (atomically (writeTVar started True)))
    , atomically (readTVar started >>= check)
    ]

interruptedAtOnce :: Host -> String -> Int -> Behavior String
interruptedAtOnce host name order =
  done . firstOf $
    [ void (goal (to host) (fibonacci name) (wanted order))
    , Signal.waitUntil ((> 0) <$> movingGoals (to host))
    ]

-- | Again and again, until its server says that none runs.
stopAllAtLast :: Host -> String -> Behavior ()
stopAllAtLast host name =
  tryAny (stopAll (to host) (fibonacci name)) >>= \case
    Left e | how e == "NotConfirmed" -> stopAllAtLast host name
    end -> either throwIO pure end

done :: Behavior () -> Behavior String
done act = either how (const "done") <$> tryAny act

ended :: Behavior Value -> Behavior String
ended act = either how sequenceIn <$> tryAny act
 where
  sequenceIn value = head ([show [n] | n <- orders, value == object ["sequence" .= [n]]] ++ [show value])

how :: SomeException -> String
how e = fromMaybe (show e) (failureOrFault e)

orders :: [Int]
orders = [1000002 .. 1000015]

-- | How many goals may still run.
mayRun :: Host -> Behavior String
mayRun host = show <$> Signal.read (movingGoals (to host))

untilNoneRuns :: Host -> Behavior String
untilNoneRuns host = Signal.waitUntil ((== 0) <$> movingGoals (to host)) >> mayRun host

wanted :: Int -> Value
wanted order = object ["order" .= order]

-- | What never comes is not waited for longer than this.
impatient :: RosOptions
impatient = patient {patience = 0.5}

-- | The servers of the fake robot. (Of "/stubborn" and "/steady" goals must still run when the mission looks: on a
-- busy machine that is late.)
servers :: [(String, Value -> GoalScript)]
servers =
  [ ("/fast", lasting 3600)
  , ("/stubborn", \v -> (lasting 3 v) {confirmsAfter = 1 / 0})
  , ("/steady", lasting 3)
  , ("/brief", lasting 0.01)
  , ("/picky", picky)
  ]
 where
  lasting seconds value =
    succeeding
      { acceptedAfter = 0.001
      , endsAfter = seconds
      , endsWith = Succeeds (answer value)
      , confirmsAfter = 0.01
      , feedbacks = [(0, answer value)]
      }
  picky value
    | value == wanted 1000002 = succeeding {endsWith = Refuses}
    | value == wanted 1000015 = (lasting 0.01 value) {endsWith = Aborts (answer value)}
    | otherwise = lasting 0.01 value
  answer value = object ["sequence" .= [n | n <- orders, value == wanted n]]
