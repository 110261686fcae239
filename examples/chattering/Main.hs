-- |
-- Section 3.4 of the paper: a battery near its threshold, under the paper's 'rSelect',
-- which interrupts the charging as well as the task, and under 'monitor', which interrupts
-- only the task.
module Main (main) where

import System.IO (BufferMode (..), hSetBuffering, stdout)

import Behavior
import Behavior.Parallel (firstOf)
import qualified Paper.Chattering as Chattering
import Robot
import World
import WorldChange

main :: IO ()
main = runBehavior $ do
  hSetBuffering stdout LineBuffering
  putStrLn "A minute of the robot's life, a character a second: - its task, # recharging"
  observe "rSelect (battery > 10) task recharge" Chattering.bt
  observe "monitor batteryLow recharge task" (monitor batteryLow recharge task)

-- | Runs the behaviour for a minute in its own world, and shows what it did.
observe :: String -> Behavior () -> Behavior ()
observe title behavior = do
  world <- newWorld nearThreshold
  inWorld world (firstOf [behavior, wait world 60])
  begun <- filter ((== Begins) . changeKind) <$> happened world
  let doing second = last (' ' : [mark (action e) | e <- begun, time e <= second])
      timeline = map (doing . (+ 0.5) . fromInteger) [0 .. 59]
      switches = length begun - 1
  putStrLn ("\n" ++ title ++ "\n  " ++ timeline ++ "\n  " ++ show switches ++ " switches")
 where
  mark name = if name == "recharge" then '#' else '-'

-- | In this world the task never ends by itself.
nearThreshold :: Setting
nearThreshold =
  still
    { chargedTo = 14
    , drain = 2
    , gain = 8
    , speed = 40
    , lasting = taking (pure (1 / 0))
    }
