{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What is in a mock world, by name, and which names fit a claim.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Subject
  ( SubjectKind (..)
  , kindName
  , Need (..)
  , anyAction
  , unfit
  ) where

import Data.List (intercalate, isPrefixOf, nub, stripPrefix)
import Data.Maybe (listToMaybe, mapMaybe)

-- $setup
-- >>> import Behavior.Internal.Mock.Subject

-- | What something in a mock world is.
--
-- @since 0.1.0.0
data SubjectKind
  = -- | Made by 'Behavior.Sim.Mock.action'.
    AnAction
  | -- | An action with an argument: made by 'Behavior.Sim.Mock.actionOn'.
    AnActionOn
  | -- | Made by 'Behavior.Sim.Mock.sensor'.
    ASensor
  | -- | Made by 'Behavior.Sim.Mock.condition' or 'Behavior.Sim.Mock.partialCondition'.
    ACondition
  | -- | Made by 'Behavior.Sim.Mock.driver'.
    ADriver
  deriving (Eq, Ord, Show)

-- | The word for it.
kindName :: SubjectKind -> String
kindName kind = case kind of
  AnAction -> "action"
  AnActionOn -> "action"
  ASensor -> "sensor"
  ACondition -> "condition"
  ADriver -> "driver"

-- | What a claim needs: something of this name and of one of these kinds, since only that does what
-- the verb says.
data Need = Need
  { needName :: String
  , needVerb :: String
  , needKinds :: [SubjectKind]
  }

-- | The kinds of actions.
anyAction :: [SubjectKind]
anyAction = [AnAction, AnActionOn]

-- | Why the first of the needs that does not fit the world does not, if there is one: a claim with it
-- would be about nothing, so that 'Behavior.Sim.Mock.never' would hold whatever happened.
--
-- >>> let world = [("low", ACondition), ("drive", AnAction)]
-- >>> let whyNot name = mapM_ putStrLn (unfit world [Need name "begins" anyAction])
-- >>> whyNot "drive"
-- >>> whyNot "low"
-- "low" is a condition, and never begins. The actions of this world: "drive".
-- >>> whyNot "drive 'x'"
-- "drive" is an action without an argument, so nothing is called "drive 'x'".
-- >>> whyNot "drvie"
-- Nothing in this world is called "drvie", only "low", "drive".
unfit :: [(String, SubjectKind)] -> [Need] -> Maybe String
unfit world = listToMaybe . mapMaybe unfitNeed
 where
  unfitNeed (Need name verb kinds)
    | any ((`elem` kinds) . snd) namesakes = Nothing
    | (_, kind) : _ <- namesakes = Just (name `is` kind ++ ", and " ++ negated verb ++ ". " ++ those kinds)
    | known : _ <- [known | (known, AnAction) <- world, (known ++ " ") `isPrefixOf` name] =
        Just (known `is` AnAction ++ " without an argument, so nothing is called " ++ show name ++ ".")
    | otherwise = Just ("Nothing in this world is called " ++ show name ++ ", only " ++ listed (map fst world) ++ ".")
   where
    namesakes = filter (`isCalled` name) world

  those kinds = case [name | (name, kind) <- world, kind `elem` kinds] of
    [] -> "This world has no " ++ plurals " or " ++ "."
    names -> "The " ++ plurals " and " ++ " of this world: " ++ listed names ++ "."
   where
    plurals between = intercalate between (nub [kindName kind ++ "s" | kind <- kinds])

  name `is` kind = show name ++ " is " ++ (if kindName kind == "action" then "an " else "a ") ++ kindName kind
  negated verb = maybe ("never " ++ verb) ("is never " ++) (stripPrefix "is " verb)
  listed = intercalate ", " . map show

-- | Whether a name is that of the subject; of an action with an argument also with an argument.
isCalled :: (String, SubjectKind) -> String -> Bool
isCalled (known, kind) name = known == name || (kind == AnActionOn && (known ++ " ") `isPrefixOf` name)
