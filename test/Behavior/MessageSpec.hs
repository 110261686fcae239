-- |
-- Messages: the inbox, and how each message is handled. Its promises in common with the other
-- operators are in the specs that go through "Places".
module Behavior.MessageSpec (spec) where

import Control.Concurrent (yield)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception hiding (handle)
import Control.Monad (replicateM, replicateM_, unless, void)
import Data.Foldable (for_, traverse_)
import Data.IORef
import Data.List (sort)
import Test.Hspec
import Test.Hspec.QuickCheck (prop)
import Test.QuickCheck (Positive (..))

import Behavior
import Behavior.Message
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Sim (Outcome (Returned), Plan, Run (outcome), exhaustively, explain, explore, randomly, simulate)
import Behavior.Sim.Mock (driver, eventually, happened, newMock, noted, shouldRecord)
import qualified Behavior.Sim.Mock as Mock
import Behavior.Time (now)
import Memory (inConstantMemory)
import Support hiding (eventually, note)
import qualified Support

spec :: Spec
spec = guarded $ do
  describe "An inbox" inbox
  describe "onMessage" handlingEach
  describe "handleNext" handlingOne
  describe "A courier whose orders and battery interrupt it" courier
  describe "A driver of the mock world" mockDriver

inbox :: Spec
inbox = do
  prop "keeps the newest messages, in order, and counts those that it drops" $ \(Positive size) messages ->
    withInbox size (delivering messages) (\box -> atomically ((,,) <$> unhandled box <*> allOf box <*> dropped box))
      `shouldReturn`
        let kept = reverse (take size (reverse (messages :: [Int])))
         in (length kept, kept, length messages - length kept)

  it "refuses a capacity of less than one, and does not subscribe" $ do
    entries <- newLog
    for_ [0, -3] $ \size ->
      ending (withInbox size (\_ -> pure () <$ Support.note entries "subscribed") (\_ -> pure ()))
        `shouldReturn` FaultedWith ("withInbox: an inbox has room for at least 1 message, not " ++ show size)
    notes entries `shouldReturn` []

  it "ends its subscription when the behaviour returns, fails, faults, or is cancelled" $
    for_ [pure (), failed, throwIO (Fault "arm"), throwIO (Cancel "user")] $ \act -> do
      entries <- newLog
      let subscribe _ = Support.note entries "subscribed" >> pure (Support.note entries "unsubscribed")
      _ <- ending (withInbox 1 subscribe (\_ -> act :: IO ()))
      notes entries `shouldReturn` ["subscribed", "unsubscribed"]

  it "ignores what the driver delivers while its subscription ends, and later" $ do
    callback <- newIORef (\_ -> pure ())
    box <- withInbox 9 (\deliver -> deliver 'b' <$ (writeIORef callback deliver >> deliver 'a')) pure
    readIORef callback >>= ($ 'c')
    atomically ((,) <$> allOf box <*> dropped box) `shouldReturn` ("a", 0)

  it "is closed although the end of its subscription faults" $ do
    callback <- newIORef (\_ -> pure ())
    boxes <- newIORef []
    ending
      ( withInbox
          9
          (\deliver -> throwIO (Fault "unsubscribing") <$ writeIORef callback deliver)
          (\box -> writeIORef boxes [box])
      )
      `shouldReturn` FaultedWith (show (Fault "unsubscribing"))
    readIORef callback >>= ($ 'c')
    readIORef boxes >>= traverse (atomically . unhandled) >>= (`shouldBe` [0])

  it "takes a hundred thousand messages that nothing receives in constant memory" $
    inConstantMemory 100000 $ \step ->
      withInbox 3 (\deliver -> pure () <$ replicateM_ 100000 (step >> deliver 'm')) (void . atomically . dropped)

