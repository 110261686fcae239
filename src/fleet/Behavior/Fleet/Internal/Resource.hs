{-# OPTIONS_HADDOCK not-home #-}
{-# LANGUAGE LambdaCase #-}

-- |
-- Resources that one robot holds at a time.
--
-- Internal: any of it may change in any release.
module Behavior.Fleet.Internal.Resource
  ( Resource
  , resource
  , Fence (..)
  , fenceNumber
  , isLeaseLost
  , holding
  , holdingWithin
  , holdingAll
  ) where

import Control.Exception (finally, throwIO, try)
import Control.Monad (when)
import Data.Int (Int64)
import Data.List (intercalate)
import qualified Data.Set as Set
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior (Behavior, BehaviorFailed, Seconds, (?))
import Behavior.Fleet.Internal.Contract
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error
import Behavior.Fleet.Internal.Fleet
import Behavior.Fleet.Internal.Lease
import Behavior.STM (atomically, orElse)
import Behavior.Signal (insteadWhen, named, watching)
import Behavior.Time (timeout)
import qualified Behavior.Trace as Trace

-- $setup
-- >>> import Behavior
-- >>> import Behavior.Fleet
-- >>> import Behavior.Fleet.Fake
-- >>> import Behavior.Parallel (allOf)
-- >>> import Behavior.Sim (simulate, well)
-- >>> import Behavior.Time (now)
-- >>> db <- newFakeDatabase
-- >>> let inFleet name = withFleet (fakeDatabase db) (Robot name [])

-- | Something that one robot uses at a time: a door, a charger, a corridor.
--
-- @since 0.1.0.0
newtype Resource = Resource Text
  deriving (Eq, Ord, Show)

-- | The resource with that name, of 1 to 200 characters. (It need not be created.)
--
-- @since 0.1.0.0
resource :: String -> Resource
resource = Resource . Text.pack

-- | A later holder of a resource has a greater one. A resource that refuses each command with a smaller fence than it
-- has seen is protected from robots that do not know yet that they have lost it.
--
-- @since 0.1.0.0
newtype Fence = Fence Int64
  deriving (Eq, Ord, Show)

-- | As one number, as a resource compares it: the same as the SQL functions give. It is exact in JSON, until 2311.
--
-- @since 0.1.0.0
fenceNumber :: Fence -> Int64
fenceNumber (Fence n) = n

-- | Whether a fault is 'LeaseLost'. For a robot that is well where it is then, and tries again: that is a failure.
--
-- > failingOn isLeaseLost (holding fleet door 3 pass) ? wait
--
-- @since 0.1.0.0
isLeaseLost :: FleetFault -> Bool
isLeaseLost fault = case fault of
  LeaseLost _ -> True
  _ -> False

-- | Holds a resource while the behaviour runs; waits until it is free. First come is first served.
--
-- > holding fleet (resource "north door") 3 $ \fence -> passThrough fence
--
-- The term, of 0.1 s to a day, is how long the resource stays held if this robot's process dies. While it lives, the
-- hold is renewed at each third of it. The behaviour is interrupted when two thirds have passed since the last renewal
-- was /asked for/, by this machine's own clock, which goes on while it is suspended. (If the answer takes as long as
-- that, the resource is asked for again.)
--
-- It is given back when the behaviour has ended, also when that was interrupted: then the behaviour has to bring the
-- robot out of the door, in less than a third of the term ('Behavior.Time.cleanupWithin').
--
-- So no other robot holds the resource meanwhile, /if/ this process runs, and stopping the behaviour and a step of the
-- database's clock take together less than a third of the term. Otherwise only the fence protects, and a resource that
-- checks no fence is unprotected.
--
-- [Result] The behaviour's.
-- [Failure] The behaviour's. 'NotAllowed', if the name or the term is not allowed. 'NoDatabase', while it waits.
-- [Fault] The behaviour's. 'LeaseLost', when the hold could not be renewed: after the behaviour has stopped.
-- [Cancellation] Requests the stop of the behaviour; the resource is free when that has ended. While it waits, it
--   gives up its place.
--
-- >>> let passes name = inFleet name (\fleet -> holding fleet (resource "door") 3 (\_ -> sleep 5 >> now))
-- >>> simulate (allOf [passes "amy", sleep 1 >> passes "bob"]) >>= well
-- [5.0,10.0]
--
-- @since 0.1.0.0
holding :: Fleet -> Resource -> Seconds -> (Fence -> Behavior a) -> Behavior a
holding fleet which seconds use = holdingAll fleet [which] seconds (use . snd . head)

-- | 'holding', which fails with 'StillHeld' if the resource is not free within that time, of more than 0 seconds.
--
-- > holdingWithin 0.5 fleet (resource "north door") 3 pass ? holding fleet (resource "south door") 3 pass
--
-- (A 'Behavior.Time.timeout' around 'holding' would be a limit of its use, too.)
--
-- >>> let passes name = inFleet name (\fleet -> holdingWithin 1 fleet (resource "door") 3 (\_ -> sleep 5 >> now))
-- >>> simulate (allOf [passes "amy", sleep 2 >> (passes "bob" ? now), sleep 4.5 >> passes "carl"]) >>= well
-- [5.0,3.0,10.0]
--
-- @since 0.1.0.0
holdingWithin :: Seconds -> Fleet -> Resource -> Seconds -> (Fence -> Behavior a) -> Behavior a
holdingWithin patience fleet which seconds use = holdingFor (Just patience) fleet [which] seconds (use . snd . head)

-- | Holds all of these resources, or none: so two robots never wait for each other in a circle. The fences are in the
-- order of the resources' names. Otherwise as 'holding'.
--
-- (Take together what is needed together. Of two robots that hold one resource each, and wait for the other's inside of
-- that, each waits for ever.)
--
-- @since 0.1.0.0
holdingAll :: Fleet -> [Resource] -> Seconds -> ([(Resource, Fence)] -> Behavior a) -> Behavior a
holdingAll = holdingFor Nothing

-- | Fails if they are not free within that time.
holdingFor :: Maybe Seconds -> Fleet -> [Resource] -> Seconds -> ([(Resource, Fence)] -> Behavior a) -> Behavior a
holdingFor patience fleet which seconds use = do
  number <- newUnique (database fleet)
  (`finally` release number) $ do
    (asked, fences) <- inTime . waitFor $ Wish number (Set.fromList names) (Text.pack (robotName (robot fleet))) seconds
    withLease (leases fleet) clock (OfWish number) seconds asked $ \lease ->
      insteadWhen (named "lease lost" (watching ((/= Valid) <$> standing lease))) (throwIO (LeaseLost called)) $
        use [(Resource name, Fence n) | (name, Number n) <- fences]
 where
  names = [name | Resource name <- which]
  called = intercalate ", " (map Text.unpack names)
  clock = ownClock (database fleet)
  inTime wait = case patience of
    Nothing -> wait
    -- (A failure of its own is not one of the time.)
    Just limit -> (timeout limit (try wait) ? throwIO (StillHeld called limit)) >>= either rethrown pure
  rethrown why = throwIO (why :: BehaviorFailed)
  release number = posted fleet listening (Release number)
  waitFor wish = Trace.named ("wait for " ++ called) . withTurns fleet wish $ \waitForTurn ->
    let go = do
          (asked, answer) <- requestTimed fleet listening (Hold wish)
          time <- clock
          either (throwIO . refusedAs) pure answer >>= \case
            -- (The answer came too late. If it is held still, it is then renewed.)
            Holds _ | time >= lostAt asked seconds -> go
            Holds fences -> (asked, fences) <$ atomically (mapM_ (seen fleet . snd) fences)
            AskAgainIn again -> waitForTurn (max 0.005 again) >> go
     in go

-- | Gives the behaviour what waits until it is this wish's turn, if that is known; otherwise for at most that long, or,
-- when others have their turns, until none has for 0.25 s (the last one may have died); in any case for at most 3 s.
withTurns :: Fleet -> Wish -> ((Seconds -> Behavior ()) -> Behavior a) -> Behavior a
withTurns fleet wish use =
  withNotices fleet (OfTurn (wishNumber wish) : map OfResource names) $ \turn ->
    withNotices fleet (map OfLine names) $ \others ->
      let wait seconds = do
            isOthers <- timeout seconds (atomically ((False <$ turn) `orElse` (True <$ others))) ? pure False
            when isOthers (wait 0.25)
       in use (\seconds -> timeout 3 (wait seconds) ? pure ())
 where
  names = Set.toList (wishFor wish)
