"""Row 7 of make fleets: what the fake database does is what PostgreSQL does; and days of a fleet on it, simulated."""

import concurrent.futures
import os
import re
import subprocess

from claims import claim
from fleet import BUILT, SEED, address, another_server, psql, server

LONG = "LONG" in os.environ


def row_7():
    with concurrent.futures.ThreadPoolExecutor() as beside:
        both = [beside.submit(agreed), beside.submit(simulated)]
    for part in both:
        part.result()


def agreed():
    folder = another_server("agreed")
    psql("create database fleet owner owner", user="postgres", database="postgres", host=folder)
    owner, robot = (address(user=user, host=folder) for user in ("owner", "robot"))
    subprocess.run([f"{BUILT}/behavior-fleet", "create", owner], check=True, stdout=subprocess.DEVNULL)
    psql("create role robot login in role fleet_robot", host=folder)
    wanted = 5000 if LONG else 300
    said = run("agree", owner, robot, str(SEED), str(wanted))
    tried = re.search(r"OK, passed (\d+) tests", said)
    claim(7, "sequences of requests to PostgreSQL and to the fake database, which agree",
          tried[1] if tried else said, wanted, bool(tried) and int(tried[1]) == wanted)
    # (A robot's session may have another time zone; and this one has a day of 23 hours then.)
    psql("""
      set timezone = 'Europe/Berlin';
      truncate fleet.task;
      update fleet.about set is_restored = false;
      update fleet.tested set at = '2026-03-14 12:00 UTC';
      select fleet.submit('patrols', 'a', '1', a_deadline => timestamptz '2026-03-14 12:00 UTC' + interval '240 hours',
        a_period => '240 hours');
      select fleet.complete(task, lease, 'null') from fleet.claim('patrols', '{amy}', '{}', '10 s');
    """, host=folder)
    seconds = psql("select extract(epoch from deadline)::int - extract(epoch from due)::int from fleet.task "
                   "where state = 'later'", host=folder)
    claim(7, "from when to when the next of a periodic task may start, in which summer time begins", seconds, "864000",
          seconds == "864000")
    in_line(folder)
    server("-m", "immediate", "stop", data="agreed/data")


def in_line(folder):
    """What random sequences reach seldom. (The clock stands.)"""
    def hold(n, robot, names):
        return psql(f"select fences is not null from fleet.hold('{request(n)}', '{names}', '{robot}', '10 s')",
                    host=folder)

    def request(n):
        return f"00000000-0000-0000-0000-{n:012}"

    # Amy, who holds b, asks for a. Bob is the first who waits for a, and cannot have it without b; carl is behind him.
    psql("truncate fleet.resource, fleet.place", host=folder)
    held = [hold(1, "amy", "{b}"), hold(2, "bob", "{a,b}"), hold(3, "carl", "{a}"), hold(4, "amy", "{a}")]
    claim(7, "who has what it asks for: amy, bob, carl, amy", held, ["t", "f", "f", "t"], held == ["t", "f", "f", "t"])
    psql("truncate fleet.resource, fleet.place", host=folder)
    for n, robot in enumerate(["amy", "bob", "carl"]):
        hold(n, robot, "{a}")
    said = re.findall('payload "(.*?)"', psql(f"listen fleet; select fleet.release('{request(0)}')", host=folder))
    wanted = ["line a", f"turn {request(1)}"]
    claim(7, "notices of a release, of which bob is the first in the line", sorted(said), wanted,
          sorted(said) == wanted)


def simulated():
    wanted = 100000 if LONG else 1000
    said = run("days", str(SEED), str(wanted))
    tried = re.search(r"(\d+) schedules, (\d+) scheduling points", said)
    claim(7, "schedules of days of a fleet, in which nothing is broken", tried[0] if tried else said, wanted,
          bool(tried) and int(tried[1]) >= wanted)


def run(*arguments):
    done = subprocess.run([f"{BUILT}/fleets", *arguments], text=True, capture_output=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else f"{done.stdout[-2000:]} {done.stderr[-2000:]}"
