"""Row 14: one page of many robots."""

import contextlib
import signal
import subprocess
import time

from browser import Browser
from claims import at_most, claim
from readers import Tunnel
from robot import FOLDER, Robot, names_running
from watching import until

HOSTILE = "<img src=x onerror=window.hit=1>/../\u202e\x1b[31m?#\"'"


class Hub:
    """A hub of robots, by their names."""

    def __init__(self, addresses):
        options = [part for name, address in addresses.items() for part in ("--hub", f"{name}={address}")]
        self.process = subprocess.Popen([FOLDER + "/behavior-trace", *options], stderr=subprocess.PIPE, text=True)
        self.address = "http" + self.process.stderr.readline().split("http")[1].strip()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()


def cards(browser):
    """What the page shows of each robot: its state, what runs, the last interruption, and its style."""
    rows = browser.js("""[...document.querySelectorAll("#robots > li")].map((row) => [row.dataset.key, {
      title: row.querySelector("a").textContent,
      state: row.querySelector(".standing").textContent,
      runs: [...row.querySelectorAll("ul span:first-child")].map((e) => e.textContent),
      why: row.querySelector(".why").textContent,
      text: row.textContent,
      filter: getComputedStyle(row).filter }])""")
    return dict(rows)


def becomes(browser, name, state, seconds):
    """How long it took until the robot has this state."""
    begun = time.monotonic()
    until(lambda: cards(browser)[name]["state"].startswith(state), seconds, f"{name}: {state}")
    return time.monotonic() - begun


def goes_on(browser, names):
    """Whether the texts of all these change, three times, within two seconds each."""
    for _ in range(3):
        before = cards(browser)
        until(lambda: all(now["text"] != before[name]["text"] and now["state"] == "live"
                          for name, now in cards(browser).items() if name in names), 2, "other texts")
    return True


def row_14():
    """Five robots on one hub."""
    names = ["Ann", "Bob", "Cid", "Dee", HOSTILE]
    with contextlib.ExitStack() as stack:
        robots = {name: stack.enter_context(Robot("work")) for name in names}
        passing = stack.enter_context(Tunnel(robots["Dee"].port))
        addresses = {name: robot.address for name, robot in robots.items()}
        addresses["Dee"] = f"http://127.0.0.1:{passing.port}/"
        hub = stack.enter_context(Hub(addresses))
        browser = stack.enter_context(Browser())
        browser.open(hub)
        until(lambda: [c["state"] for c in cards(browser).values()] == ["live"] * 5, 5, "five live robots")
        claim(14, "robots on the page", browser.text("#told"), "5 of 5 robots are live",
              browser.text("#told") == "5 of 5 robots are live" and set(cards(browser)) == set(names))
        claim(14, "what all five show", "other texts, three times", "within 2 s each", goes_on(browser, names))
        sockets = [url for url in browser.requests() if url.startswith("ws")]
        claim(14, "websockets of the page", sockets, "one, of the hub", len(sockets) == 1)
        killed(browser, hub, robots, stack)
        silent(browser, robots, passing)
        opened(browser, robots)
        hostile(browser, hub)
    accessible()


def killed(browser, hub, robots, stack):
    """One is killed, and started again."""
    others = [name for name in robots if name != "Ann"]
    robots["Ann"].tell("tick 0")
    goes_on(browser, ["Ann"]) # (the clock changes once more)
    robots["Ann"].tell("order dock")
    until(lambda: "order dock" in cards(browser)["Ann"]["why"], 5, "the order")
    before = cards(browser)["Ann"]
    claim(14, "what it does", ", ".join(before["runs"]), "arm, wheels",
          before["runs"] == ["mission / dock / arm", "mission / dock / wheels"])
    claim(14, "its last interruption", before["why"], "order dock (was survey): stopped survey, starts dock",
          all(part in before["why"] for part in ("order dock (was survey): stopped survey after", ", starts dock")))
    robots["Ann"].process.send_signal(signal.SIGKILL)
    at_most(14, "killed: until the page says so", becomes(browser, "Ann", "disconnected since", 5), 1)
    claim(14, "killed: the others", "other texts, three times", "within 2 s each", goes_on(browser, others))
    shown = cards(browser)
    claim(14, "killed: its card", shown["Ann"]["filter"], "grey", shown["Ann"]["filter"] == "grayscale(1)")
    claim(14, "killed: the other cards", {shown[name]["filter"] for name in others}, "not grey",
          {shown[name]["filter"] for name in others} == {"none"})
    claim(14, "killed: what it did, and its last interruption", shown["Ann"]["why"], before["why"],
          (shown["Ann"]["runs"], shown["Ann"]["why"]) == (before["runs"], before["why"]))
    with Browser() as late:
        # (The hub tries again and again, and says why it is in vain: so the other page is read before and after.)
        there = [cards(browser)["Ann"]]
        late.open(hub)
        until(lambda: len(cards(late)) == 5, 5, "five cards")
        at_once = cards(late)["Ann"]
        there.append(cards(browser)["Ann"])
        same = [all(at_once[k] == card[k] for k in ("state", "runs", "why")) for card in there]
        claim(14, "killed: a page that is opened later", at_once["state"],
              " or ".join(dict.fromkeys(card["state"] for card in there)), any(same))
    robots["Ann"].process.wait()
    robots["Ann"] = stack.enter_context(Robot("work", port=robots["Ann"].port))
    at_most(14, "started again: until the page says so", becomes(browser, "Ann", "live", 10), 3)
    claim(14, "started again: all five", "other texts, three times", "within 2 s each", goes_on(browser, list(robots)))


