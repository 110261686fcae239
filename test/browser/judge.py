"""Says how each row of the live page's table went, by what a browser shows, what a robot has recorded of itself, and
what the system knows of connections.

judge.py ROW...: BROWSER is the folder with the robot (test/Browser.hs). A line for each claim; the exit code is 1 if
any has failed. No row waits for a time to pass: each waits for what it looks for, and gives up after a limit.
"""

import collections
import contextlib
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import time
import unicodedata

from PIL import Image, ImageChops

from browser import Browser, delays
from claims import all_of, at_most, claim, end, percentile
from readers import Silent, ask, connections, reading, serving, tunnel, upgrade
from robot import FOLDER, Robot, running, until


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
        robot.end()
        events = robot.recorded()
        for snapshot in snapshots:
            before = events[:snapshot["next"]]
            offset = {round(a["began"] - b["began"], 4) for a, b in zip(
                snapshot["running"], sorted(running(before).values(), key=lambda e: e["number"]))}
            same = (without_times(snapshot["running"])
                    == without_times(sorted(running(before).values(), key=lambda e: e["number"]))
                    and without_times(snapshot["reacted"])
                    == without_times([e for e in before if e["event"] == "reacted"][-200:])
                    and without_times(snapshot["ended"])
                    == without_times([e for e in before if e["event"] == "ended"][-200:])
                    and len(offset) == 1)
            late.append(same)
        all_of(2, "snapshots equal to the robot's own record", filter(None, late), late, 20)
        at_most(2, "from the connection to the snapshot", max(took), 0.5)
        at_most(2, "from the address to what runs, in a browser", in_page, 0.5)
        last = [e["number"] for e in events if e["event"] == "reacted" and e["number"] <= reacted[-1]]
        claim(2, "reactions in the page, equal to the robot's last ones", len(reacted), "200 or more",
              len(reacted) >= 200 and reacted == last[-len(reacted):])
        named = [e["name"] for e in sorted(running(events[:-6]).values(), key=lambda e: e["number"])
                 if e["kind"] == "named"]
        claim(2, "names that run, in the page", ", ".join(tree), "mission, dock, arm, wheels",
              tree == ["mission", "dock", "arm", "wheels"] == named)


def without_times(events):
    """Texts of the events in which each time is left out. (The page and the file have different zeros.)"""
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
        claim(3, "errors in the console", browser.problems(), "none", not browser.problems())


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
            own = [e["name"] for e in sorted(running(robot.recorded()).values(), key=lambda e: e["number"])
                   if e["kind"] == "named"]
            claim(4, "what runs, in the page", ", ".join(browser.tree()), ", ".join(own), browser.tree() == own)
            own = [e["number"] for e in robot.recorded() if e["event"] == "reacted"]
            until(lambda: browser.js("reactions.length") >= len(own), 5, "the last reaction")
            held = browser.js("reactions.map((r) => r.number)")
            claim(4, "reactions in the page, equal to the robot's", len(held), len(own), held[:len(own)] == own)


def row_5():
    """Twenty thousand events a second, for fifty seconds."""
    with Robot("flood", 20000, recorded=False) as robot:
        until(lambda: robot.cpu() > 2, 20, "two seconds of work")
        alone = robot.memory()
        robot.end()
    with Robot("flood", 20000, recorded=False) as robot, Browser() as browser:
        browser.open(robot)
        begun, heaps, told = time.monotonic(), [], set()
        while time.monotonic() - begun < 50:
            heaps.append((time.monotonic() - begun, browser.heap()))
            told.add(browser.text("#told"))
            until(lambda: time.monotonic() - begun > heaps[-1][0] + 1, 2)
        frames = browser.js("notes.frames.slice(1).map((t, i) => t - notes.frames[i])")
        lost, missed = browser.js("[lost, missed]")
        print(f"row 5: {len(frames)} frames: the longest took {max(frames):.0f} ms, "
              f"the median {statistics.median(frames):.0f} ms; the page has held {browser.js('spans.size')} spans")
        with_page = robot.memory()
        made = int(robot.end())
        claim(5, "events a second", round(made / 50), "20,000 or more", made >= 20000 * 50)
        claim(5, "events that the robot has discarded", lost, "0", lost == 0)
        print(f"row 5: events of which only a summary came: {missed}")
        # (What is garbage is taken out; messages that are being read are in it.)
        plateau = max(heap for when, heap in heaps if when < 20)
        most = max(heap for _, heap in heaps)
        print("row 5: the page's heap, in MiB:", *(f"{heap / 2**20:.1f}" for _, heap in heaps))
        claim(5, "the page's heap: most, by the most of the first 20 s", f"{most / plateau:.2f}", "at most 1.2",
              most <= 1.2 * plateau)
        claim(5, "the page's heap", f"{most / 2**20:.1f} MiB", "at most 64 MiB", most <= 64 * 2**20)
        more = (with_page - alone) / 2**20
        claim(5, "the robot's memory, more than without a reader", f"{more:.1f} MiB", "at most 64 MiB", more <= 64)


