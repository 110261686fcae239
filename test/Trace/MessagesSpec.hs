-- |
-- The traces of programs that handle messages, under random schedules.
module Trace.MessagesSpec
  ( spec
  , messagesTraced
  ) where

import Data.Foldable (for_)
import Data.IORef
import Data.List (isPrefixOf, sort)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior (both, sleep)
import Behavior.Internal.Inbox (onMessage, withInbox)
import Behavior.Sim (Schedule (..))
import qualified Behavior.Sim as Sim
import Behavior.Time (timeout)
import Behavior.Trace
import Support (leavingNothing)

spec :: Spec
spec = around_ leavingNothing $ prop "of messages and their handlers are right" messagesTraced

-- | Messages come at random times; handlers take a random time each.
messagesTraced :: Property
messagesTraced =
  forAll ((,,) <$> (choose (0, 5) >>= \n -> vectorOf n (choose (0, 3))) <*> choose (0, 2) <*> arbitrary) $ \(pauses, takes, seed) -> ioProperty $ do
    run <- Sim.simulateWith Sim.defaultSimOptions {Sim.scheduled = Seeded seed} (mission pauses (fromIntegral (takes :: Int)))
    let spans = [s | Began s <- Sim.events run]
        ended = [(s, how) | Ended s _ how <- Sim.events run]
        reactions = [r | Reacted r <- Sim.events run]
        spanOf n = [s | s <- spans, Inside (spanNumber s) == n]
        calls name = [(s, how) | (s, how) <- ended, spanKind s == Named, name `isPrefixOf` spanName s]
        -- The names and kinds around a span, the innermost first.
        around' s = concat [(spanKind p, spanName p) : around' p | p <- spanOf (spanParent s)]
        inWatch branch = [(Branch, branch), (Operator, "onMessage"), (Named, "watch"), (Branch, "both: right"), (Operator, "both"), (Named, "mission"), (Branch, "timeout: branch"), (Operator, "timeout")]
        startedBy' s = [r | b <- spanOf (spanParent s), r <- reactions, Just (reactionNumber r) == spanReaction b]
        message n = "handle " ++ show n
    pure . counterexample (unlines (map show (Sim.events run))) $
      conjoin
        [ counterexample "each message is handled once" (sort [spanName s | (s, Succeeded) <- calls "handle"] === map message [1 .. length pauses])
        , counterexample "each span has one end" (sort (map (spanNumber . fst) ended) === sort (map spanNumber spans))
        , conjoin [counterexample "a handler is in its branch" (around' s === inWatch "onMessage: handler") | (s, _) <- calls "handle"]
        , conjoin [counterexample "a task is in its branch" (around' s === inWatch "onMessage: task") | (s, _) <- calls "task"]
        , conjoin [counterexample "what delivers is in its branch" (take 1 (around' s) === [(Branch, "both: left")]) | (s, _) <- calls "deliver"]
        , conjoin
            [ counterexample "a handler is started by a reaction" . property $ case startedBy' s of
                [r] -> reactionStarts r == Just "handler" && reactionOperator r == "onMessage" && [changeSignal c | c <- reactionChanges r, changeAfter c /= "0"] == ["messages waiting"]
                _ -> False
            | (s, _) <- calls "handle"
            ]
        , conjoin
            [ counterexample "a task is stopped by messages, or by the time limit" . property $ case how of
                StoppedBy (SignalChanged n changes) -> [() | r <- reactions, reactionNumber r == n, reactionChanges r == changes, (stoppedName <$> reactionStopped r) == Just "task", reactionStarts r == Just "handler"] == [()]
                StoppedBy (TimeLimit limit) -> limit == 40
                _ -> False
            | (s, how) <- calls "task"
            , s `elem` spans
            ]
        ]
 where
  mission pauses takes = do
    callback <- newIORef (const (pure ()))
    withInbox 10 (\deliver -> writeIORef callback deliver >> pure (pure ())) $ \inbox ->
      timeout 40 . named "mission" $
        both
          (for_ (zip [1 :: Int ..] pauses) $ \(n, t) -> sleep (fromIntegral (t :: Int)) >> named ("deliver " ++ show n) (readIORef callback >>= \deliver -> deliver n))
          (named "watch" (onMessage inbox (\n -> named ("handle " ++ show n) (pure () <$ sleep takes)) (named "task" (sleep 1000))))
