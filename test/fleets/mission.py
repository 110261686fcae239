"""make fleet: 20 robots of examples/fleet-mission carry an office's 500 orders, while robots are killed and frozen, and
the database is killed. Prints what happens, and in the end a table. It is judged by the user's own table, "delivered".

mission.py   (with FLEET, the folder of the server and its socket, and BUILT, that of the programs)
"""

import random
import signal
import subprocess
import sys
import time

from fleet import BUILT, FOLDER, SEED, address, psql, server

ORDERS, ROBOTS, POISON = 500, 20, 13
TERM = 2  # seconds, after which an order is started again when its robot is gone
KILLS, FREEZES, AWAY = 10, 5, 5
LIMIT = 180
processes, killed, frozen, fallen, crashes = {}, [], [], [], []


def start(name, *arguments):
    with open(f"{FOLDER}/{name}.log", "a", encoding="utf-8") as log:
        processes[name] = subprocess.Popen(
            [f"{BUILT}/fleet-mission", *arguments, "--database", address(), "--term", str(TERM)],
            stdout=log, stderr=log)


def start_office():
    start("office", "office", "--orders", str(ORDERS))


def port(n):
    return 8500 + 10 * n


def start_robot(n):
    start(f"robot-{n}", "robot", f"robot-{n}", "--speed", "20", "--live", "--page-port", str(port(n)),
          *(["--skill", "lift"] if n % 4 == 0 else []))


def show_page():
    with open(f"{FOLDER}/hub.log", "w", encoding="utf-8") as log:
        processes["hub"] = subprocess.Popen(
            [f"{BUILT}/behavior-fleet", "hub", address(user="viewer")], stdout=log, stderr=log)
    while "http://" not in (said := log_of("hub")) and processes["hub"].poll() is None:
        time.sleep(0.05)
    print(said.strip(), flush=True)


def log_of(name):
    with open(f"{FOLDER}/{name}.log", encoding="utf-8") as log:
        return log.read()


def kill(name):
    processes[name].kill()
    processes[name].wait()
    killed.append(name)


def what_happens():
    """At which time what. (The office is killed while it submits, or soon after.)"""
    away = random.uniform(10, 20)
    plan = [(random.uniform(0.3, 2), kill_office), (away, crash), (away + AWAY, lambda: server("start"))]
    plan += [(random.uniform(3, 35), kill_robot) for _ in range(KILLS)]
    for _ in range(FREEZES):
        at, n = random.uniform(3, 35), random.randint(1, ROBOTS)
        plan += [(at, lambda n=n: freeze(n)), (at + 1.5 * TERM, lambda n=n: send(n, signal.SIGCONT))]
    return sorted(plan, key=lambda it: it[0])


def kill_office():
    kill("office")
    start_office()


def kill_robot():
    n = random.randint(1, ROBOTS)
    kill(f"robot-{n}")
    start_robot(n)


def freeze(n):
    send(n, signal.SIGSTOP)
    frozen.append(f"robot-{n}")


def send(n, what):
    processes[f"robot-{n}"].send_signal(what)


def crash():
    server("-m", "immediate", "stop")
    crashes.append(time.monotonic())


def main():
    """For how long it took."""
    begun = shown = time.monotonic()
    start_office()
    for n in range(1, ROBOTS + 1):
        start_robot(n)
    show_page()
    plan = what_happens()
    while processes["office"].poll() is None and time.monotonic() < begun + LIMIT:
        time.sleep(0.05)
        now = time.monotonic() - begun
        for n in range(1, ROBOTS + 1):
            if processes[f"robot-{n}"].poll() is not None:
                fallen.append(f"robot-{n}")
                start_robot(n)
        while plan and plan[0][0] <= now:
            plan.pop(0)[1]()
        if time.monotonic() >= shown + 3:
            shown = time.monotonic()
            print(f"{now:4.0f} s: {count_delivered()}; killed: {len(killed)}, frozen: {len(frozen)}", flush=True)
    took = time.monotonic() - begun
    for process in processes.values():
        process.send_signal(signal.SIGCONT)
        process.terminate()
    for process in processes.values():
        process.wait()
    return took


def count_delivered():
    try:
        return psql("select count(*) from delivered") + " delivered"
    except RuntimeError:
        return "the database is away"


def judge(took):
    """Prints the table; whether it is right."""
    wanted = f"generate_series(1, {ORDERS}) n where n <> {POISON}"
    missing = psql(f"select count(*) from {wanted} and n not in (select number from delivered)")
    others = psql(f"select count(*) from delivered where number not in (select n from {wanted})")
    twice = psql("select count(*) from (select from delivered group by number having count(*) > 1) t")
    dead = psql("select string_agg(key || ', after ' || starts || ' starts', '; ') from fleet.dead")
    rows = [
        ("orders", ORDERS, None),
        ("delivered", psql("select count(distinct number) from delivered"), None),
        ("delivered twice", twice, twice == "0"),
        ("missing", missing, missing == "0"),
        ("delivered, but should not be", others, others == "0"),
        ("dead", dead or "none", dead.startswith(f"order {POISON},") and ";" not in dead),
        ("starts", psql("select sum(starts) from fleet.task"), None),
        ("killed (kill -9)", ", ".join(killed), len(killed) == KILLS + 1),
        ("frozen, for 1.5 terms", ", ".join(frozen), len(frozen) == FREEZES),
        ("the database was killed", f"{len(crashes)}, and was away for {AWAY} s", len(crashes) == 1),
        ("robots that ended by themselves", ", ".join(fallen) or "none", not fallen),
        ("it took", f"{took:.0f} s", took < LIMIT),
    ]
    print()
    for what, value, ok in rows:
        print(f"{what:32} {value}{'' if ok is not False else '   WRONG'}")
    return all(ok is not False for _, _, ok in rows)


print(f"SEED={SEED}", flush=True)
random.seed(SEED)
right = judge(main())
print("\nThe office says:")
print(log_of("office"))
sys.exit(not right)
