-- | The premises of claims: what has to come, or a claim holds whatever the robot does.
module Sim.PremiseSpec (spec) where

import Control.Monad (void)
import Data.Foldable (for_)
import Data.List (intercalate)
import Test.Hspec hiding (parallel)

import Behavior
import Behavior.Sim
import Behavior.Sim.Mock
import Support (guarded)

spec :: Spec
spec = guarded . describe "The report of an exploration: what never came" $ do
  for_ absent $ \(claim, these) ->
    it ("has it, if it came under no schedule: " ++ intercalate ", " these) $ do
      report <- claiming claim
      reportNeverCame report `shouldBe` these
      show report `shouldContain` ("; never came: " ++ intercalate ", " these)
  for_ present $ \(what, claim) ->
    it ("does not have what came under one of the schedules, in " ++ what) $ do
      report <- claiming claim
      reportNeverCame report `shouldBe` []
      show report `shouldNotContain` "never came"
  it "has each once, of all claims" $ do
    let its = whenever low mempty
    report <- claiming (its <> whenever (failureOf "honk") mempty <> its)
    reportNeverCame report `shouldBe` ["\"honk\" fails", "\"low\" becomes True"]
  it "has it also if the world was made, and the claim checked, in another place" $ do
    world <- newMock
    drive <- action world "drive" [succeeds]
    beside <- explore (replaying NonPreemptive) $ \simulated ->
      simulated drive >> (world `shouldRecord` whenever (failureOf "drive") mempty)
    reportNeverCame beside `shouldBe` ["\"drive\" fails"]
    inside <- explore (randomly 3) $ \simulated -> void . simulated $ do
      own <- newMock
      begin own
      own `shouldRecord` whenever (noted "ready") mempty
    reportNeverCame inside `shouldBe` ["\"ready\" is noted"]
  it "knows nothing of a claim that is checked outside of explorations" $ do
    world <- newMock
    drive <- action world "drive" [succeeds]
    void (simulate drive)
    world `shouldRecord` whenever (failureOf "drive") mempty
    report <- claiming (whenever (startOf "drive") mempty)
    reportNeverCame report `shouldBe` []
 where
  absent =
    [ (whenever low mempty, ["\"low\" becomes True"])
    , ( whenever low (whenever (successOf "drive") mempty)
      , ["\"drive\" is done after \"low\" becomes True", "\"low\" becomes True"]
      )
    , (whenever (startOf "drive") (whenever low mempty), ["\"low\" becomes True after \"drive\" begins"])
    , (whenever (endOf "drive") (whenever (startOf "drive") mempty), ["\"drive\" begins after \"drive\" ends"])
    , (successOf "drive" `comesBefore` low, ["\"low\" becomes True"])
    , (never (startOf "drive" `during` being "low" True), ["\"low\" is True"])
    , (exactly 0 (startOf "drive" `during` being "low" True), ["\"low\" is True"])
    , (never (running "drive" `overlapping` being "low" True), ["\"low\" is True"])
    , (never (being "low" True `overlapping` running "drive"), ["\"low\" is True"])
    , (never (startOf "drive" `during` (being "low" False `heldFor` 60)), ["\"low\" is False for over 60.0 s"])
    , (never ((startOf "drive" `during` being "low" True) `outside` running "honk"), ["\"low\" is True"])
    , ( whenever (endOf "drive") (never (startOf "honk" `during` running "drive"))
      , ["\"drive\" is running after \"drive\" ends"]
      )
    ]
  present =
    [ ("whenever", whenever (successOf "honk") mempty <> whenever (interruptionOf "honk") mempty)
    , ("whenever, twice", whenever (startOf "drive") (whenever (successOf "drive") mempty))
    , ("comesBefore", foldMap (startOf "honk" `comesBefore`) [successOf "honk", interruptionOf "honk"])
    , ("during", whenever (startOf "drive") (never (startOf "honk" `during` being "low" False)))
    , ("exactly", exactly 1 (anyOf [startOf "drive" `during` being "low" s | s <- [True, False]]))
    , ("outside", never (successOf "drive" `outside` being "low" False))
    ]
  low = becoming "low" True
  -- The right branch ends or is stopped, as the schedule says.
  claiming claim = explore (randomly 20) $ \simulated -> do
    world <- newMock
    _ <- condition world "low" [(0, False)]
    drive <- action world "drive" [succeeds `taking` 4]
    honk <- action world "honk" [succeeds `taking` 1]
    void (simulated (parallel (sleep 1) honk >> drive))
    world `shouldRecord` claim
