{-# LANGUAGE OverloadedStrings #-}

-- |
-- docs/trace-format.md describes the files that are really written.
module Viewer.FormatSpec (spec) where

import Data.Aeson
import qualified Data.Aeson.Key as Key
import qualified Data.Aeson.KeyMap as KeyMap
import qualified Data.ByteString as Strict
import qualified Data.ByteString.Lazy as Bytes
import Data.Foldable (toList)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Maybe (mapMaybe)
import Data.Set (Set)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text
import qualified Data.Text.Encoding as Text
import Test.Hspec

import Behavior.Trace
import Behavior.Trace.File
import Viewer.Examples

readPage :: IO Text
readPage = Text.decodeUtf8 <$> Strict.readFile "docs/trace-format.md"

spec :: Spec
spec = before readPage . describe "is described by docs/trace-format.md:" $ do
  it "each field that is written is there, and no other one" $ \page ->
    Map.map Map.keysSet (documented page) `shouldBe` Map.map Map.keysSet written
  it "each text that selects how a line is read is there, and no other one" $ \page -> do
    let ofSelector key values = if key `elem` selectors then values else Set.empty
        selecting = Map.map (Map.filter (not . Set.null) . Map.mapWithKey ofSelector)
        keep = Map.filter (not . Map.null)
    keep (selecting (documented page)) `shouldBe` keep (selecting written)
  it "its example is a file as this library writes it" $ \page -> do
    let shown = takeWhile (/= "```") . drop 1 . dropWhile (/= "```json") . Text.lines
        shownThere = Bytes.fromStrict (Text.encodeUtf8 (Text.unlines (shown page)))
    case parseTrace shownThere of
      Right (h, events, Nothing) -> do
        renderTrace h events `shouldBe` shownThere
        length events `shouldBe` 6
      other -> expectationFailure (show other)
 where
  selectors = ["event", "how", "why", "kind", "parent"] :: [Text]

-- For each kind of object its fields, each with the texts that it can be.
type Fields = Map Text (Map Text (Set Text))

-- What is written for events of all kinds.
written :: Fields
written =
  Map.unionsWith
    (Map.unionWith Set.union)
    (zipWith fieldsOf ("Header" : repeat "") (mapMaybe decode (Bytes.split 10 (renderTrace header events))))
 where
  events =
    mission ++ detailed
      ++ [Began (Span 1 parent kind "" 0 (Just 2)) | parent <- parents, kind <- [minBound ..]]
      ++ [Ended (Span 1 parent Named "" 0 Nothing) 0 Succeeded | parent <- parents]
      ++ [Reacted (Reaction 1 parent "" 0 [] Nothing Nothing) | parent <- parents]
  parents = [Top, Inside 1, UnknownParent]

fieldsOf :: Text -> Value -> Fields
fieldsOf kind (Object o) =
  Map.unionsWith (Map.unionWith Set.union) (Map.singleton title (Map.fromList (map field fields)) : map inner fields)
 where
  fields = [(Key.toText key, value) | (key, value) <- KeyMap.toList o]
  title = case KeyMap.lookup "event" o of
    Just (String event) | Text.null kind -> "Event: " <> event
    _ -> kind
  field (key, String value) = (key, Set.singleton value)
  field (key, _) = (key, Set.empty)
  inner (key, value) = case key of
    "end" -> fieldsOf "An end" value
    "cause" -> fieldsOf "A cause" value
    "stopped" -> fieldsOf "A stopped branch" value
    "changes"
      | Array changes <- value ->
          Map.unionsWith (Map.unionWith Set.union) (map (fieldsOf "A change") (toList changes))
    _ -> Map.empty
fieldsOf _ _ = Map.empty

-- The tables of the page.
documented :: Text -> Fields
documented = Map.fromList . mapMaybe section . drop 1 . Text.splitOn "\n## "
 where
  section text = case Text.lines text of
    title : rest | rows@(_ : _) <- mapMaybe row rest -> Just (title, Map.fromList rows)
    _ -> Nothing
  row line = case Text.splitOn " | " line of
    field : meaning
      | Just name <- Text.stripPrefix "| `" field >>= Text.stripSuffix "`" ->
          Just (name, values name (Text.concat meaning))
    _ -> Nothing
  values name meaning
    | "as in `began`" `Text.isInfixOf` meaning = same name
    | otherwise =
        Set.fromList
          [ value
          | part <- Text.splitOn "`\"" meaning
          , (value, end) <- [Text.breakOn "\"`" part]
          , not (Text.null end)
          ]
  same name = case name of
    "kind" -> Set.fromList ["named", "operator", "branch"]
    "parent" -> Set.fromList ["top", "unknown"]
    _ -> Set.empty
