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
  , premisesIn
  ) where

import Control.Applicative ((<|>))
import Data.Char (toUpper)
import Data.Foldable (for_)
import Data.List (intercalate, sortOn)
import Data.Maybe (listToMaybe)

import Behavior.Internal.Core.SafeText (settledText)
import Behavior.Internal.Mock.Interval
import Behavior.Internal.Mock.Moment
import Behavior.Internal.Mock.Record
import Behavior.Internal.Mock.Subject
import Behavior.Internal.Seam.Runtime (Seconds)

-- $setup
-- >>> import Data.List (sortOn)
-- >>> import Behavior.Sim.Mock
-- >>> import Behavior.Internal.Mock.Record
-- >>> let line s name = RecordEntry s name "" 1
-- >>> let low = [line 0 "low" (Is "False"), line 4 "low" (Becomes "True")]
-- >>> let drive = [line 0 "drive" Begins, line 4 "drive" StopRequested, line 5 "drive" Stops]
-- >>> let charge = [line 5 "charge" Begins, line 9 "charge" Succeeds]
-- >>> let entries = sortOn entryTime (low ++ drive ++ charge)
-- >>> let record = Record [("low", ACondition), ("drive", AnAction), ("charge", AnAction)] entries 9
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
  , claimNeeds :: [Need]
  , premises :: [Premise]
  -- ^ What has to come, or the claim holds whatever happens.
  , violation :: Record -> Origin -> Maybe Violation
  -- ^ How the claim is violated by the entries after the origin, if it is.
  }

-- | Why a claim does not hold, and the lines that show it.
data Violation = Violation
  { broken :: String
  -- ^ The claim; of several that are joined, the one that does not hold.
  , reason :: String
  , shown :: [Line]
  -- ^ The lines that show it.
  }

instance Semigroup Claim where
  a <> b =
    Claim
      { claimWords = intercalate ", and " (filter (not . null) [claimWords a, claimWords b])
      , claimNeeds = claimNeeds a ++ claimNeeds b
      , premises = premises a ++ premises b
      , violation = \record origin -> violation a record origin <|> violation b record origin
      }

instance Monoid Claim where
  mempty = Claim "" [] [] (\_ _ -> Nothing)

-- | It happens, at least once.
--
-- @since 0.1.0.0
eventually :: Moment -> Claim
eventually = withinSeconds (1 / 0)

-- | It happens within the given number of seconds (to a microsecond): from the beginning,
-- or under 'whenever' from that moment on. A negative number or NaN is rejected with an
-- 'Control.Exception.ErrorCall'.
--
-- This is so even if the run ends before the limit: what has not come by then never came. (A claim
-- that held because the run was cut would show nothing.) So let the run last longer than the limit.
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
  | limit >= 0 = claimOf (term ++ momentWords m) [] m $ \record (Origin _ since) found -> case found of
      []
        | limit < 1 / 0 && since + limit - tolerance > recordEnd record ->
            Just ("it never came (the record ends at " ++ inSeconds (recordEnd record) ++ ", before the limit)", [])
        | otherwise -> Just ("it never came", [])
      row : _
        | time row <= since + limit + tolerance -> Nothing
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
never m = claimOf ("never " ++ momentWords m) (momentPremises m) m $ \_ _ found -> case found of
  [] -> Nothing
  row : _ -> Just ("it was so at " ++ inSeconds (time row), [row])

-- | It happens exactly the given number of times.
--
-- @since 0.1.0.0
exactly :: Int -> Moment -> Claim
exactly n m = claimOf ("exactly " ++ times n ++ " " ++ momentWords m) presupposed m $ \_ _ found ->
  if length found == n then Nothing else Just ("it was so " ++ times (length found), found)
 where
  presupposed = if n == 0 then momentPremises m else []
  times 1 = "once"
  times many = show many ++ " times"

-- | The interval is going on all the time, up to the end of the record: at every entry (the initial values
-- of conditions excepted), and at every moment after it.
--
-- >>> holds (whenever (startOf "charge") (always (being "low" True))) record
-- True
--
-- @since 0.1.0.0
always :: Interval -> Claim
always s = simple ("always " ++ intervalWords s) (intervalNeeds s) [] $ \record (Origin origin since) ->
  let ranges = intervalRanges s record
      rows = numbered record
      end = Instant (recordEnd record) After 0
      -- It is going on all the time if it is at the entries, where one of its ranges ends, and at the end.
      instants =
        [(at row, "at", time row) | row@(n, entry) <- rows, n > origin, not (isInitial entry)]
          ++ [(p, "after", t - tolerance) | p@(Instant t _ _) <- map to ranges, p > Instant since At origin, p < end]
          ++ [(end, "at", recordEnd record)]
      isIncluded (instant, _, _) = any (\range -> from range <= instant && instant < to range) ranges
   in case sortOn (\(instant, _, _) -> instant) (filter (not . isIncluded) instants) of
        [] -> Nothing
        (instant, word, t) : _ ->
          Just ("it was not so " ++ word ++ " " ++ inSeconds t, take 1 (reverse (takeWhile ((<= instant) . at) rows)))
 where
  -- An entry that the set-up of the world makes: then not everything exists yet.
  isInitial entry = case entryKind entry of
    Is _ -> True
    _ -> False

