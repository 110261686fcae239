"""Rows 1, 2 and 9: robots are killed, frozen and cut off, and clocks drift and step."""

import os
import random
import signal
import subprocess
import sys
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat

import psycopg2
from claims import claim
from fleet import CLOCK, FOLDER, SEED, TRUE_CLOCK, Robot, address, fresh, kill_all, number, psql, server
from processes import sent
from watching import until

TERM = 1


def row_1():
    """Tasks, robots' processes that are killed and frozen, and a crash of the database."""
    carried(1, 1500, 60, 30, lambda n: False)


def row_9():
    """Rows 1 and 2, with half of the robots in Python, by the documented functions."""
    half = lambda n: n % 2 == 1
    carried(9, 1500, 60, 30, half)
    passed(9, half, doors=10, times=3)


def carried(row, orders, kills, freezes, is_python):
    chance = random.Random(SEED)
    fresh()
    begun = time.monotonic()
    with Robot("submit", "office", 1, orders, 0.05) as office:
        until(lambda: office.says("submitted"), 60, "the orders' submission")
    robots = [Robot("robot", f"robot-{n}", TERM, python=is_python(n)) for n in range(8)]
    events = ["kill"] * kills + ["freeze"] * freezes + ["crash"]
    chance.shuffle(events)
    thaws, went = [], []

    def thaw():
        for at, robot in [t for t in thaws if t[0] <= time.monotonic()]:
            robot.thaw()
            thaws.remove((at, robot))
        return [robot for robot in robots if robot not in [frozen for _, frozen in thaws]]

    for event in events:
        time.sleep(chance.uniform(0.05, 0.25))
        robot = chance.choice(until(thaw, 10, "a robot that is not frozen"))
        if event == "kill":
            robot.kill()
            robot.start()
        elif event == "freeze":
            robot.freeze()
            thaws.append((time.monotonic() + 1.5 * TERM, robot))
        else:
            server("-m", "immediate", "restart")
        went.append(event)
    until(lambda: len(thaw()) == len(robots), 10, "the last thaw")
    done = lambda: number("select count(distinct n) from delivered") == orders or time.monotonic() > begun + 90
    until(done, 100, step=0.2)
    took = time.monotonic() - begun
    kill_all(robots)
    counts = [went.count(event) for event in ("kill", "freeze", "crash")]
    distinct = number("select count(distinct n) from delivered")
    twice = number("select count(*) from (select from delivered group by n having count(*) > 1) t")
    starts = number("select sum(starts) from fleet.task")
    claim(row, "kills, freezes longer than the lease, crashes of the database", counts, [kills, freezes, 1],
          counts == [kills, freezes, 1])
    claim(row, "orders with a delivery in the users' table", distinct, orders, distinct == orders)
    claim(row, "orders with two deliveries", twice, 0, twice == 0)
    claim(row, "starts that a blow has ended", starts - orders, f"{(kills + freezes) // 2} or more",
          starts - orders >= (kills + freezes) // 2)
    claim(row, "took", f"{took:.1f} s", "under 60 s", took < 60)
    for kind in ("Haskell", "Python"):
        names = [f"'{r.name}'" for n, r in enumerate(robots) if is_python(n) == (kind == "Python")]
        if names and len(names) < len(robots):
            its = number(f"select count(*) from delivered where robot in ({','.join(names)})")
            claim(row, f"deliveries by robots in {kind}", its, f"{orders // 4} or more", its >= orders // 4)


def row_2():
    """Doors that one robot passes at a time: there are ten, each with ten robots."""
    asked_at_once()
    passed(2, lambda n: False, doors=10, times=10)


def asked_at_once():
    """A free door that two ask for at once: the second waits for the first's transaction, then for the door."""
    fresh()
    hold = lambda name: f"select fences from fleet.hold('{uuid.uuid4()}', '{{door}}', '{name}', '10 s')"
    psql(f"{hold('amy')}; select fleet.release(request) from fleet.resource")
    first, second, watching = (psycopg2.connect(address()) for _ in range(3))
    watching.autocommit = True

    def ask(connection, statement):
        with connection.cursor() as cursor:
            cursor.execute(statement)
            return cursor.fetchone()[0]

    answers = [ask(first, hold("bob"))]
    with ThreadPoolExecutor() as beside:
        answer = beside.submit(ask, second, hold("carl"))
        waits = f"select wait_event_type = 'Lock' from pg_stat_activity where pid = {second.info.backend_pid}"
        try:
            until(lambda: ask(watching, waits), 10, "the second's wait", step=0)
        finally:
            first.commit()
        answers.append(answer.result())
    has = [fences is not None for fences in answers]
    claim(2, "two that ask for a free door at once: whether they have it", has, [True, False], has == [True, False])
    for connection in (first, second, watching):
        connection.close()


class Door:
    """A door of its own process, with its record: what it has accepted and refused."""

    def __init__(self, n):
        self.name, self.socket, path = f"door-{n}", f"{FOLDER}/door-{n}", f"{FOLDER}/door-{n}.record"
        for other in filter(os.path.exists, (self.socket, path)):
            os.remove(other)  # of another row
        self.process = subprocess.Popen([sys.executable, "test/fleets/door.py", self.socket, path])
        until(lambda: os.path.exists(self.socket), 10, "the door")
        self.file, self.part, self.lines = open(path, encoding="utf-8"), "", []

    def record(self):
        """Each line: when, what, the robot's name, its fence, whether that was accepted."""
        *whole, self.part = (self.part + self.file.read()).split("\n")
        for at, what, name, fence, how in map(str.split, whole):
            self.lines.append((float(at), what, name, int(fence), how == "accepted"))
        return self.lines

    def inside(self):
        """The robot that is inside, according to the door, and since when."""
        accepted = next((line for line in reversed(self.record()) if line[4]), None)
        return (accepted[2], accepted[0]) if accepted and accepted[1] == "enter" else (None, 0)

    def end(self):
        self.process.kill()
        self.process.wait()
        self.file.close()


def passed(row, is_python, doors, times):
    """That many kills and freezes at each door, in five phases. (A robot is cut off by freezing its connections, in the
    database: so it loses its lease while it is inside.)"""
    fresh()
    psql(CLOCK)
    doors = [Door(n) for n in range(doors)]
    robots = {
        # (Their own clocks: 10 % slow, right, 10 % fast.)
        door: {robot.name: robot for robot in (
            Robot("visitor", f"{door.name}-{n}", door.name, door.socket, 0.9 + 0.1 * (n % 3), python=is_python(n))
            for n in range(10))}
        for door in doors}
    everyone = [robot for its in robots.values() for robot in its.values()]
    here = "select count(distinct application_name) from pg_stat_activity where application_name like 'door-%'"
    some, half = max(1, times // 5), times // 2
    phases = [
        # Name, blows at each door, the rate of the database's clock, its steps.
        ("kills", {"kill": times - 2 * some}, 1, 0),
        ("freezes", {"freeze": times - half}, 1, 0),
        ("the clock 10 % fast", {"kill": some, "cut": some}, 1.1, 0),
        ("the clock steps", {"kill": some, "cut": some}, 1, 0.05),
        ("freezes, and the clock leaps", {"freeze": half}, 1, 1),
    ]
    blows = []
    try:
        began = time.monotonic()
        until(lambda: number(here) == len(everyone), 60, "the last robot", step=0.5)
        took = time.monotonic() - began
        claim(row, "the last of the robots is connected after", f"{took:.1f} s", "within 20 s", took <= 20)
        for name, its, rate, step in phases:
            psql(f"update clock set since = clock_timestamp(), rate = {rate}, step = 0")
            phase = Phase(doors, robots, its, step)
            blows += [kind for door in doors for kind, _, _, is_hit in phase.blows[door] if is_hit]
            judge_phase(row, name, phase, is_timed=(rate, step) == (1, 0), is_frozen="freeze" in its)
    finally:
        ended = [" ".join([robot.name, *robot.last()]) for robot in everyone if robot.process.poll() is not None]
        claim(row, "robots' processes that have ended by themselves", ended, [], ended == [])
        kill_all(everyone)
        psql(TRUE_CLOCK)
        for door in doors:
            door.end()
    counts = [blows.count(kind) for kind in ("kill", "freeze", "cut")]
    wanted = [len(doors) * count for count in (times, times, 2 * some)]
    claim(row, f"kills, freezes and cuts of the robot that is inside, at {len(doors)} doors", counts, wanted,
          counts == wanted)


def tell(door, robots):
    """Why nothing passes a door, as the database, the door and the robots tell it."""
    waiting = f"application_name like '{door.name}-%' and state <> 'idle'"
    print(f"{door.name}: no robot passes, at {time.monotonic():.2f}; its record ends with", door.record()[-3:])
    print(psql(f"""
      select 'the resource', fleet.clock(), * from fleet.resource where resource = '{door.name}';
      select 'waits', * from fleet.place where '{door.name}' = any (resources) order by place;
      select 'asks', application_name, pid, pg_blocking_pids(pid), wait_event, now() - xact_start, query
        from pg_stat_activity where {waiting}
    """))
    for robot in robots.values():
        print(robot.name, robot.process.pid, robot.process.poll(), *robot.last(), flush=True)


class Phase:
    """Blows to the robots that are inside: of each its kind, when it came, to which robot, and whether that was inside
    then, are in blows; the lines of the doors' records in lines."""

    def __init__(self, doors, robots, blows, step):
        self.is_over = False
        begins = {door: len(door.record()) for door in doors}
        self.blows = {door: [] for door in doors}
        with ThreadPoolExecutor(len(doors) + 1) as together:
            stepping = together.submit(self.step, step)
            try:
                list(together.map(self.strike, range(len(doors)), doors, map(robots.get, doors), repeat(blows)))
                time.sleep(1.7 * TERM)
            finally:
                self.is_over = True
        stepping.result()
        self.lines = {door: door.record()[begins[door]:] for door in doors}

    def step(self, step):
        """At most once in a term."""
        chance = random.Random(SEED)
        while step and not self.is_over:
            psql(f"update clock set step = {chance.uniform(-step, step)}")
            time.sleep(1.2 * TERM)

    def strike(self, n, door, robots, blows):
        chance = random.Random(f"{SEED} {n}")
        events = [kind for kind, count in blows.items() for _ in range(count)]
        chance.shuffle(events)
        while events:
            # At once, or later: most stay for a moment, some for longer than the term.
            least = 0.05 if events[-1] == "cut" else chance.choice([0, 0, 0, 0.3])
            last = door.inside()

            def another():
                inside = door.inside()
                return inside != last and inside[0] and time.monotonic() - inside[1] >= least and inside

            try:
                name, since = until(another, 20, "a robot that passes", step=0.002)
            except TimeoutError:
                tell(door, robots)
                raise
            if self.struck(events[-1], door, robots[name], since):
                events.pop()

    def struck(self, kind, door, robot, since):
        """Whether it was still inside then."""
        at = time.monotonic()
        backends = []
        if kind == "kill":
            robot.kill()
        elif kind == "freeze":
            robot.freeze()
        else:
            backends = psql(f"select pid from pg_stat_activity where application_name = '{robot.name}'").split()
            for backend in map(int, backends):
                sent(signal.SIGSTOP, backend)
        time.sleep(0.005)  # (What was on its way to the door is there.)
        is_hit = door.inside() == (robot.name, since)
        self.blows[door].append((kind, at, robot.name, is_hit))
        if kind == "kill":
            robot.start()
        else:
            time.sleep(1.3 * TERM if is_hit else 0)
            robot.thaw()
        for backend in map(int, backends):
            sent(signal.SIGCONT, backend)
        return is_hit


def judge_phase(row, name, phase, is_timed, is_frozen):
    overlaps, stale, refused, entered, gaps, shared = 0, 0, 0, 0, [], 0
    for door, lines in phase.lines.items():
        greatest, inside, owners = 0, None, {}
        for at, what, robot, fence, accepted in lines:
            refused += not accepted
            stale += accepted and fence < greatest
            greatest = max(greatest, fence)
            shared += owners.setdefault(fence, robot) != robot
            if accepted and what == "enter":
                entered += 1
                blows = inside and [(kind, when) for kind, when, who, _ in phase.blows[door]
                                    if who == inside[0] and inside[1] <= when <= at]
                if inside and "kill" not in dict(blows) and not is_frozen:
                    overlaps += 1
                    print(f"row {row}: {robot} entered at {at}, and {inside} was there; blows: {blows}")
                inside = (robot, at)
            elif inside and inside[0] == robot:
                inside = None
        entries = [at for at, what, _, _, accepted in lines if accepted and what == "enter"]
        gaps += [min((at for at in entries if at > when), default=1e9) - when
                 for kind, when, _, _ in phase.blows[door] if kind != "cut"]
    count = sum(map(len, phase.blows.values()))
    claim(row, f"{name}: passes of the doors", entered, f"more than the {count} blows", entered > count)
    if not is_frozen:
        claim(row, f"{name}: overlaps", overlaps, 0, overlaps == 0)
        claim(row, f"{name}: refused by a door", refused, 0, refused == 0)
    claim(row, f"{name}: accepted with a stale fence, or with that of another robot", f"{stale}, {shared}", "0, 0",
          stale == shared == 0)
    if is_timed:
        claim(row, f"{name}: longest until the door is passed again", f"{max(gaps):.2f} s",
              f"at most the term + 0.5 s = {TERM + 0.5} s", max(gaps) <= TERM + 0.5)
    if is_frozen:
        print(f"row {row}: {name}: refused, for their fences are stale: {refused}", flush=True)
