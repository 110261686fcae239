-- |
-- The events of a real run, and what must hold of all events.
module Trace.Traced
  ( traceOf
  , tracedWith
  , cancellingSelf
  , parentsOf
  , checkSpans
  , spanMistakes
  ) where

import Control.Concurrent (forkIO, killThread, myThreadId, throwTo)
import Control.Exception (SomeException, bracket, try)
import Data.IORef (modifyIORef', newIORef, readIORef)
import qualified Data.IntMap.Strict as IntMap
import Test.Hspec

import Behavior
import Behavior.Trace
import Support (Cancel (..))

-- | Runs the behaviour in a trace: how it ended, and the events.
traceOf :: Behavior a -> IO (Either SomeException a, [Event])
traceOf = tracedWith defaultTraceOptions

tracedWith :: TraceOptions -> Behavior a -> IO (Either SomeException a, [Event])
tracedWith options act = do
  seen <- newIORef []
  end <- try (withTraceOptions options {waitAtEnd = 1 / 0} [EachEvent (\event -> modifyIORef' seen (event :))] act)
  (,) end . reverse <$> readIORef seen

-- | Runs the action, and throws a cancellation to it when the first action has returned.
cancellingSelf :: IO () -> IO a -> IO a
cancellingSelf first act = do
  self <- myThreadId
  bracket (forkIO (first >> throwTo self (Cancel "user"))) killThread (const act)

-- | The name of each span, in the order in which they began, and that of its parent.
parentsOf :: [Event] -> [(String, Maybe String)]
parentsOf seen = [(spanName s, parent (spanParent s)) | Began s <- seen]
 where
  parent (Inside n) = Just (IntMap.findWithDefault "a span that did not begin" n known)
  parent _ = Nothing
  known = IntMap.fromList [(spanNumber s, spanName s) | Began s <- seen]

-- | Expects that there is no mistake.
checkSpans :: [Event] -> Expectation
checkSpans seen = spanMistakes seen `shouldBe` []

-- | What is wrong with these events of a trace in which everything has ended: each span begins once,
-- and ends once, inside its parent.
spanMistakes :: [Event] -> [String]
spanMistakes seen =
  [show s ++ " began " ++ show n ++ " times" | (s, n) <- counted [spanNumber s | Began s <- seen], n /= 1]
    ++ [show s ++ " ended " ++ show n ++ " times" | (s, n) <- counted [spanNumber s | Ended s _ _ <- seen], n /= 1]
    ++ ["did not end: " ++ spanName s | Began s <- seen, IntMap.notMember (spanNumber s) ends]
    ++ ["did not begin: " ++ spanName s | Ended s _ _ <- seen, IntMap.notMember (spanNumber s) begins]
    ++ [ "differs at its end: " ++ spanName s
       | (_, Ended s _ _) <- numbered
       , Just (_, s') <- [IntMap.lookup (spanNumber s) begins]
       , s /= s'
       ]
    ++ concat [outside s at parent | (at, Began s) <- numbered, Inside parent <- [spanParent s]]
    ++ ["ended before it began: " ++ spanName s | Ended s t _ <- seen, t < spanBegan s]
 where
  numbered = zip [0 :: Int ..] seen
  begins = IntMap.fromList [(spanNumber s, (at, s)) | (at, Began s) <- numbered]
  ends = IntMap.fromList [(spanNumber s, (at, t)) | (at, Ended s t _) <- numbered]
  counted ns = IntMap.toList (IntMap.fromListWith (+) [(n, 1 :: Int) | n <- ns])
  outside s at parent =
    case (IntMap.lookup parent begins, IntMap.lookup parent ends, IntMap.lookup (spanNumber s) ends) of
    (Just (begunAt, p), Just (endAt, endTime), Just (childEnd, childTime)) ->
      [ spanName s ++ " is not within " ++ spanName p
      | at < begunAt || childEnd > endAt || spanBegan s < spanBegan p || childTime > endTime
      ]
    _ -> [spanName s ++ " has a parent that is not there"]
