-- | Runs one attack by its name; without a name it prints the names of all.
module Main (main) where

import System.Environment (getArgs)
import System.Exit (die)

import qualified Abandons
import qualified AllocationLimits
import qualified DeadCleanup
import qualified EveryThread
import qualified IndirectThrow
import qualified LateRecovery
import qualified Messages
import qualified MutualThrow
import qualified NestedLimits
import qualified NurseryRaces
import qualified Pauses
import qualified ReactiveThrow
import qualified ScopedScale
import qualified SharedFilters
import qualified SimBusy
import qualified SimEnds
import qualified SimGhc
import qualified SimReality
import qualified SimStopped
import qualified SinkStorms
import qualified Sinks
import qualified SlowStops
import qualified StopsOnce
import qualified Storm
import qualified StuckLimits
import qualified StuckMasked
import qualified TracedStops
import qualified Traces
import qualified Truth
import qualified UndefinedOutside
import qualified UninterruptibleCaller

main :: IO ()
main = do
  arguments <- getArgs
  case arguments of
    [] -> mapM_ (putStrLn . fst) attacks
    [name] | Just attack <- lookup name (attacks ++ documented) -> attack
    _ -> die "attacks: the argument is the name of an attack"

attacks :: [(String, IO ())]
attacks =
  [ ("Abandons", Abandons.attack)
  , ("AllocationLimits", AllocationLimits.attack)
  , ("DeadCleanup", DeadCleanup.attack)
  , ("EveryThread", EveryThread.attack)
  , ("LateRecovery", LateRecovery.attack)
  , ("Messages", Messages.attack)
  , ("MutualThrow", MutualThrow.attack)
  , ("NestedLimits", NestedLimits.attack)
  , ("NurseryRaces", NurseryRaces.attack)
  , ("Pauses", Pauses.attack)
  , ("ReactiveThrow", ReactiveThrow.attack)
  , ("SimBusy", SimBusy.attack)
  , ("SimEnds", SimEnds.attack)
  , ("ScopedScale", ScopedScale.attack)
  , ("SharedFilters", SharedFilters.attack)
  , ("SimGhc", SimGhc.attack)
  , ("SimReality", SimReality.attack)
  , ("SimStopped", SimStopped.attack)
  , ("StuckMasked", StuckMasked.attack)
  , ("Sinks", Sinks.attack)
  , ("SinkStorms", SinkStorms.attack)
  , ("SlowStops", SlowStops.attack)
  , ("StopsOnce", StopsOnce.attack)
  , ("Storm", Storm.attack)
  , ("StuckLimits", StuckLimits.attack)
  , ("TracedStops", TracedStops.attack)
  , ("Traces", Traces.attack)
  , ("Truth", Truth.attack)
  , ("UndefinedOutside", UndefinedOutside.attack)
  ]

-- | Attacks that hang, as the page of "Behavior" documents ("What GHC limits").
documented :: [(String, IO ())]
documented =
  [ ("IndirectThrow", IndirectThrow.attack)
  , ("UninterruptibleCaller", UninterruptibleCaller.attack)
  ]
