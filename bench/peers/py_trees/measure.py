"""What py_trees costs at the work of our own benchmarks.

measure.py ROW [N] measures one row for one round. It prints a line for each
figure: its name, a tab, its value.
"""

import gc
import os
import sys
import time

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

# The number of actions of a sequence or a fallback.
LENGTH = 100_000


class World:
    """What the leaves of a tree read."""

    def __init__(self, outcome=Status.RUNNING, conditions=()):
        self.battery = 50.0
        self.open = {"front": False, "back": False}
        self.outcome = outcome
        self.conditions = conditions


class Leaf(Behaviour):
    def __init__(self, name, world):
        super().__init__(name)
        self.world = world


class Act(Leaf):
    """An action, whose status is a field of the world."""

    def update(self):
        return self.world.outcome


class Holds(Leaf):
    def __init__(self, index, world):
        super().__init__("holds", world)
        self.index = index

    def update(self):
        return condition(self.world.conditions[self.index])


class IsOpen(Leaf):
    def update(self):
        return condition(self.world.open[self.name])


class BatteryLow(Leaf):
    def update(self):
        return condition(self.world.battery < 10)


class Recharge(Leaf):
    def update(self):
        self.world.battery += 0.1
        return Status.SUCCESS if self.world.battery >= 100 else Status.RUNNING


def condition(truth):
    return Status.SUCCESS if truth else Status.FAILURE


# --- the trees ---------------------------------------------------------------


def agent():
    """The robot of the paper's section 6: it opens the front door, which never ends.

    Of its 18 nodes a tick visits eight.
    """
    world = World()

    def act(name):
        return Act(name, world)

    def in_turn(*children):
        return Sequence("in turn", memory=True, children=list(children))

    def either(*children):
        return Selector("either", memory=True, children=list(children))

    mission = in_turn(
        either(
            in_turn(
                either(IsOpen("front", world), act("open")),
                act("pass through"),
                act("close"),
            ),
            in_turn(
                either(act("open"), act("smash")),
                act("pass through"),
            ),
        ),
        act("do the task"),
    )
    care = in_turn(BatteryLow("low", world), Recharge("recharge", world))
    # Without memory, so that each tick reads the battery; the mission has its
    # own memory, and loses it when the battery is low.
    return Selector("monitor", memory=False, children=[care, mission])


def rules(n):
    """The first rule that holds runs: the last one, which never ends."""
    world = World(conditions=[i == n - 1 for i in range(n)])

    def rule(i):
        parts = [Holds(i, world), Act("act", world)]
        return Sequence("rule", memory=False, children=parts)

    listed = [rule(i) for i in range(n)]
    return Selector("rules", memory=False, children=listed)


# --- the measurements --------------------------------------------------------


def report(name, value):
    print(f"py_trees {name}\t{value:.4f}")


def nanoseconds(work):
    """Nanoseconds per call, measured over a fifth of a second or more."""
    calls = 1
    while True:
        begun = time.perf_counter_ns()
        for _ in range(calls):
            work()
        elapsed = time.perf_counter_ns() - begun
        if elapsed >= 200_000_000:
            return elapsed / calls
        calls *= 2


def processor_at_10_hz(work):
    """Processor seconds per second, over two seconds.

    A value near 1 means that it cannot keep up.
    """
    used, begun = time.process_time(), time.monotonic()
    for period in range(1, 21):
        work()
        time.sleep(max(0, begun + period / 10 - time.monotonic()))
    return (time.process_time() - used) / (time.monotonic() - begun)


def resident():
    """Bytes of this process that are in memory."""
    with open("/proc/self/statm", encoding="ascii") as counts:
        return int(counts.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def tick(root, expected=Status.RUNNING):
    root.tick_once()
    assert root.status == expected


def flat(name, composite, outcome):
    """One tick of a new tree. Unlike in bonsai-bt, no reset is needed."""
    world = World(outcome)
    children = [Act("act", world) for _ in range(LENGTH)]
    root = composite("flat", memory=True, children=children)
    begun = time.perf_counter_ns()
    tick(root, outcome)
    report(name, (time.perf_counter_ns() - begun) / LENGTH)


def fleet(n):
    """Many robots, each with its own tree and world."""
    gc.collect()
    before, begun = resident(), time.perf_counter_ns()
    agents = [agent() for _ in range(n)]
    creation = time.perf_counter_ns() - begun
    report(f"fleet creation {n}", creation / n)
    report(f"fleet bytes {n}", (resident() - before) / n)

    def tick_all():
        for root in agents:
            tick(root)

    report(f"fleet tick {n}", nanoseconds(tick_all) / n)
    report(f"fleet cpu {n}", processor_at_10_hz(tick_all))


def one_tick(name, root):
    report(name, nanoseconds(lambda: tick(root)))


def main():
    match sys.argv[1:]:
        case ["tick"]:
            one_tick("door/battery tick", agent())
        case ["sequence"]:
            flat("sequence step", Sequence, Status.SUCCESS)
        case ["fallback"]:
            flat("fallback step", Selector, Status.FAILURE)
        case ["rules", n]:
            one_tick(f"rules tick {n}", rules(int(n)))
        case ["fleet", n]:
            fleet(int(n))
        case ["fleet"]:
            fleet(1000)
        case _:
            sys.exit("Usage: tick | sequence | fallback | rules N | fleet [N]")


main()
