{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- The robots' processes of @make fleets@. @.ci/fleets@ starts the database, and @test/fleets@ starts and kills these;
-- what they have done is judged by what they have written, and by the door's own record. A line that one prints begins
-- with the time, by the clock of Python's @time.monotonic@.
--
-- > fleets ADDRESS robot NAME TERM                   carries orders; says which it begins, and which are interrupted
-- > fleets ADDRESS submit NAME FIRST LAST SECONDS    submits orders that take so long, and says so at the end
-- > fleets ADDRESS office NAME FIRST LAST SECONDS    likewise, and says of each when it is submitted, and done
-- > fleets ADDRESS visitor NAME RESOURCE DOOR RATE   passes through the door at that socket, again and again; its own
-- >                                                  clock runs at that rate
-- > fleets ADDRESS idle NAME COUNT                   that many robots, which wait for orders
-- > fleets ADDRESS drain NAME ROBOTS COUNT           that many robots do nothing, until that many tasks are done; says
-- >                                                  how long that took, from the first to the last
-- > fleets ADDRESS harmed NAME SEED COUNT            is interrupted that often (test/Fleets/Harmed.hs)
-- > fleets ADDRESS hostile NAME                      uses hostile texts
-- > fleets ADDRESS once NAME                         submits once, and says what came of it
-- > fleets ADDRESS migrate SCRIPT...                 migrates the schema, to versions that are made by these
-- > fleets agree ADDRESS ADDRESS SEED COUNT          that many sequences of requests, to an owner's and a robot's
-- >                                                  database and to a fake one
-- > fleets days SEED COUNT                           that many schedules of days on a fake database
module Main (main) where

import Control.Concurrent.STM (check, modifyTVar', newTVarIO, readTVar, readTVarIO)
import Control.Exception (bracket, finally, onException)
import Control.Monad (forever, void)
import qualified Data.ByteString.Char8 as Bytes
import Data.Foldable (for_)
import Data.IORef
import Data.Maybe (fromMaybe)
import Database.PostgreSQL.Simple (execute)
import Network.Socket
  ( Family (AF_UNIX)
  , SockAddr (SockAddrUnix)
  , SocketType (Stream)
  , close
  , connect
  , defaultProtocol
  , socket
  )
import Network.Socket.ByteString (recv, sendAll)
import System.Clock (Clock (Monotonic), getTime, toNanoSecs)
import System.Environment (getArgs)
import System.Exit (die, exitFailure)
import System.IO (BufferMode (LineBuffering), hSetBuffering, stdout)

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Internal.Database (ownClock)
import Behavior.Fleet.Internal.Migration (migrateFurther)
import Behavior.Parallel (allOf, firstOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (now)
import Fleet.Promised (keptByFleets)
import Fleets.Agreeing
import Fleets.Harmed
import Promises.Trying (underRandom)

main :: IO ()
main = do
  hSetBuffering stdout LineBuffering
  getArgs >>= \case
    [address, "robot", name, term] ->
      as options {taskTerm = realToFrac (read term :: Double)} (postgres address) name $ \fleet ->
        void (servingWith fleet orders (carry name))
    [address, "submit", name, first, end, seconds] ->
      as options (postgres address) name $ \fleet -> do
        for_ [read first .. read end] $ \n -> submitOrder fleet n (read seconds)
        say ["submitted"]
    [address, "office", name, first, end, seconds] -> do
      next <- newIORef (read first)
      as options (postgres address) name $ \fleet ->
        void . allOf . replicate 4 $ office fleet next (read end) (read seconds)
    [address, "visitor", name, which, door, rate] -> do
      let own = postgres address
      as options own {ownClock = (realToFrac (read rate :: Double) *) <$> ownClock own} name $ \fleet ->
        forever (failingOn isLeaseLost (visit name which door fleet) ? pure ())
    [address, "idle", name, count] ->
      as options (postgres address) name $ \fleet -> do
        let each it = withRobot fleet it (\mine -> servingWith mine orders (carry name))
        void (allOf (map each (robots name (read count))))
    [address, "drain", name, count, tasks] -> as options (postgres address) name (drain name (read count) (read tasks))
    [address, "harmed", _, seed, count] -> harmed say (postgres address) (read seed) (read count) orders
    [address, "hostile", _] -> hostile say (postgres address)
    [address, "once", _] -> once say (postgres address)
    address : "migrate" : scripts -> runBehavior (migrateFurther (map Bytes.pack scripts) address) >>= print
    ["agree", owner, robot, seed, count] ->
      agreeing (Bytes.pack owner) robot (read seed) (read count) >>= \agree -> if agree then pure () else exitFailure
    ["days", seed, count] -> underRandom (read seed) (read count) keptByFleets >>= print
    _ -> die "fleets ADDRESS robot | submit | office | visitor | idle | drain | harmed | hostile | once ARGUMENT..."

as :: FleetOptions -> Database -> String -> (Fleet -> Behavior ()) -> IO ()
as chosen address name = runBehavior . withFleetOptions chosen address (Robot name [])

-- | The defaults, which users have.
options :: FleetOptions
options = defaultFleetOptions {onFleetReport = \line -> say ["report", line]}

-- | Prints the words, with the time.
say :: [String] -> IO ()
say them = do
  time <- getTime Monotonic
  putStrLn (unwords (show (fromIntegral (toNanoSecs time) / 1e9 :: Double) : them))

-- | An order has a number, and takes some seconds.
orders :: Queue (Int, Double) ()
orders = queue "orders"

carry :: String -> Work (Int, Double) -> Behavior (Commit ())
carry name work = do
  let (n, seconds) = workInput work
  say ["begins", show n]
  sleep (realToFrac seconds) `onException` say ["interrupted", show n]
  pure . writing $ \connection -> void (execute connection "insert into delivered (n, robot) values (?, ?)" (n, name))

-- | (Robots are killed often: so a task may be started often.)
submitOrder :: Fleet -> Int -> Double -> Behavior (Ticket ())
submitOrder fleet n seconds =
  submitWith defaultSubmitOptions {taskPauses = replicate 100 0} fleet orders ("order " ++ show n) (n, seconds)

-- | Submits the next order, and waits until it is done, again and again.
office :: Fleet -> IORef Int -> Int -> Double -> Behavior ()
office fleet next end seconds = do
  n <- atomicModifyIORef' next (\n -> (n + 1, n))
  if n > end
    then pure ()
    else do
      ticket <- submitOrder fleet n seconds
      say ["submitted", show n]
      watchingTask fleet ticket $ \task -> Signal.waitUntil ((== Done) . taskState <$> task)
      say ["done", show n]
      office fleet next end seconds

robots :: String -> Int -> [Robot]
robots name count = [Robot (name ++ "/" ++ show n) [] | n <- [1 .. count]]

drain :: String -> Int -> Int -> Fleet -> Behavior ()
drain name count tasks fleet = do
  ran <- newTVarIO (0 :: Int)
  first <- newTVarIO Nothing
  let nothing () = do
        time <- now
        atomically $ do
          modifyTVar' ran (+ 1)
          modifyTVar' first (Just . fromMaybe time)
        pure (pure ())
      empty = queue "empty" :: Queue () ()
  firstOf
    [ void (allOf [withRobot fleet it (\mine -> serving mine empty nothing) | it <- robots name count])
    , do
        atomically (readTVar ran >>= check . (>= tasks))
        took <- (-) <$> now <*> (fromMaybe 0 <$> readTVarIO first)
        sleep 0.5 -- (The last ones are to be completed.)
        say ["drained", show took]
    ]

-- | Once. It says to the door when it enters and leaves, which is in the door's own record. (Most stay for a moment,
-- some for longer than the term.)
visit :: String -> String -> FilePath -> Fleet -> Behavior ()
visit name which door fleet = holding fleet (resource which) 1 $ \fence -> do
  let stays = if fenceNumber fence `mod` 8 == 0 then 1.2 else 0.02
      says what =
        bracket (socket AF_UNIX Stream defaultProtocol) close $ \it -> do
          connect it (SockAddrUnix door)
          sendAll it (Bytes.pack (unwords [what, name, show (fenceNumber fence)] ++ "\n"))
          recv it 16
  (says "enter" >> sleep stays) `finally` says "leave"
