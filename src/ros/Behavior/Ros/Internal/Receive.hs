{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- What comes from a bridge: for which topic, goal or call it is.
--
-- Internal: any of it may change in any release.
module Behavior.Ros.Internal.Receive
  ( take
  , refuse
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Monad (unless, when)
import Data.Aeson (Value (String))
import Data.Char (isPrint)
import Data.Foldable (for_, toList, traverse_)
import qualified Data.Map.Strict as Map
import Data.Maybe (isJust, isNothing)
import qualified Data.Text as Text
import Prelude hiding (take)

import Behavior (Seconds)
import Behavior.Ros.Internal.Frame
import Behavior.Ros.Internal.Link
import Behavior.Ros.Internal.Message (decoded)
import Behavior.Ros.Internal.Options
import Behavior.Ros.Internal.Sent
import Behavior.Ros.Internal.Status

-- | Takes what came from the bridge at this time, in a frame of this size.
take :: Ros -> Seconds -> Int -> Answer -> STM ()
take ros time bytes answer = do
  allowed <- maximum . (frameBytes (rosOptions ros) :) <$> case answer of
    Message name _ -> traverse (readTVar . bytesWanted) . toList . Map.lookup name =<< readTVar (kept ros)
    _ -> pure []
  if bytes > allowed then refuse ros (tooLarge bytes allowed) else takeAnswer ros time answer

takeAnswer :: Ros -> Seconds -> Answer -> STM ()
takeAnswer ros time answer = case answer of
  Message name value -> do
    topic <- Map.lookup name <$> readTVar (kept ros)
    for_ topic $ \known -> do
      modifyTVar' (arrivals known) (+ 1)
      n <- readTVar (arrivals known)
      writeTVar (newest known) (Just (Arrival n time value))
      readTVar (receivers known) >>= traverse_ ($ value)
    case Text.stripSuffix "/_action/status" name of
      -- (That is subscribed to also where no signal has asked for it.)
      Just action -> takeStatus action value
      Nothing -> when (isNothing topic) (unawaited "a message on" name)
  -- By its id: the result of another goal, which may come late, is not taken for that of this one.
  Result n status values ->
    goal n >>= maybe (unawaited "a result for" n) (\known -> known `endWith` Ended status values >> forget n)
  Feedback n values ->
    goal n >>= maybe (unawaited "feedback for" n) (\known -> writeTVar (feedback known) (Just values))
  Response n can values ->
    call n >>= maybe (unawaited "an answer to" n) (`setOnce` if can then Answered values else Refused values)
  Complaint (Just n) why -> do
    called <- call n
    for_ called (`setOnce` Refused (String why))
    goal n >>= \case
      Nothing -> unless (isJust called) . report ros $ "the bridge complains: " ++ Text.unpack why
      Just known ->
        -- (It may be about a cancel that came too early, and the goal goes on.)
        readTVar (cancelled known) >>= \is -> unless is (known `endWith` Complained why >> forget n)
  Complaint Nothing why -> report ros ("the bridge complains: " ++ Text.unpack why)
  Other "status" -> pure ()
  Other name -> refuse ros ("a frame that rosbridge does not send: op " ++ show name)
 where
  unawaited what n = refuse ros (what ++ " " ++ show n ++ ", which nothing awaits")
  goal n = Map.lookup n <$> readTVar (sent ros)
  call n = Map.lookup n <$> readTVar (calls ros)
  forget n = modifyTVar' (sent ros) (Map.delete n)
  -- (Goals that were sent in this connection may not have come to their server yet.)
  takeStatus action value = case decoded value of
    Left why -> refuse ros why
    Right (Statuses goals) -> do
      connection <- connections <$> readTVar (link ros)
      known <- readTVar (sent ros)
      let ours = Map.filter (\one -> sentTo one == action && sentIn one < connection) known
      for_ (Map.toList ours) $ \(n, one) -> do
        by <- readTVar (arrivedBy one)
        let none = all (hasEnded . snd) goals
        if none && time >= by then forget n else writeTVar (isAbsent one) none

-- | Counts a frame that was refused, and reports why.
refuse :: Ros -> String -> STM ()
refuse ros why = modifyTVar' (refused ros) (+ 1) >> report ros ("refused: " ++ why)

-- | Hands the line to the user; or counts it, if too many wait.
report :: Ros -> String -> STM ()
report ros line = do
  full <- isFullTBQueue (reports ros)
  if full then modifyTVar' (leftOut ros) (+ 1) else swapTVar (leftOut ros) 0 >>= (writeTBQueue (reports ros) $!) . with
 where
  with n = if n == 0 then brief line else brief line ++ " (and " ++ show n ++ " lines before it were left out)"

-- | One line that is not long, whatever the bridge has put into it; and nothing else of the frame is kept for it.
brief :: String -> String
brief line = foldr (strictly . printable) (if null rest then "" else "...") start
 where
  strictly c later = c `seq` later `seq` c : later
  (start, rest) = splitAt 200 line
  printable c = if isPrint c then c else ' '
