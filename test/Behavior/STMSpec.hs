-- |
-- stm, with this library's 'atomically'.
module Behavior.STMSpec (spec) where

import Control.Monad (replicateM)
import Test.Hspec

import Behavior
import Behavior.STM
import Behavior.Sim (Outcome (..), Run (..), simulate)
import Support (guarded)

spec :: Spec
spec = guarded $ do
  it "blocks in a way that is visible to a simulation" $ do
    run <- simulate $ do
      box <- newEmptyTMVarIO
      queue <- newTBQueueIO 1
      both
        (sleep 3 >> atomically (putTMVar box 'a') >> atomically (mapM_ (writeTBQueue queue) "b"))
        (atomically (takeTMVar box) >>= \a -> atomically (readTBQueue queue) >>= \b -> [a, b] `shouldBy` "ab")
    outcome run `returns` ()
    finished run `shouldBe` 3

  it "has stm's variables, queues and channels" $ do
    var <- newTVarIO (0 :: Int)
    queue <- newTQueueIO
    channel <- newTChanIO
    (,,)
      <$> atomically (stateTVar var (\n -> (n, n + 1)))
      <*> (atomically (writeTQueue queue 'q') >> atomically (flushTQueue queue))
      <*> (atomically (mapM_ (writeTChan channel) "ch") >> replicateM 2 (atomically (readTChan channel)))
      >>= (`shouldBe` (0, "q", "ch"))
 where
  actual `shouldBy` expected = if actual == expected then pure () else failWith actual
  returns (Returned a) expected = a `shouldBe` expected
  returns _ _ = expectationFailure "it did not return"
