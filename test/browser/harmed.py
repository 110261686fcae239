"""Rows 6, 8 and 9: who would harm the mission by its page, or read it, or those who look at it."""

import contextlib
import json
import os
import socket
import statistics
import subprocess
import unicodedata

from browser import Browser, delays
from claims import all_of, at_most, claim, percentile
from readers import Silent, Tunnel, ask, connections, upgrade
from robot import FOLDER, Robot
from watching import until


def row_6():
    """Twenty readers that never read."""
    with Robot("flood", 5000, recorded=False) as robot, Browser() as browser:
        browser.open(robot)
        silent = [Silent(robot.port) for _ in range(20)]
        until(lambda: watched(silent, connections(robot.port)), 60, "the end of all twenty")
        stuck = [s.ended - s.stalled for s in silent]
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


def watched(silent, known):
    return all([s.watched(known) for s in silent])


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
        with Tunnel(robot.port) as passing, Browser() as browser:
            browser.driver.get(f"http://127.0.0.1:{passing.port}/")
            browser.comes("live", 5)
            claim(8, "another port, by a tunnel", browser.state(), "live", browser.state() == "live")
    with Robot("work") as robot, contextlib.ExitStack() as stack:
        count = lambda: len(os.listdir(f"/proc/{robot.process.pid}/fd"))
        until(robot.recorded, 5, "the mission's beginning") # (Its files are open then.)
        before = count()
        for _ in range(200):
            stack.enter_context(socket.create_connection(("127.0.0.1", robot.port)))
        until(lambda: sum(is_there for is_there, _ in connections(robot.port).values()) <= 64, 5, "the end of others")
        # (One that is just being closed may still be there.)
        more = until(lambda: (n := count() - before) <= 65 and n, 5, "the end of others in the robot")
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
        browser.no_problems(9)


def as_text(name):
    """How the page shows it: two hundred characters, and what acts by its number."""
    short = name[:200] + ("…" if len(name) > 200 else "")
    return "".join(f"\\u{{{ord(c):x}}}" if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Zl", "Zp") else c
                   for c in short)
