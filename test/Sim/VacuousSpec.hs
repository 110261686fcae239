-- |
-- Tests that would pass because they test nothing: each is an error that says what to do.
module Sim.VacuousSpec (spec) where

import Control.Exception (ErrorCall (..))
import Control.Monad (void)
import Data.Foldable (for_)
import Data.List (isInfixOf)
import Test.Hspec

import Behavior
import Behavior.Sim
import Behavior.Sim.Mock
import Support (guarded)

spec :: Spec
spec = guarded $ do
  describe "A world that a run does not own" worlds

worlds :: Spec
worlds = do
  for_ usesOutside $ \(how, use) ->
    it ("cannot be used in a simulation after it was used outside: " ++ how) $ do
      (world, drive, low) <- rover
      use world low
      run <- simulate (drive >> begin world)
      explain (outcome run) `shouldSatisfy` ("started outside of the simulation" `isInfixOf`)
      -- The run is not judged here; but its record cannot be read either.
      (world `shouldRecord` never (startOf "drive")) `shouldThrow` saying "started outside of the simulation"
  it "cannot be used in another simulation" $ do
    (world, drive, _) <- rover
    void (simulate drive)
    again <- simulate drive
    explain (outcome again) `shouldSatisfy` ("started in another simulation" `isInfixOf`)
    happened world `shouldThrow` saying "started in another simulation"
  it "cannot be used outside after a simulation; but its record can be read there, again and again" $ do
    (world, drive, low) <- rover
    void (simulate drive)
    world `shouldRecord` exactly 1 (successOf "drive")
    map entryTime . recordEntries <$> happened world `shouldReturn` [0, 0, 4]
    reading low `shouldThrow` saying "only read its record"
  it "is one that was not used at all, of which no claim is made" $ do
    (world, drive, _) <- rover
    void (simulate (pure () ? drive))
    (world `shouldRecord` never (startOf "drive")) `shouldThrow` \(BrokenClaim why) -> "begin it: simulate (begin world" `isInfixOf` why
  it "can begin with nothing else, so that such a claim is made" $ do
    (world, drive, _) <- rover
    void (simulate (begin world >> pure () ? drive))
    world `shouldRecord` never (startOf "drive")
  it "is used again and again in reality" $ do
    world <- newMock
    wave <- action world "wave" [succeeds]
    wave >> runBehavior wave
    world `shouldRecord` exactly 2 (successOf "wave")
 where
  usesOutside =
    [ ("begin", \world _ -> begin world)
    , ("a note", \world _ -> note world "ready")
    , ("a reading", \_ low -> void (reading low))
    , ("a change", \_ low -> set low True)
    ]

-- | A world, an action that takes four seconds, and a condition.
rover :: IO (Mock, Behavior (), Condition Bool)
rover = do
  world <- newMock
  low <- condition world "low" [(0, False)]
  drive <- action world "drive" [succeeds `taking` 4]
  pure (world, drive, low)

saying :: String -> ErrorCall -> Bool
saying text (ErrorCall why) = text `isInfixOf` why
