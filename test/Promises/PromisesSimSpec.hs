-- |
-- The promises that every operator keeps, tested under many schedules and in reality.
--
-- (That they reject broken operators is shown by the mutants in test/mutants/Promises.txt.)
module Promises.PromisesSimSpec (spec) where

import Control.Monad (forM_)
import Data.IORef
import Test.Hspec

import Promises.Properties
import Promises.Stage
import Promises.Trying

spec :: Spec
spec = do
  explored <- runIO (newIORef mempty)
  let counting needed act = do
        t <- act
        modifyIORef' explored (<> t)
        schedulesExplored t `shouldSatisfy` (>= needed)
      counted = readIORef explored >>= \t -> putStrLn ("  (explored: " ++ show t ++ ")")
  afterAll_ counted . forM_ promises $ \promise -> describe (promised promise) $ do
    it "under random schedules" $
      counting randomSchedules (underRandom 1 randomSchedules promise)
    it "under all schedules of small programs, with up to two pre-emptions" $
      counting smallPrograms (underAll 1 2 100000 smallPrograms promise)
    it "in reality" $
      inReality 1 realPrograms promise

-- | The amount of testing for each promise: random schedules, small programs of which all schedules
-- are tried, and programs that run in reality.
randomSchedules, smallPrograms, realPrograms :: Int
randomSchedules = 2000
smallPrograms = 20
realPrograms = 50
