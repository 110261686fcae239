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

import Data.List (intercalate, isPrefixOf, isSuffixOf, nub, stripPrefix)
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

-- | What a claim needs of the world.
data Need
  = -- | Something with this name; a verb, for what it does; the kinds of subjects that can do that; and the value
    -- that the verb names, if it does, as it is shown.
    Need String String [SubjectKind] (Maybe String)
  | -- | A note, of any text.
    Noting String

-- | The kinds of actions.
anyAction :: [SubjectKind]
anyAction = [AnAction, AnActionOn]

-- | If one of the needs does not fit the world: why the first such need does not. A claim with it
-- would be about nothing, so that 'Behavior.Sim.Mock.never' would hold whatever happened.
--
-- >>> let world = [("low", ACondition), ("drive", AnAction), ("open", AnActionOn)]
-- >>> let shown = [("open", "\"front\"")]
-- >>> let whyNot name = mapM_ putStrLn (unfit world shown [Need name "begins" anyAction Nothing])
-- >>> whyNot "drive"
-- >>> whyNot "low"
-- "low" is a condition, and never begins. The actions of this world: "drive", "open".
-- >>> whyNot "drive 'x'"
-- "drive" is an action without an argument, so nothing is called "drive 'x'".
-- >>> whyNot "drvie"
-- Nothing in this world is called "drvie", only "low", "drive", "open".
--
-- Which arguments, values and notes there can be is not known. But if the need writes one that was recorded in
-- another way, that is an error, too. (The second list has those that were recorded, as they are shown, each with the
-- name of its action, condition or sensor; a note with @""@.)
--
-- >>> whyNot "open front"
-- "open" was not called as "open front", but as "open \"front\"".
-- >>> whyNot "open \"back\""
unfit :: [(String, SubjectKind)] -> [(String, String)] -> [Need] -> Maybe String
unfit world shown = listToMaybe . mapMaybe unfitNeed
 where
  unfitNeed (Noting text) =
    listToMaybe [show text ++ " was not noted, but " ++ show known ++ "." | known <- otherSpellings sameWords text ""]
  unfitNeed (Need name verb kinds value)
    | any ((`elem` kinds) . snd) namesakes = listToMaybe (maybe (unlikeCalls name) (unlikeValues name) value)
    | (_, kind) : _ <- namesakes = Just (name `is` kind ++ ", and " ++ negated verb ++ ". " ++ those kinds)
    | known : _ <- [known | (known, AnAction) <- world, (known ++ " ") `isPrefixOf` name] =
        Just (known `is` AnAction ++ " without an argument, so nothing is called " ++ show name ++ ".")
    | otherwise = Just ("Nothing in this world is called " ++ show name ++ ", only " ++ listed (map fst world) ++ ".")
   where
    namesakes = filter (`isCalled` name) world

  unlikeCalls name =
    [ show known ++ " was not called as " ++ show name ++ ", but as " ++ show (known ++ " " ++ argument) ++ "."
    | name `notElem` map fst world
    , (known, AnActionOn) <- world
    , Just given <- [stripPrefix (known ++ " ") name]
    , argument <- otherSpellings rewrites given known
    ]
  unlikeValues name given =
    [ show name ++ " was not recorded as " ++ given ++ ", but as " ++ value ++ "."
    | value <- otherSpellings rewrites given name
    ]
  -- What was recorded with this name and is the given text in another spelling; nothing, if the given text itself was
  -- recorded.
  otherSpellings isLike given name = if given `elem` these then [] else filter (given `isLike`) these
   where
    these = [text | (known, text) <- shown, known == name]

  those kinds = case [name | (name, kind) <- world, kind `elem` kinds] of
    [] -> "This world has no " ++ plurals " or " ++ "."
    names -> "The " ++ plurals " and " ++ " of this world: " ++ listed names ++ "."
   where
    plurals between = intercalate between (nub [kindName kind ++ "s" | kind <- kinds])

  name `is` kind = show name ++ " is " ++ (if kindName kind == "action" then "an " else "a ") ++ kindName kind
  negated verb = maybe ("never " ++ verb) ("is never " ++) (stripPrefix "is " verb)
  listed = intercalate ", " . map show

-- | Whether the subject has this name; an action with an argument also has its name with any argument.
isCalled :: (String, SubjectKind) -> String -> Bool
isCalled (known, kind) name =
  known == name || (kind == AnActionOn && any (any (/= ' ')) (stripPrefix (known ++ " ") name))

-- | Whether the two differ only in quotes, brackets or blanks.
sameWords :: String -> String -> Bool
given `sameWords` shown = bare given == bare shown && not (null (bare given))

-- | The words of a text without quotes and brackets.
bare :: String -> [String]
bare = words . map (\c -> if c `elem` "\"'()[]{},=" then ' ' else c)

-- | 'sameWords'; or the first is the same number in another type; or it lacks a 'Just'; or it lacks the quotes and
-- the constructor before them. (But two texts in quotes are never spellings of each other.)
rewrites :: String -> String -> Bool
given `rewrites` shown =
  not (all ((== "\"") . take 1) [given, shown]) && (given `sameWords` shown || isSameNumber || lacksBeginning)
 where
  lacksBeginning =
    not (null (bare given))
      && bare given `isSuffixOf` bare shown
      && (take 1 (bare shown) == ["Just"] || (not (quoted given) && quoted shown))
  -- (The first digit is looked at first, since 'reads' takes long.)
  isSameNumber =
    take 1 given == take 1 shown && or [a == b | (a, "") <- reads given, (b, "") <- reads shown :: [(Double, String)]]
  quoted = any (`elem` "\"'")
