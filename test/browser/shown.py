"""Rows 1 to 5, and 12: what the page shows, and how soon."""

import json
import signal
import statistics
import time

from browser import Browser, delays
from claims import all_of, at_most, claim, percentile
from readers import Tunnel, reading
from robot import Robot, names_running, running
from watching import until


def row_1():
    """Ten tabs, nine of them hidden."""
    with Robot("work") as robot, Browser() as browser:
        browser.open(robot)
        for _ in range(9):
            browser.tab()
            browser.open(robot)
        seen = []
        for _ in range(20):
            at = browser.js("notes.clock.length")
            until(lambda: browser.js("notes.clock.length") > at, 5, "the clock")
            seen += browser.other_tabs(9)
        all_of(1, "hidden tabs that are live", [s for s in seen if s[:2] == ["hidden", "live"]], seen, 180)
        claim(1, "the tab in front", browser.state(), "live", browser.state() == "live")
        at_most(1, "the oldest text of a hidden tab", max(age for _, _, age in seen) / 1000, 0.5)


def row_2():
    """A reader that attaches late."""
    with Robot("work") as robot, Browser() as browser:
        robot.tell("tick 5")
        robot.tell("order dock")
        until(lambda: sum(e["event"] == "reacted" for e in robot.recorded()) > 300, 30, "300 reactions")
        late, took, snapshots = [], [], []
        for _ in range(20):
            begun = time.monotonic()
            with reading(robot.port) as messages:
                for message in messages:
                    if message["message"] == "snapshot":
                        took.append(time.monotonic() - begun)
                        snapshots.append(message)
                        break
        robot.tell("tick 0")
        browser.driver.get(robot.address)
        until(lambda: browser.js("notes.rows"), 5, "the tree")
        in_page = browser.js("notes.rows") / 1000
        tree, reacted = browser.tree(), browser.js("reactions.map((r) => r.number)")
        own = names_running(robot.recorded())
        robot.end()
        events = robot.recorded()
        for snapshot in snapshots:
            before = events[:snapshot["next"]]
            # (The page and the file have different zeros.)
            offsets = {round(a["began"] - b["began"], 4) for a, b in zip(snapshot["running"], running(before))}
            late.append(len(offsets) == 1 and all(
                without_times(snapshot[part]) == without_times(wanted) for part, wanted in (
                    ("running", running(before)),
                    ("reacted", [e for e in before if e["event"] == "reacted"][-200:]),
                    ("ended", [e for e in before if e["event"] == "ended"][-200:]))))
        all_of(2, "snapshots equal to the robot's own record", filter(None, late), late, 20)
        at_most(2, "from the connection to the snapshot", max(took), 0.5)
        at_most(2, "from the address to what runs, in a browser", in_page, 0.5)
        last = [e["number"] for e in events if e["event"] == "reacted" and e["number"] <= reacted[-1]]
        claim(2, "reactions in the page, equal to the robot's last ones", len(reacted), "200 or more",
              len(reacted) >= 200 and reacted == last[-len(reacted):])
        claim(2, "names that run, in the page", ", ".join(tree), "mission, dock, arm, wheels",
              tree == ["mission", "dock", "arm", "wheels"] == own)


def without_times(events):
    """Texts of the events, in which each time is left out."""
    def cut(value):
        if isinstance(value, dict):
            return {k: cut(v) for k, v in value.items() if k not in ("time", "began", "ended", "took", "after")}
        return [cut(v) for v in value] if isinstance(value, list) else value
    return [json.dumps(cut(event), sort_keys=True) for event in events]


def row_3():
    """From the event to the page's text."""
    with Robot("work") as robot, Browser() as browser:
        browser.open(robot)
        until(lambda: browser.js("notes.clock.length") > 220, 60, "220 values")
        late = delays(browser.js("notes.clock")[20:])
        print(f"row 3: {len(late)} values; the latest came after {max(late) * 1000:.0f} ms")
        at_most(3, "median", statistics.median(late), 0.1)
        at_most(3, "99th percentile", percentile(late, 0.99), 0.25)
        browser.no_problems(3)


