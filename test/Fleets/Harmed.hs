{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Robots that are interrupted at random moments, and hostile texts: row 8 of @make fleets@.
module Fleets.Harmed
  ( harmed
  , hostile
  , once
  ) where

import Control.Concurrent (threadDelay)
import Control.Concurrent.Async (race)
import Control.Concurrent.STM hiding (atomically)
import Control.Exception (SomeException, onException, throwIO)
import Control.Monad (forever, unless, void, when)
import Data.Aeson (Value (..), decodeStrict, toJSON)
import qualified Data.ByteString.Char8 as Bytes
import Data.Foldable (for_)
import Data.Maybe (fromMaybe, listToMaybe)
import Data.Text (Text)
import qualified Data.Text as Text
import Data.Traversable (for)
import Data.Void (absurd)
import Database.PostgreSQL.Simple (Only (..), execute)
import Test.QuickCheck (Gen, chooseInt, elements, frequency)
import Test.QuickCheck.Gen (unGen)
import Test.QuickCheck.Random (mkQCGen)

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Internal.Database
import Behavior.Fleet.Internal.Error (ConnectionLost (..))
import Behavior.Parallel (allOf, firstOf)
import Behavior.STM (atomically)
import qualified Behavior.Signal as Signal
import Behavior.Time (timeout)

-- | What a robot is asked to do; by what it is interrupted, after how many microseconds; and whether it waits for the
-- connections before.
data Step = Step Asked (Int -> Behavior () -> Behavior ()) Int Bool

data Asked = Submits | Serves | Holds' String | Cancels Int | Watches Int

step :: Gen Step
step = do
  asked <-
    frequency
      [ (4, pure Submits)
      , (4, pure Serves)
      , (2, Holds' <$> elements ["door", "charger", "lift"])
      , (1, Cancels <$> chooseInt (0, 1000))
      , (1, Watches <$> chooseInt (0, 1000))
      ]
  Step asked <$> elements [limited, killed] <*> frequency [(4, chooseInt (0, 8000)), (1, chooseInt (0, 40000))]
    <*> elements [True, False]
 where
  limited micros act = timeout (fromIntegral micros / 1e6) act ? pure ()
  killed micros act = void (race (threadDelay micros) act)

-- | Six robots, until that many requests were interrupted. Then they serve what is there, until there is a line at the
-- standard input. (They connect again at once: users' robots are not interrupted that often.)
harmed :: ([String] -> IO ()) -> Database -> Int -> Int -> Queue (Int, Double) () -> IO ()
harmed say at seed count orders = do
  watch <- Watch <$> newTVarIO (seed * 1000003) <*> newTVarIO 0 <*> newTVarIO 0 <*> pure say
  interrupted <- newTVarIO (0 :: Int)
  tickets <- newTVarIO []
  numbers <- newTVarIO (0 :: Int)
  let chosen = defaultFleetOptions {connectAgainAfter = 0.001, connectAgainWithin = 0.001}
      robots = [Robot ("harmed-" ++ show n) [] | n <- [1 .. 6 :: Int]]
      storm fleet k n = do
        times <- readTVarIO interrupted
        when (times < count) $ do
          let Step asked interrupting micros isPatient = unGen step (mkQCGen (seed * 1000 + k * 1000003 + n)) 30
          when isPatient $ Signal.waitUntil (databaseUp fleet)
          ended <- newTVarIO False
          tryAny (interrupting micros (act fleet asked >> atomically (writeTVar ended True)))
            >>= either (\why -> say ["unexpected", oneLine why]) pure
          is <- readTVarIO ended
          unless is $ atomically (modifyTVar' interrupted (+ 1))
          storm fleet k (n + 1 :: Int)
      act fleet = \case
        Submits -> do
          n <- atomically (stateTVar numbers (\n -> (n, n + 1)))
          let often = defaultSubmitOptions {taskPauses = replicate 1000 0}
          ticket <- submitWith often fleet orders ("order " ++ show n) (n, 0)
          say ["submitted", show n]
          atomically (modifyTVar' tickets ((n, ticket) :))
        Serves -> serves fleet
        Holds' name -> holding fleet (resource name) 0.5 (\_ -> sleep 0.001)
        Cancels n -> one n >>= mapM_ (\(m, _) -> cancelTask fleet orders ("order " ++ show m))
        Watches n -> one n >>= mapM_ (\(_, ticket) -> watchingTask fleet ticket isDone)
      -- One of the latest.
      one n = listToMaybe . drop (n `mod` 50) <$> readTVarIO tickets
      serves fleet = void . serving fleet orders $ \(n, _) ->
        pure . writing $ \c -> void (execute c "insert into delivered (n, robot) values (?, 'harmed')" (Only n))
  runBehavior . withFleetOptions chosen (watched watch at) (head robots) $ \fleet -> do
    void (allOf [withRobot fleet it (\mine -> storm mine k 0) | (k, it) <- zip [1 ..] robots])
    counts <- traverse readTVarIO [interrupted, lostConnections watch, wrongUses watch]
    say ("quiet" : map show counts)
    firstOf (void getLine : [withRobot fleet it serves | it <- robots])

isDone :: Signal.Signal Task -> Behavior ()
isDone = Signal.waitUntil . fmap ((== Done) . taskState)

oneLine :: SomeException -> String
oneLine = take 300 . unwords . lines . show

-- | How connections are used, and interrupted.
data Watch = Watch
  { uses :: TVar Int
  , lostConnections :: TVar Int
  -- ^ How often one was interrupted in its use.
  , wrongUses :: TVar Int
  , says :: [String] -> IO ()
  }

-- | The database, of which each use of a connection is watched: none comes after one that was interrupted, and no two
-- come at once. Of six uses one is interrupted, at a random moment, as a limit of time would interrupt it.
watched :: Watch -> Database -> Database
watched watch at = at {opening = \limit use -> opening at limit (\session -> newTVarIO True >>= use . over session)}
 where
  over session isFree =
    session
      { ask = used isFree . ask session
      , commit = \task lease json wanted -> used isFree (commit session task lease json wanted)
      , takeNews = used isFree (takeNews session)
      }
  used :: TVar Bool -> Behavior a -> Behavior a
  used isFree act = do
    is <- atomically (swapTVar isFree False)
    unless is $ do
      atomically (modifyTVar' (wrongUses watch) (+ 1))
      says watch ["unexpected", "a connection is used that was interrupted, or is in use"]
    n <- atomically (stateTVar (uses watch) (\n -> (n, n + 1)))
    let (one, micros) = unGen ((,) <$> chooseInt (1, 6) <*> chooseInt (0, 3000)) (mkQCGen n) 30
        late = sleep (fromIntegral micros / 1e6) >> throwIO (ConnectionLost "interrupted")
    gave <-
      (if one == 1 then firstOf [act, late] else act)
        `onException` atomically (modifyTVar' (lostConnections watch) (+ 1))
    gave <$ atomically (writeTVar isFree True)

-- | For each text of the list at the standard input: a task and a resource with these texts everywhere. Then results
-- that cannot be stored, and inputs that cannot be decoded.
hostile :: ([String] -> IO ()) -> Database -> IO ()
hostile say at = do
  texts <- fromMaybe [] . decodeStrict <$> Bytes.getLine
  runBehavior . withFleetOptions defaultFleetOptions {noDatabaseAfter = 5} at (Robot "hostile" []) $ \fleet -> do
    for_ (zip [0 :: Int ..] texts) $ \(n, text) -> trying say ("text " ++ show n) (everywhere fleet text)
    trying say "needs" $
      submitWith defaultSubmitOptions {taskNeeds = manyNeeds} fleet (queue "needs" :: Queue () ()) "needs" ()
    trying say "megabyte" (roundTrip fleet "megabyte" "megabyte" (Text.replicate 1000000 "m"))
    trying say "nothing to hold" (holdingAll fleet [] 1 (\_ -> pure ()))
    trying say "batch" (batch fleet)
    trying say "progress" (reporting fleet)
    trying say "decoding" (decoding fleet say)
    void getLine
 where
  manyNeeds = [[toEnum (0x1f300 + (n * 50 + k) * 7919 `mod` 700) | k <- [1 .. 50]] | n <- [1 .. 20]]

trying :: ([String] -> IO ()) -> String -> Behavior a -> Behavior ()
trying say name act = tryAny (timeout 20 act) >>= \how -> say [name ++ ":", either oneLine (const "ok") how]

everywhere :: Fleet -> Text -> Behavior ()
everywhere fleet text = as (Robot (Text.unpack text) [Text.unpack (Text.take 50 text)]) $ \mine -> do
  roundTrip mine text text text
  holding mine (resource (Text.unpack text)) 1 (\_ -> pure ())
 where
  -- (No robot may have a text that is no name.)
  as it act = if isName then withRobot fleet it act else act fleet
  isName = Text.length text `elem` [1 .. 200] && not (Text.any (== '\0') text)

-- | A task whose input is its result.
roundTrip :: Fleet -> Text -> Text -> Text -> Behavior ()
roundTrip fleet name key input = do
  let texts = queue (Text.unpack name) :: Queue Text Text
  ticket <- submitWith defaultSubmitOptions {taskNeeds = needed} fleet texts (Text.unpack key) input
  firstOf
    [ void (serving fleet texts (pure . pure))
    , watchingTask fleet ticket isDone
    ]
 where
  needed = [Text.unpack (Text.take 50 name) | name /= "megabyte"]

-- | Eight robots whose tasks end at the same moment, and the result of one cannot be stored.
batch :: Fleet -> Behavior ()
batch fleet = do
  arrived <- newTVarIO (0 :: Int)
  let together = queue "batch" :: Queue Int Text
      robots = [Robot ("batch-" ++ show n) [] | n <- [1 .. 8 :: Int]]
      gives n = do
        atomically (modifyTVar' arrived (+ 1))
        atomically (readTVar arrived >>= check . (>= 8))
        pure (pure (if n == 5 then "a\0b" else "fine"))
  tickets <- for [1 .. 8] $ \n -> submitWith defaultSubmitOptions {taskPauses = []} fleet together (show n) n
  firstOf
    [ void (allOf [withRobot fleet it (\mine -> serving mine together gives) | it <- robots])
    , for_ tickets $ \ticket -> watchingTask fleet ticket (Signal.waitUntil . fmap ((`elem` [Done, Dead]) . taskState))
    ]

-- | A task that reports what cannot be stored.
reporting :: Fleet -> Behavior ()
reporting fleet = do
  let these = queue "progress" :: Queue () ()
  ticket <- submitWith defaultSubmitOptions {taskPauses = []} fleet these "progress" ()
  firstOf
    [ void (servingWith fleet these (\work -> reportProgress work (String "a\0b") >> pure (pure ())))
    , watchingTask fleet ticket (Signal.waitUntil . fmap ((== Dead) . taskState))
    ]

-- | Two robots serve the queue "numbers", until both the good and the bad tasks have ended.
decoding :: Fleet -> ([String] -> IO ()) -> Behavior ()
decoding fleet say = do
  let numbers = queue "numbers" :: Queue Int Int
      faulted why = say ["decoding-fault", oneLine why]
      again mine = forever (tryAny (serving mine numbers (pure . pure)) >>= either faulted absurd)
  latest <- submit fleet numbers "last" 7
  firstOf
    [ void (allOf [withRobot fleet (Robot name []) again | name <- ["decoding-1", "decoding-2"]])
    , watchingTask fleet latest isDone >> sleep 3
    ]

-- | One submission, which gives up soon.
once :: ([String] -> IO ()) -> Database -> IO ()
once say at =
  runBehavior . withFleetOptions defaultFleetOptions {noDatabaseAfter = 3} at (Robot "once" []) $ \fleet ->
    trying say "once" (submit fleet (queue "once" :: Queue Value ()) "once" (toJSON ()))