def watched(silent, known):
    return all([s.watched(known) for s in silent])


def row_6():
    """Twenty readers that never read."""
    with Robot("flood", 5000, recorded=False) as robot, Browser() as browser:
        browser.open(robot)
        silent = [Silent(robot.port) for _ in range(20)]
        until(lambda: watched(silent, connections(robot.port)), 60, "the end of all twenty")
        stuck = [s.ended - s.stalled for s in silent]
        claim(6, "readers that were cut", len(stuck), "20", len(stuck) == 20)
        at_most(6, "from the first byte that was not taken until it was cut", max(stuck), 6)
        late = delays(browser.js("notes.clock")[5:])
        print(f"row 6: {len(late)} values; the median came after {statistics.median(late) * 1000:.0f} ms, the latest "
              f"after {max(late) * 1000:.0f} ms")
        at_most(6, "the other reader's delay, 99th percentile", percentile(late, 0.99), 0.25)
        claim(6, "the other reader", browser.state(), "live", browser.state() == "live")
    # Where nothing happens, the connection of one that never reads has place for all beats of a day.
    with Robot("work") as robot, Browser() as browser:
        robot.tell("tick 0")
        browser.open(robot)
        silent = [Silent(robot.port) for _ in range(20)]
        # (A text begins, and goes on with fragments that are empty, of which none is the last.)
        fragments = Silent(robot.port, once=b"\x01\x80abcd", more=b"\x00\x80abcd" * 1000)
        until(lambda: watched([*silent, fragments], connections(robot.port)), 30, "the end of all")
        at_most(6, "where nothing happens: until they were cut", max(s.ended - s.begun for s in silent), 11)
        at_most(6, "one that says fragments without end: until it was cut", fragments.ended - fragments.begun, 2)
        claim(6, "the other reader", browser.state(), "live", browser.state() == "live")


def row_11():
    """Other programs read what is made of a trace."""
    with Robot("work") as robot:
        robot.tell("order dock")
        until(lambda: any(e.get("name") == "dock" for e in robot.recorded()), 5, "dock")
        robot.end()
    for file in (robot.file, "test/golden/mission.jsonl", "test/golden/detailed.jsonl"):
        made = f"{FOLDER}/otlp.json"
        subprocess.run([FOLDER + "/behavior-trace", file, "--otlp", made], check=True)
        with open(made + ".read", "w") as read:
            subprocess.run([FOLDER + "/otlp", made], stdout=read, check=True)
        said = subprocess.run([sys.executable, "test/browser/otlp.py", file, made + ".read"], text=True,
                              stdout=subprocess.PIPE)
        print(said.stdout, end="")
        claim(11, f"OTLP of {os.path.basename(file)}", f"exit code {said.returncode}", "0", said.returncode == 0)
    in_speedscope("test/golden/mission.jsonl")


def in_speedscope(file):
    """Its tables have each name of the trace, with its duration: a table for each lane."""
    with open(file) as lines:
        events = [json.loads(line) for line in lines][1:]
    last = max(e[time] for e in events for time in ("began", "ended", "time") if time in e)
    spans = {e["number"]: e for e in events if e.get("kind") == "named"}
    wanted = collections.Counter()
    for span in spans.values():
        wanted[span["name"]] += span.get("ended", last) - span["began"]
    root = FOLDER + "/node_modules/speedscope/dist/release"
    subprocess.run([FOLDER + "/behavior-trace", file, "--trace-events", root + "/trace.json"], check=True)
    with serving(root) as address, Browser() as browser:
        browser.driver.get(address + "index.html#profileURL=/trace.json")
        until(lambda: "tid" in browser.text("body"), 10, "the profile")
        lanes = int(browser.text("body").split("(1/")[1].split(")")[0])
        press(browser, "3") # its tables
        found = collections.Counter()
        for lane in range(1, lanes + 1):
            until(lambda: f"({lane}/{lanes})" in browser.text("body"), 5, f"lane {lane}")
            for row in until(lambda: rows_of(browser), 5, "the table"):
                total, *_, name = row
                found[name] += in_seconds(total.split()[0])
            press(browser, "n")
        right = [name for name in wanted if abs(found[name] - wanted[name]) <= 0.006 * lanes]
        all_of(11, f"names in {lanes} lanes of speedscope, with the durations of the trace", right, wanted, 5)
        claim(11, "other names", sorted(set(found) - set(wanted)), "none", set(found) <= set(wanted))


