-- |
-- The traces of programs that handle messages: what each message was, and, under random schedules, all the rest.
module Trace.MessagesSpec
  ( spec
  , messagesTraced
  ) where

import Control.Concurrent.STM (STM)
import Control.Monad (forever)
import Data.Foldable (for_, traverse_)
import Data.IORef
import Data.List (isPrefixOf, sort)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck

import Behavior
import Behavior.Message
import qualified Behavior.Signal as Signal
import Behavior.Sim (Schedule (..))
import qualified Behavior.Sim as Sim
import Behavior.Time (timeout)
import Behavior.Trace
import Support (guarded, hang, newGate, open, pass)
import Trace.Traced

spec :: Spec
spec = guarded $ do
  prop "of messages and their handlers are right" messagesTraced

  for_ ways $ \(way, handling) -> describe ("of " ++ way) $ do
    it "show what each message was, and how its handling ended" $ do
      let serve order = if order == "tea" then pure (pure ()) else failWith "spilt"
      (_, seen) <- traceOf . withInbox 9 (delivering ["tea", "milk"]) $ \box ->
        named "serve" (handling (namedInbox "order" box) serve)
      parentsOf seen
        `shouldBe` [("serve", Nothing), ("order: \"tea\"", Just "serve"), ("order: \"milk\"", Just "serve")]
      take 2 [how | Ended _ _ how <- seen] `shouldBe` [Succeeded, FailedWith "the behaviour failed: spilt"]
      checkSpans seen

    it "show that a handler was interrupted, and the message again" $ do
      begun <- newGate
      (_, seen) <- traceOf . withInbox 9 (delivering ["tea"]) $ \box -> do
        let text m = if m == "tea" then m else error "no such text"
        handling (namedInboxWith "order" text box) (\_ -> open begun >> hang) ||| pass begun
        handleNext (namedInboxWith "order" (\m -> text (m ++ "!")) box) (\_ -> pure (pure ()))
      [(spanName s, how) | Ended s _ how <- seen]
        `shouldBe` [ ("order: tea", StoppedBy (SiblingFinished "right"))
                   , ("order: <its text throws an exception>", Succeeded)
                   ]

  it "name the inbox whose messages interrupted something" $ do
    let act box = onMessage box (\_ -> pure (pure ())) (pure ())
        ruled box =
          messageRule box (\_ -> pure (pure ())) >>= \rule -> Signal.teleoReactive [rule, (pure True, pure ())]
    for_ [("order", namedInbox "order"), ("messages", id)] $ \(name, naming) -> do
      (_, seen) <- traceOf . withInbox 9 (delivering "a") $ \box -> act (naming box)
      [reactionChanges r | Reacted r <- seen]
        `shouldBe` [[Change (name ++ " waiting") Nothing "1"], [Change (name ++ " waiting") (Just "1") "0"]]
      (_, ruledSeen) <- traceOf . withInbox 9 (delivering "a") $ \box -> ruled (naming box)
      [reactionChanges r | Reacted r <- ruledSeen] `shouldBe` [[Change (name ++ " unhandled") (Just "1") "0"]]

-- | The ways to have each message handled, until one fails.
ways :: [(String, Inbox String -> (String -> Behavior (STM ())) -> Behavior ())]
ways =
  [ ("handleNext", \box serve -> forever (handleNext box serve))
  , ("onMessage", \box serve -> onMessage box serve hang)
  , ("messageRule", \box serve -> messageRule box serve >>= \rule -> Signal.teleoReactive [rule, (pure True, hang)])
  ]

-- | A driver that delivers the messages as soon as it is subscribed to.
delivering :: [e] -> (e -> IO ()) -> IO (IO ())
delivering messages deliver = pure () <$ traverse_ deliver messages

-- | Messages come at random times; handlers take a random time each.
messagesTraced :: Property
messagesTraced =
  forAll ((,,) <$> (choose (0, 5) >>= \n -> vectorOf n (choose (0, 3))) <*> choose (0, 2) <*> arbitrary) $
    \(pauses, takes, seed) -> ioProperty $ do
      run <-
        Sim.simulateWith
          Sim.defaultSimOptions {Sim.scheduled = Seeded seed}
          (mission pauses (fromIntegral (takes :: Int)))
      let spans = [s | Began s <- Sim.events run]
          ended = [(s, how) | Ended s _ how <- Sim.events run]
          reactions = [r | Reacted r <- Sim.events run]
          spanOf n = [s | s <- spans, Inside (spanNumber s) == n]
          calls name = [(s, how) | (s, how) <- ended, spanKind s == Named, name `isPrefixOf` spanName s]
          -- The names and kinds around a span, the innermost first.
          outer s = concat [(spanKind p, spanName p) : outer p | p <- spanOf (spanParent s)]
          inWatch branch =
            [ (Branch, branch)
            , (Operator, "onMessage")
            , (Named, "watch")
            , (Branch, "both: right")
            , (Operator, "both")
            , (Named, "mission")
            , (Branch, "timeout: branch")
            , (Operator, "timeout")
            ]
          causesOf s = [r | b <- spanOf (spanParent s), r <- reactions, Just (reactionNumber r) == spanReaction b]
          message n = "handle " ++ show n
          inSpanOf s = (Named, "order: " ++ drop (length "handle ") (spanName s))
      pure . counterexample (unlines (map show (Sim.events run))) $
        conjoin
          [ counterexample "each message is handled once" $
              sort [spanName s | (s, Succeeded) <- calls "handle"] === map message [1 .. length pauses]
          , counterexample "each span has one end" (sort (map (spanNumber . fst) ended) === sort (map spanNumber spans))
          , conjoin
              [ counterexample "a handler is in its branch" (outer s === inSpanOf s : inWatch "onMessage: handler")
              | (s, _) <- calls "handle"
              ]
          , conjoin
              [ counterexample "a task is in its branch" (outer s === inWatch "onMessage: task")
              | (s, _) <- calls "task"
              ]
          , conjoin
              [ counterexample "what delivers is in its branch" (take 1 (outer s) === [(Branch, "both: left")])
              | (s, _) <- calls "deliver"
              ]
          , conjoin
              [ counterexample "a handler is started by a reaction" . property $ case causesOf s of
                  [r] ->
                    reactionStarts r == Just "handler"
                      && reactionOperator r == "onMessage"
                      && [changeSignal c | c <- reactionChanges r, changeAfter c /= "0"] == ["order waiting"]
                  _ -> False
              | (s, _) <- calls "order"
              ]
          , conjoin
              [ counterexample "a task is stopped by messages, or by the time limit" . property $ case how of
                  StoppedBy (SignalChanged n changes) ->
                    [ ()
                    | r <- reactions
                    , reactionNumber r == n
                    , reactionChanges r == changes
                    , (stoppedName <$> reactionStopped r) == Just "task"
                    , reactionStarts r == Just "handler"
                    ]
                      == [()]
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
          (for_ (zip [1 ..] pauses) (delivery callback))
          (named "watch" (onMessage (namedInbox "order" inbox) (handler takes) (named "task" (sleep 1000))))
  delivery callback (n, t) = do
    sleep (fromIntegral (t :: Int))
    named ("deliver " ++ show n) (readIORef callback >>= \deliver -> deliver (n :: Int))
  handler takes n = named ("handle " ++ show n) (pure () <$ sleep takes)
