-- |
-- The operators in a monad of the user's own: each is there, and carries the environment into all its
-- branches. (What it does is tested for the original.)
module Behavior.UnliftIOSpec (spec) where

import Control.Monad (forM, forM_, void)
import Control.Monad.IO.Class (liftIO)
import Control.Monad.Trans.Reader (ReaderT (..), local)
import Data.List (isInfixOf, isPrefixOf, sort, (\\))
import Data.Map (empty)
import System.Mem.Weak (finalize)
import Test.Hspec hiding (parallel)

import Behavior.UnliftIO
import Behavior.UnliftIO.Message
import Behavior.UnliftIO.Parallel
import Behavior.UnliftIO.STM
import qualified Behavior.UnliftIO.Signal as Signal
import Behavior.UnliftIO.Time
import qualified Behavior.UnliftIO.Trace as Trace
import Support (Fault (..), Log, guarded, newLog, note, notes)

-- | The environment: a number, and a log of the numbers that were seen.
type Mission = ReaderT (Int, Log Int) IO

spec :: Spec
spec = guarded $ do
  describe "exports what the original does:" $
    forM_ parts $ \part ->
      it ("Behavior" ++ part) $ do
        original <- exportsOf ("src/" ++ pathOf ("Behavior" ++ part))
        lifted <- exportsOf ("src/unliftio/" ++ pathOf ("Behavior.UnliftIO" ++ part))
        original \\ lifted `shouldBe` []
        original `shouldSatisfy` (not . null)

  describe "runs in the monad, with its environment," $
    forM_ places $ \(name, which) ->
      it name $ forM_ which $ \place -> do
        seen <- newLog
        let act = ReaderT (\(n, entries) -> note entries n)
        runReaderT (local (\(n, entries) -> (n + 1, entries)) (place act)) (6, seen)
        found <- notes seen
        (found, all (== 7) found) `shouldSatisfy` \(these, right) -> not (null these) && right

  it "each operator that takes a behaviour" $ do
    let qualifier part = if part `elem` [".Signal", ".Trace"] then drop 1 part ++ "." else ""
        source part = (,) (qualifier part) <$> readFile ("src/unliftio/" ++ pathOf ("Behavior.UnliftIO" ++ part))
    sources <- forM parts source
    let operators =
          [ qualified ++ filter (`notElem` "()") name
          | (qualified, code) <- sources
          , name : "::" : _ <- map words (filter (isInfixOf "MonadUnliftIO") (lines code))
          ]
    sort operators `shouldBe` sort (map fst places)

-- | What follows @Behavior@ in the names of the modules.
parts :: [String]
parts = ["", ".Message", ".Parallel", ".Signal", ".STM", ".Time", ".Trace"]

