"""Rows 4, 5 and 6: what fleets cost."""

import os
import statistics
import subprocess
import time
import uuid

import psycopg2

from claims import claim
from fleet import BUILT, FOLDER, Robot, address, fresh, kill_all, number, psql
from watching import until
from processes import cpu, family, postmaster


def row_4():
    """A thousand robots that wait for tasks, in twenty processes, each of which polls every 5 s."""
    fresh()
    for statement in ("vacuum analyze", "checkpoint"):
        psql(statement, user="postgres")  # (What was written before is no cost of these.)
    robots = [Robot("idle", f"idle-{n}", 50) for n in range(20)]
    seen = "select count(*) from fleet.process where cardinality(robots) >= 50"
    until(lambda: number(seen) == 20, 60, "all processes", step=0.5)
    time.sleep(5)
    groups = family(postmaster()), [robot.process.pid for robot in robots]
    # (Together they are the claim; each shows whether it was always so, or a burst of something.)
    windows = [shares(5, groups) for _ in range(4)]
    with Robot("submit", "office", 1, 20, 0) as office:
        until(lambda: office.says("submitted"), 30, "the orders' submission")
        until(lambda: number("select count(*) from delivered") == 20, 10, "their delivery")
    kill_all(robots)
    for whose, took, limit in zip(("the database takes", "all robots take"), zip(*windows), (1, 5)):
        share, each = statistics.mean(took), ", ".join(f"{share:.2f}" for share in took)
        claim(4, f"1,000 idle robots in 20 processes: of a core, {whose}", f"{share:.2f} % ({each})",
              f"under {limit} %", share < limit)


def shares(seconds, groups):
    """Of a core, in percent, what each of these groups of processes takes."""
    before, begun = [cpu(group) for group in groups], time.monotonic()
    time.sleep(seconds)
    took = time.monotonic() - begun
    return [(cpu(group) - then) / took * 100 for group, then in zip(groups, before)]


ROUNDS = int(os.environ.get("ROUNDS") or 3)
TASKS = {1: 600, 4: 2000, 16: 4000}
COMMITS = "select xact_commit from pg_stat_database where datname = 'fleet'"


def row_5():
    """Empty tasks, beside graphile-worker, in turn."""
    psql("create schema if not exists graphile_worker")
    graphile(1, 0)
    for workers, count in TASKS.items():
        ours, theirs, commits = [], [], []
        for _ in range(ROUNDS):
            fresh()
            psql(f"select count(fleet.submit('empty', n::text, '[]')) from generate_series(1, {count}) n")
            psql("vacuum analyze fleet.task")
            before = number(COMMITS)
            with Robot("drain", "drain", workers, count) as robot:
                ours.append(float(until(lambda: robot.says("drained"), 120, "the last task")[0][2]))
            # (A connection that has ended has counted all that it has done.)
            until(lambda: number("select count(*) from pg_stat_activity where application_name = 'drain'") == 0, 10)
            commits.append((number(COMMITS) - before) / count)
            done = number("select count(*) from fleet.task where state = 'done'")
            psql(f"select count(graphile_worker.add_job('empty', '[]')) from generate_series(1, {count}) n")
            psql("vacuum analyze graphile_worker._private_jobs")
            theirs.append(graphile(workers, count))
            left = number("select count(*) from graphile_worker.jobs")
            if (done, left) != (count, 0):
                claim(5, "tasks that are done, and that graphile-worker has left", [done, left], [count, 0], False)
        mine, other = (count / statistics.median(times) for times in (ours, theirs))
        claim(5, f"{workers} workers: empty tasks in a second, graphile-worker's, and the ratio",
              f"{mine:.0f}, {other:.0f}, {mine / other:.2f}", "at least 1.0", mine >= other)
        # (Robots whose tasks end together have one transaction, for them and their next ones.)
        its, most = max(commits), 1.5 / workers
        claim(5, f"{workers} workers: transactions for a task", f"{its:.2f}", f"at most {most:.2f}", its <= most)


def graphile(workers, count):
    """How long it took."""
    done = subprocess.run(["node", "test/fleets/graphile.cjs", FOLDER, str(workers), str(count)], text=True, check=True,
                          env={**os.environ, "NODE_PATH": f"{BUILT}/node_modules"}, capture_output=True, timeout=120)
    return float(done.stdout or 0)


