-- |
-- What a terminal shows.
module Viewer.Screen
  ( screen
  , screenOf
  ) where

import Data.ByteString (ByteString)
import Data.Char (isDigit)
import qualified Data.Text as Text
import Data.Text.Encoding (decodeUtf8With)
import Data.Text.Encoding.Error (lenientDecode)

-- | The lines that a terminal shows to which this was written.
screen :: ByteString -> [String]
screen = screenOf . Text.unpack . decodeUtf8With lenientDecode

-- | What a terminal shows after this output: it knows the sequences that a frame may contain, and no
-- other ones.
screenOf :: String -> [String]
screenOf = go [] "" "" []
 where
  -- The lines above the cursor (the nearest first), the text before it (reversed) and after it in
  -- its line, and the lines below.
  go above before behind below output = case output of
    '\ESC' : '[' : rest
      | (digits, command : rest') <- span (\c -> isDigit c || c == ';') rest -> case command of
          'F'
            | (passed, line : above') <- splitAt (read digits - 1) above ->
                go above' "" line (reverse passed ++ [reverse before ++ behind] ++ below) rest'
          'K' -> go above before "" below rest'
          'J' -> go above before "" [] rest'
          'm' -> go above before behind below rest'
          _ -> ["unknown sequence " ++ show (digits, command)]
    '\r' : rest -> go above "" (reverse before ++ behind) below rest
    '\n' : rest -> go ((reverse before ++ behind) : above) "" (concat (take 1 below)) (drop 1 below) rest
    c : rest
      | c < ' ' -> ["unknown character " ++ show c]
      | otherwise -> go above (c : before) (drop 1 behind) below rest
    [] -> reverse above ++ filter (not . null) ((reverse before ++ behind) : below)
