{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The functions of the schema that are about resources.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Model.Resources
  ( hold
  , keep
  , release
  ) where

import Control.Monad (forM, forM_, unless, when)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe, isNothing, listToMaybe, mapMaybe)
import Data.Set (Set)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text
import Data.UUID.Types (UUID)

import Behavior (Seconds)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Model.Tables

-- | All of these resources, or when to ask again.
hold :: Seconds -> Wish -> Doing Held
hold at it = do
  requireRobots [wishRobot it]
  requireTerm (wishTerm it)
  when (Set.null names) $ refuse "there is no resource to hold"
  when (any (\name -> Text.length name < 1 || Text.length name > 200) names) $
    refuse "the name of a resource has 1 to 200 characters"
  change $ \m -> m {resources = Map.union (resources m) (Map.fromSet (const (unheld m)) names)}
  holders <- getting (resourcesOf names)
  mine <- getting (Map.keysSet . Map.filter isMine . resources)
  unless (Set.null mine || mine == names) $ refuse "a request that holds other resources already has another number"
  if all isMine holders then again holders else wait
 where
  names = wishFor it
  unheld m = Holder 0 Nothing Text.empty (wishTerm it) (holdsFrom m)
  isMine holder = holderRequest holder == Just (wishNumber it) && heldUntil holder > at

  -- It holds them: the answer may have been lost.
  again holders = do
    let renewed holder = holder {heldUntil = at + wishTerm it, holderTerm = wishTerm it}
    change (\m -> m {resources = Map.union (renewed <$> holders) (resources m)})
    pure (Holds (Map.toList (fence <$> holders)))

  wait = do
    mine <- placeOf at it
    freeAt <- getting (freeFrom names)
    before <- getting (\m -> [(n, waitUntil m other) | (n, other) <- othersBefore mine m])
    let (passedOver, waitedFor) = span (isNothing . snd) before
    case waitedFor of
      _ | freeAt > at -> pure (AskAgainIn (min 5 (freeAt - at)))
      (_, end) : _ -> passOver passedOver >> pure (AskAgainIn (min 0.25 (maybe 0 (subtract at) end)))
      [] -> do
        passOver passedOver
        change (\m -> m {places = Map.delete mine (places m)})
        Holds <$> forM (Set.toList names) taken

  -- (Once is enough, until it asks again.)
  passOver these = forM_ these $ \(n, _) ->
    change (\m -> m {places = Map.adjust (\other -> other {placeUntil = at}) n (places m)})

  taken name = do
    n <- nextNumberOf
    let holder = Holder n (Just (wishNumber it)) (wishRobot it) (wishTerm it) (at + wishTerm it)
    (name, n) <$ change (\m -> m {resources = Map.insert name holder (resources m)})

  -- Those that came before, and have not gone. (A robot that holds something waits for none whose turn it is not.)
  othersBefore mine m
    | any isHeldHere (resources m) = filter isTurn others
    | otherwise = others
   where
    others = inLine names mine
    isTurn (n, other) =
      freeFrom (wishFor (wish other)) m <= at && null (inLine (wishFor (wish other)) n)
    inLine these end =
      [ (n, other)
      | (n, other) <- Map.toList (places m)
      , n < end
      , placeUntil other > at
      , not (Set.disjoint these (wishFor (wish other)))
      ]
  isHeldHere holder = holderRobot holder == wishRobot it && heldUntil holder > at

  -- How long that one is waited for, after all that it waits for is free.
  waitUntil m other =
    let end = 0.5 + max (asked other) (freeFrom (wishFor (wish other)) m)
     in if at < end then Just end else Nothing

-- | The place of this wish, which it keeps for ten seconds more.
placeOf :: Seconds -> Wish -> Doing Int
placeOf at it = do
  before <- getting (Map.keys . Map.filter ((== wishNumber it) . wishNumber . wish) . places)
  next <- getting nextPlace
  let n = fromMaybe next (listToMaybe before)
  change (\m -> m {places = Map.insert n (Waiter it at (at + 10)) (places m)})
  n <$ change (\m -> m {nextPlace = max (nextPlace m) (n + 1)})

resourcesOf :: Set Text -> Model -> Map Text Holder
resourcesOf names m = resources m `Map.restrictKeys` names

-- | When all of these are free.
freeFrom :: Set Text -> Model -> Seconds
freeFrom names m = maximum (-1e9 : map heldUntil (Map.elems (resourcesOf names m)))

-- | Of these requests, those that keep what they hold.
keep :: Seconds -> [UUID] -> Doing [UUID]
keep at wishes = do
  let isKept holder = heldUntil holder > at && maybe False (`elem` wishes) (holderRequest holder)
  these <- getting (Map.filter isKept . resources)
  change (\m -> m {resources = Map.union ((\h -> h {heldUntil = at + holderTerm h}) <$> these) (resources m)})
  pure (Set.toList (Set.fromList (mapMaybe holderRequest (Map.elems these))))

-- | The request holds nothing, and waits for nothing.
release :: Seconds -> UUID -> Doing ()
release at number = do
  waited <- getting (filter isIts . map wish . Map.elems . places)
  freed <- getting (Map.filter (\h -> holderRequest h == Just number && heldUntil h > at) . resources)
  change $ \m ->
    m
      { places = Map.filter (not . isIts . wish) (places m)
      , resources = Map.union ((\h -> h {heldUntil = at, holderRequest = Nothing}) <$> freed) (resources m)
      }
  forM_ (Set.union (foldMap wishFor waited) (Map.keysSet freed)) $ \name -> getting (turn name) >>= mapM_ tell
 where
  turn name m
    | freeFrom (Set.singleton name) m > at = []
    | otherwise = maybe [OfResource name] (\next -> [OfTurn next, OfLine name]) (listToMaybe (canHave name m))
  canHave name m =
    [ wishNumber it
    | Waiter it _ end <- Map.elems (places m)
    , Set.member name (wishFor it) && end > at && freeFrom (wishFor it) m <= at
    ]
  isIts = (== number) . wishNumber
