-- | A small reader of XML: it accepts no file that is not well-formed, and less than XML allows.
module Viewer.Xml
  ( Xml (..)
  , readXml
  , everything
  , attribute
  , textOf
  ) where

import Data.Char (chr, isAlpha, isDigit, isHexDigit)
import Data.List (isPrefixOf, nub, sort, stripPrefix)
import Data.Maybe (fromMaybe)
import Numeric (readHex)

-- | An element with its attributes in the order of their names, or a text.
data Xml
  = Element String [(String, String)] [Xml]
  | Text String
  deriving (Eq, Show)

-- | The element that the text is, or what is wrong.
readXml :: String -> Either String Xml
readXml input = do
  (x, rest) <- element input
  if null rest then Right x else wrong "something after the end" rest

-- | The element and all in it.
everything :: Xml -> [Xml]
everything x@(Element _ _ inner) = x : concatMap everything inner
everything x = [x]

-- | The attribute, or an empty text.
attribute :: String -> Xml -> String
attribute name (Element _ attributes _) = fromMaybe "" (lookup name attributes)
attribute _ _ = ""

-- | All text in it.
textOf :: Xml -> String
textOf x = concat [t | Text t <- everything x]

wrong :: String -> String -> Either String a
wrong what rest = Left (what ++ ": " ++ show (take 60 rest))

element :: String -> Either String (Xml, String)
element ('<' : input) | (name@(_ : _), rest) <- span isAlpha input = do
  (attributes, rest') <- attributesOf rest
  let names = map fst attributes
  if nub names /= names then wrong "an attribute twice" input else Right ()
  case rest' of
    '/' : '>' : rest'' -> Right (Element name (sort attributes) [], rest'')
    '>' : rest'' -> do
      (inner, after) <- content rest''
      case stripPrefix ("</" ++ name ++ ">") after of
        Just after' -> Right (Element name (sort attributes) inner, after')
        Nothing -> wrong ("no end of " ++ name) after
    _ -> wrong "no end of the tag" rest'
element input = wrong "no element" input

attributesOf :: String -> Either String ([(String, String)], String)
attributesOf (' ' : input)
  | (name@(_ : _), '=' : '"' : rest) <- span (\c -> isAlpha c || c == '-') input
  , (raw, '"' : rest') <- break (== '"') rest = do
      value <- characters raw
      (more, after) <- attributesOf rest'
      Right ((name, value) : more, after)
  | otherwise = wrong "no attribute" input
attributesOf input = Right ([], input)

content :: String -> Either String ([Xml], String)
content input
  | "</" `isPrefixOf` input = Right ([], input)
  | '<' : _ <- input = do
      (x, rest) <- element input
      (more, after) <- content rest
      Right (x : more, after)
  | (raw@(_ : _), rest) <- break (== '<') input = do
      t <- characters raw
      (more, after) <- content rest
      Right (Text t : more, after)
  | otherwise = wrong "the end is missing" input

characters :: String -> Either String String
characters [] = Right []
characters ('&' : rest) = case break (== ';') rest of
  ("amp", ';' : after) -> ('&' :) <$> characters after
  ("lt", ';' : after) -> ('<' :) <$> characters after
  ("gt", ';' : after) -> ('>' :) <$> characters after
  ("quot", ';' : after) -> ('"' :) <$> characters after
  ("apos", ';' : after) -> ('\'' :) <$> characters after
  ('#' : 'x' : digits, ';' : after)
    | not (null digits), all isHexDigit digits -> reference (fst (head (readHex digits))) after
  ('#' : digits, ';' : after) | not (null digits), all isDigit digits -> reference (read digits) after
  _ -> wrong "no reference" rest
 where
  reference n after
    | n <= 0x10FFFF, legal (chr n) = (chr n :) <$> characters after
    | otherwise = wrong "a reference to what is no character of XML" (show n)
characters (c : rest)
  | c `elem` "<>" = wrong "not escaped" (c : rest)
  | legal c = (c :) <$> characters rest
  | otherwise = wrong "no character of XML" (c : rest)

-- The characters of XML 1.0.
legal :: Char -> Bool
legal c = c `elem` "\t\n\r" || (c >= ' ' && c < '\xD800') || (c >= '\xE000' && c < '\xFFFE') || c >= '\x10000'