handlingEach :: Spec
handlingEach = do
  prop "without a message is the task" $ \a ->
    sameAs (\entries -> withInbox 1 (delivering "") (\box -> onMessage box (const hang) (play entries a))) (`play` a)

  prop "is monitor with handleNext, when nothing else takes messages" $ \messages a b ->
    sameAs
      (\entries -> withInbox 9 (delivering messages) $ \box -> onMessage box (handler entries b) (play entries a))
      ( \entries -> withInbox 9 (delivering messages) $ \box ->
          Signal.monitor ((> 0) <$> Signal.watching (unhandled box)) (handleNext box (handler entries b))
            (play entries a)
      )

  it "stops the task for each message, handles it, and starts the task again" $ do
    entries <- newLog
    boxes <- newEmptyTMVarIO
    let task = (Support.note entries "task" >> boxed boxes >> hang) `onException` Support.note entries "stopped"
        boxed var = atomically (tryTakeTMVar var) >>= traverse_ ($ "b")
    withInbox 9 (\deliver -> pure () <$ (deliver "a" >> atomically (putTMVar boxes deliver))) $ \box ->
      withThread (onMessage box (\m -> Support.note entries m >> pure (pure ())) task) $ \caller -> do
        Support.eventually ((>= 5) . length <$> notes entries)
        stillRunning caller
    notes entries `shouldReturn` ["a", "task", "stopped", "b", "task", "stopped"]

  it "handles with the message neither lost nor repeated when the handler fails, faults, or is cancelled" $
    for_ [failed, throwIO (Fault "arm"), throwIO (Cancel "user")] $ \how -> do
      done <- newTVarIO ""
      withInbox 9 (delivering "ab") $ \box -> do
        _ <- ending (onMessage box (const how) (pure ()))
        atomically (unhandled box) `shouldReturn` 2
        onMessage box (\m -> pure (modifyTVar' done (m :))) (pure ())
      readTVarIO done `shouldReturn` "ba"

  it "leaves the message in the inbox when its transaction throws" $
    withInbox 9 (delivering "a") $ \box -> do
      ending (onMessage box (\_ -> pure (throwSTM (Fault "commit"))) (pure ()))
        `shouldReturn` FaultedWith (show (Fault "commit"))
      atomically (receive box) `shouldReturn` 'a'

  it "can be interrupted while its transaction retries; then the message waits again" $ do
    entered <- newGate
    withInbox 9 (delivering "a") $ \box -> do
      cancelling (onMessage box (\_ -> retry <$ open entered) (pure ())) (pass entered)
        `shouldReturn` CancelledBy (show (Cancel "the caller"))
      atomically (receive box) `shouldReturn` 'a'

  it "lets several consumers share an inbox: each message is handled by one" $ do
    done <- newTVarIO []
    withInbox 1000 (delivering [1 .. 300 :: Int]) $ \box -> do
      let consume = onMessage box (\m -> yield >> pure (modifyTVar' done (m :))) hang
      (consume `both` consume) ||| atomically (readTVar done >>= check . (== 300) . length)
    sort <$> readTVarIO done `shouldReturn` [1 .. 300]

  it "goes on with its task if another consumer has taken the message" $
    void . explore (randomly 300) $ \simulated -> do
      begun <- newTVarIO (0 :: Int)
      run <- simulated . withInbox 1 (\deliver -> pure () <$ deliver 'a') $ \box -> do
        let consume = onMessage box (\_ -> pure (pure ())) (atomically (modifyTVar' begun (+ 1)) >> hang)
        (consume `both` consume) ||| atomically (readTVar begun >>= check . (== 2))
      explain (outcome run) `shouldBe` explain (Returned ())

  it "puts messages whose handlers were interrupted back in their order" $
    withInbox 9 (delivering "abc") $ \box -> do
      let failing entered mayEnd =
            ending (handleNext box (\_ -> open entered >> pass mayEnd >> failed) :: Behavior ())
      [entered, enteredNext, mayEnd, mayEndNext] <- replicateM 4 newGate
      withThread (failing entered mayEnd) $ \first ->
        pass entered >> withThread (failing enteredNext mayEndNext) (\second -> do
          pass enteredNext
          open mayEnd
          _ <- awaitEnd first
          open mayEndNext
          void (awaitEnd second))
      atomically (allOf box) `shouldReturn` "abc"

  it "drops an interrupted message, and counts it, if newer ones fill the inbox" $ do
    callback <- newIORef (\_ -> pure ())
    withInbox 1 (\deliver -> pure () <$ (writeIORef callback deliver >> deliver 'a')) $ \box -> do
      deliver <- readIORef callback
      -- The one that is being handled is not dropped ...
      ending (handleNext box (\m -> deliver 'b' >> pure ((,) m <$> dropped box))) `shouldReturn` Gave ('a', 0)
      -- ... unless its handler is interrupted, and it has to wait again.
      _ <- ending (handleNext box (\_ -> deliver 'c' >> failed) :: Behavior ())
      atomically ((,) <$> allOf box <*> dropped box) `shouldReturn` ("c", 1)
 where
  handler entries script m = do
    Support.note entries [m]
    pure () <$ play entries script

handlingOne :: Spec
handlingOne = do
  it "waits for a message, and gives the transaction's result" $ do
    callback <- newIORef (\_ -> pure ())
    withInbox 1 (\deliver -> pure () <$ writeIORef callback deliver) $ \box ->
      withThread (handleNext box (\m -> pure (pure [m, m]))) $ \caller -> do
        stillRunning caller
        readIORef callback >>= ($ 'a')
        awaitEnd caller `shouldReturn` Gave "aa"

  it "runs the handler in the caller's masking state" $
    for_ [id, mask_, uninterruptibleMask_] $ \inState -> do
      (seen, here) <- withInbox 1 (delivering "a") $ \box ->
        inState ((,) <$> handleNext box (const (pure <$> getMaskingState)) <*> getMaskingState)
      seen `shouldBe` here

-- | A courier handles orders while its battery becomes low; each order takes a while.
courier :: Spec
courier = do
  it "commits an order exactly once, under all schedules" $
    miscounted (exhaustively 1) oneOrder once `shouldReturn` []
  it "commits each of three exactly once, under random schedules" $
    miscounted (randomly 300) threeOrders once `shouldReturn` []
  it "loses one if the order is taken first" $
    miscounted (randomly 100) threeOrders takenFirst >>= (`shouldContain` [0])
  it "commits one twice if the order is taken when its handler has returned" $
    miscounted (exhaustively 1) oneOrder takenAtReturn >>= (`shouldContain` [2])

  it "on real threads: commits each of 300 exactly once, however often it is interrupted" $ do
    done <- newTVarIO []
    withInbox 1000 (delivering [1 .. 300 :: Int]) $ \box -> do
      let handle m = yield >> pure (modifyTVar' done (m :))
          again = do
            over <- (== 300) . length <$> readTVarIO done
            unless over (void (onMessage box handle hang ||| replicateM_ 20 yield) >> again)
      again
    reverse <$> readTVarIO done `shouldReturn` [1 .. 300]

-- | How to subscribe, and then to handle each order beside a task.
type Handling =
  ((Int -> IO ()) -> IO (IO ()))
  -> (((Int -> Behavior (STM ())) -> Behavior () -> Behavior ()) -> Behavior ())
  -> Behavior ()

-- | The orders and their driver; the times at which the battery becomes low. (An order takes a
-- second.)
oneOrder, threeOrders :: ([Int], IO ((Int -> IO ()) -> IO (IO ())), [Seconds])
oneOrder = ([1], pure (delivering [1]), [1])
threeOrders = ([1, 2, 3], newMock >>= \world -> driver world "orders" [(1, 1), (2, 2), (2, 3)], [2, 4])

-- | How often, in one of the schedules, an order was committed, where that was not once.
miscounted :: Plan -> ([Int], IO ((Int -> IO ()) -> IO (IO ())), [Seconds]) -> Handling -> IO [Int]
miscounted plan (expected, newDriver, lows) handlingBy = do
  wrong <- newIORef []
  _ <- explore plan $ \simulated -> do
    orders <- newDriver
    low <- newTVarIO False
    done <- newTVarIO []
    let serve order = sleep 1 >> pure (modifyTVar' done (order :))
        recharge = sleep 0.5 >> atomically (writeTVar low False)
        drains = for_ (zipWith (-) lows (0 : lows)) $ \pause -> sleep pause >> atomically (writeTVar low True)
    _ <- simulated . handlingBy orders $ \onEach ->
      Signal.monitor (Signal.watching (readTVar low)) recharge (onEach serve hang) ||| (drains >> sleep 9)
    orderList <- readTVarIO done
    let counts = [length (filter (== order) orderList) | order <- expected]
    modifyIORef' wrong (filter (/= 1) counts ++)
  readIORef wrong

-- | With an inbox.
once :: Handling
once orders act = withInbox 5 orders (act . onMessage)

-- | The first mistake that 'onMessage' does not make.
takenFirst :: Handling
takenFirst = queued $ \queue handle -> atomically (readTQueue queue) >>= handle >>= atomically

-- | The second: the handler's transaction and the removal are two steps.
takenAtReturn :: Handling
takenAtReturn = queued $ \queue handle -> do
  atomically (peekTQueue queue) >>= handle >>= atomically
  void (atomically (readTQueue queue))

-- | A handler made from a queue and 'Signal.monitor'.
queued :: (TQueue Int -> (Int -> Behavior (STM ())) -> Behavior ()) -> Handling
queued handleOne orders act = do
  queue <- newTQueueIO
  bracket (orders (atomically . writeTQueue queue)) id $ \_ ->
    act (Signal.monitor (not <$> Signal.watching (isEmptyTQueue queue)) . handleOne queue)

mockDriver :: Spec
mockDriver = do
  it "delivers each message at its time, and nothing that was due before the subscription or is due after its end" $ do
    (world, orders) <- newWorld
    got <- newIORef []
    let stamped m = now >>= \t -> modifyIORef' got ((m, t) :)
    _ <- simulate $ do
      Mock.begin world
      zero <- now
      sleep 1.5
      bracket (orders stamped) id (\_ -> sleep 1)
      sleep 10
      modifyIORef' got (map (fmap (subtract zero)))
    readIORef got `shouldReturn` [('b', 2)]
    map Mock.entrySubject . Mock.recordEntries <$> happened world
      `shouldReturn` ["orders: subscribed", "orders: 'b'", "orders: unsubscribed"]

  it "records each message" $ do
    (world, orders) <- newWorld
    _ <- simulate (withInbox 9 orders (\_ -> sleep 5))
    for_ "abc" $ \m -> world `shouldRecord` eventually (noted ("orders: " ++ show m))

  it "throws what the callback threw when the subscription ends" $ do
    for_
      [ (throwIO (Fault "callback"), FaultedWith (show (Fault "callback")))
      , (throwIO ThreadKilled, CancelledBy "thread killed")
      ]
      $ \(callback, expected) -> do
          (_, orders) <- newWorld
          ended <- newIORef Nothing
          _ <- simulate $ ending (orders (const callback) >>= (sleep 2 >>)) >>= writeIORef ended . Just
          readIORef ended `shouldReturn` Just expected

  it "refuses times that decrease or are negative, and names that are used" $ do
    world <- newMock
    let refused messages = ending (void (driver world "orders" messages))
        rule = "driver \"orders\": the times of the messages start from zero and do not decrease; "
    refused [(2, 'a'), (1, 'b')] `shouldReturn` FaultedWith (rule ++ "1.0 must not come after 2.0")
    refused [(-1, 'a')] `shouldReturn` FaultedWith (rule ++ "-1.0 is no such time")
    refused [(1, 'a'), (1, 'b')] `shouldReturn` Gave ()
    refused [(1, 'a')]
      `shouldReturn` FaultedWith "driver \"orders\": something else in this world has this name already"
 where
  newWorld = newMock >>= \world -> (,) world <$> driver world "orders" [(1, 'a'), (2, 'b'), (3, 'c')]

-- | A driver that delivers the messages as soon as it is subscribed to.
delivering :: [e] -> (e -> IO ()) -> IO (IO ())
delivering messages deliver = pure () <$ traverse_ deliver messages

-- | Receives all that is waiting.
allOf :: Inbox e -> STM [e]
allOf box = unhandled box >>= \n -> traverse (const (receive box)) [1 .. n]
