{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TemplateHaskell #-}

-- |
-- The files of the page.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Page
  ( pageFile
  ) where

import Data.ByteString (ByteString)
import Data.FileEmbed (embedFile)
import Data.Text (Text)

-- | The type and the content of the file with this path.
pageFile :: [Text] -> Maybe (ByteString, ByteString)
pageFile path = case path of
  [] -> Just ("text/html; charset=utf-8", $(embedFile "src/live-page/live.html"))
  ["live.css"] -> Just ("text/css; charset=utf-8", $(embedFile "src/live-page/live.css"))
  ["live.js"] -> Just ("text/javascript; charset=utf-8", $(embedFile "src/live-page/live.js"))
  _ -> Nothing
