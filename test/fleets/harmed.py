"""Row 8: what robots are interrupted in, and what comes in from outside, harms nothing."""

import json
import os
import pathlib
import time

from claims import claim
from fleet import FOLDER, SEED, Robot, address, fresh, kill_all, number, psql
from watching import until

COUNT = int(os.environ.get("TIMES") or 10_000)
OPEN = "state in ('later', 'waiting', 'running')"


def row_8():
    interrupted()
    cancelled()
    deferred()
    texts()
    half_migrated()


def interrupted():
    """Statements are interrupted at random moments: robots submit, serve, hold, cancel and watch."""
    fresh()
    with Robot("harmed", "harmed", SEED, COUNT) as robot:
        connections = "select count(*) from pg_stat_activity where application_name = 'harmed'"
        most = 0
        while not robot.says("quiet") and robot.process.poll() is None:
            most = max(most, number(connections))
            time.sleep(0.02)
        times, lost, wrong = map(int, robot.says("quiet")[0][2:])
        until(lambda: number(f"select count(*) from fleet.task where {OPEN}") == 0, 60, "the last task", step=0.1)
        time.sleep(1)  # (A term of what was held.)
        claim(8, "interrupted: requests", times, f"{COUNT} or more", times >= COUNT)
        claim(8, "interrupted: of these in a statement", lost, f"{COUNT // 20} or more", lost >= COUNT // 20)
        claim(8, "interrupted: uses of a connection after that, or by two at once", wrong, 0, wrong == 0)
        claim(8, "interrupted: connections, according to the database, while they were interrupted", most, "at most 6",
              2 <= most <= 6)
        then = connections.replace("count(*)", "count(*) || ', ' || count(*) filter (where state <> 'idle')")
        ends = time.monotonic() + 0.5
        while (seen := psql(then)) != "2, 0" and time.monotonic() < ends:
            time.sleep(0.02)  # (It may be asking for tasks just now.)
        claim(8, "interrupted: connections then, and those in use", seen, "2, 0", seen == "2, 0")
        unexpected = [" ".join(line[2:]) for line in robot.says("unexpected")]
        claim(8, "interrupted: what was thrown that is nothing of an interruption", unexpected[:3], [], not unexpected)
        submitted = [f"'order {line[2]}'" for line in robot.says("submitted")]
    there = number(f"select count(*) from fleet.task where key in ({','.join(submitted)})")
    claim(8, "interrupted: orders whose submission was acknowledged", there, f"all of {len(submitted)}",
          there == len(submitted) > 20)
    done, cancelled, others = [number(f"select count(*) from fleet.task where state {which}") for which in (
        "= 'done'", "= 'cancelled'", "not in ('done', 'cancelled')")]
    claim(8, "interrupted: orders that are done, cancelled, or neither", [done, cancelled, others],
          "more than 100, some, 0", done > 100 and cancelled > 0 and others == 0)
    wrong = number("""
      select count(*) from fleet.task t
      where (select count(*) from delivered d where d.n = (t.input->>0)::int) <> (t.state = 'done')::int
    """)
    claim(8, "interrupted: orders that are done and not delivered once, or delivered and not done", wrong, 0,
          wrong == 0)
    left = number("select count(*) from fleet.resource where until > fleet.clock()") + number(
        "select count(*) from fleet.place where until > fleet.clock()")
    claim(8, "interrupted: resources that are held for no robot, and places in a queue", left, 0, left == 0)


def cancelled():
    """Statements of robots and of an office are ended on the server, by a superuser."""
    fresh()
    robots = [Robot("robot", f"cancelled-{n}", 3) for n in range(4)]
    robots += [Robot("office", "cancelled-office", 1, 600, 0.02)]
    until(lambda: number("select count(*) from delivered") >= 20, 30, "the first orders")
    before, rounds = cancelled_statements(), 0
    while rounds < 10 or (cancelled_statements() - before < 20 and rounds < 40):
        rounds += 1
        psql("""
          do $$
          declare pids int[] := array(select pid from pg_stat_activity where application_name like 'cancelled-%');
          begin
            for n in 1..200 loop
              perform pg_cancel_backend(pid) from unnest(pids) pid;
              perform pg_sleep(0.001);
            end loop;
          end $$
        """, user="postgres")
    times = cancelled_statements() - before
    claim(8, "cancelled: statements, according to the server's log", times, "20 or more", times >= 20)
    until(lambda: number("select count(distinct n) from delivered") == 600, 60, "the last order", step=0.1)
    ended = [robot.name for robot in robots[:-1] if robot.process.poll() is not None]
    claim(8, "cancelled: robots' processes that have ended by themselves", ended, [], ended == [])
    claim(8, "cancelled: the office has ended with", robots[-1].process.wait(30), 0, robots[-1].process.poll() == 0)
    kill_all(robots)
    twice = number("select count(*) from (select from delivered group by n having count(*) > 1) it")
    claim(8, "cancelled: orders with two deliveries", twice, 0, twice == 0)


def cancelled_statements():
    """How many there were until now, according to the server's log. (One that another row has started again has a
    second log; and robots cancel the statements that they are interrupted in.)"""
    logs = [path.read_text(errors="replace") for path in pathlib.Path(FOLDER).glob("*.log")]
    return "".join(logs).count("canceling statement due to user request")


def deferred():
    """What the users' own tables refuse only at the commit is the users' fault, whatever code it has."""
    for code in "FL001", "22012":
        fresh()
        psql(f"""
          create or replace function refuse() returns trigger language plpgsql as $$
            begin raise exception using errcode = '{code}', message = 'no more shelves'; end $$;
          create constraint trigger refusing after insert on delivered deferrable initially deferred
            for each row execute function refuse();
          select fleet.submit('orders', 'order 1', '[1, 0]', some_pauses => '{{}}');
        """)
        with Robot("robot", f"deferred-{code}", 3) as robot:
            status = robot.process.wait(30)
            said = " ".join(word for line in robot.lines() for word in line)
        claim(8, f"deferred: {code} at the commit: the robot's process ends with", f"{status}: {said[-200:]}",
              "1, and an SqlError with that code", status == 1 and f'SqlError {{sqlState = "{code}"' in said)
        found = psql("select state || ' ' || (reasons -> 0 ->> 'reason') from fleet.task")
        claim(8, f"deferred: {code} at the commit: the task, and why", found[:150], "dead ... no more shelves",
              found.startswith("dead ") and "no more shelves" in found)
    psql("drop table delivered; drop function refuse()")


GOOD = ["a'b\"c\\d", "'); drop table fleet.task; --", "\\'); select 1; --", "🤖🚪 ünï", "%s ? $1 {} \t\n\r\x01\x7f",
        "x" * 200, "𝄞" * 200, "null", "{\"a\": [1]}", " "]
BAD = ["", "x" * 201, "a\0b", "m" * 1_000_000]


def texts():
    fresh()
    for key, value in [("bad", '{"x": "7"}'), ("worse", '"\\ud83e\\udd16"'), ("big", "1e400"), ("good", "5")]:
        psql(f"select fleet.submit('numbers', '{key}', '{value}', some_pauses => '{{0s,0s}}')")
    with Robot("hostile", "hostile") as robot:
        robot.process.stdin.write(json.dumps(GOOD + BAD).encode() + b"\n")
        robot.process.stdin.flush()
        until(lambda: robot.says("decoding:") or robot.process.poll() is not None, 120, "the end of the hostile texts")
        lines = robot.lines()
    said = {" ".join(line[1:3]) if line[1] == "text" else line[1]: " ".join(line[3 if line[1] == "text" else 2:])
            for line in lines}
    for n, text in enumerate(GOOD):
        quoted = "'" + json.dumps(text).replace("'", "''") + "'::jsonb"
        found = number(f"""
          select count(*) from fleet.task where state = 'done' and {quoted} = all
            (array[to_jsonb(queue), to_jsonb(key), to_jsonb(robot), input, result])
            and needs = array[substr({quoted} #>> '{{}}', 1, 50)]
        """)
        held = number(f"select count(*) from fleet.resource where {quoted} in (to_jsonb(resource))")
        claim(8, f"hostile: {text[:30]!r} everywhere: tasks and resources that have it, as it is",
              [found, held, said[f"text {n}:"]], [1, 1, "ok"], [found, held, said[f"text {n}:"]] == [1, 1, "ok"])
    # (A notice that is missed would cost the time until the next poll.)
    ends = [float(line[0]) for line in lines if line[1] in ("text", "needs:", "megabyte:")]
    longest = max(after - before for before, after in zip(ends, ends[1:]))
    claim(8, "hostile: longest of these", f"{longest:.1f} s", "at most 3 s", longest <= 3)
    refused("an empty text", said[f"text {len(GOOD)}:"], "has 1 to 200 characters")
    refused("a text of 201 characters", said[f"text {len(GOOD) + 1}:"], "has 1 to 200 characters")
    refused("a text with U+0000", said[f"text {len(GOOD) + 2}:"], "has no character U+0000")
    refused("a megabyte as a name", said[f"text {len(GOOD) + 3}:"], "has 1 to 200 characters")
    refused("needs that are too large together", said["needs:"], "needs")
    refused("no resource to hold", said["nothing"], "there is no resource to hold")
    size = number("select length(result #>> '{}') from fleet.task where queue = 'megabyte'")
    claim(8, "hostile: a megabyte as input and result", size, 1_000_000, size == 1_000_000)
    states = psql("select string_agg(state || ' ' || coalesce(result #>> '{}', reasons #>> '{0,reason}'), ', ' "
                  "order by task) from fleet.task where queue = 'batch'").split(", ")
    good = [how for how in states if how == "done fine"]
    claim(8, "hostile: of eight results together one has U+0000", f"{len(good)} are done, and {states[4]}",
          "7, and an error", len(good) == 7 and states[4].startswith("dead a text has no character U+0000"))
    why = psql("select state || ' ' || (reasons #>> '{0,reason}') from fleet.task where queue = 'progress'")
    refused("progress with U+0000", why, "dead a text has no character U+0000")
    numbers = psql("select string_agg(state::text, ', ' order by key) from fleet.task where queue = 'numbers'")
    claim(8, "hostile: inputs that cannot be decoded, and the others", numbers, "dead and done",
          numbers == "dead, dead, done, done, dead")  # bad, big, good, last, worse
    whys = psql("select distinct r ->> 'reason' from fleet.task, jsonb_array_elements(reasons) r "
                "where queue = 'numbers'")
    claim(8, "hostile: their reasons", len(whys.splitlines()), "3, each is said",
          len(whys.splitlines()) == 3 and all("is not what this robot expects" in why for why in whys.splitlines()))
    faults = [line for line in lines if line[1] == "decoding-fault"]
    claim(8, "hostile: faults of the robots that had started them", len(faults), 0, not faults)


def refused(what, said, why):
    claim(8, f"hostile: {what}", said[:150], f"...{why}...", why in said)


def half_migrated():
    """A database without a schema, with the half of one, and with all but its last statements."""
    with open("src/fleet-schema/schema-1.sql", encoding="utf-8") as file:
        whole = file.read()
    with open("src/fleet-schema/rights.sql", encoding="utf-8") as file:
        rights = file.read()
    half = whole[:whole.index("-- --- Resources")]
    almost = whole[:whole.index("insert into fleet.about")] + rights
    for name, part in [("none", "select"), ("half", half), ("almost", almost)]:
        psql(f"drop database if exists {name}", user="postgres", database="postgres")
        psql(f"create database {name}", user="postgres", database="postgres")
        psql(f"grant all on database {name} to owner", user="postgres", database=name)
        psql(part, database=name)
        with Robot("once", f"once-{name}", database=address(name)) as robot:
            said = " ".join(until(lambda: robot.says("once:"), 30, "its answer")[0][2:])
        refused(f"a schema that is there in part ({name})", said, "behavior-fleet")
