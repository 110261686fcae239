{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The robots that a hub follows: for each there is a behaviour that reads its live page, and connects again when the
-- connection has ended. So what one robot does, or does not do, concerns no other one.
--
-- Internal: any of it may change in any release.
module Behavior.Live.Internal.Robots
  ( Robots (..)
  , Robot (..)
  , Seen (..)
  , following
  ) where

import Control.Exception (evaluate)
import Control.Monad (forever)
import Data.Foldable (traverse_)
import Data.Map.Strict (Map)
import qualified Data.Map.Strict as Map
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Time.Clock.POSIX (POSIXTime, getPOSIXTime)
import GHC.Clock (getMonotonicTime)

import Behavior
import Behavior.Live.Internal.Known
import Behavior.Live.Internal.Protocol
import Behavior.Live.Internal.Reading
import Behavior.Parallel (Child, Nursery, fork, requestStop, scoped)
import Behavior.STM
import Behavior.Time (sleepForever)

-- | Those that are followed, by the names under which the hub shows them; and how many others there are.
data Robots = Robots
  { followed :: !(Map Text Robot)
  , others :: !Int
  }

-- | One that is followed.
data Robot = Robot
  { place :: Either String Address
  -- ^ Where its own server is; or why that is no address.
  , seen :: TVar Seen
  }

-- | What has come of it.
data Seen = Seen
  { known :: !Known
  , lastCame :: !(Maybe (Double, POSIXTime))
  -- ^ When the last message came: by the clock that is never set, and the time of day.
  , problem :: !(Maybe String)
  -- ^ Why there is no connection.
  }

-- | The greatest number of robots that are followed.
mostRobots :: Int
mostRobots = 200

-- | Follows the robots with these names and addresses, whenever the transaction gives others: of those with one name
-- the first. It publishes them in the variable, and does not end.
following :: STM [(String, String)] -> TVar Robots -> Behavior a
following wanted robots = scoped (`go` Map.empty)
 where
  go :: Nursery -> Map Text (String, Child ()) -> Behavior a
  go nursery children = do
    (given, more) <- atomically $ do
      these@(given, _) <- atMost . Map.fromListWith (\_ first -> first) . map named <$> wanted
      these <$ check (given /= fmap fst children)
    held <- followed <$> readTVarIO robots
    new <- Map.traverseWithKey (\name address -> robotAt address (Map.lookup name held)) given
    atomically (writeTVar robots (Robots new more))
    let kept = Map.filterWithKey (\name (address, _) -> Map.lookup name given == Just address) children
    traverse_ (requestStop . snd) (children Map.\\ kept)
    started <- traverse (\(address, robot) -> (,) address <$> fork nursery (follow robot))
      (Map.intersectionWith (,) given new Map.\\ kept)
    go nursery (kept <> started)
  -- (The name is a part of an address of the hub's.)
  named (name, address) = (Text.pack (take 200 name), address)
  atMost these = let (some, more) = Map.splitAt mostRobots these in (some, Map.size more)
  -- One that has moved is known from before.
  robotAt address before =
    Robot (parseAddress address) <$> maybe (newTVarIO (Seen nothingKnown Nothing Nothing)) (pure . seen) before

-- | Reads what the robot says, always from the beginning: so nothing has to be kept for coming back.
follow :: Robot -> Behavior ()
follow robot = case place robot of
  Left why -> without why >> sleepForever
  Right address -> forever $ do
    why <- reading address (Attach protocolVersion Nothing Nothing) (forever . learning)
    without (either id id why)
    sleep 1
 where
  without why = atomically (modifyTVar' (seen robot) (\s -> s {problem = Just why}))
  learning next = do
    message <- next
    came <- (,) <$> getMonotonicTime <*> getPOSIXTime
    before <- known <$> readTVarIO (seen robot)
    now <- either (ioError . userError) evaluate (learn message before)
    atomically (writeTVar (seen robot) (Seen now (Just came) Nothing))
