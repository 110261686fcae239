{-# LANGUAGE OverloadedStrings #-}

-- |
-- The targets, row by row.
module Promises (promises) where

import Data.String (fromString)

import Row

promises :: [Group]
promises =
  [trying, together, reacting, manyBranches, rules, unchangedRules, longPrograms, traces]
    ++ [reactions, coldReactions, besideComputation, livePage, plainReactions, idleFleet, fleetBytes, fleetTime]
    ++ [seamTime, seamBytes, simulator, simulatedDay, explorations]

-- What the operators cost, compared with the same by hand or in a behaviour tree.

trying, together, reacting, manyBranches, rules, unchangedRules, longPrograms, traces :: Group
trying =
  operators
    "Fallback: nanoseconds"
    [ "? that succeeds" `within` 1.1 `times` "try that succeeds"
    , "? that fails" `within` 1.1 `times` "try that fails"
    ]
together =
  operators
    "Two at once: nanoseconds"
    [ "parallel, both end at once" `within` 1.15 `times` "race, both end at once"
    , "parallel, one to be stopped" `within` 1.2 `times` "race, one to be stopped"
    , "both, both end at once" `within` 1.3 `times` "concurrently_, both end at once"
    , "both, one to be stopped" `within` 1.3 `times` "concurrently_, one to be stopped"
    ]
reacting =
  operators
    "Reacting: nanoseconds"
    [ "monitor, uninterrupted" `within` 1.4 `times` "race, both end at once"
    , "rSelect, uninterrupted" `within` 1.4 `times` "race, both end at once"
    , "monitor, polled" `within` 2.5 `times` "race, both end at once"
    , "interruption, recovery and restart" `within` 1.3 `times` scaled 2 "race, one to be stopped"
    ]
manyBranches =
  operators "Many at once, compared with n/2 times the cost for 2: nanoseconds" $
    concat
      [ [ operator `of'` n `within` 1.2 `times` scaled (n / 2) (operator `of'` 2)
        | operator <-
            [ "firstOf"
            , "firstOf, the last ends"
            , "allOf"
            , "decide"
            , "scoped, older children end"
            , "scoped, children fork at once"
            ]
        , n <- [10, 100, 1000]
        ]
      , [operator `of'` 100 `atMost` 60 * microseconds | operator <- ["firstOf", "allOf"]]
      , [ "bare threads, stopped" `of'` n `beside` scaled (n / 2) ("bare threads, stopped" `of'` 2)
        | n <- [10, 100, 1000]
        ]
      , [noTarget (primitive `of'` n) | primitive <- ["asum of Concurrently", "mapConcurrently_"], n <- [10, 100, 1000]]
      ]
rules =
  operators "Ordered rules, a change: nanoseconds" $
    [ "teleoReactive" `of'` n `within` share `times` (peer ++ " rules tick") `of'` n
    | (peer, share) <- [("bonsai", 1 / 3), ("py_trees", 1)]
    , n <- [10, 100, 1000]
    ]
      ++ [noTarget ("transaction reading variables" `of'` n) | n <- [10, 100, 1000]]
unchangedRules =
  operators
    "Ordered rules, no change: processor seconds per second"
    (noTarget "bare thread idle cpu" : ["teleoReactive idle cpu" `of'` n `atMost` 0.001 | n <- [10, 100, 1000]])
longPrograms =
  operators
    "100,000 steps: nanoseconds per step"
    [ "sequence, a step" `within` 1 `times` "bonsai sequence step"
    , "sequence, a step" `within` 1 `times` "py_trees sequence step"
    , "fallback, a step" `within` 1 `times` "bonsai fallback step"
    , "fallback, a step" `within` 1 `times` "py_trees fallback step"
    , "fallback, a step" `within` 1.1 `times` "try that fails"
    ]

-- A span is two events.
traces =
  Group "Traces, with a sink that keeps up: nanoseconds" "-A4m, with -N1 or -N2" $
    concat
      [ [ at n "named" `beside` at n "no name"
        , at n "traced named" `atMost` 2 * microseconds
        , at n "traced named, the sink blocked" `within` 1.05 `times` at n "traced named"
        , at n "traced named, by two" `atMost` 2 * microseconds
        , at n "traced parallel" `beside` at n "parallel"
        , at n "traced monitor" `beside` at n "monitor"
        ]
      | n <- ["N1", "N2"]
      ]
 where
  at n what = fromString (n ++ " " ++ what)

operators :: String -> [Row] -> Group
operators title = Group title "-N1 -A4m"

livePage :: Group
livePage =
  Group
    "A reaction in a trace, with a live page: microseconds"
    "-I0 -A16m -qm -N1"
    [ "live reaction, 10 readers" `within` 1.25 `times` "live reaction, no reader"
    , "live reaction, no reader" `beside` "live reaction, no page"
    ]

-- From the change of a condition to the start of the recovery, compared with a bare thread.

reactions :: Group
reactions =
  Group
    "From a change of the condition to the start of the recovery: microseconds"
    "-I0 -A16m -qm, with -N1 or -N2"
    $ concat
      [ [ reaction n share "ours" `within` bound `times` reaction n share "bare"
        | n <- ["N1", "N2"]
        , (share, bound) <- [("p50", 2), ("p99", 3), ("p99.9", 5)]
        ]
      , [ reaction n share "ours" `atMost` bound
        | (n, share, bound) <- [("N1", "p50", 5), ("N1", "p99", 50), ("N2", "p50", 16), ("N2", "p99", 106)]
        ]
      , [noTarget (reaction "N1" share "by hand") | share <- ["p50", "p99", "p99.9"]]
      , ["reaction among 100000 p99 ours" `within` 5 `times` "reaction among 0 p99 ours"]
      ]

-- The same compared with BehaviorTree.CPP; also when the process is idle between the changes.

coldReactions :: Group
coldReactions =
  Group "The same, changes every 0.3 ms, or every 2 ms (cold): microseconds" "-I0 -A16m -qm, with -N1 or -N2" $
    [reaction setting share "ours" `within` 1 `times` theirs "cold" share | setting <- cold, share <- shares]
      ++ [reaction setting share "ours" `beside` theirs "hot" share | setting <- ["N1", "N2"], share <- shares]
      ++ [reaction setting share "ours" `beside` reaction setting share "bare" | setting <- cold, share <- shares]
 where
  cold = ["cold N1", "cold N2"]
  shares = ["p50", "p99"]
  theirs gap share = fromString (unwords ["btcpp reaction", gap, share])

-- With two capabilities, the computation has one of them for itself. With one, a thread that is
-- woken waits until the time slice of the computation ends; the operator needs three such waits,
-- one after the other.

besideComputation :: Group
besideComputation =
  Group "The same beside an endless computation: microseconds" "-I0 -A16m -qm, with -N2 or -N1 -C0.001" $
    [ reaction (load ++ " N2") share "ours" `within` bound `times` reaction "N2" share "ours"
    | load <- ["busy", "counting"]
    , (share, bound) <- [("p50", 2), ("p99", 5), ("p99.9", 5)]
    ]
      ++ [noTarget (reaction setting share whose) | (setting, whose) <- others, share <- ["p50", "p99"]]
 where
  others = [("busy N2", "bare"), ("busy N1", "ours"), ("busy N1", "bare")]

-- Where threads run is decided by 'pinned' or, without it, by GHC. In the reference no thread is
-- moved.

plainReactions :: Group
plainReactions =
  Group
    "A program without other options, changes every 0.3 ms (hot), 5 ms (colder): microseconds"
    "-N1, -N2, or -N2 -qm"
    $ [ plain "N2" gap share "pinned alone branch" `within` 1.5 `times` plain "N2 -qm" gap share "alone branch"
      | gap <- gaps
      , share <- shares
      ]
      ++ [noTarget (plain setting gap share situation) | (setting, situation) <- others, gap <- gaps, share <- shares]
 where
  gaps = ["hot", "colder"]
  shares = ["p50", "p99"]
  others = ("N1", "alone thread") : [("N2", situation) | situation <- unmarked ++ marked]
  unmarked = ["alone thread", "alone branch", "busy thread", "busy branch"]
  marked = ["pinned alone thread", "pinned busy thread", "pinned busy branch"]
  plain setting gap share situation = fromString (unwords ["plain", setting, gap, share, situation])

reaction :: String -> String -> String -> Figure
reaction setting share whose = fromString (unwords ["reaction", setting, share, whose])

-- A fleet of agents in one process. "bare" is the lower bound: the same number of threads.

idleFleet, fleetBytes, fleetTime :: Group
idleFleet =
  fleet
    "A fleet, no change: processor seconds per second"
    ["fleet idle cpu 100000" `within` 0.01 `times` "bonsai fleet cpu 100000"]
fleetBytes =
  fleet
    "A fleet: bytes per agent"
    [ "fleet bytes 100000" `within` 1.5 `times` "bonsai fleet bytes 100000"
    , noTarget "bare fleet bytes 100000"
    ]
fleetTime =
  fleet
    "A fleet: nanoseconds per agent, or per reading (after two garbage collections); wake: a change for all"
    [ "fleet creation 100000" `within` 3 `times` "bonsai fleet creation 100000"
    , noTarget "bare fleet creation 100000"
    , noTarget "fleet wake 100000"
    , "fleet polled reading 10000" `within` 1 `times` "bonsai fleet tick 10000"
    , noTarget "bare fleet reading 10000"
    , "fleet polled reading 100000" `within` 1 `times` "bonsai fleet tick 100000"
    , noTarget "bare fleet reading 100000"
    ]

fleet :: String -> [Row] -> Group
fleet title = Group title "-N1 -I0 -A64m -O512m -ki672 -kc4k"

-- What it costs that the operators can be simulated: with the dispatch and without.

seamTime, seamBytes :: Group
seamTime =
  Group
    "With and without the dispatch to simulations, the shortest round: nanoseconds"
    "-N1"
    (seam "ns" dispatched)
seamBytes =
  Group
    "With and without the dispatch to simulations, the shortest round: bytes allocated"
    "-N1"
    (seam "bytes" (undispatched ++ dispatched))

seam :: String -> [String] -> [Row]
seam unit operators' =
  [ shortest (dispatch "with") `within` 1.1 `times` shortest (dispatch "without")
  | operator <- operators'
  , let dispatch present = fromString (unwords ["seam", present, unit ++ ":", operator])
  ]

-- | Operators that use the dispatch, and operators that do not. (The latter take four nanoseconds,
-- and the alignment of the code makes a greater difference.)
dispatched, undispatched :: [String]
dispatched = ["atomically", "parallel", "both", "allOf 10", "monitor, watched", "monitor, polled"]
undispatched = ["? that succeeds", "? that fails"]

-- How fast the simulator is.

simulator, simulatedDay :: Group
simulator =
  Group
    "The simulator: number per second"
    "-N1 -A16m -ki2k"
    [ "scheduling points, two threads in turn" `atLeast` 1 * million
    , "scheduling points, one thread" `atLeast` 1 * million
    , noTarget "scheduling points, random schedules"
    , noTarget "random schedules of a small mission"
    ]
simulatedDay =
  Group
    "A simulated day, a sensor at 1 Hz and a thousand actions: seconds"
    "-N1 -A16m -ki2k"
    ["a simulated day" `atMost` 0.5]

-- The memory of an exploration does not grow with the number of schedules.

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

-- | The measurement for the given number of branches, rules or agents.
of' :: String -> Double -> Figure
operator `of'` n = fromString (operator ++ " " ++ show (round n :: Int))

infix 3 `of'`