def rows_of(browser):
    """What is in the rows of its table, which is times and a name."""
    rows = [[word for word in text.replace("\n", "\t").split("\t") if word]
            for text in browser.js("[...document.querySelectorAll('tr')].map((r) => r.innerText)")]
    return [row for row in rows if len(row) > 2 and row[0][0].isdigit()]


def in_seconds(text):
    number = float(text.rstrip("nµmsin"))
    return number * {"s": 1, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "min": 60}[text.lstrip("0123456789.")]


def row_12():
    """A page that is overtaken says how much it has missed. (The broken variants are in test/mutants/Live.txt.)"""
    with Robot("flood", 40000, recorded=False) as robot, Browser() as browser:
        browser.open(robot)
        browser.driver.execute_script("""
          window.came = next;
          const learned = receive;
          receive = (message) => { if (message.message === "events") came += message.events.length; learned(message); };
          const begun = performance.now();
          while (performance.now() - begun < 4500);""")
        until(lambda: browser.js("missed"), 30, "a gap")
        came, missed, after = browser.js("[came, missed, next]")
        claim(12, "events that came, and those that the page says it has missed", f"{came} and {missed}",
              f"{after} in all", came + missed == after)
        told = browser.text("#told")
        claim(12, "the page says", told, f"gap: of {missed} events", told.startswith(f"gap: of {missed} events"))


def row_8():
    """The access to it."""
    with Robot("work") as robot:
        own = f"127.0.0.1:{robot.port}"
        refusals = {
            "a foreign Host": ask(robot.port, [("Host", "robot.example:8420")]),
            "a foreign Origin": ask(robot.port, upgrade(own, "http://evil.example"), "/live"),
            "the Origin null": ask(robot.port, upgrade(own, "null"), "/live"),
            "no Origin": ask(robot.port, upgrade(own), "/live"),
        }
        for what, (status, text) in refusals.items():
            claim(8, what, f"{status} {text.splitlines()[-1][:60]}", "403", status == 403)
        status, _ = ask(robot.port, upgrade(own, "http://" + own), "/live")
        claim(8, "its own Origin", status, "101", status == 101)
        with tunnel(robot.port) as port, Browser() as browser:
            browser.driver.get(f"http://127.0.0.1:{port}/")
            browser.comes("live", 5)
            claim(8, "another port, by a tunnel", browser.state(), "live", browser.state() == "live")
    with Robot("work") as robot, contextlib.ExitStack() as stack:
        files = os.listdir(f"/proc/{robot.process.pid}/fd")
        for _ in range(200):
            stack.enter_context(socket.create_connection(("127.0.0.1", robot.port)))
        until(lambda: sum(is_there for is_there, _ in connections(robot.port).values()) <= 64, 5, "the end of others")
        more = len(os.listdir(f"/proc/{robot.process.pid}/fd")) - len(files)
        claim(8, "files that 200 connections take", more, "60 to 65", 60 <= more <= 65)
        kept = [fd for fd in os.listdir(f"/proc/{robot.process.pid}/fd") if is_kept(robot.process.pid, fd)]
        claim(8, "sockets that a program keeps that the mission starts", kept, "none", not kept)
    with Robot("secret", recorded=False) as robot, Browser() as browser:
        for token, wanted in (("another", "refused"), ("", "refused"), ("a%20secret", "live")):
            browser.driver.get("about:blank")
            browser.driver.get(robot.address + ("#" + token if token else ""))
            browser.comes(wanted, 5)
            claim(8, f"the token {token or '(none)'}", browser.state(), wanted, browser.state().startswith(wanted))
    with Robot("open", recorded=False) as robot:
        refused = False
        try:
            ask(robot.port, [("Host", "127.0.0.1")])
        except ConnectionRefusedError:
            refused = True
        claim(8, "beyond loopback without a token", robot.says.strip(), "no page", refused and "no page" in robot.says)


