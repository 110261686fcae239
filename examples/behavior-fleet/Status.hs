{-# LANGUAGE OverloadedStrings #-}

-- |
-- What is in the database of a fleet, as tables and as JSON: by the views of the schema.
module Status
  ( status
  , dead
  , explained
  ) where

import Control.Exception (catch, throwIO)
import Control.Monad (unless, void)
import Data.Char (ord)
import Data.List (dropWhileEnd, stripPrefix, transpose)
import Data.Maybe (mapMaybe)
import Data.String (fromString)
import Data.Text (Text)
import qualified Data.Text as Text
import Database.PostgreSQL.Simple
import Numeric (showHex)
import Text.Read (readMaybe)

import Behavior (Behavior)
import Behavior.Fleet.Internal.Connect (text)
import Behavior.Fleet.Internal.Migration (withDatabase)
import Behavior.Fleet.Internal.Version (noFleet, unfit)
import Behavior.Fleet.Schema (SchemaFailure (..))
import Behavior.Trace.Describe (inertUpTo)

-- | One kind of what is in the database.
data Section = Section
  { title :: String
  , numbers :: Int
  -- ^ How many of the table's columns are numbers; they come first.
  , shown :: String
  -- ^ The columns that are in the table. (The end @_seconds@ is left out in its headings.)
  , rows :: Query
  }

sections :: [Section]
sections =
  [ Section "queues" 7 "waiting later running done dead cancelled oldest_seconds queue"
      "select queue, coalesce(sum(tasks) filter (where state = 'waiting'), 0) as waiting, \
      \coalesce(sum(tasks) filter (where state = 'later'), 0) as later, \
      \coalesce(sum(tasks) filter (where state = 'running'), 0) as running, \
      \coalesce(sum(tasks) filter (where state = 'done'), 0) as done, \
      \coalesce(sum(tasks) filter (where state = 'dead'), 0) as dead, \
      \coalesce(sum(tasks) filter (where state = 'cancelled'), 0) as cancelled, \
      \round(extract(epoch from fleet.clock() - min(oldest) filter (where state = 'waiting')), 1) as oldest_seconds \
      \from fleet.queues group by queue order by dead desc, waiting desc, queue"
  , Section "robots" 1 "seen_seconds state host page robot"
      "select robot, case when is_there then 'there' else 'gone' end as state, host, page, process, \
      \round(extract(epoch from fleet.clock() - seen), 1) as seen_seconds \
      \from (select p.*, robot, row_number() over (partition by robot order by is_there desc, seen desc) as n \
      \from fleet.processes p, unnest(robots) robot) latest where is_there or n = 1 order by is_there, robot, seen desc"
  , Section "starts that run" 3 "expires_seconds start lease robot queue key progress"
      "select queue, key, task, lease, robot, starts as start, progress, \
      \round(extract(epoch from expires_in), 1) as expires_seconds from fleet.starts order by expires_in, task"
  , Section "holds" 2 "expires_seconds fence robot resource"
      "select resource, robot, fence, round(extract(epoch from expires_in), 1) as expires_seconds \
      \from fleet.holds order by resource"
  , Section "waits" 1 "place robot resources"
      "select place, robot, resources from fleet.waits order by place"
  , deadTasks
  ]

deadTasks :: Section
deadTasks =
  Section "dead tasks" 2 "ended_seconds starts queue key reason"
    "select queue, key, task, starts, round(extract(epoch from fleet.clock() - ended), 1) as ended_seconds, \
    \reasons -> -1 ->> 'reason' as reason, reasons from fleet.dead order by ended desc, task"

-- | All that is in the database: as JSON, or as tables of at most 20 rows.
status :: Bool -> String -> Behavior String
status asJson at = looking at $ \connection -> do
  about <- query_ connection
    "select version, epoch, is_restored or origin <> fleet.origin() as is_restored from fleet.about"
  if asJson then json connection sections else do
    tables <- mapM (table connection 20 40) sections
    pure . unlines $ concatMap said about ++ concatMap ("" :) tables
 where
  said (version, epoch, isRestored) =
    ("schema: version " ++ show (version :: Int) ++ ", epoch " ++ show (epoch :: Integer))
      : ["This database was restored from a copy: run behavior-fleet new-epoch, when none of the robots that used the \
         \other one runs." | isRestored]

-- | The dead tasks: as JSON, or as a table.
dead :: Bool -> String -> Behavior String
dead asJson at = looking at $ \connection ->
  if asJson then json connection [deadTasks] else unlines <$> table connection 1000 1000 deadTasks

-- | With a connection that only reads, of one moment.
looking :: String -> (Connection -> Behavior a) -> Behavior a
looking at act = withDatabase at $ \connection -> explained "fleet_viewer" $ do
  void (execute_ connection "begin isolation level repeatable read read only")
  isThere <- query_ connection "select to_regnamespace('fleet') is not null"
  unless (any fromOnly isThere) (throwIO (SchemaFailure noFleet))
  versions <- query_ connection "select version from fleet.about"
  mapM_ (throwIO . SchemaFailure) (mapMaybe (unfit . fromOnly) versions)
  act connection

-- | What a user lacks that has to have this role, in words.
explained :: String -> IO a -> IO a
explained role act = act `catch` \e -> case sqlState e of
  "3F000" -> throwIO (SchemaFailure noFleet)
  "42501" ->
    throwIO . SchemaFailure $
      "the database refuses this user (" ++ Text.unpack (text (sqlErrorMsg e)) ++ "): run, as the owner, grant " ++ role
        ++ " to USER"
  _ -> throwIO e

-- | The rows, at most that many, with cells of at most that many characters. (What is longer is not even fetched.)
table :: Connection -> Int -> Int -> Section -> Behavior [String]
table connection limit width section = do
  fetched <- query_ connection . mconcat $
    ["select (count(*) over ())::text"]
      ++ [", left(" <> cell name <> ", 1000)" | name <- names]
      ++ [" from (", rows section, ") t limit ", fromString (show limit)]
  pure $ case fetched :: [[Maybe Text]] of
    [] -> [title section ++ ": none"]
    (total : _) : _ ->
      let more = maybe 0 (subtract (length fetched)) (readMaybe (number total))
       in (title section ++ ": " ++ number total) : aligned (numbers section) (headings : map cells fetched)
            ++ ["  and " ++ show more ++ " more" | more > 0]
    _ -> []
 where
  names = words (shown section)
  headings = map (map (\c -> if c == '_' then ' ' else c) . withoutUnit) names
  withoutUnit name = maybe name reverse (stripPrefix (reverse "_seconds") (reverse name))
  number = maybe "" Text.unpack
  cells = zipWith shownAs names . drop 1
  shownAs name it
    | withoutUnit name /= name = maybe "" duration (readMaybe . Text.unpack =<< it)
    | otherwise = inertUpTo width (number it)
  -- (An array is shown as its elements.)
  cell name
    | name == "resources" = "array_to_string(resources, ', ')"
    | otherwise = fromString name <> "::text"

-- | Rows, of which the given number of columns are aligned to the right. (The last one is not padded.)
aligned :: Int -> [[String]] -> [String]
aligned right cells = map (dropWhileEnd (== ' ') . concat . zipWith3 pad [1 ..] widths) cells
 where
  widths = map (maximum . map length) (transpose cells)
  pad n width cell
    | n <= right = "  " ++ spaces ++ cell
    | n == length widths = "  " ++ cell
    | otherwise = "  " ++ cell ++ spaces
   where
    spaces = replicate (width - length cell) ' '

-- | A number of seconds.
duration :: Double -> String
duration seconds
  | abs seconds < 100 = show (round seconds :: Int) ++ " s"
  | abs seconds < 6000 = show (round (seconds / 60) :: Int) ++ " min"
  | abs seconds < 360000 = show (round (seconds / 3600) :: Int) ++ " h"
  | otherwise = show (round (seconds / 86400) :: Int) ++ " days"

-- | These sections, with all their rows.
json :: Connection -> [Section] -> Behavior String
json connection them = do
  made <- query_ connection . mconcat $
    ["select json_build_object('version', version, 'epoch', epoch, "]
      ++ ["'is_restored', is_restored or origin <> fleet.origin()"]
      ++ [ mconcat [", '", key it, "', (select coalesce(json_agg(t), '[]') from (", rows it, ") t)"]
         | it <- them
         ]
      ++ [")::text from fleet.about"]
  pure (concatMap plain (concatMap (Text.unpack . fromOnly) made) ++ "\n")
 where
  key it = fromString [if c == ' ' then '_' else c | c <- title it]
  -- (Outside ASCII there may be characters that a terminal obeys.)
  plain c
    | c == '\n' = ""
    | c >= ' ' && c < '\DEL' = [c]
    | c > '\xFFFF' = escape (0xD7C0 + ord c `div` 0x400) ++ escape (0xDC00 + ord c `mod` 0x400)
    | otherwise = escape (ord c)
  escape n = "\\u" ++ replicate (4 - length (showHex n "")) '0' ++ showHex n ""