-- | The second does not happen before the first has happened: @startOf "look" \`comesBefore\`
-- startOf "cross"@. The claim holds if the second never happens.
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
comesBefore a b = simple text (momentNeeds a ++ momentNeeds b) [premiseOf b] $ \record (Origin origin _) ->
  let after m = filter ((> origin) . fst) (occurrences m record)
   in case (after a, after b) of
        (_, []) -> Nothing
        ((n, _) : _, (k, _) : _) | n < k -> Nothing
        (_, row : _) -> Just ("the second came at " ++ inSeconds (time row) ++ ", without the first", [row])
 where
  text = momentWords a ++ " before " ++ momentWords b

infix 7 `comesBefore`

-- | Each time that the moment comes, the claim holds for what comes after it.
--
-- > whenever (becoming "low" True) (eventually (startOf "charge"))
-- > whenever (becoming "low" True) (withinSeconds 2 (startOf "charge"))
-- > whenever (faultOf "motor") (never (startOf "drive"))
--
-- @since 0.1.0.0
whenever :: Moment -> Claim -> Claim
whenever m claim =
  Claim
    { claimWords = given (claimWords claim)
    , claimNeeds = momentNeeds m ++ claimNeeds claim
    , premises = premiseOf m : map later (premises claim)
    , violation = \record origin ->
        listToMaybe
          [ Violation (given (broken v)) ("from " ++ inSeconds (time row) ++ " on, " ++ reason v) (row : shown v)
          | (row, here) <- after record origin
          , Just v <- [violation claim record here]
          ]
    }
 where
  after record (Origin origin _) = [(row, Origin n (time row)) | row@(n, _) <- occurrences m record, n > origin]
  later p =
    Premise
      { premiseWords = premiseWords p ++ " after " ++ momentWords m
      , comes = \record -> any (comes p record . snd) . after record
      }
  given consequence = "whenever " ++ momentWords m ++ ", " ++ consequence

-- | A claim that is not made of others: its words, what it needs and presupposes, and why it does not hold, with
-- the lines that show it.
simple :: String -> [Need] -> [Premise] -> (Record -> Origin -> Maybe (String, [Line])) -> Claim
simple text needs presupposed check =
  Claim text needs presupposed (\record origin -> uncurry (Violation text) <$> check record origin)

-- | A claim about when a moment occurs.
claimOf :: String -> [Premise] -> Moment -> (Record -> Origin -> [Line] -> Maybe (String, [Line])) -> Claim
claimOf text presupposed m check = simple text (momentNeeds m) presupposed $ \record origin@(Origin after _) ->
  check record origin (filter ((> after) . fst) (occurrences m record))

-- | Whether a claim holds. With hspec: @record \`shouldSatisfy\` holds claim@.
-- ('Behavior.Sim.Mock.shouldRecord' also gives the reason if it does not.)
--
-- @since 0.1.0.0
holds :: Claim -> Record -> Bool
holds claim = either (const False) (const True) . verdict claim

-- | Why a claim does not hold, with the lines of the record that show it.
--
-- A claim about an unknown name, or about something that can never do what the claim says, does not hold;
-- otherwise a typo would make 'never' hold.
--
-- >>> check (never (startOf "chrage"))
-- This does not hold: never "chrage" begins.
-- Nothing in this world is called "chrage", only "low", "drive", "charge".
-- >>> check (never (startOf "low"))
-- This does not hold: never "low" begins.
-- "low" is a condition, and never begins. The actions of this world: "drive", "charge".
--
-- (An action can have any argument, so a misspelt one is not noticed. But if the record has an argument that the
-- claim only writes in another way, that is noticed: @open front@ instead of @open "front"@.)
--
-- @since 0.1.0.0
verdict :: Claim -> Record -> Either String ()
verdict claim record = case unfitIn record (claimNeeds claim) of
  Just why -> refuted (claimWords claim) why []
  Nothing -> for_ (violation claim record (Origin (-1) 0)) $ \v ->
    refuted (broken v) (capital (reason v) ++ if null entries then "." else ":") (excerpt (map fst (shown v)) entries)
 where
  entries = recordEntries record
  refuted which why rows = Left (unlines (("This does not hold: " ++ which ++ ".") : why : rows))
  capital why = map toUpper (take 1 why) ++ drop 1 why

-- | What has to come, or the claim holds whatever happens: in words, and whether it has come in this record.
premisesIn :: Record -> Claim -> [(String, Bool)]
premisesIn record claim = [(settledText (premiseWords p), comes p record (Origin (-1) 0)) | p <- premises claim]

-- | The given lines, marked, each with the two before and after it; if none are given,
-- the last lines.
excerpt :: [Int] -> [RecordEntry] -> [String]
excerpt seen rows = gaps 0 [(n, marked n line) | (n, line) <- zip [0 ..] (timeline rows), near n]
 where
  near n = any (\k -> abs (n - k) <= 2) (if null seen then [length rows - 3] else seen)
  marked n line = (if n `elem` seen then "  > " else "    ") ++ line
  gaps next [] = ["    ..." | next < length rows]
  gaps next ((n, line) : others) = ["    ..." | n > next] ++ line : gaps (n + 1) others