def silent(browser, robots, passing):
    """One is stopped and goes on; of another one the machine vanishes."""
    robots["Bob"].process.send_signal(signal.SIGSTOP)
    at_most(14, "stopped: until the page says so", becomes(browser, "Bob", "disconnected since", 5), 1.5)
    claim(14, "stopped: the others", "other texts, three times", "within 2 s each",
          goes_on(browser, [name for name in robots if name != "Bob"]))
    robots["Bob"].process.send_signal(signal.SIGCONT)
    at_most(14, "it goes on: until the page says so", becomes(browser, "Bob", "live", 5), 3)
    passing.freeze()
    becomes(browser, "Dee", "disconnected since", 5)
    at_most(14, "a dead connection: until there is another one", becomes(browser, "Dee", "live", 20), 12)


def opened(browser, robots):
    """The tree of one robot, from the overview; also while it is killed, and back."""
    for name in ("Bob", HOSTILE):
        browser.js(f"[...document.querySelectorAll('#robots a')][{sorted(robots).index(name)}].click()")
        until(lambda: browser.js("location.pathname.startsWith('/robots/')"), 5, "the robot's page")
        until(lambda: browser.js("typeof run !== 'undefined' && run !== null"), 5, "its first message")
        browser.comes("live", 5)
        robots[name].tell("order inspect")
        until(lambda: "inspect" in browser.tree(), 5, "the order")
        own = names_running(robots[name].recorded())
        claim(14, f"the page of {ascii(name)}, from there", ", ".join(browser.tree()), ", ".join(own),
              browser.tree() == own)
        browser.driver.back()
        until(lambda: browser.driver.find_elements("css selector", "#robots > li"), 5, "the overview")
        browser.comes("live", 5)


def hostile(browser, hub):
    """A name makes no element, and nothing of it acts."""
    elements = set(browser.js("[...document.body.querySelectorAll('*')].map((e) => e.localName)"))
    allowed = set("a h1 h2 header li main p span ul".split())
    claim(14, "elements that no name may make", sorted(elements - allowed), "none", elements <= allowed)
    title = cards(browser)[HOSTILE]["title"]
    wanted = HOSTILE.replace("\u202e", "\\u{202e}").replace("\x1b", "\\u{1b}")
    claim(14, "the name, as a text", ascii(title), ascii(wanted), title == wanted)
    claim(14, "what acted", browser.js("window.hit ?? null"), "None", browser.js("window.hit ?? null") is None)
    foreign = [url for url in browser.requests()
               if not url.startswith((hub.address, hub.address.replace("http", "ws"), "data:"))]
    claim(14, "requests to anything else", foreign, "none", not foreign)
    browser.no_problems(14)


def accessible():
    """For all: what axe-core finds, where one robot is live, and another one is not."""
    with Robot("work") as live, Robot("work") as away, Hub({"Ann": live.address, "Bob": away.address}) as hub:
        with Browser() as browser:
            browser.open(hub)
            becomes(browser, "Bob", "live", 5)
        away.process.kill()
        for dark in (False, True):
            for width in (1280, 360):
                with Browser(width=width, dark=dark) as browser:
                    browser.open(hub)
                    until(lambda: len(cards(browser)) == 2, 5, "the cards")
                    becomes(browser, "Bob", "disconnected since", 5)
                    browser.accessible(14, 15)
