{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- The fleet, on its worst day: a robot is withdrawn in the instant in which it takes an order,
-- another one as it hands over its order, and two have faults.
module Examples.FleetSpec (spec) where

import Control.Exception (mask)
import Control.Monad (forever, void)
import Test.Hspec

import Behavior
import Behavior.Message
import qualified Behavior.Parallel as Parallel
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim.Mock
import Behavior.Time (checkpoint)
import Examples.WorstDay
import Fleet
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "hands over each order once, and frees each charger, on its worst day" $
    survives 300 (day worst "returned" once fleet)
  it "fails when no robot is left, and keeps the orders" $
    let noneLeft = day [quiet "Bo" [5], quiet "Ed" [5]] "failure: FailedBecause \"no robot is left\""
     in survives 100 (noneLeft (never (successOf "hand over")) fleet)
  it "and robots that take an order and then protect it lose one" $
    failsWith "It was so 0 times" 200 (day worst "returned" once (each takeThenProtect))
  it "and robots that can be interrupted as they hand over an order do it twice" $
    failsWith "It was so 2 times" 300 (day worst "returned" once (each unprotected))
 where
  once = foldMap (\order -> exactly 1 (successOf ("hand over " ++ show order))) [1 .. 6 :: Order]
  each serve shared robots = void (Parallel.allOf [forever (serve shared robot) `outOfService` robot | robot <- robots])
  outOfService act robot = Signal.insteadWhen (withdrawn robot) (pure ()) act `catchAny` \_ -> pure ()
  takeThenProtect shared robot = do
    order <- atomically (receive (orders shared))
    logLine shared (name robot ++ " has an order")
    mask (\restore -> restore (carry robot order) >> handOver robot order)
  unprotected shared robot =
    handleNext (orders shared) (\order -> carry robot order >> handOver robot order >> pure (pure ()))

-- | What happens to one robot: at which times its battery becomes low and it is withdrawn.
data Story = Story
  { who :: String
  , lowAt, withdrawnAt :: [Seconds]
  , carrying, charging :: Script ()
  }

quiet :: String -> [Seconds] -> Story
quiet called gone =
  Story {who = called, lowAt = [], withdrawnAt = gone, carrying = succeeds `taking` 3, charging = succeeds `taking` 2}

-- | The orders come after 5 seconds, and the first ones are handed over after 8. In the end Ann is
-- the only one that works, and her battery becomes low each time when she hands over an order.
worst :: [Story]
worst =
  [ (quiet "Ann" []) {lowAt = [8, 13, 18]}
  , quiet "Bo" [5]
  , (quiet "Cid" []) {lowAt = [6], charging = faults "short circuit" `taking` 2}
  , (quiet "Di" []) {lowAt = [6], carrying = faults "a wheel is lost" `taking` 3}
  , quiet "Ed" [8]
  ]

day :: [Story] -> String -> Claim -> (Fleet -> [Robot] -> Behavior ()) -> Day
day stories end claim serve simulated = do
  world <- newMock
  newOrders <- driver world "orders" [(5, order) | order <- [1 .. 6]]
  free <- atomically (newTSem 1)
  done <- newTVarIO (0 :: Int)
  carries <- actionOn world "carry" $ \(called, _order :: Order) ->
    [carrying s `slowToStop` 0.5 | s <- stories, who s == called]
  hands <- actionOn world "hand over" (const [succeeds `causing` atomically (modifyTVar' done (+ 1))])
  charges <- actionOn world "charge" $ \called -> [charging s | s <- stories, who s == called]
  let robot story = do
        low <- condition world (who story ++ ": battery low") ((0, False) : [(t, True) | t <- lowAt story])
        gone <- condition world (who story ++ ": withdrawn") ((0, False) : [(t, True) | t <- withdrawnAt story])
        pure
          Robot
            { name = who story
            , carry = \order -> carries (who story, order)
            , -- The driver returns a moment after the order has been handed over.
              handOver = \order -> hands order >> checkpoint
            , charge = charges (who story) >> set low False
            , batteryLow = signal low
            , withdrawn = signal gone
            }
      sixOrders = atomically (readTVar done >>= check . (== 6))
  robots <- traverse robot stories
  run <- simulated . withInbox 10 newOrders $ \inbox ->
    serve Fleet {orders = inbox, chargers = free, logLine = const checkpoint} robots ||| sixOrders
  world `shouldRecord` claim
  world `shouldRecord` never (running "charge" `overlapping` running "charge")
  ended run `shouldBe` end
  atomically ((True <$ waitTSem free) `orElse` pure False) `shouldReturn` True
