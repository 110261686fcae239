"""Row 3: the database is stopped; it is slow; and a standby takes its place, when it was killed, and when it is
frozen."""

import os
import shutil
import signal
import subprocess
import time

from claims import claim
from fleet import FOLDER, Robot, address, as_server, fresh, kill_all, number, psql, server
from processes import end, family, postmaster, sent
from watching import until

OUTAGE, GOES_ON, TERM = 30, 5, 3
OTHER = f"{FOLDER}/sockets"


def row_3():
    stopped()
    slow()
    standing_by("data", "other", FOLDER, OTHER, "killed")
    # (Libpq asks the first server of the address first: this one is the frozen one.)
    standing_by("other", "data", OTHER, FOLDER, "frozen")


def stopped():
    """The server is stopped for a while: four robots have long orders then, the others short ones."""
    fresh()
    with Robot("submit", "office-long", 1001, 1004, 8) as office:
        until(lambda: office.says("submitted"), 30, "the long orders")
    robots = [Robot("robot", f"robot-{n}", TERM) for n in range(8)]
    until(lambda: sum(len(robot.says("begins")) for robot in robots) >= 4, 30, "four robots that have orders")
    office = Robot("office", "office", 1, 120, 0.3)
    until(lambda: len(office.says("done")) >= 20, 30, "orders that are done")
    before = time.monotonic()
    server("-m", "fast", "stop")
    after = time.monotonic()
    time.sleep(OUTAGE)
    until_then = {robot: robot.lines() for robot in robots}
    server("start")
    up = time.monotonic()
    until(lambda: number("select count(distinct n) from delivered") == 124, 60, "the last order", step=0.2)
    ended = [robot.name for robot in (*robots, office) if robot.process.poll() is not None and robot is not office]
    kill_all([*robots, office])

    cut = [float(line[0]) for lines in until_then.values() for line in lines if line[1:2] == ["interrupted"]
           and int(line[2]) > 1000]
    least, most = before + TERM / 3 - 0.2 - before, after + TERM * 2 / 3 + 0.3 - before
    at = [f"{time - before:.1f}" for time in sorted(cut)]
    claim(3, "stopped: robots were interrupted in their orders after", at, f"4, after {least:.1f} to {most:.1f} s",
          len(cut) == 4 and all(least <= time - before <= most for time in cut))
    goes_on("stopped", robots, up)
    claim(3, "stopped: robots' processes that have ended by themselves", ended, [], ended == [])
    judge_orders("stopped", office, 124)


def slow():
    """A server that takes three seconds to answer who connects: for longer than a client has patience, at first."""
    fresh()
    folder = f"{FOLDER}/slow"
    os.makedirs(folder, exist_ok=True)
    late = f"SYSTEM:sleep 3; exec socat - UNIX-CONNECT\\:{FOLDER}/.s.PGSQL.5432"
    with subprocess.Popen(["socat", f"UNIX-LISTEN:{folder}/.s.PGSQL.5432,fork", late],
                          stderr=subprocess.DEVNULL) as socat:
        try:
            until(lambda: os.path.exists(f"{folder}/.s.PGSQL.5432"), 10, "the slow server")
            begun = time.monotonic()
            with Robot("submit", "office", 1, 1, 0, database=address(host=folder)) as office:
                until(lambda: office.says("submitted") or time.monotonic() > begun + 30, 40)
                took = float((office.says("submitted") or [["inf"]])[0][0]) - begun
        finally:
            socat.terminate()
    claim(3, "slow: who connects to a server that takes 3 s to answer is connected after", f"{took:.1f} s",
          "within 10 s", took <= 10)


def goes_on(name, robots, since, limit=GOES_ON):
    """Each robot begins an order."""
    begins = [min((float(line[0]) for line in robot.says("begins") if float(line[0]) > since), default=1e9) - since
              for robot in robots]
    claim(3, f"{name}: the last robot to go on does so after", f"{max(begins):.1f} s", f"within {limit} s",
          max(begins) <= limit)


def judge_orders(name, office, count, **where):
    """All that was acknowledged is there, and everything once."""
    submitted = [f"'order {line[2]}'" for line in office.says("submitted")]
    done = [line[2] for line in office.says("done")]
    there = number(f"select count(*) from fleet.task where key in ({','.join(submitted)})", **where)
    claim(3, f"{name}: orders whose submission was acknowledged", there, f"all of {len(submitted)}",
          there == len(submitted) > 0)
    there = number(f"select count(distinct n) from delivered where n in ({','.join(done)})", **where)
    claim(3, f"{name}: orders whose completion was acknowledged", there, f"all of {len(done)}", there == len(done) > 0)
    every = [number(f"select count({what}) from delivered", **where) for what in ("distinct n", "*")]
    claim(3, f"{name}: orders that were delivered, and deliveries", every, [count, count], every == [count, count])


def standing_by(primary, standby, host, other, how):
    """A standby confirms each transaction. Then the server that has been the primary is there no more, and the standby
    is promoted."""
    shutil.rmtree(f"{FOLDER}/{standby}", ignore_errors=True)
    fresh(host)
    as_server("pg_basebackup", "-h", host, "-U", "postgres", "-D", f"{FOLDER}/{standby}", "-R", "-c", "fast")
    with open(f"{FOLDER}/{standby}/postgresql.conf", "a", encoding="utf-8") as settings:
        settings.write(f"unix_socket_directories = '{other}'\n")
    os.makedirs(other, exist_ok=True)
    shutil.chown(other, "postgres")
    server("start", data=standby)
    psql("alter system set synchronous_standby_names = '*'; select pg_reload_conf()", user="postgres", host=host)
    sync = "select count(*) from pg_stat_replication where sync_state = 'sync'"
    until(lambda: number(sync, user="postgres", host=host) == 1, 30, "the standby")

    both = address(host=f"{host},{other}") + " target_session_attrs=read-write"
    robots = [Robot("robot", f"robot-{n}", TERM, database=both) for n in range(4)]
    # (There are orders left when the last robot goes on.)
    count = 320 if how == "frozen" else 160
    office = Robot("office", "office", 1, count, 0.1, database=both)
    until(lambda: len(office.says("done")) >= 40, 30, "orders that are done")
    processes = family(postmaster(primary))
    for process in processes:
        sent(signal.SIGSTOP, process)
    if how == "killed":
        end(processes)
    time.sleep(1)
    as_server("pg_ctl", "-D", f"{FOLDER}/{standby}", "-w", "promote")
    since = time.monotonic()
    try:
        until(lambda: len(office.says("done")) == count, 60, f"the last order ({how})")
    finally:
        ended = [robot.name for robot in robots if robot.process.poll() is not None]
        kill_all([*robots, office])
        if how == "frozen":
            end(processes)
    # (A robot that waits notices by its next poll, within five seconds, that a frozen server does not answer. Each of
    # its two connections waits two seconds for an answer, one after the other, and the second then two for the server.)
    goes_on(how, robots, since, 10 if how == "frozen" else GOES_ON)
    claim(3, f"{how}: robots' processes that have ended by themselves", ended, [], ended == [])
    judge_orders(how, office, count, host=other)
    psql("alter system reset synchronous_standby_names; select pg_reload_conf()", user="postgres", host=other)