def is_kept(process, fd):
    """Whether that is a socket, and is not closed in programs that the process starts."""
    with contextlib.suppress(OSError):
        if os.readlink(f"/proc/{process}/fd/{fd}").startswith("socket:"):
            with open(f"/proc/{process}/fdinfo/{fd}") as file:
                flags = next(line.split()[1] for line in file if line.startswith("flags"))
            return not int(flags, 8) & os.O_CLOEXEC
    return False


HOSTILE = [
    "<img src=x onerror=window.hit=1>",
    "</script><script>window.hit=1</script>",
    "<svg onload=window.hit=1>",
    "\"><iframe src=javascript:window.hit=1>",
    "javascript:window.hit=1",
    "\x00\x07\x1b[31mred\x1b[0m\x08\x7f\x9b",
    "\u202egnp.exe\u2066\u2069\u200f",
    "one\ntwo\r\u2028three\u2029\u200b",
    "&lt;b&gt;&#60;i&#62;",
    "${window.hit=1}{{constructor.constructor('window.hit=1')()}}",
    "<link rel=stylesheet href=http://evil.example/x.css><img src=http://evil.example/x.png>",
    "a megabyte" * 100_000,
]


def as_text(name):
    """How the page shows it: two hundred characters, and what acts by its number."""
    short = name[:200] + ("…" if len(name) > 200 else "")
    return "".join(f"\\u{{{ord(c):x}}}" if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Zl", "Zp") else c
                   for c in short)


def row_9():
    """Names that would act, if they were taken for more than texts."""
    saved = FOLDER + "/saved/run.jsonl"
    if os.path.exists(saved):
        os.remove(saved)
    with Robot("hostile", first=json.dumps(HOSTILE)) as robot, Browser() as browser:
        browser.open(robot)
        until(lambda: browser.js("[...spans.values()].filter((s) => s.end?.how === 'failed').length") >= len(HOSTILE),
              30, "all failures")
        browser.find("#timeline").click()
        browser.js("document.querySelector('details').open = true")
        for selector in ("#tree .span", "#interruptions button", "#failures .span"):
            for element in browser.driver.find_elements("css selector", selector)[:15]:
                browser.driver.execute_script("arguments[0].click()", element)
        elements = browser.js("[...document.body.querySelectorAll('*')].map((e) => e.localName)")
        allowed = set("a button canvas dd details div dl dt form h1 h2 header input label li main ol option output p "
                      "section select span strong summary table tbody td th thead tr ul".split())
        claim(9, "elements that no name may make", sorted(set(elements) - allowed), "none", set(elements) <= allowed)
        claim(9, "what acted", browser.js("window.hit ?? null"), "None", browser.js("window.hit ?? null") is None)
        texts = browser.js("[document.title, document.body.innerText, ...[...document.querySelectorAll('input,"
                           "[aria-label],[title]')].map((e) => e.value + e.ariaLabel + e.title)].join('')")
        bad = {c for c in texts if c != "\n" and c != "\t" and not c.isprintable()}
        claim(9, "characters that act, in the page and its title", sorted(map(ascii, bad)), "none", not bad)
        shown = [text[2:] for text in browser.texts("#tree .span")]
        all_of(9, "names that are shown, as texts", [name for name in HOSTILE if as_text(name) in shown], HOSTILE, 12)
        longest = max(map(len, browser.texts("#tree li")))
        claim(9, "characters of the longest row", longest, "at most 300", longest <= 300)
        browser.find("#save").click()
        until(lambda: os.path.exists(saved), 10, "the saved file")
        with open(saved, newline="") as file:
            content = file.read()
        bad = {c for c in content if c != "\n" and not c.isprintable()} | {c for c in "<>&" if c in content}
        claim(9, "characters that act, in the saved file", sorted(map(ascii, bad)), "none", not bad)
        events = [json.loads(line) for line in content.splitlines()]
        claim(9, "names in the saved file, of which the first thousand characters are equal",
              len({e["name"][:1000] for e in events if "name" in e} & {name[:1000] for name in HOSTILE}), "12",
              {name[:1000] for name in HOSTILE} <= {e["name"][:1000] for e in events if "name" in e})
        said = subprocess.run([FOLDER + "/behavior-trace", saved, "--tree"], capture_output=True, text=True)
        claim(9, "behavior-trace reads the saved file", f"exit code {said.returncode}", "0", said.returncode == 0)
        foreign = [url for url in browser.requests() if not url.startswith((
            robot.address, robot.address.replace("http", "ws"), "data:", "blob:" + robot.address))]
        claim(9, "requests to anything else", foreign, "none", not foreign)
        claim(9, "errors in the console", browser.problems(), "none", not browser.problems())


