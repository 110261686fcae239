{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE ScopedTypeVariables #-}

-- |
-- Texts that the user's code computes.
--
-- If computing a text throws, of whatever type, that is shown in the text. Texts are evaluated masked, so that an
-- exception of another thread is not taken for the text's: it is received afterwards. (So a text that neither
-- ends nor grows cannot be interrupted.)
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Core.SafeText
  ( safeShow
  , settledText
  ) where

import Control.Exception (SomeException, catch, evaluate, uninterruptibleMask_)
import System.IO.Unsafe (unsafePerformIO)

-- | The text up to the place where computing it throws, and then a remark that it throws: the
-- description of an exception must not throw another one.
safeShow :: String -> String
safeShow text = case evaluated text of
  Just [] -> []
  Just (c : rest) | Just known <- evaluated c -> known : safeShow rest
  _ -> "<its text throws an exception>"
 where
  evaluated :: a -> Maybe a
  evaluated a = orElseWhenItThrows (Just <$> evaluate a) (pure Nothing)

-- | The text, wholly evaluated, and cut if it is long: whatever the user's code does, the result can be compared
-- and written. If computing it throws, it is as of 'safeShow'.
settledText :: String -> String
settledText text = orElseWhenItThrows (whole text) (whole (safeShow text))
 where
  whole t = let cut = limited t in evaluate (foldr seq cut cut)
  limited t = case splitAt textLimit t of
    (_, []) -> t
    (beginning, _) -> beginning ++ " ..."

-- | The result of the first action, or if that throws, of the second.
orElseWhenItThrows :: IO a -> IO a -> a
orElseWhenItThrows first second =
  unsafePerformIO (uninterruptibleMask_ (first `catch` \(_ :: SomeException) -> second))

-- | Longer texts are cut.
textLimit :: Int
textLimit = 10000