KEPT = """
insert into fleet.task (queue, key, state, priority, needs, input, due, pauses, kept, starts, lease, robot, term, wakes,
  result, submitted, ended)
select 'orders', 'done ' || n, 'done', 0, '{{}}', jsonb_build_array(n, 0), at, '{{1s,10s,1min,10min}}', '7 days', 1, n,
  'robot-' || n % 100, '10 s', at + interval '7 days', 'null', at, at + interval '1 s'
from generate_series(1, {count}) n, clock_timestamp() at
"""
CLAIMS = 300
BOTH = "few", "many"


def row_6():
    """A database with a million tasks that are done, and another one with a thousand."""
    for name, count in zip(BOTH, [1000, 1_000_000]):
        psql(f"create database {name} owner owner", user="postgres", database="postgres")
        subprocess.run([f"{BUILT}/behavior-fleet", "create", f"host={FOLDER} dbname={name} user=owner"], check=True,
                       stdout=subprocess.DEVNULL)
        psql(KEPT.format(count=count), database=name)
    few, many = medians(one_poll)
    claim(6, "a poll, without its commit, with a thousand finished tasks, and with a million",
          f"{few * 1000:.2f} ms, {many * 1000:.2f} ms: {many / few:.2f} times", "at most 1.5 times", many <= 1.5 * few)
    # As if they had been kept for less: in each second the time of a thousand has come; then that of many at once.
    passing = """
      update fleet.task set wakes = clock_timestamp() + n * interval '{}' from (
        select task, row_number() over () n from fleet.task where key like 'done %' limit {}) t
      where t.task = fleet.task.task
    """
    vacuum = "vacuum analyze fleet.task"
    for name, *before in [("a million", "", ""), ("a million, both vacuumed", vacuum, vacuum),
                          ("a thousand to go each second", vacuum, passing.format("1 ms", 20_000))]:
        few, many = claims(name, before)
        claim(6, f"a claim, without its commit, with a thousand finished tasks, and with {name}",
              f"{few * 1000:.2f} ms, {many * 1000:.2f} ms: {many / few:.2f} times", "at most 1.5 times",
              many <= 1.5 * few)
    _, many = claims("all", ("", passing.format("0 s", 100_000)))
    print(f"row 6: a claim when the time of a hundred thousand has come: {many * 1000:.2f} ms", flush=True)
    count, begun = number("select count(*) from fleet.task", database="many"), time.monotonic()
    with Robot("idle", "idle", 1, database=address("many")):
        time.sleep(6)
    took = time.monotonic() - begun
    gone = count - number("select count(*) from fleet.task", database="many")
    claim(6, "then one idle process forgets in a second", f"{gone / took:.0f}", "100 or more", gone / took >= 100)


def claims(name, before):
    """The medians of the seconds that one claim takes, in databases that are prepared so."""
    for database, prepare in zip(BOTH, before):
        psql(f"select count(fleet.submit('orders', '{name} ' || n, '[1, 0]')) from generate_series(1, {CLAIMS}) n",
             database=database)
        psql(prepare, database=database)
    return medians(one_claim)


def medians(one):
    """Of the seconds that one takes in the database with few tasks and in that with many: in turn, for what else the
    machine does costs both."""
    psql("checkpoint", user="postgres")  # (What was written before is no cost of these.)
    connections = [psycopg2.connect(address(database)) for database in BOTH]
    times = [[one(connection) for connection in connections] for _ in range(CLAIMS)]
    for connection in connections:
        connection.close()
    return map(statistics.median, zip(*times))


def one_claim(connection):
    with connection.cursor() as cursor:
        cursor.execute("select")  # (It begins the transaction.)
        begun = time.monotonic()
        cursor.execute("select task, lease from fleet.claim('orders', '{robot}', '{}', '10 s')")
        took = time.monotonic() - begun
        cursor.execute("select fleet.complete(%s, %s, 'null')", cursor.fetchone())
    connection.commit()
    return took


def one_poll(connection):
    with connection.cursor() as cursor:
        cursor.execute("select")
        begun = time.monotonic()
        cursor.execute("select * from fleet.poll(%s, 'host', null, '{robot}', '5 s')", [str(uuid.UUID(int=1))])
        took = time.monotonic() - begun
    connection.commit()
    return took