-- | Each place in which an operator runs a behaviour.
places :: [(String, [Mission () -> Mission ()])]
places =
  [ ("runBehavior", [runBehavior])
  , ("fallback", [(`fallback` failed), fallback failed])
  , ("?", [(? failed), (failed ?)])
  , ("fallbackWith", [\act -> fallbackWith act (const failed), fallbackWith failed . const])
  , ("fallbackOver", [fallbackOver [()] . const])
  , ("attempt", [attempt 1])
  , ("parallel", [(`parallel` sleepForever), parallel sleepForever])
  , ("|||", [(||| sleepForever), (sleepForever |||)])
  , ("both", [(`both` pure ()), both (pure ())])
  , ( "rSelect"
    , [ \act -> rSelect (True <$ act) (pure ()) failed
      , \act -> rSelect (pure True) act failed
      , rSelect (pure False) failed
      ]
    )
  , ( "monitor"
    , [ \act -> monitor (False <$ act) failed (pure ())
      , \act -> once (\var recovered -> monitor (atomically (readTVar var)) (act >> recovered) (pure ()))
      , monitor (pure False) failed
      ]
    )
  , ("failingOn", [failingOn (== Fault "none")])
  , ("tryAny", [void . tryAny])
  , ("catchAny", [(`catchAny` const failed), catchAny failed . const])
  , ("firstOf", [\act -> firstOf [sleepForever, act]])
  , ("allOf", [\act -> void (allOf [pure (), act])])
  , ("decide", [\act -> decide (fmap (const (pure ())) . sequence) [act, act], \act -> decide (const (Just act)) []])
  , ("agreeing", [\act -> void (agreeing 1 (==) [act, sleepForever])])
  , ("scoped", [scoped . const])
  , ("fork", [\act -> scoped (\nursery -> fork nursery act >>= atomically . await)])
  , ("pinned", [pinned])
  , ("unpinned", [unpinned])
  , ("Signal.polling", [\act -> Signal.polling 0.001 (True <$ act) >>= Signal.waitUntil])
  , ("Signal.withShared", [Signal.withShared (pure ()) . const])
  , ("Signal.rSelect", [\act -> Signal.rSelect (pure True) act failed, Signal.rSelect (pure False) failed])
  , ( "Signal.monitor"
    , [ \act -> once (\var recovered -> Signal.monitor (Signal.watching (readTVar var)) (act >> recovered) (pure ()))
      , Signal.monitor (pure False) failed
      ]
    )
  , ("Signal.insteadWhen", [\act -> Signal.insteadWhen (pure True) act failed, Signal.insteadWhen (pure False) failed])
  , ("Signal.pausedWhile", [Signal.pausedWhile (pure False) failed failed, \act -> near act (pure ()), near (pure ())])
  , ("Signal.stoppedWhile", [Signal.stoppedWhile (pure False)])
  , ("Signal.switch", [Signal.switch (pure 'a') . const])
  , ("Signal.teleoReactive", [\act -> Signal.teleoReactive [(pure False, failed), (pure True, act)]])
  , ("Signal.whileHolding", [Signal.whileHolding (pure True)])
  , ("retrying", [retrying []])
  , ("retryingWith", [retryingWith (const failed) [], \act -> retryingWith (const act) [0] failed ? pure ()])
  , ("every", [\act -> every 1 (act >> failed) ? pure ()])
  , ("timeout", [timeout 3600])
  , ("timeoutAt", [timeoutAt (1 / 0)])
  , ("cleanupWithin", [void . cleanupWithin 3600])
  , ("abandoning", [abandoning 3600])
  , ("resumable", [\act -> newTVarIO "a" >>= \left -> resumable left (const act)])
  , ( "resumableFor"
    , [\act -> newTVarIO empty >>= \progress -> resumableFor progress 'k' "a" (const act) >>= atomically]
    )
  , ("mkWeakTVar", [\act -> newTVarIO 'a' >>= (`mkWeakTVar` act) >>= liftIO . finalize])
  , ("mkWeakTMVar", [\act -> newTMVarIO 'a' >>= (`mkWeakTMVar` act) >>= liftIO . finalize])
  , ("withTSem", [\act -> atomically (newTSem 1) >>= (`withTSem` act)])
  , ( "withInbox"
    , [ \act -> withInbox 1 (const (pure () <$ act)) (const (pure ()))
      , \act -> withInbox 1 (const (pure act)) (const (pure ()))
      , withMessage . const
      ]
    )
  , ( "onMessage"
    , [ \act -> withMessage (\inbox -> onMessage inbox (\() -> pure () <$ act) (pure ()))
      , \act -> withMessage (\inbox -> atomically (receive inbox) >> onMessage inbox (const failed) act)
      ]
    )
  , ( "messageRule"
    , [ \act -> withMessage $ \inbox ->
          messageRule inbox (\() -> pure () <$ act) >>= \rule ->
            Signal.teleoReactive [rule, (pure True, pure ())]
      ]
    )
  , ("handleNext", [\act -> withMessage (`handleNext` (\() -> pure () <$ act))])
  , ("Trace.named", [Trace.named "name"])
  , ("Trace.withTrace", [Trace.withTrace []])
  , ("Trace.withTraceOptions", [Trace.withTraceOptions Trace.defaultTraceOptions []])
  , ("Trace.adopt", [\act -> Trace.adopt >>= ($ act)])
  ]
 where
  -- With a condition that is true until the second argument is run.
  once body = newTVarIO True >>= \var -> body var (atomically (writeTVar var False))
  -- The condition becomes true when the behaviour has begun, which ends when it is paused.
  near pause resume = do
    var <- newTVarIO False
    paused <- newTVarIO False
    let become which = atomically (writeTVar which True)
    Signal.pausedWhile
      (Signal.watching (readTVar var))
      (pause >> become paused)
      resume
      (become var >> atomically (readTVar paused >>= check))
  withMessage = withInbox 1 (\deliver -> pure () <$ liftIO (deliver ()))

-- | The file of a module.
pathOf :: String -> FilePath
pathOf = (++ ".hs") . map (\c -> if c == '.' then '/' else c)

-- | What a module exports.
exportsOf :: FilePath -> IO [String]
exportsOf path = do
  text <- readFile path
  let list = takeWhile (/= "  ) where") (dropWhile (not . isPrefixOf "  (") (lines text))
  pure [export | ' ' : ' ' : c : ' ' : export <- list, c `elem` "(,", not ("--" `isPrefixOf` export)]
