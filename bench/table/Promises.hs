{-# LANGUAGE OverloadedStrings #-}

-- |
-- What is promised of speed, row by row.
module Promises (promises) where

import Data.String (fromString)

import Row

promises :: [Group]
promises =
  [trying, together, reacting, manyBranches, rules, standingStill, longPrograms]
    ++ [reactions, besideComputation, idleFleet, fleetBytes, fleetTime]
    ++ [seamTime, seamBytes, simulator, simulatedDay, explorations]

-- What the operators cost, beside what does the same by hand, or as behaviour trees do it.

trying, together, reacting, manyBranches, rules, standingStill, longPrograms :: Group
trying =
  operators
    "Fallback: nanoseconds"
    [ "? that succeeds" `within` 1.1 `times` "try that succeeds"
    , "? that fails" `within` 1.1 `times` "try that fails"
    ]
together =
  operators
    "Two at once: nanoseconds"
    [ "parallel, both end at once" `within` 1.3 `times` "race, both end at once"
    , "parallel, one to be stopped" `within` 1.3 `times` "race, one to be stopped"
    , "both, both end at once" `within` 1.3 `times` "concurrently_, both end at once"
    , "both, one to be stopped" `within` 1.3 `times` "concurrently_, one to be stopped"
    ]
reacting =
  operators
    "Reacting: nanoseconds"
    [ "monitor, undisturbed" `within` 1.3 `times` "race, both end at once"
    , "rSelect, undisturbed" `within` 1.3 `times` "race, both end at once"
    , "monitor, polled" `within` 2.5 `times` "race, both end at once"
    , "interruption, recovery and restart" `within` 1.5 `times` scaled 2 "race, one to be stopped"
    ]
manyBranches =
  operators "Many at once, and n/2 times the cost for 2: nanoseconds" $
    concat
      [ [ operator `of'` n `within` 1.2 `times` scaled (n / 2) (operator `of'` 2)
        | operator <- ["firstOf", "firstOf, the last ends", "allOf"]
        , n <- [10, 100, 1000]
        ]
      , [operator `of'` 100 `atMost` 60 * microseconds | operator <- ["firstOf", "allOf"]]
      , ["bare threads, stopped" `of'` n `beside` scaled (n / 2) ("bare threads, stopped" `of'` 2) | n <- [10, 100, 1000]]
      , [told (primitive `of'` n) | primitive <- ["asum of Concurrently", "mapConcurrently_"], n <- [10, 100, 1000]]
      ]
rules =
  operators "Ordered rules, a change: nanoseconds" $
    [ "teleoReactive" `of'` n `within` share `times` (peer ++ " rules tick") `of'` n
    | (peer, share) <- [("bonsai", 1 / 3), ("py_trees", 1)]
    , n <- [10, 100, 1000]
    ]
      ++ [told ("a look at variables" `of'` n) | n <- [10, 100, 1000]]
standingStill =
  operators
    "Ordered rules, no change: seconds of the processor a second"
    (told "bare thread idle cpu" : ["teleoReactive idle cpu" `of'` n `atMost` 0.001 | n <- [10, 100, 1000]])
longPrograms =
  operators
    "100,000 steps: nanoseconds a step"
    [ "sequence, a step" `within` 1 `times` "bonsai sequence step"
    , "sequence, a step" `within` 1 `times` "py_trees sequence step"
    , "fallback, a step" `within` 1 `times` "bonsai fallback step"
    , "fallback, a step" `within` 1 `times` "py_trees fallback step"
    , "fallback, a step" `within` 1.1 `times` "try that fails"
    ]

operators :: String -> [Row] -> Group
operators title = Group title "-N1 -A4m"

-- From the change of a condition to the start of the recovery, beside a bare thread.

reactions :: Group
reactions =
  Group "A condition changes, its recovery starts: microseconds" "-I0 -A16m -qm, with -N1 or -N2" $
    concat
      [ [ reaction n share "ours" `within` bound `times` reaction n share "bare"
        | n <- ["N1", "N2"]
        , (share, bound) <- [("p50", 2), ("p99", 3), ("p99.9", 5)]
        ]
      , [ reaction n share "ours" `atMost` bound
        | (n, share, bound) <- [("N1", "p50", 5), ("N1", "p99", 50), ("N2", "p50", 16), ("N2", "p99", 106)]
        ]
      , [told (reaction "N1" share "by hand") | share <- ["p50", "p99", "p99.9"]]
      , ["reaction among 100000 p99 ours" `within` 5 `times` "reaction among 0 p99 ours"]
      ]

-- Where there are two capabilities, the computation has one of them for itself. Where there
-- is one, a thread that is woken waits until the computation's turn is over, and ours are
-- three, one after the other.

besideComputation :: Group
besideComputation =
  Group "The same beside a computation without end: microseconds" "-I0 -A16m -qm, with -N2 or -N1 -C0.001" $
    [ reaction (load ++ " N2") share "ours" `within` bound `times` reaction "N2" share "ours"
    | load <- ["busy", "counting"]
    , (share, bound) <- [("p50", 2), ("p99", 5), ("p99.9", 5)]
    ]
      ++ [told (reaction setting share whose) | (setting, whose) <- others, share <- ["p50", "p99"]]
 where
  others = [("busy N2", "bare"), ("busy N1", "ours"), ("busy N1", "bare")]

reaction :: String -> String -> String -> Figure
reaction setting share whose = fromString (unwords ["reaction", setting, share, whose])

-- A fleet of agents in one process. What is bare is the least that as many threads cost.

idleFleet, fleetBytes, fleetTime :: Group
idleFleet =
  fleet
    "A fleet, nothing changes: seconds of the processor a second"
    ["fleet idle cpu 100000" `within` 0.01 `times` "bonsai fleet cpu 100000"]
fleetBytes =
  fleet
    "A fleet: bytes an agent"
    [ "fleet bytes 100000" `within` 1 `times` "bonsai fleet bytes 100000"
    , told "bare fleet bytes 100000"
    ]
fleetTime =
  fleet
    "A fleet: nanoseconds an agent, or a reading (after two collections)"
    [ "fleet creation 100000" `within` 1 `times` "bonsai fleet creation 100000"
    , told "bare fleet creation 100000"
    , "fleet polled reading 10000" `within` 1 `times` "bonsai fleet tick 10000"
    , told "bare fleet reading 10000"
    , "fleet polled reading 100000" `within` 1 `times` "bonsai fleet tick 100000"
    , told "bare fleet reading 100000"
    ]

fleet :: String -> [Row] -> Group
fleet title = Group title "-N1 -I0 -A1g -ki672 -kc4k"

-- What it costs that the operators can be simulated: with the switch and without.

seamTime, seamBytes :: Group
seamTime =
  Group "The seam, the shortest round: nanoseconds" "-N1" (seam "ns" switched)
seamBytes =
  Group "The seam, the shortest round: bytes allocated" "-N1" (seam "bytes" (unswitched ++ switched))

seam :: String -> [String] -> [Row]
seam unit operators' =
  [ shortest (switch "with") `within` 1.1 `times` shortest (switch "without")
  | operator <- operators'
  , let switch present = fromString (unwords ["seam", present, unit ++ ":", operator])
  ]

-- | Those that go through the seam; the others take four nanoseconds, and how the code
-- happens to lie makes more of a difference.
switched, unswitched :: [String]
switched = ["atomically", "parallel", "both", "allOf 10", "monitor, watched", "monitor, polled"]
unswitched = ["? that succeeds", "? that fails"]

-- How fast the simulator is.

simulator, simulatedDay :: Group
simulator =
  Group
    "The simulator: so many a second"
    "-N1 -A16m -ki2k"
    [ "scheduling points, two threads in turn" `atLeast` 1 * million
    , "scheduling points, one thread" `atLeast` 1 * million
    , told "scheduling points, random schedules"
    , told "random schedules of a small mission"
    ]
simulatedDay =
  Group
    "A simulated day, a sensor at 1 Hz and a thousand actions: seconds"
    "-N1 -A16m -ki2k"
    ["a simulated day" `atMost` 0.5]

-- What a search of schedules keeps in memory does not grow with their number.

explorations :: Group
explorations =
  Group "A million schedules: bytes" "-N1 -A16m -ki2k" $
    concat
      [ [ schedulesOf "live 200000" `within` 1.1 `times` schedulesOf "live 20000"
        , schedulesOf "resident" `atMost` 200 * million
        ]
      | searching <- ["random", "exhaustive"]
      , let schedulesOf what = fromString (searching ++ " schedules, " ++ what)
      ]

-- | The measurement of this for so many branches, rules or agents.
of' :: String -> Double -> Figure
operator `of'` n = fromString (operator ++ " " ++ show (round n :: Int))

infix 3 `of'`
