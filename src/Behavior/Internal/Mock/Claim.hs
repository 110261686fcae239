{-# OPTIONS_HADDOCK not-home #-}

-- |
-- Claims about the record of a mock world.
--
-- Internal: any of it may change in any release.
module Behavior.Internal.Mock.Claim
  ( Claim
  , eventually
  , withinSeconds
  , never
  , exactly
  , always
  , comesBefore
  , whenever

    -- * Checking
  , holds
  , verdict
  ) where

import Control.Applicative ((<|>))
import Data.Char (toUpper)
import Data.List (intercalate, isPrefixOf)
import Data.Maybe (listToMaybe)

import Behavior.Internal.Mock.Moment
import Behavior.Internal.Mock.Record
import Behavior.Internal.Runtime (Seconds)

-- $setup
-- >>> import Behavior.Sim.Mock
-- >>> import Behavior.Internal.Mock.Record
-- >>> let line s name = RecordEntry s name "" 1
-- >>> let drive = [line 0 "drive" Begins, line 4 "low" (Becomes "True"), line 4 "drive" StopRequested, line 5 "drive" Stops]
-- >>> let charge = [line 5 "charge" Begins, line 9 "charge" Succeeds]
-- >>> let record = Record ["low", "drive", "charge"] (line 0 "low" (Is "False") : drive ++ charge)
-- >>> let check claim = either putStr pure (verdict claim record)

-- | A claim about a record. Two claims joined by '<>' hold when both hold; if not, the report has the
-- one that does not.
--
-- The claims are the most common patterns of specifications (Dwyer, Avrunin and
-- Corbett, /Patterns in property specifications for finite-state verification/):
-- existence, absence, bounded existence, universality, precedence and response. A
-- record is complete: what is not in it has not happened in time.
--
-- @since 0.1.0.0
data Claim = Claim
  { claimWords :: String
  , claimNames :: [String]
  , violation :: Lines -> Origin -> Maybe Violation
  -- ^ How it does not hold for the entries after the origin, if so.
  }

-- | How a claim does not hold.
data Violation = Violation
  { broken :: String
  -- ^ The claim; of several that are joined, the one that does not hold.
  , reason :: String
  , shown :: Lines
  -- ^ The entries that show it.
  }

-- | The entry after which a claim is checked, and its time. (For the whole record the
-- entry is -1.)
data Origin = Origin Int Seconds

instance Semigroup Claim where
  a <> b =
    Claim (intercalate ", and " (filter (not . null) [claimWords a, claimWords b])) (claimNames a ++ claimNames b) $
      \rows origin -> violation a rows origin <|> violation b rows origin

instance Monoid Claim where
  mempty = Claim "" [] (\_ _ -> Nothing)

-- | It happens, at least once.
--
-- @since 0.1.0.0
eventually :: Moment -> Claim
eventually = withinSeconds (1 / 0)

-- | It happens within the given number of seconds (to a microsecond): from the beginning,
-- or under 'whenever' from that moment on. A negative number or NaN is rejected with an
-- 'Control.Exception.ErrorCall'.
--
-- >>> check (whenever (becoming "low" True) (withinSeconds 0.5 (startOf "charge")))
-- This does not hold: whenever "low" becomes True, within 0.5 s "charge" begins.
-- From 4.0 s on, it came only at 5.0 s:
--     0.0 s  low: is False
--     0.0 s  drive: begins
--   > 4.0 s  low: becomes True
--     4.0 s  drive: stop requested
--     5.0 s  drive: has stopped
--   > 5.0 s  charge: begins
--     9.0 s  charge: done
--
-- @since 0.1.0.0
withinSeconds :: Seconds -> Moment -> Claim
withinSeconds limit m
  | limit >= 0 = claimOf (term ++ momentWords m) m $ \(Origin _ since) found -> case found of
      [] -> Just ("it never came", [])
      row : _
        | time row - since <= limit + 0.000001 -> Nothing
        | otherwise -> Just ("it came only at " ++ inSeconds (time row), [row])
  | otherwise = errorWithoutStackTrace ("withinSeconds: a limit is zero or more seconds, not " ++ show limit)
 where
  term
    | limit == 1 / 0 = "eventually "
    | otherwise = "within " ++ inSeconds limit ++ " "

-- | It does not happen.
--
-- @since 0.1.0.0
never :: Moment -> Claim
never m = claimOf ("never " ++ momentWords m) m $ \_ found -> case found of
  [] -> Nothing
  row : _ -> Just ("it was so at " ++ inSeconds (time row), [row])

-- | It happens exactly the given number of times.
--
-- @since 0.1.0.0
exactly :: Int -> Moment -> Claim
exactly times m = claimOf ("exactly " ++ show times ++ " times " ++ momentWords m) m $ \_ found ->
  if length found == times then Nothing else Just ("it was so " ++ show (length found) ++ " times", found)

-- | The interval is going on at every entry (the initial values of conditions excepted).
--
-- >>> holds (whenever (startOf "charge") (always (being "low" True))) record
-- True
--
-- @since 0.1.0.0
always :: Interval -> Claim
always s = simple ("always " ++ intervalWords s) (intervalNames s) $ \rows (Origin origin _) ->
  let isInside n = any (\range -> from range <= at n && at n < to range) (intervalRanges s rows)
   in case [row | row@(n, entry) <- rows, n > origin, not (isInitial entry || isInside n)] of
        [] -> Nothing
        row : _ -> Just ("it was not so at " ++ inSeconds (time row), [row])
 where
  -- The entries that the set-up of the world makes: not everything exists yet.
  isInitial entry = case entryKind entry of
    Is _ -> True
    _ -> False

-- | The second does not happen before the first has happened: @startOf "look" \`comesBefore\`
-- startOf "cross"@. It holds when the second never happens.
--
-- >>> check (startOf "charge" `comesBefore` endOf "drive")
-- This does not hold: "charge" begins before "drive" ends.
-- The second came at 5.0 s, without the first:
--     ...
--     4.0 s  low: becomes True
--     4.0 s  drive: stop requested
--   > 5.0 s  drive: has stopped
--     5.0 s  charge: begins
--     9.0 s  charge: done
--
-- @since 0.1.0.0
comesBefore :: Moment -> Moment -> Claim
comesBefore a b =
  simple (momentWords a ++ " before " ++ momentWords b) (momentNames a ++ momentNames b) $ \rows (Origin origin _) ->
    let after m = filter ((> origin) . fst) (occurrences m rows)
     in case (after a, after b) of
          (_, []) -> Nothing
          ((n, _) : _, (k, _) : _) | n < k -> Nothing
          (_, row : _) -> Just ("the second came at " ++ inSeconds (time row) ++ ", without the first", [row])

infix 7 `comesBefore`

-- | Each time that it happens, the claim holds for what comes after.
--
-- > whenever (becoming "low" True) (eventually (startOf "charge"))
-- > whenever (becoming "low" True) (withinSeconds 2 (startOf "charge"))
-- > whenever (faultOf "motor") (never (startOf "drive"))
--
-- @since 0.1.0.0
whenever :: Moment -> Claim -> Claim
whenever m claim =
  Claim (words' (claimWords claim)) (momentNames m ++ claimNames claim) $ \rows (Origin origin _) ->
    listToMaybe
      [ Violation (words' (broken v)) ("from " ++ inSeconds (time row) ++ " on, " ++ reason v) (row : shown v)
      | row@(n, _) <- occurrences m rows
      , n > origin
      , Just v <- [violation claim rows (Origin n (time row))]
      ]
 where
  words' then' = "whenever " ++ momentWords m ++ ", " ++ then'

-- | A claim that is not made of others: its words, its names, and why it does not hold, with the
-- entries that show it.
simple :: String -> [String] -> (Lines -> Origin -> Maybe (String, Lines)) -> Claim
simple words' names check = Claim words' names (\rows origin -> uncurry (Violation words') <$> check rows origin)

claimOf :: String -> Moment -> (Origin -> Lines -> Maybe (String, Lines)) -> Claim
claimOf words' m check = simple words' (momentNames m) $ \rows origin@(Origin after _) ->
  check origin (filter ((> after) . fst) (occurrences m rows))

time :: (Int, RecordEntry) -> Seconds
time = entryTime . snd

-- | Whether a claim holds. With hspec: @record \`shouldSatisfy\` holds claim@.
-- ('Behavior.Sim.Mock.shouldRecord' also gives the reason if it does not.)
--
-- @since 0.1.0.0
holds :: Claim -> Record -> Bool
holds claim = either (const False) (const True) . verdict claim

-- | Why a claim does not hold, with the lines of the record that show it.
--
-- A claim about an unknown name does not hold; otherwise a typo would make 'never' true.
--
-- >>> check (never (startOf "chrage"))
-- This does not hold: never "chrage" begins.
-- Nothing in this world is called "chrage", only "low", "drive", "charge".
--
-- @since 0.1.0.0
verdict :: Claim -> Record -> Either String ()
verdict claim record = case (unknown, violation claim (numbered record) (Origin (-1) 0)) of
  (name : _, _) ->
    refuted (claimWords claim) ("Nothing in this world is called " ++ show name ++ ", only " ++ commas (map show (recordSubjects record)) ++ ".") []
  ([], Just v) ->
    refuted (broken v) (capital (reason v) ++ if null (recordEntries record) then "." else ":") (excerpt (map fst (shown v)) (recordEntries record))
  ([], Nothing) -> Right ()
 where
  unknown = [name | name <- claimNames claim, not (any (`names` name) (recordSubjects record))]
  names known name = known == name || (known ++ " ") `isPrefixOf` name
  commas = intercalate ", "
  refuted which why rows = Left (unlines (("This does not hold: " ++ which ++ ".") : why : rows))
  capital why = map toUpper (take 1 why) ++ drop 1 why

-- | The given lines, marked, each with the two before and after it; if none are given,
-- the last lines.
excerpt :: [Int] -> [RecordEntry] -> [String]
excerpt seen rows = gaps 0 [(n, marked n line) | (n, line) <- zip [0 ..] (timeline rows), near n]
 where
  near n = any (\k -> abs (n - k) <= 2) (if null seen then [length rows - 3] else seen)
  marked n line = (if n `elem` seen then "  > " else "    ") ++ line
  gaps next [] = ["    ..." | next < length rows]
  gaps next ((n, line) : others) = ["    ..." | n > next] ++ line : gaps (n + 1) others