def row_4():
    """The robot is stopped, killed, and started again."""
    with Browser() as browser:
        with Robot("work") as robot:
            browser.open(robot)
            for what, strike in (("stopped", signal.SIGSTOP), ("killed", signal.SIGKILL)):
                begun = time.monotonic()
                robot.process.send_signal(strike)
                browser.comes("disconnected since", 5)
                at_most(4, f"{what}: until the page says so", time.monotonic() - begun, 1)
                shown = browser.js("getComputedStyle(document.querySelector('main')).filter")
                claim(4, f"{what}: the values", shown, "grey", shown == "grayscale(1)")
                if strike == signal.SIGSTOP:
                    robot.process.send_signal(signal.SIGCONT)
                    begun = time.monotonic()
                    browser.comes("live", 5)
                    at_most(4, "it goes on: until the page is live", time.monotonic() - begun, 3)
            robot.process.wait()
            held = browser.js("run.run")
        with Robot("work", port=robot.port) as robot:
            begun = time.monotonic()
            browser.comes("live", 10)
            at_most(4, "started again: until the page is live", time.monotonic() - begun, 3)
            claim(4, "another run", browser.js("run.run"), f"not {held}", browser.js("run.run") != held)
            robot.tell("tick 0")
            robot.tell("order inspect")
            until(lambda: "inspect" in browser.tree(), 5, "the new order")
            own = names_running(robot.recorded())
            claim(4, "what runs, in the page", ", ".join(browser.tree()), ", ".join(own), browser.tree() == own)
            own = [e["number"] for e in robot.recorded() if e["event"] == "reacted"]
            until(lambda: browser.js("reactions.length") >= len(own), 5, "the last reaction")
            held = browser.js("reactions.map((r) => r.number)")
            claim(4, "reactions in the page, equal to the robot's", len(held), len(own), held[:len(own)] == own)
    # Its machine vanishes: nothing closes the connection, and no byte comes any more.
    with Robot("work") as robot, Tunnel(robot.port) as passing, Browser() as browser:
        browser.driver.get(f"http://127.0.0.1:{passing.port}/")
        browser.comes("live", 5)
        passing.freeze()
        browser.comes("disconnected since", 5)
        begun = time.monotonic()
        browser.comes("live", 20)
        took = time.monotonic() - begun
        at_most(4, "the connection is there, and dead: until the page is live by another one", took, 12)


# (Somewhat more than the row is about: the robot counts them when each of its steps has ended.)
RATE = 20500


def row_5():
    """Twenty thousand events a second, for fifty seconds."""
    with Robot("flood", RATE, recorded=False) as robot:
        until(lambda: robot.cpu() > 1, 20, "a second of work")
        alone = robot.memory()
        robot.end()
    with Browser() as browser, Robot("flood", RATE, recorded=False) as robot:
        started = time.monotonic()
        browser.open(robot)
        begun, heaps = time.monotonic(), []
        while time.monotonic() - begun < 50:
            heaps.append((time.monotonic() - begun, browser.heap()))
        frames = browser.js("notes.frames.slice(1).map((t, i) => t - notes.frames[i])")
        print(f"row 5: {len(frames)} frames: the longest took {max(frames):.0f} ms, "
              f"the median {statistics.median(frames):.0f} ms; the page has held {browser.js('spans.size')} spans")
        with_page = robot.memory()
        lasted = time.monotonic() - started
        made = int(robot.end())
        browser.comes("the run is over", 5)
        numbered, lost, missed = browser.js("[next, lost, missed]")
        claim(5, "events a second", round(made / lasted), "20,000 or more", made >= 20000 * lasted)
        claim(5, "events that came, with those of which a summary came", numbered, f"{made} or more", numbered >= made)
        claim(5, "events that the robot has discarded", lost, "0", lost == 0)
        print(f"row 5: events of which only a summary came: {missed}")
        # (What is garbage is taken out. Messages that are being read are in it: so it is looked at all the time.)
        plateau = max(heap for when, heap in heaps if when < 20)
        most = max(heap for _, heap in heaps)
        some = (f"{heap / 2**20:.1f}" for _, heap in heaps[::10])
        print(f"row 5: the page's heap, {len(heaps)} times, of which each tenth is, in MiB:", *some)
        claim(5, "the page's heap: most, by the most of the first 20 s", f"{most / plateau:.2f}", "at most 1.2",
              most <= 1.2 * plateau)
        claim(5, "the page's heap", f"{most / 2**20:.1f} MiB", "at most 64 MiB", most <= 64 * 2**20)
        more = (with_page - alone) / 2**20
        claim(5, "the robot's memory, more than without a reader", f"{more:.1f} MiB", "at most 64 MiB", more <= 64)


def row_12():
    """A page that is overtaken says how much it has missed. (The rest of this row is in test/mutants/Live.txt.)"""
    with Robot("flood", 40000, recorded=False) as robot, Browser() as browser:
        browser.open(robot)
        until(lambda: browser.js("next !== null"), 5, "the snapshot")
        browser.driver.execute_script("""
          window.came = next;
          const learned = receive;
          receive = (message) => { if (message.message === "events") came += message.events.length; learned(message); };
          const begun = performance.now();
          while (performance.now() - begun < 4500);""")
        until(lambda: browser.js("missed"), 30, "a gap")
        came, missed, after, told = browser.js("[came, missed, next, document.getElementById('told').textContent]")
        claim(12, "events that came, and those that the page says it has missed", f"{came} and {missed}",
              f"{after} in all", came + missed == after)
        claim(12, "the page says", told, f"gap: of {missed} events", told.startswith(f"gap: of {missed} events"))
