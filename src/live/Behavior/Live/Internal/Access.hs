{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The access to a live page: no other web page reads it, and beyond this machine no reader without the token.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Access
  ( refusedHost
  , refusedOrigin
  , isToken
  ) where

import Data.Bits (xor, (.|.))
import Data.ByteString (ByteString)
import qualified Data.ByteString as Bytes
import qualified Data.ByteString.Char8 as Char8
import Data.Char (isDigit)
import Data.Foldable (foldl')
import Data.Text (Text)
import Data.Text.Encoding (encodeUtf8)

import Behavior.Internal.Loopback (isLoopback)

-- | Why a request with this header @Host@ is refused, if it is: under another name than one of this machine, a web
-- page from elsewhere could read the answer (its author decides which address that name has). Any port is allowed:
-- that of a tunnel is another one.
--
-- >>> map (maybe "allowed" (const "refused") . refusedHost . Just) ["localhost:8420", "[::1]:9000", "evil.example"]
-- ["allowed","allowed","refused"]
refusedHost :: Maybe ByteString -> Maybe String
refusedHost given = case given of
  Just host | Just name <- withoutPort host, isLoopback (Char8.unpack name) -> Nothing
  _ -> Just ("the host must be localhost, 127.0.0.1 or [::1] (use a tunnel: ssh -L), not " ++ maybe "none" show given)

withoutPort :: ByteString -> Maybe ByteString
withoutPort host = if Bytes.null port || isPort port then Just name else Nothing
 where
  (name, port)
    | "[" `Bytes.isPrefixOf` host = Bytes.splitAt (1 + Bytes.length (Char8.takeWhile (/= ']') host)) host
    | otherwise = Char8.break (== ':') host
  isPort text = Bytes.length text > 1 && Char8.head text == ':' && Char8.all isDigit (Bytes.drop 1 text)

-- | Why a websocket with these headers @Host@ and @Origin@ is refused, if it is: the page that opens it must come from
-- here. A client that is no browser sends no @Origin@, and is refused unless it will show a token.
--
-- >>> let refused = maybe "allowed" (const "refused")
-- >>> [refused (refusedOrigin False (Just "localhost:8420") o) | o <- [Just "http://localhost:8420", Just "null", Nothing]]
-- ["allowed","refused","refused"]
-- >>> refused (refusedOrigin True (Just "localhost:8420") Nothing)
-- "allowed"
refusedOrigin :: Bool -> Maybe ByteString -> Maybe ByteString -> Maybe String
refusedOrigin hasToken host origin = case origin of
  Nothing
    | hasToken -> Nothing
    | otherwise -> Just "without a header Origin, a reader must show a token, and this page has none"
  Just given
    | given `elem` [scheme <> own | Just own <- [host], scheme <- ["http://", "https://"]] -> Nothing
    | otherwise -> Just ("the page that reads must come from here, and not from " ++ show given)

-- | Whether they are equal. How long that takes depends on the shown one's length alone.
isToken :: Text -> Text -> Bool
isToken token shown = differences == 0 && Bytes.length right == Bytes.length given
 where
  (right, given) = (encodeUtf8 token, encodeUtf8 shown)
  padded = Bytes.unpack right ++ repeat 0
  differences = foldl' (.|.) 0 (zipWith xor padded (Bytes.unpack given))
