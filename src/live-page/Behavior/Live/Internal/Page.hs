{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE OverloadedStrings #-}
{-# LANGUAGE TemplateHaskell #-}

-- |
-- The files of the page.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Page
  ( pageFile
  , hubFile
  ) where

import Data.ByteString (ByteString)
import Data.FileEmbed (embedFile)
import Data.Text (Text)

-- | The type and the content of the file with this path, at a robot's own server.
pageFile :: [Text] -> Maybe (ByteString, ByteString)
pageFile path = case path of
  [] -> Just robotPage
  _ -> common path

-- | The same at a hub: its page, and that of each robot.
hubFile :: [Text] -> Maybe (ByteString, ByteString)
hubFile path = case path of
  [] -> Just (html, $(embedFile "src/live-page/hub.html"))
  ["robots", _, ""] -> Just robotPage
  ["hub.css"] -> Just (css, $(embedFile "src/live-page/hub.css"))
  ["hub.js"] -> Just (javascript, $(embedFile "src/live-page/hub.js"))
  _ -> common path

robotPage :: (ByteString, ByteString)
robotPage = (html, $(embedFile "src/live-page/live.html"))

common :: [Text] -> Maybe (ByteString, ByteString)
common path = case path of
  ["live.css"] -> Just (css, $(embedFile "src/live-page/live.css"))
  ["live.js"] -> Just (javascript, $(embedFile "src/live-page/live.js"))
  ["page.js"] -> Just (javascript, $(embedFile "src/live-page/page.js"))
  _ -> Nothing

html, css, javascript :: ByteString
html = "text/html; charset=utf-8"
css = "text/css; charset=utf-8"
javascript = "text/javascript; charset=utf-8"
