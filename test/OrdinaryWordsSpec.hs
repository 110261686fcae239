{-# OPTIONS_GHC -Wno-unused-imports #-}

-- |
-- The names that a program has of its own, beside open imports of all public modules: that this module compiles is
-- the test. A public module that took one of these words would make each use of it here an ambiguous one, which is
-- an error. ("Behavior.Signal" and "Behavior.Ros.Messages.Geometry" are imported qualified.)
--
-- These ordinary words are taken: they are the language and the words of its tests, so a program that imports the
-- module openly has to avoid them, or to hide them.
--
-- * "Behavior": attempt, both, failed, fallback, monitor, parallel, sleep
-- * "Behavior.Fleet": holding, instead, queue, resource, serving, submit, writing
-- * "Behavior.Live.Hub": hub
-- * "Behavior.Message": dropped, receive, unhandled
-- * "Behavior.Parallel": await, decide, fork, pinned, scoped
-- * "Behavior.Ros": call, entry, latched, latest, measured, patience, publication, publishing, service, topic
-- * "Behavior.Ros.Action": action, goal, replacing, untyped
-- * "Behavior.Ros.Fake": answering, publish, seen, succeeding
-- * "Behavior.Ros.Messages": stamp
-- * "Behavior.Ros.Messages.Navigation": pose, to
-- * "Behavior.Ros.Messages.Sensor": charging, intensities, nearest, percentage, ranges, voltage
-- * "Behavior.STM": check, retry, and what else stm exports
-- * "Behavior.Time": checkpoint, every, now, timeout
-- * "Behavior.Trace": adopt, named
-- * "Behavior.Sim": events, explain, explore, finished, outcome, randomly, scheduled, simulate, steps, well
-- * "Behavior.Sim.Mock": action, always, begin, being, clear, condition, driver, during, eventually, exactly, fails,
--   faults, hangs, happened, holds, never, note, noted, outside, reading, returning, running, sensor, set, signal,
--   succeeds, taking, throws, verdict, whenever
module OrdinaryWordsSpec (spec) where

import Data.List (nub)
import qualified Test.Hspec as Hspec

import Behavior
import Behavior.Fleet
import Behavior.Fleet.Fake
import Behavior.Fleet.Schema
import Behavior.Live
import Behavior.Live.Hub
import Behavior.Message
import Behavior.Parallel
import Behavior.Ros
import Behavior.Ros.Action hiding (goal)
import Behavior.Ros.Fake
import Behavior.Ros.Messages
import qualified Behavior.Ros.Messages.Geometry as Geometry
import Behavior.Ros.Messages.Navigation
import Behavior.Ros.Messages.Sensor
import Behavior.Ros.Messages.Test
import Behavior.STM
import qualified Behavior.Signal as Signal
import Behavior.Sim
import Behavior.Sim.Mock
import Behavior.Sim.QuickCheck
import Behavior.Time
import Behavior.Trace
import Behavior.Trace.Describe
import Behavior.Trace.Diff
import Behavior.Trace.File
import Behavior.Trace.Format
import Behavior.Trace.Otlp
import Behavior.Trace.Path
import Behavior.Trace.Recording
import Behavior.Trace.Summary
import Behavior.Trace.Svg
import Behavior.Trace.Terminal
import Behavior.Trace.TraceEvents
import Behavior.Trace.Tree
import Behavior.Trace.Viewing

spec :: Hspec.Spec
spec = Hspec.it "leaves a hundred ordinary words to the programs that import its modules" $
  length (nub ordinaryWords) `Hspec.shouldSatisfy` (>= 100)

ordinaryWords :: [String]
ordinaryWords =
  [ angle, area, argument, arm, arrived, at, axis, back, base, battery, beacon, begins, box, brake, camera,
    cancel, capacity, cargo, charge, close, color, command, complete, config, contents, count, current, defaults,
    depth, describe, detailed, did, direction, distance, dock, door, drive, duration, end, ends, entries, failing,
    failures, field, find, format, forward, frame, from, front, full, goal, grasp, gripper, group, handle, heading,
    height, home, index, input, interrupted, interruptions, item, job, joint, key, kind, label, lane, left, level,
    lift, light, limit, line, load, location, lock, longest, look, lost, low, mass, measure, median, message, mission,
    mode, model, motor, move, name, next, node, nothing, number, obstacle, offset, open, order, origin, outcomes,
    parent, part, path, pause, place, point, points, position, power, priority, progress, quoted, radius,
    range, rate, reactions, ready, reason, reset, result, right, robot, room, roots, route, run, runs, safe, scan,
    schedule, schedules, score, search, seconds, send, size, slip, speed, start, state, status, step, stop, stopping,
    subject, subjects, table, target, task, temperature, text, thread, tick, time, times, tool, total, turn, unit,
    update, value, velocity, version, wait, wall, watch, weight, what, wheel, who, width, world, zone
  ]

angle, area, argument, arm, arrived, at, axis, back, base, battery, beacon, begins, box, brake, camera, cancel,
  capacity, cargo, charge, close, color, command, complete, config, contents, count, current, defaults, depth,
  describe, detailed, did, direction, distance, dock, door, drive, duration, end, ends, entries, failing, failures,
  field, find, format, forward, frame, from, front, full, goal, grasp, gripper, group, handle, heading, height, home,
  index, input, interrupted, interruptions, item, job, joint, key, kind, label, lane, left, level, lift, light, limit,
  line, load, location, lock, longest, look, lost, low, mass, measure, median, message, mission, mode, model, motor,
  move, name, next, node, nothing, number, obstacle, offset, open, order, origin, outcomes, parent, part, path, pause,
  place, point, points, position, power, priority, progress, quoted, radius, range, rate, reactions, ready,
  reason, reset, result, right, robot, room, roots, route, run, runs, safe, scan, schedule, schedules, score, search,
  seconds, send, size, slip, speed, start, state, status, step, stop, stopping, subject, subjects, table, target,
  task, temperature, text, thread, tick, time, times, tool, total, turn, unit, update, value, velocity, version, wait,
  wall, watch, weight, what, wheel, who, width, world, zone :: String
angle = "angle"; area = "area"; argument = "argument"; arm = "arm"; arrived = "arrived"; at = "at"; axis = "axis"
back = "back"; base = "base"; battery = "battery"; beacon = "beacon"; begins = "begins"; box = "box"; brake = "brake"
camera = "camera"; cancel = "cancel"; capacity = "capacity"; cargo = "cargo"; charge = "charge"
close = "close"; color = "color"; command = "command"; complete = "complete"; config = "config"; contents = "contents"
count = "count"; current = "current"; defaults = "defaults"; depth = "depth"; describe = "describe"
detailed = "detailed"; did = "did"; direction = "direction"; distance = "distance"; dock = "dock"; door = "door"
drive = "drive"; duration = "duration"; end = "end"; ends = "ends"; entries = "entries"; failing = "failing"
failures = "failures"; field = "field"; find = "find"; format = "format"; forward = "forward"; frame = "frame"
from = "from"; front = "front"; full = "full"; goal = "goal"; grasp = "grasp"; gripper = "gripper"; group = "group"
handle = "handle"; heading = "heading"; height = "height"; home = "home"; index = "index"; input = "input"
interrupted = "interrupted"; interruptions = "interruptions"; item = "item"; job = "job"; joint = "joint"; key = "key"
kind = "kind"; label = "label"; lane = "lane"; left = "left"; level = "level"; lift = "lift"; light = "light"
limit = "limit"; line = "line"; load = "load"; location = "location"; lock = "lock"; longest = "longest"
look = "look"; lost = "lost"; low = "low"; mass = "mass"; measure = "measure"; median = "median"; message = "message"
mission = "mission"; mode = "mode"; model = "model"; motor = "motor"; move = "move"; name = "name"; next = "next"
node = "node"; nothing = "nothing"; number = "number"; obstacle = "obstacle"; offset = "offset"; open = "open"
order = "order"; origin = "origin"; outcomes = "outcomes"; parent = "parent"; part = "part"; path = "path"
pause = "pause"; place = "place"; point = "point"; points = "points"; position = "position"; power = "power"
priority = "priority"; progress = "progress"; quoted = "quoted"; radius = "radius"; range = "range"
rate = "rate"; reactions = "reactions"; ready = "ready"; reason = "reason"; reset = "reset"; result = "result"
right = "right"; robot = "robot"; room = "room"; roots = "roots"; route = "route"; run = "run"; runs = "runs"
safe = "safe"; scan = "scan"; schedule = "schedule"; schedules = "schedules"; score = "score"; search = "search"
seconds = "seconds"; send = "send"; size = "size"; slip = "slip"; speed = "speed"; start = "start"; state = "state"
status = "status"; step = "step"; stop = "stop"; stopping = "stopping"; subject = "subject"; subjects = "subjects"
table = "table"; target = "target"; task = "task"; temperature = "temperature"; text = "text"; thread = "thread"
tick = "tick"; time = "time"; times = "times"; tool = "tool"; total = "total"; turn = "turn"; unit = "unit"
update = "update"; value = "value"; velocity = "velocity"; version = "version"; wait = "wait"; wall = "wall"
watch = "watch"; weight = "weight"; what = "what"; wheel = "wheel"; who = "who"; width = "width"; world = "world"
zone = "zone"
