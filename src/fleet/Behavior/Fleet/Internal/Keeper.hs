{-# OPTIONS_HADDOCK not-home #-}

-- |
-- The threads of a process's fleet. No user's code runs in them, but for 'onFleetReport'.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Keeper
  ( withFleet
  , withFleetOptions
  , withRobot
  ) where

import Control.Concurrent.STM hiding (atomically)
import Control.Exception (ErrorCall (..), bracket_, finally, throwIO)
import Control.Monad (forever, when)
import qualified Data.Map.Strict as Map
import Data.Maybe (fromMaybe)
import qualified Data.Text as Text

import Behavior (Behavior, tryAny)
import Behavior.Fleet.Internal.Check (whyNotRobot)
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Dispatch
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Fleet
import Behavior.Fleet.Internal.Lease
import Behavior.Fleet.Internal.Line
import Behavior.Fleet.Internal.Options
import Behavior.Fleet.Internal.Version
import Behavior.Internal.Concurrent.Service (betweenTurns, servedBy)
import Behavior.Parallel (firstOf)
import Behavior.STM (atomically)

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Fleet
-- >>> import Behavior.Fleet.Fake
-- >>> import Behavior.Parallel (firstOf)
-- >>> import Behavior.Sim (simulate, well)
-- >>> import Data.Void (absurd)
-- >>> db <- newFakeDatabase

-- | Runs a behaviour of a robot in its fleet.
--
-- > main = runBehavior . withFleet (postgres "dbname=fleet") (Robot "amy" ["lift"]) $ \fleet -> ...
--
-- It does not wait for a database that is not there: what is asked of it first waits. The process has two connections,
-- which all its robots share ('withRobot'). When one is lost it connects again, with growing pauses, and what waits
-- goes on.
--
-- [Result, failure, fault] The behaviour's. The failure 'NotAllowed', at once, if the robot's name has not 1 to 200
--   characters, or a skill has not 1 to 50, or one of them has U+0000.
-- [Cancellation] Requests the stop of the behaviour; the connections are there until it has ended, cleanup included.
--
-- >>> let orders = queue "orders" :: Queue String Int
-- >>> :{
-- (>>= well) . simulate . withFleet (fakeDatabase db) (Robot "amy" ["lift"]) $ \amy -> do
--   ticket <- submit amy orders "order 1" "a chair"
--   firstOf [absurd <$> serving amy orders (pure . pure . length), waitForTask amy ticket]
-- :}
-- 7
--
-- @since 0.1.0.0
withFleet :: Database -> Robot -> (Fleet -> Behavior a) -> Behavior a
withFleet = withFleetOptions defaultFleetOptions

-- | 'withFleet' with other options. One that is not allowed is refused with an 'ErrorCall' (a fault), which says what
-- is allowed.
--
-- >>> let chosen = defaultFleetOptions {taskTerm = 0.01}
-- >>> simulate (withFleetOptions chosen (fakeDatabase db) (Robot "amy" []) (\_ -> pure ())) >>= well
-- *** Exception: it faulted: withFleetOptions: taskTerm is 0.01 s; allowed: 0.1 to 86400.0 s
--
-- @since 0.1.0.0
withFleetOptions :: FleetOptions -> Database -> Robot -> (Fleet -> Behavior a) -> Behavior a
withFleetOptions chosen at it behavior = do
  mapM_ (throwIO . ErrorCall . ("withFleetOptions: " ++)) (notAllowed chosen)
  requireAllowed it
  fleet <- newFleet at chosen it
  servedBy (firstOf (keepers fleet)) $
    firstOf [withRobot fleet it behavior, reporting fleet] `finally` leaving fleet

-- | Another robot of this process, in the same fleet, while the behaviour runs. (A robot that 'withFleet' refuses is
-- refused here, too.)
--
-- > withRobot amy (Robot "bob" []) $ \bob -> firstOf [serving amy orders carry, serving bob orders carry]
--
-- @since 0.1.0.0
withRobot :: Fleet -> Robot -> (Fleet -> Behavior a) -> Behavior a
withRobot fleet it behavior = do
  requireAllowed it
  bracket_ (here (+ 1)) (here (subtract 1)) (behavior fleet {robot = it})
 where
  here change = atomically $ do
    modifyTVar' (robots fleet) (Map.filter (> 0) . Map.alter (Just . change . fromMaybe 0) (Text.pack (robotName it)))

-- | Refuses a robot that the database would refuse.
requireAllowed :: Robot -> Behavior ()
requireAllowed it =
  mapM_ (throwIO . NotAllowed . Text.unpack) (whyNotRobot (Text.pack (robotName it)) (map Text.pack (robotSkills it)))

keepers :: Fleet -> [Behavior ()]
keepers fleet =
  [ keeping at (working fleet) (connection "tasks") greet (\_ -> tested working listening)
  , keeping at (listening fleet) (connection "leases") (\session -> listen session >> greet session) $ \session ->
      firstOf [hearing session, tested listening working]
  , answering (working fleet)
  , answering (listening fleet)
  , renewing (leases fleet) (ownClock at) (granting . Renew) (granting . Keep)
  , expiring (leases fleet) (ownClock at)
  , dispatching fleet
  , polling fleet
  ]
 where
  at = database fleet
  connection what why =
    report fleet (maybe ("connected for " ++ what ++ " again") (("no connection for " ++ what ++ ": ") ++) why)
  -- (Once: what is to be asked again must not be in the way of the other leases.)
  granting what = askingFirst (listening fleet) once >>= either (throwIO . refusedAs) pure
   where
    once session = ask session what
  connect session = do
    number <- readTVarIO (greatest fleet)
    ask session (Connect number) >>= either (throwIO . refusedAs) pure
  greet session = do
    (version, _) <- connect session
    maybe (atomically (noticed fleet OfAnything)) (throwIO . WrongSchema) (unfit version)
  -- (When one connection is lost, the other is tried at once: a server that is frozen says nothing.)
  tested line other = forever $ do
    atomically (isThere (other fleet) >>= check . not)
    _ <- withSession (line fleet) connect
    atomically (isThere (other fleet) >>= check)
  hearing session = forever $ do
    awaitNews session
    withSession (listening fleet) takeNews >>= atomically . mapM_ (noticed fleet)

-- | Says that this process is there; and looks for what was missed.
polling :: Fleet -> Behavior a
polling fleet = forever $ do
  names <- Map.keys <$> readTVarIO (robots fleet)
  atomically (writeTVar (pollNow fleet) False)
  let presence = Presence (processId fleet) (Text.pack <$> pageAddress chosen) names (pollEvery chosen)
  next <- tryAny (request fleet listening (Poll presence))
  atomically $ case next of
    Right (Right (_, queues)) -> modifyTVar' (missed fleet) (+ 1) >> mapM_ (noticed fleet . OfQueue) queues
    _ -> noticed fleet OfAnything
  -- (While the database is away, or refuses, it is asked again.)
  let wait = case next of
        Right (Right (Just seconds, _)) -> min (pollEvery chosen) (max 0.05 seconds)
        _ -> pollEvery chosen
  betweenTurns wait (readTVar (pollNow fleet) >>= check)
 where
  chosen = options fleet

-- | Says that this process has ended, if the database is there.
leaving :: Fleet -> Behavior ()
leaving fleet = do
  there <- atomically (isThere (listening fleet))
  when there $ posted fleet listening (Leave (processId fleet))

reporting :: Fleet -> Behavior a
reporting fleet = forever (atomically (readTBQueue (reports fleet)) >>= onFleetReport (options fleet))
