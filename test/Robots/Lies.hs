{-# LANGUAGE LambdaCase #-}
{-# LANGUAGE OverloadedStrings #-}

-- |
-- Rows 9 and 10: a bridge that floods, and one that sends what no bridge should (@test/robots/bridge.py@, whose own
-- record is the judge's).
module Robots.Lies
  ( hostile
  , floods
  ) where

import Control.Exception (SomeException, displayException)
import Control.Monad (forever, void, when)
import Data.Aeson (Value, (.=))
import Data.Foldable (for_)
import Data.Int (Int32)
import Data.Maybe (fromMaybe)
import Data.Text (Text)
import qualified Data.Text as Text

import Behavior
import Behavior.Message
import Behavior.Parallel (firstOf)
import Behavior.Ros
import Behavior.Ros.Messages
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Time (every, timeout)
import Robots.Campaign
import Robots.Goals
import Ros.Stage (failureOrFault)

-- | While a goal runs, each frame is answered: by the line about it, or by what a signal says of the reading. (The
-- lines that nothing has time for are left out, and counted.)
hostile :: Campaign -> Behavior ()
hostile campaign = withLies campaign ["hostile", "10000"] $ \way -> do
  reported <- newTBQueueIO 16
  let options = defaultRosOptions {onReport = atomically . writeTBQueue reported}
  withRosOptions options way $ \ros -> do
    awaitBridge ros
    let readings = topic "/readings" latched :: Topic (Std (Maybe Double))
        judging = tryAny (Signal.read ((< 0.1) <$> measured unStd (latest ros readings)))
    publishing ros (publication "/said") $ \say -> withMessages ros readings 16 $ \inbox ->
      firstOf
        [ do
            uninterrupted campaign 10 [] (plainly ros (fibonacci "/fake"))
            refused <- Signal.read (refusedFrames ros)
            note campaign 10 ["refused" .= refused]
            -- Now come frames as large as is allowed: a map.
            uninterrupted campaign 10 [] (plainly ros (fibonacci "/fake"))
              `both` void (Signal.read (latest ros (upToBytes 10000000 (topic "/map" latched) :: Topic Value)))
        , forever (atomically (readTBQueue reported) >>= say . Std . Text.pack)
        , forever (atomically (receive inbox) >> judging >>= say . Std . verdict)
        ]

-- | What a signal says of a reading.
verdict :: Either SomeException Bool -> Text
verdict = \case
  Right low -> Text.pack (show low)
  Left why -> Text.pack (fromMaybe "another fault" (failureOrFault why))

-- | Messages faster than one reader takes them, while there is a reaction to others; then those which a real bridge
-- carries.
floods :: Campaign -> Behavior ()
floods campaign = do
  withLies campaign ["flood", "10000", if isLong campaign then "30" else "10"] $ \way -> withRos way $ \ros -> do
    awaitBridge ros
    let numbers name = topic name latched :: Topic (Std Int32)
        newest name = unStd <$> latest ros (numbers name)
    publishing ros (publication "/said") $ \say ->
      withMessages ros (numbers "/flood") 1000 $ \fast -> withMessages ros (numbers "/flood") 100 $ \slow -> do
        let reacting n = do
              next <- otherThan n (newest "/pulse")
              say (Std (Text.pack (show next)))
              reacting next
        quickly <- newTaken
        slowly <- newTaken
        firstOf
          [ reacting 0
          , forever (atomically (taking quickly fast))
          , forever (atomically (taking slowly slow) >> sleep 0.001)
          , void (Signal.read (newest "/over"))
          ]
        for_ [("fast" :: String, quickly, fast), ("slow", slowly, slow)] $ \(name, taken, inbox) -> do
          waited <- atomically (unhandled inbox)
          Taken handled disorder _ _ <- readTVarIO taken
          lost <- atomically (dropped inbox)
          note campaign 9
            ["reader" .= name, "handled" .= handled, "waiting" .= waited, "dropped" .= lost, "disorder" .= disorder]
  withBridge campaign 1 $ \_ way -> carried campaign way 250

-- | What a reader has taken: how many messages, how many of which were not later than the one before, the first number
-- and the last.
data Taken = Taken !Int !Int !Int32 !Int32

newTaken :: IO (TVar Taken)
newTaken = newTVarIO (Taken 0 0 0 0)

-- | Takes a message in the transaction in which it is counted.
taking :: TVar Taken -> Inbox (Std Int32) -> STM ()
taking taken inbox = do
  Std n <- receive inbox
  modifyTVar' taken $ \(Taken handled disorder first before) ->
    Taken (handled + 1) (if n > before then disorder else disorder + 1) (if handled == 0 then n else first) n

-- | How many of two seconds' messages a real bridge carries: at that rate, and at twice as much, as long as that is
-- 99 %. (It drops what does not fit into its queue, or ends the connection: so each rate has one of its own. Those
-- before the first one that arrives do not count: the bridge has just subscribed.)
carried :: Campaign -> Transport -> Int32 -> Behavior ()
carried campaign way rate = do
  taken <- newTaken
  let anyCame = readTVar taken >>= \(Taken n _ _ _) -> check (n > 0)
      lastCame = readTVar taken >>= \(Taken _ _ _ m) -> check (m == 2 * rate)
  end <- tryAny . withRos way $ \ros -> do
    awaitBridge ros
    withMessages ros (topic "/load" latched) 100000 $ \inbox -> publishing ros (publication "/rate") $ \say ->
      firstOf
        [ forever (atomically (taking taken inbox))
        , (every 0.2 (say (Std rate)) ||| atomically anyCame) >> (timeout 5 (atomically lastCame) ? pure ())
        ]
  Taken n _ begun ended <- readTVarIO taken
  let wanted = 2 * fromIntegral rate - fromIntegral begun + 1
      almostAll = ended > 0 && 100 * n >= 99 * wanted
  note campaign 9
    ["rate" .= rate, "wanted" .= wanted, "arrived" .= n, "end" .= either displayException (const "well") end]
  when (almostAll && rate < 64000) $ carried campaign way (2 * rate)