def row_10():
    """For all: what axe-core finds, and a keyboard alone."""
    with open(FOLDER + "/node_modules/axe-core/axe.min.js") as file:
        axe = file.read()
    with Robot("work") as robot:
        robot.tell("tick 0")
        for order in ("survey", "dock", "inspect"):
            robot.tell("order " + order)
            until(lambda: any(e.get("name") == order for e in robot.recorded()), 5, order)
        for dark in (False, True):
            for width in (1280, 360):
                with Browser(width=width, dark=dark) as browser:
                    browser.open(robot)
                    until(lambda: "inspect" in browser.tree(), 5, "the order")
                    browser.js("document.querySelector('details').open = true")
                    browser.find("#tree button").click()
                    browser.driver.execute_script(axe)
                    found = browser.driver.execute_async_script("axe.run().then(arguments[0])")
                    faults = [f"{v['id']} ({len(v['nodes'])}): {v['nodes'][0]['html'][:100]}"
                              for v in found["violations"]]
                    claim(10, f"axe-core, {'dark' if dark else 'light'}, {width} px: violations", faults, "none",
                          not faults and len(found["passes"]) > 20)
                    wide = browser.js("[document.documentElement.scrollWidth, innerWidth]")
                    claim(10, f"{width} px: the page's width", wide[0], f"at most {wide[1]}", wide[0] <= wide[1])
        with Browser() as browser:
            browser.open(robot)
            until(lambda: "inspect" in browser.tree(), 5, "the order")
            by_keyboard(browser, robot)


def by_keyboard(browser, robot):
    focused = lambda: browser.driver.switch_to.active_element

    def tab_to(wanted):
        """Presses Tab until what has the focus has that in its accessible name."""
        names = []
        while len(names) < 40:
            press(browser, "\ue004")
            names.append(focused().accessible_name)
            if wanted in names[-1]:
                return names[-1]
        raise TimeoutError(f"no Tab leads to {wanted}, but to {names}")

    name = tab_to("stopped dock")
    claim(10, "by keyboard: the last interruption", name, "order inspect (was dock), stopped dock",
          all(part in name for part in ("order inspect (was dock)", "stopped dock", "starts inspect")))
    press(browser, "\ue007")
    claim(10, "by keyboard: its details", browser.text("#details")[:80], "dock", "dock" in browser.text("#details"))
    browser.driver.refresh()
    browser.comes("live", 5)
    name = tab_to("Pause")
    press(browser, " ")
    browser.comes("paused", 5)
    claim(10, "by keyboard: pause", f"{name}: {browser.state()}", "paused", browser.state() == "paused")
    before = browser.js("reactions.length")
    robot.tell("order dock")
    until(lambda: browser.js("reactions.length") > before, 5, "the next reaction")
    claim(10, "what runs, while it is paused", browser.tree()[1], "inspect", browser.tree()[1] == "inspect")
    press(browser, " ")
    browser.comes("live", 5)
    name = tab_to("Search")
    press(browser, "wheels")
    found = browser.texts("#tree .found")
    claim(10, "by keyboard: search", f"{name}: {found}", "wheels", len(found) == 1 and "wheels" in found[0])
    # (The list of bars is open by the keyboard, too.)
    tab_to("The bars as a list")
    press(browser, "\ue007")
    until(lambda: browser.texts("#bars li"), 5, "the bars")
    bars = browser.texts("#bars li")
    claim(10, "by keyboard: the bars that are found, as a list", len(bars), "4, each of wheels",
          len(bars) == 4 and all("wheels" in bar for bar in bars))


def press(browser, keys):
    from selenium.webdriver.common.action_chains import ActionChains
    ActionChains(browser.driver).send_keys(keys).perform()


