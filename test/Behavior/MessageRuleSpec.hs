-- |
-- Messages as one of ordered rules: each is handled once, whatever rule comes before it, and nothing spins.
module Behavior.MessageRuleSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception hiding (handle)
import Control.Monad (forever, replicateM_, unless, void)
import Data.Foldable (for_, traverse_)
import Data.IORef
import Data.List (sort)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)

import Behavior
import Behavior.Message
import Behavior.STM (atomically)
import Behavior.Signal (Signal)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Plan, exhaustively, explore, randomly, simulate)
import Support

spec :: Spec
spec = guarded $ do
  describe "messageRule" rule
  describe "A drone that flees, handles detections, and patrols" drone
  describe "unhandled" counting

rule :: Spec
rule = do
  prop "is onMessage around the rules that come after it" $ \messages a b ->
    sameAs
      (\entries -> withInbox 9 (delivering messages) $ \box -> onMessage box (handler entries b) (play entries a))
      ( \entries -> withInbox 9 (delivering messages) $ \box ->
          messageRule box (handler entries b) >>= \handling ->
            Signal.teleoReactive [(pure False, hang), handling, (pure True, play entries a)]
      )

  it "ends the rules with the handler's failure, fault, or cancellation; then the message waits again" $
    for_ [failed, throwIO (Fault "arm"), throwIO (Cancel "user")] $ \how ->
      withInbox 9 (delivering "ab") $ \box -> do
        expected <- ending (how :: IO ())
        handling <- messageRule box (const (pure () <$ how))
        ending (Signal.teleoReactive [handling, (pure True, hang)]) `shouldReturn` expected
        atomically ((,) <$> unhandled box <*> receive box) `shouldReturn` (2, 'a')

  it "can be interrupted by a rule before it while its transaction retries; then the message waits again" $ do
    danger <- newTVarIO False
    entered <- newGate
    withInbox 9 (delivering "a") $ \box -> do
      handling <- messageRule box (\_ -> retry <$ open entered)
      withThread (pass entered >> atomically (writeTVar danger True)) . const $
        Signal.teleoReactive
          [(Signal.watching (readTVar danger), atomically (receive box)), handling, (pure True, pure 'p')]
          `shouldReturn` 'a'

  it "drops the message that a rule before it interrupts, if newer ones have filled the inbox" $ do
    callback <- newIORef (\_ -> pure ())
    danger <- newTVarIO False
    done <- newTVarIO ""
    withInbox 1 (\deliver -> pure () <$ (writeIORef callback deliver >> deliver 'a')) $ \box -> do
      deliver <- readIORef callback
      let handle m
            | m == 'a' = deliver 'b' >> atomically (writeTVar danger True) >> hang
            | otherwise = pure (modifyTVar' done (m :))
          flee = atomically (writeTVar danger False) >> hang
      handling <- messageRule box handle
      let counted = atomically ((,,) <$> readTVar done <*> dropped box <*> unhandled box)
      Signal.teleoReactive [(Signal.watching (readTVar danger), flee), handling, (pure True, counted)]
        `shouldReturn` ("b", 1, 0)

  it "is interrupted by a rule before it also if the handler completes nevertheless" $ do
    done <- newTVarIO ""
    danger <- newTVarIO False
    _ <- explore (randomly 100) $ \simulated -> do
      atomically (writeTVar done "" >> writeTVar danger False)
      _ <- simulated . withInbox 9 (delivering "ab") $ \box -> do
        handling <- messageRule box (\m -> modifyTVar' done (m :) <$ (try (sleep 9) :: IO (Either SomeException ())))
        Signal.teleoReactive [(Signal.watching (readTVar danger), sleep 1), handling]
          `both` (sleep 1 >> atomically (writeTVar danger True))
      readTVarIO done `shouldReturn` "a"
    pure ()

  it "of several inboxes handles those of the first rule first" $ do
    entries <- newLog
    withInbox 9 (delivering "a") $ \first -> withInbox 9 (delivering "x") $ \second -> do
      let told m = note entries [m] >> pure (pure ())
      urgent <- messageRule first told
      other <- messageRule second told
      Signal.teleoReactive [urgent, other, (pure True, pure ())]
    notes entries `shouldReturn` ["a", "x"]

  it "lets the rules after it run while another robot handles the only message" $ do
    patrols <- newIORef (0 :: Int)
    handled <- newIORef (0 :: Int)
    _ <- explore (randomly 100) $ \simulated -> do
      writeIORef patrols 0
      writeIORef handled 0
      _ <- simulated . withInbox 9 (delivering "a") $ \box -> do
        let robot = do
              handling <- messageRule box (\_ -> sleep 10 >> pure () <$ modifyIORef' handled (+ 1))
              Signal.teleoReactive [handling, (pure True, forever (sleep 1 >> modifyIORef' patrols (+ 1)))]
        (robot `both` robot) ||| sleep 9.5
      (,) <$> readIORef patrols <*> readIORef handled >>= (`shouldBe` (9, 0))
    pure ()

  it "lets several robots share an inbox, on real threads: each message is handled by one" $ do
    done <- newTVarIO []
    withInbox 1000 (delivering [1 .. 300 :: Int]) $ \box -> do
      let robot = messageRule box (\m -> yield >> pure (modifyTVar' done (m :))) >>= \handling ->
            Signal.teleoReactive [handling, (pure True, hang)]
      (robot `both` robot) ||| atomically (readTVar done >>= check . (== 300) . length)
    sort <$> readTVarIO done `shouldReturn` [1 .. 300]
 where
  handler entries script m = do
    note entries [m]
    pure () <$ play entries script

-- | How a robot handles messages as one of its rules.
type Way = Inbox Int -> (Int -> Behavior (STM ())) -> Behavior (Signal Bool, Behavior ())

drone :: Spec
drone = do
  it "handles each of three once, under random schedules" $ wrong (randomly 300) three messageRule `shouldReturn` []
  it "handles one once, under all schedules with one pre-emption" $
    wrong (exhaustively 1) [[Message 1, Danger]] messageRule `shouldReturn` []
  it "does so too with the condition that a message is unhandled, if it alone takes them" $
    wrong (randomly 300) three conditioned `shouldReturn` []
  it "loses some if its rule receives them" $
    wrong (randomly 100) three received >>= (`shouldContain` ["1 was committed 0 times"])
  it "handles some twice if they are taken when its handler has returned" $
    wrong (randomly 300) three takenAtReturn >>= (`shouldContain` ["1 was committed 2 times"])

  it "ends after one message if its rule returns" $ do
    begun <- newIORef (0 :: Int)
    _ <- simulate . withInbox 9 (delivering [1, 2 :: Int]) $ \box ->
      Signal.teleoReactive
        [ (someUnhandled box, handleNext box (\_ -> modifyIORef' begun (+ 1) >> sleep 1 >> pure (pure ())))
        , (pure True, sleep 5)
        ]
    readIORef begun `shouldReturn` 1

  it "on real threads: handles each of 300 once, in order, and begins none again without an interruption" $ do
    danger <- newTVarIO False
    done <- newTVarIO []
    begun <- newIORef (0 :: Int)
    dangers <- newIORef (0 :: Int)
    withInbox 1000 (delivering [1 .. 300 :: Int]) $ \box -> do
      handling <- messageRule box $ \m -> modifyIORef' begun (+ 1) >> yield >> pure (modifyTVar' done (m :))
      let flee = forever (atomically (readTVar danger >>= check) >> yield >> atomically (writeTVar danger False))
          alarms = forever $ do
            replicateM_ 3 yield >> modifyIORef' dangers (+ 1)
            atomically (writeTVar danger True) >> atomically (readTVar danger >>= check . not)
          untilAllAreDone = readTVarIO done >>= \committed -> unless (length committed == 300) hang
      alarms
        ||| Signal.teleoReactive
          [(Signal.watching (readTVar danger), flee), handling, (pure True, untilAllAreDone)]
    reverse <$> readTVarIO done `shouldReturn` [1 .. 300]
    (,) <$> readIORef begun <*> readIORef dangers >>= (`shouldSatisfy` \(n, interruptions) -> n <= 300 + interruptions)

-- | What comes, in each second.
type Day = [[News]]

data News = Message Int | Danger

three :: Day
three = [[Message 1], [Danger], [Message 2], [Danger, Message 3]]

-- | What went wrong in one of the schedules. (A message is handled within a second.)
wrong :: Plan -> Day -> Way -> IO [String]
wrong plan day way = do
  mistakes <- newIORef []
  _ <- explore plan $ \simulated -> do
    danger <- newTVarIO False
    done <- newTVarIO []
    begun <- newIORef (0 :: Int)
    callback <- newIORef (\_ -> pure ())
    let handle m = modifyIORef' begun (+ 1) >> sleep 1 >> pure (modifyTVar' done (m :))
        flee = sleep 0.5 >> atomically (writeTVar danger False) >> hang
        comes (Message m) = readIORef callback >>= ($ m)
        comes Danger = atomically (writeTVar danger True)
    _ <- simulated . withInbox 5 (\deliver -> pure () <$ writeIORef callback deliver) $ \box -> do
      handling <- way box handle
      Signal.teleoReactive [(Signal.watching (readTVar danger), flee), handling, (pure True, hang)]
        ||| (for_ day (\news -> sleep 1 >> traverse_ comes news) >> sleep 9)
    committed <- readTVarIO done
    n <- readIORef begun
    let messages = [m | Message m <- concat day]
        miscounted =
          [ show m ++ " was committed " ++ show k ++ " times"
          | m <- messages
          , let k = length (filter (== m) committed)
          , k /= 1
          ]
        -- An interruption makes one begin again; so may the commit of the message before it.
        tooMany =
          [ "handlers began " ++ show n ++ " times"
          | n > 2 * length messages + length [() | Danger <- concat day]
          ]
    modifyIORef' mistakes ((miscounted ++ tooMany) ++)
  readIORef mistakes

someUnhandled :: Inbox e -> Signal Bool
someUnhandled box = (> 0) <$> Signal.watching (unhandled box)

-- | From the parts.
conditioned :: Way
conditioned box handle = pure (someUnhandled box, forever (handleNext box handle))

-- | The first mistake: what was received waits no longer.
received :: Way
received box handle = pure (someUnhandled box, forever (atomically (receive box) >>= handle >>= atomically))

-- | The second: the handler's transaction and the removal are two steps.
takenAtReturn :: Way
takenAtReturn box handle = do
  known <- newTVarIO Nothing
  let peek = readTVar known >>= maybe (receive box >>= \m -> m <$ writeTVar known (Just m)) pure
      some = (||) <$> anyUnhandled <*> (not . null <$> readTVar known)
      anyUnhandled = (> 0) <$> unhandled box
  pure
    ( Signal.watching some
    , forever (atomically peek >>= handle >>= atomically >> atomically (writeTVar known Nothing))
    )

counting :: Spec
counting = do
  it "counts a message until its transaction is committed, and again when its handler was interrupted" $
    withInbox 9 (delivering "ab") $ \box -> do
      let count = atomically (unhandled box)
      count `shouldReturn` 2
      handleNext box (\_ -> pure <$> count) `shouldReturn` 2
      count `shouldReturn` 1
      _ <- ending (handleNext box (const failed) :: Behavior ())
      count `shouldReturn` 1
      void (atomically (receive box))
      count `shouldReturn` 0

  it "counts a message that a rule handles, for the whole inbox" $ do
    counted <- newTVarIO 0
    withInbox 9 (delivering "a") $ \box -> do
      handling <- messageRule box (\_ -> writeTVar counted <$> atomically (unhandled box))
      Signal.teleoReactive [handling, (pure True, pure ())]
    readTVarIO counted `shouldReturn` 1

  it "no longer counts a message where the effect of its transaction is seen" $
    void . explore (exhaustively 1) $ \simulated -> do
      done <- newTVarIO False
      found <- newIORef (-1)
      _ <- simulated . withInbox 9 (delivering "a") $ \box ->
        handleNext box (\_ -> pure (writeTVar done True))
          `both` (atomically (readTVar done >>= check >> unhandled box) >>= writeIORef found)
      readIORef found `shouldReturn` 0

  it "is zero when all that was delivered has been handled" $ do
    done <- newTVarIO ""
    withInbox 9 (delivering "abc") $ \box -> do
      let robot = forever (handleNext box (\m -> yield >> pure (modifyTVar' done (m :))))
      robot ||| robot ||| Signal.waitUntil ((== 0) <$> Signal.watching (unhandled box))
    sort <$> readTVarIO done `shouldReturn` "abc"

-- | A driver that delivers the messages as soon as it is subscribed to.
delivering :: [e] -> (e -> IO ()) -> IO (IO ())
delivering messages deliver = pure () <$ traverse_ deliver messages
