{-# OPTIONS_HADDOCK not-home #-}

-- |
-- What the formats made of JSON share: how texts and numbers are written.
--
-- The bytes do not depend on the version of aeson. They contain no character that a terminal or a
-- web page acts on, whatever the texts are.
module Behavior.Trace.Json
  ( written
  , writtenExcept
  , text
  , number
  , nanoseconds
  ) where

import Data.Aeson.Encoding (Encoding, encodingToLazyByteString, unsafeToEncoding)
import qualified Data.Aeson.Encoding as Encoding
import Data.ByteString.Builder (Builder, char7, lazyByteString, string7)
import qualified Data.ByteString.Lazy.Char8 as Bytes
import Data.Char (GeneralCategory (..), generalCategory, ord)
import qualified Data.Text as Text
import qualified Data.Text.Lazy as Lazy
import qualified Data.Text.Lazy.Encoding as Lazy
import Numeric (showFFloat, showHex)

import Behavior.Internal.Core.Seconds (Seconds (..))

-- | The bytes. Control characters, characters that change the direction of a text, and @<@, @>@
-- and @&@ are written as escapes: outside of its texts, JSON contains none of them.
written :: Encoding -> Builder
written = writtenExcept ""

-- | The same, except that these characters are written as they are.
writtenExcept :: [Char] -> Encoding -> Builder
writtenExcept plain encoding
  -- (Most are of ASCII only, whose bytes are the characters.)
  | Bytes.any (\c -> c >= '\DEL' || unsafe c) bytes
  , Lazy.any unsafe characters =
      lazyByteString (Lazy.encodeUtf8 (Lazy.concatMap escaped characters))
  | otherwise = lazyByteString bytes
 where
  bytes = encodingToLazyByteString encoding
  characters = Lazy.decodeUtf8 bytes
  unsafe c
    | c `elem` plain = False
    | c < '\DEL' = c < ' ' || c == '<' || c == '>' || c == '&'
    | otherwise = generalCategory c `elem` [Control, Format, LineSeparator, ParagraphSeparator]
  escaped c
    | not (unsafe c) = Lazy.singleton c
    | ord c < 0x10000 = unit (ord c)
    | otherwise =
        let (high, low) = (ord c - 0x10000) `divMod` 0x400
        in unit (0xD800 + high) <> unit (0xDC00 + low)
  unit n = Lazy.pack ("\\u" ++ replicate (4 - length (showHex n "")) '0' ++ showHex n "")

-- | A text. A surrogate, which is no character, becomes U+FFFD.
text :: String -> Encoding
text = Encoding.text . Text.pack

-- | A number, with the digits that are needed to read it back unchanged. JSON has no infinite
-- numbers: they are the texts @"inf"@ and @"-inf"@, and NaN is @"nan"@.
number :: Double -> Encoding
number x
  | isNaN x = text "nan"
  | isInfinite x = text (if x > 0 then "inf" else "-inf")
  | x == 0 = unsafeToEncoding (char7 '0')
  | x == fromInteger whole, abs x < 1e15 = unsafeToEncoding (string7 (show whole))
  | abs x >= 1e-9, abs x < 1e15 = unsafeToEncoding (string7 (showFFloat Nothing x ""))
  | otherwise = unsafeToEncoding (string7 (show x))
 where
  whole = truncate x :: Integer

-- | A time in whole nanoseconds. Infinite ones, and those of damaged recordings, are limited to what fits a number of
-- 64 bits: some 126 years.
nanoseconds :: Seconds -> Integer
nanoseconds (Seconds t)
  | isNaN t = 0
  | otherwise = round (max (-4e9) (min 4e9 t) * 1e9)
