{-# LANGUAGE GADTs #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Random requests of a few robots, with few keys and resources, so that they get in each other's way.
module Fleet.Requests
  ( Step (..)
  , steps
  , Asked (..)
  , Given (..)
  , given
  , describe
  ) where

import Data.Aeson (Value (..))
import Data.Bifunctor (bimap, first)
import Data.Function (on)
import Data.List (nub, nubBy, sort, sortOn)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text
import Data.UUID.Types (UUID, fromWords)
import Test.QuickCheck

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract

-- | Time passes; something is asked, which may be about the starts so far (the latest first); or a new epoch begins.
data Step
  = Passes Seconds
  | Asks ([Start] -> Asked)
  | NewEpoch

-- | A request, and what is shown of what it gives.
data Asked = forall r. Asked (Request r) (r -> String)

-- | What a database gives, with its notices.
data Given = Given String [String]
  deriving (Eq)

instance Show Given where
  show (Given gave notices) = gave ++ concatMap (", notice: " ++) notices

given :: (r -> String) -> Either Refusal r -> [Notice] -> Given
given shown gave notices = Given (either refused shown gave) (sort (nub (map show notices)))
 where
  refused LeaseGone = "the lease is gone"
  refused (BadArgument why) = "not allowed: " ++ Text.unpack why
  refused (WasRestored _) = "restored"
  refused (NoFleet _) = "no fleet"
  refused Busy = "busy"

steps :: Gen [Step]
steps = choose (1, 60) >>= (`vectorOf` step)

step :: Gen Step
step =
  frequency
    [ (30, Passes <$> elements [0.125, 0.25, 0.5, 1, 2, 5, 40])
    , (2, pure NewEpoch)
    , (2, always (Connect <$> elements [0, 0, 1000002, 1000030, 3000000, 90000000000]) show)
    , (20, always (Submit <$> submission) show)
    , (25, always (Claim <$> claiming) (show . map started))
    , (10, about (Renew . map key) (show . sort))
    , (6, about (\these -> Complete [(t, n, String "done") | (t, n) <- map key these]) (show . sort))
    , (6, both' <$> claiming <*> listOf (choose (0, 5)))
    , (4, aboutOne (\(t, n) -> Fail t n "it failed") show)
    , (2, aboutOne (uncurry GiveBack) show)
    , (2, aboutOne (\(t, n) -> Report t n (Bool True)) show)
    , (3, aboutOne (uncurry Became) show)
    , (3, about (Look . map (fst . key)) (show . sortOn fst))
    , (2, always (Find <$> name <*> aKey) show)
    , (2, always (ListDead <$> name) (show . map (first (Text.takeWhile (/= '@')))))
    , (3, always (Cancel <$> name <*> aKey) show)
    , (3, always (Retry <$> name <*> aKey) show)
    , (25, always (Hold <$> (Wish <$> wishes <*> resources <*> robot <*> term)) shownHeld)
    , (10, always (Keep <$> listOf wishes) (show . sort))
    , (10, always (Release <$> wishes) show)
    , (5, always (pure (Poll (Presence (fromWords 0 0 0 99) Nothing ["amy"] 5))) (show . bimap (fmap rounded) sort))
    ]
 where
  always asked shown = (\request -> Asks (const (Asked request shown))) <$> asked
  about asked shown =
    (\chosen -> Asks (\starts -> Asked (asked (chosenFrom chosen starts)) shown)) <$> listOf (choose (0, 5))
  aboutOne asked shown = (\n -> Asks (\starts -> Asked (asked (one n starts)) shown)) <$> choose (0, 3)
  claiming = Claiming <$> name <*> robots <*> someSkills <*> term <*> wishes <*> elements [False, False, False, True]
  both' it chosen = Asks $ \starts ->
    let ends = [(t, n, String "done") | (t, n) <- map key (chosenFrom chosen starts)]
     in Asked (CompleteAndClaim ends it) (\(done, those) -> show (sort done, map started those))
  key it = (startTask it, startLease it)
  one :: Int -> [Start] -> (TaskNumber, Number)
  one n starts = case drop n starts of
    it : _ -> key it
    [] -> (TaskNumber 1, 7)
  chosenFrom :: [Int] -> [Start] -> [Start]
  chosenFrom chosen starts = concatMap (\n -> take 1 (drop n (nubBy ((==) `on` key) starts))) (nub chosen)
  started it =
    (startTask it, startLease it, startRobot it, Text.takeWhile (/= '@') (startKey it), startInput it, startCount it)
  shownHeld (Holds fences) = show (sort fences)
  shownHeld (AskAgainIn seconds) = "in " ++ show (rounded seconds)

rounded :: Seconds -> Integer
rounded seconds = round (seconds * 1e5)

submission :: Gen Submission
submission =
  Submission
    <$> frequency [(40, name), (1, elements ["", Text.replicate 201 "q"])]
    <*> frequency [(40, aKey), (1, elements ["", Text.replicate 201 "k"])]
    <*> frequency [(9, pure (String "x")), (1, pure (String "y"))]
    <*> elements [-1, 0, 0, 0, 1]
    <*> sometimes (elements [-1, 0, 0.5, 3])
    <*> sometimes (elements [0.5, 3, 20])
    <*> frequency [(40, someSkills), (1, elements (map Set.fromList [[""], [Text.replicate 51 "n"]]))]
    <*> sometimes (elements [0.5, 1, 7])
    <*> listOf (elements [0, 0.5, 3])
    <*> elements [0, 1, 100]

sometimes :: Gen a -> Gen (Maybe a)
sometimes gen = frequency [(3, pure Nothing), (1, Just <$> gen)]

name, aKey, robot :: Gen Text
name = elements ["orders", "patrols"]
aKey = elements ["a", "b", "c"]
robot = frequency [(40, elements ["amy", "bob"]), (1, elements ["", Text.replicate 201 "r"])]

robots :: Gen [Text]
robots = choose (0, 3) >>= (`vectorOf` robot)

someSkills, resources :: Gen (Set.Set Text)
someSkills = Set.fromList <$> sublistOf ["arm", "lift"]
resources = Set.fromList <$> sublistOf ["charger", "door", "lift"]

term :: Gen Seconds
term = frequency [(20, elements [0.5, 1, 3, 10]), (1, elements [0, 0.05, 100000])]

wishes :: Gen UUID
wishes = fromWords 0 0 0 <$> choose (1, 4)

describe :: Asked -> String
describe (Asked request _) = case request of
  Connect n -> "connect " ++ show n
  Submit it -> "submit " ++ show it
  Claim it -> "claim " ++ show it
  Renew these -> "renew " ++ show these
  Complete these -> "complete " ++ show these
  CompleteAndClaim these it -> "complete " ++ show these ++ " and claim " ++ show it
  Fail t n why -> "fail " ++ show (t, n, why)
  GiveBack t n -> "give back " ++ show (t, n)
  Report t n what -> "report " ++ show (t, n, what)
  Became t n -> "became " ++ show (t, n)
  Look these -> "look " ++ show these
  Find queue' key -> "find " ++ show (queue', key)
  ListDead queue' -> "list dead " ++ show queue'
  Cancel queue' key -> "cancel " ++ show (queue', key)
  Retry queue' key -> "retry " ++ show (queue', key)
  Hold it -> "hold " ++ show it
  Keep these -> "keep " ++ show these
  Release it -> "release " ++ show it
  Poll _ -> "poll"
  Leave it -> "leave " ++ show it
