-- |
-- Which capability threads run on: 'pinned' and 'unpinned'. (That they are operators like the
-- others is tested where all are: see "Places".)
module Behavior.PinnedSpec (spec) where

import Control.Concurrent
import Control.Concurrent.Async (async, asyncOn, wait)
import Control.Exception (bracket)
import Control.Monad (when)
import Data.Foldable (for_)
import Data.IORef (newIORef, readIORef, writeIORef)
import Test.Hspec

import Behavior
import Behavior.Parallel (pinned, unpinned)
import Places
import Support

spec :: Spec
spec = guarded . describe "Capabilities" $ do
  describe "In pinned, a thread stays on the capability of the caller:" $
    for_ (otherThan "unpinned: body") $ \place ->
      it (show place) $ do
        (here, inside) <- pinned ((,) <$> placement <*> placementIn place)
        (here, inside) `shouldBe` (here, here)
        snd here `shouldBe` True

  describe "In unpinned, within pinned, GHC may move a thread:" $
    for_ (otherThan "pinned: body") $ \place ->
      it (show place) $
        snd <$> pinned (unpinned (placementIn place)) `shouldReturn` False

  it "without them, the threads of an operator can be moved as its caller can" $ do
    moved <- async (placementIn (placeOf "both: left"))
    snd <$> wait moved `shouldReturn` False
    kept <- asyncOn 0 (placementIn (placeOf "both: left"))
    wait kept `shouldReturn` (0, True)

  it "a pinned behaviour goes on when the number of capabilities changes" . when rtsSupportsBoundThreads $
    bracket getNumCapabilities setNumCapabilities $ \_ -> do
      setNumCapabilities 2
      began <- newGate
      mayEnd <- newGate
      caller <- asyncOn 1 . pinned $ do
        open began
        pass mayEnd
        (,) <$> placement <*> placementIn (placeOf "monitor: task")
      pass began
      setNumCapabilities 1
      open mayEnd
      wait caller `shouldReturn` ((0, True), (0, True))
 where
  otherThan name = [place | place <- threaded, placeName place /= name]
  placeOf name = head [place | place <- threaded, placeName place == name]

-- | The caller's capability, and whether GHC may not move it to another.
placement :: IO (Int, Bool)
placement = myThreadId >>= threadCapability

-- | That of the thread in that place.
placementIn :: OperatorPlace -> Behavior (Int, Bool)
placementIn place = do
  found <- newIORef (-1, False)
  placed place (placement >>= writeIORef found)
  readIORef found
