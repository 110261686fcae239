{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What a lease that has expired is good for. (That the schema does the same is tried in @make fleets@.)
module Fleet.ModelSpec (spec) where

import Control.Monad.Trans.State.Strict (State, evalState)
import qualified Control.Monad.Trans.State.Strict as State
import Data.Aeson (Value (Null))
import qualified Data.Set as Set
import Data.Text (Text)
import Data.UUID.Types (nil)
import Test.Hspec

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Model
import Behavior.Fleet.Internal.Model.Tables (emptyModel)

spec :: Spec
spec = describe "A lease that has expired" $ do
  it "is not renewed, also before anyone has noticed" $
    begun [] (\task lease -> asks 2 (Renew [(task, lease)])) `shouldBe` Right []

  it "of a resource is not kept, also before anyone has noticed" $
    evalState (asks 0 (Hold (Wish nil (Set.singleton "door") "amy" 1)) >> asks 2 (Keep [nil])) emptyModel
      `shouldBe` Right []

  it "still completes its task, unless that was started again" $
    begun [0] (\task lease -> asks 2 (Complete [(task, lease, Null)]))
      `shouldSatisfy` \done -> (map fst <$> done) == Right [TaskNumber 1]

  it "does not complete a task that was started again" $
    begun [0] (\task lease -> claims 2 "bob" >> asks 2 (Complete [(task, lease, Null)])) `shouldBe` Right []

  it "counts as a start: when no pause is left, the task is dead" $
    begun [] (\task _ -> asks 2 (Poll (Presence nil Nothing [] 5)) >> asks 2 (Look [task]))
      `shouldSatisfy` \found -> (map (taskState . snd) <$> found) == Right [Dead]

asks :: Seconds -> Request r -> State Model (Either Refusal r)
asks at request = State.state (\model -> let (answer, next, _) = perform at request model in (answer, next))

claims :: Seconds -> Text -> State Model (Either Refusal [Start])
claims at robot = asks at (Claim (Claiming "orders" [robot] mempty 1 nil False))

-- | There is a task with those pauses; at the time 0 a robot has started it, for a second.
begun :: [Seconds] -> (TaskNumber -> Number -> State Model a) -> a
begun pauses next = (`evalState` emptyModel) $ do
  _ <- asks 0 (Submit (Submission "orders" "a" Null 0 Nothing Nothing mempty Nothing pauses 100))
  claims 0 "amy" >>= \case
    Right [start] -> next (startTask start) (startLease start)
    other -> error (show other)
