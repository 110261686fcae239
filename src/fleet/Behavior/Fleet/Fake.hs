-- |
-- A database for tests of fleets, also in simulations ("Behavior.Sim"): a value that does what the schema does, and
-- answers late, twice or never as a test wants.
--
-- > explore (randomly 1000) $ \simulated -> do
-- >   ends <- simulated $ do
-- >     db <- newFakeDatabase
-- >     withFleet (fakeDatabase db) (Robot "amy" []) mission `both` (sleep 3 >> atomically (loseConnections db))
-- >   ...
--
-- (That the schema does the same is tested: by random sequences of requests to both.)
module Behavior.Fleet.Fake
  ( FakeDatabase
  , newFakeDatabase
  , fakeDatabase
  , fakeDatabaseBy

    -- * What goes wrong there
  , Answer (..)
  , willAnswer
  , setClock
  , loseConnections
  , setReachable
  , losingNotices
  , cutOff
  , Model
  , copyDatabase
  , restoreDatabase
  , runNewEpoch

    -- * What is there
  , tasksThere
  ) where

import Behavior.Fleet.Internal.FakeDatabase
import Behavior.Fleet.Internal.Model (Model)
