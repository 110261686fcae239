"""Rows 10, 11 and 13: by a keyboard, by other programs, and in the documentation."""

import collections
import contextlib
import json
import os
import shutil
import subprocess
import sys

from PIL import Image, ImageChops

from browser import Browser
from claims import all_of, claim
from readers import serving
from robot import FOLDER, Robot
from watching import until


def row_10():
    """For all: what axe-core finds, and a keyboard alone."""
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
                    browser.accessible(10, 20)
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
            browser.press("\ue004")
            names.append(focused().accessible_name)
            if wanted in names[-1]:
                return names[-1]
        raise TimeoutError(f"no Tab leads to {wanted}, but to {names}")

    name = tab_to("stopped dock")
    claim(10, "by keyboard: the last interruption", name, "order inspect (was dock), stopped dock",
          all(part in name for part in ("order inspect (was dock)", "stopped dock", "starts inspect")))
    browser.press("\ue007")
    claim(10, "by keyboard: its details", browser.text("#details")[:80], "dock", "dock" in browser.text("#details"))
    browser.driver.refresh()
    browser.comes("live", 5)
    name = tab_to("Pause")
    browser.press(" ")
    browser.comes("paused", 5)
    claim(10, "by keyboard: pause", f"{name}: {browser.state()}", "paused", browser.state() == "paused")
    before = browser.js("reactions.length")
    robot.tell("order dock")
    until(lambda: browser.js("reactions.length") > before, 5, "the next reaction")
    claim(10, "what runs, while it is paused", browser.tree()[1], "inspect", browser.tree()[1] == "inspect")
    browser.press(" ")
    browser.comes("live", 5)
    name = tab_to("Search")
    browser.press("wheels")
    found = browser.texts("#tree .found")
    claim(10, "by keyboard: search", f"{name}: {found}", "wheels", len(found) == 1 and "wheels" in found[0])
    # (The list of bars is open by the keyboard, too.)
    tab_to("The bars as a list")
    browser.press("\ue007")
    until(lambda: browser.texts("#bars li"), 5, "the bars")
    bars = browser.texts("#bars li")
    claim(10, "by keyboard: the bars that are found, as a list", len(bars), "4, each of wheels",
          len(bars) == 4 and all("wheels" in bar for bar in bars))


def row_11():
    """Other programs read what is made of a trace."""
    with Robot("work") as robot:
        for order in ("survey", "dock"): # (the first is its own, and the second a reaction)
            robot.tell("order " + order)
            until(lambda: any(e.get("name") == order for e in robot.recorded()), 5, order)
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
        browser.press("3") # its tables
        found = collections.Counter()
        for lane in range(1, lanes + 1):
            until(lambda: f"({lane}/{lanes})" in browser.text("body"), 5, f"lane {lane}")
            for row in until(lambda: rows_of(browser), 5, "the table"):
                total, *_, name = row
                found[name] += in_seconds(total.split()[0])
            browser.press("n")
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


def row_13():
    """The picture in docs/seeing-a-robot.md is what the page shows of the mission that README.md draws."""
    file, made, picture = FOLDER + "/door-battery.jsonl", FOLDER + "/live-page.png", "docs/pictures/live-page.png"
    mission = [FOLDER + "/door-battery", "--program", "names", "--simulate", "--trace", file]
    subprocess.run(mission, check=True, stdout=subprocess.DEVNULL)
    with shown_live(file) as address, Browser(width=1000, height=800) as browser:
        browser.driver.get(address)
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


@contextlib.contextmanager
def shown_live(file):
    """The address of the live page of a trace file."""
    tool = subprocess.Popen([FOLDER + "/behavior-trace", file, "--live"], stderr=subprocess.PIPE, text=True)
    try:
        yield "http" + tool.stderr.readline().split("http")[1].strip()
    finally:
        tool.kill()
        tool.communicate()


def pictures():
    """Pictures of three missions, in two sizes, light and dark: for someone who has not seen the page to look at."""
    missions = {"door-battery": ["door-battery", "--program", "names"], "patrol": ["robots", "patrol"],
                "fleet": ["robots", "fleet"]}
    shutil.rmtree(FOLDER + "/pictures", ignore_errors=True)
    os.makedirs(FOLDER + "/pictures")
    for name, (program, *arguments) in missions.items():
        file = f"{FOLDER}/{name}.jsonl"
        subprocess.run([f"{FOLDER}/{program}", *arguments, "--simulate", "--trace", file], check=True,
                       stdout=subprocess.DEVNULL)
        with shown_live(file) as address:
            for width, dark in ((1280, False), (1280, True), (360, False), (360, True)):
                with Browser(width=width, dark=dark) as browser:
                    browser.driver.get(address)
                    browser.comes("live", 5)
                    until(lambda: browser.texts("#interruptions li"), 5, "an interruption")
                    browser.driver.execute_script("""
                      document.getElementById("time").value = 620;
                      document.getElementById("time").dispatchEvent(new Event("input"));""")
                    until(lambda: browser.js("frame === null"), 5, "the frame")
                    scheme = "dark" if dark else "light"
                    browser.driver.save_screenshot(f"{FOLDER}/pictures/{name}-{width}-{scheme}.png")
    kept = os.listdir(FOLDER + "/pictures")
    claim(13, "pictures of three missions, in dist-newstyle/browser/pictures", len(kept), "12", len(kept) == 12)