def pictures():
    """Pictures of three missions, in two sizes, light and dark: for someone who has not seen the page to look at."""
    missions = {"door-battery": ["door-battery", "--program", "names"], "patrol": ["robots", "patrol"],
                "fleet": ["robots", "fleet"]}
    os.makedirs(FOLDER + "/pictures", exist_ok=True)
    for name, (program, *arguments) in missions.items():
        file = f"{FOLDER}/{name}.jsonl"
        subprocess.run([f"{FOLDER}/{program}", *arguments, "--simulate", "--trace", file], check=True,
                       stdout=subprocess.DEVNULL)
        tool = subprocess.Popen([FOLDER + "/behavior-trace", file, "--live"], stderr=subprocess.PIPE, text=True)
        address = "http" + tool.stderr.readline().split("http")[1].strip()
        for width, dark in ((1280, False), (1280, True), (360, False), (360, True)):
            with Browser(width=width, dark=dark) as browser:
                browser.driver.get(address)
                browser.comes("live", 5)
                until(lambda: browser.texts("#interruptions li"), 5, "an interruption")
                browser.driver.execute_script("""
                  document.getElementById("time").value = 620;
                  document.getElementById("time").dispatchEvent(new Event("input"));""")
                until(lambda: browser.js("frame === null"), 5, "the frame")
                browser.driver.save_screenshot(f"{FOLDER}/pictures/{name}-{width}-{'dark' if dark else 'light'}.png")
        tool.kill()
        tool.communicate()
    kept = os.listdir(FOLDER + "/pictures")
    claim(13, "pictures of three missions, in dist-newstyle/browser/pictures", len(kept), "12", len(kept) == 12)


def row_13():
    """The picture in docs/seeing-a-robot.md is what the page shows of the mission that README.md draws."""
    file, made, picture = FOLDER + "/door-battery.jsonl", FOLDER + "/live-page.png", "docs/pictures/live-page.png"
    mission = [FOLDER + "/door-battery", "--program", "names", "--simulate", "--trace", file]
    subprocess.run(mission, check=True, stdout=subprocess.DEVNULL)
    tool = subprocess.Popen([FOLDER + "/behavior-trace", file, "--live"], stderr=subprocess.PIPE, text=True)
    with Browser(width=1000, height=800) as browser:
        browser.driver.get("http" + tool.stderr.readline().split("http")[1].strip())
        browser.comes("live", 5)
        until(lambda: browser.js("reactions.length") == 2, 5, "the reactions")
        browser.driver.execute_script("""
          document.getElementById("time").value = 850;
          document.getElementById("time").dispatchEvent(new Event("input"));
          document.querySelector("#interruptions button").click();""")
        until(lambda: browser.js("frame === null"), 5, "the frame")
        claim(13, "what ran then", browser.tree(), "pass through back door, in enter room",
              browser.tree() == ["mission", "enter room", "pass through back door"])
        browser.driver.save_screenshot(made)
        words = browser.js("document.body.innerText") + "\n"
    tool.kill()
    tool.communicate()
    with open(FOLDER + "/live-page.txt", "w") as file:
        file.write(words)
    with open("test/golden/live-page.txt") as file:
        claim(13, "its words", "as in dist-newstyle/browser/live-page.txt", "as in test/golden/live-page.txt",
              file.read() == words)
    # (In squares of eight pixels, since another version of the browser draws the edges of letters otherwise.)
    images = [Image.open(path).convert("L") for path in (made, picture)]
    squares = [image.resize((image.width // 8, image.height // 8), Image.BOX) for image in images]
    other = 1.0
    if images[0].size == images[1].size:
        differ = ImageChops.difference(*squares).point(lambda d: 255 if d > 48 else 0)
        other = differ.histogram()[255] / (differ.width * differ.height)
    claim(13, f"{picture}: what is otherwise in {made.removeprefix(os.getcwd() + '/')}", f"{other:.2%}",
          "at most 0.2%; else look at it, and copy it there", other <= 0.002)
    pictures()


for row in map(int, sys.argv[1:]):
    begun = time.monotonic()
    try:
        globals()[f"row_{row}"]()
    except Exception as problem:
        claim(row, "the row ended", f"{type(problem).__name__}: {problem}".splitlines()[0], "well", False)
    print(f"row {row}: it took {time.monotonic() - begun:.0f} s", flush=True)
end()
