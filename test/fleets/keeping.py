"""Row 10 of make fleets: behavior-fleet, and the refusals of a database that is not as it should be; on a server of its
own."""

import concurrent.futures
import json
import os
import random
import re
import signal
import subprocess
import time

import claims
import fleet
from fleet import BUILT, FOLDER, another_server, server
from processes import family, postmaster, sent

folder = f"{FOLDER}/kept"
TOOL, ROBOTS = f"{BUILT}/behavior-fleet", f"{BUILT}/fleets"
SUBMIT = "submit", "office", "1"
PARTS = """
  select md5(string_agg(part, ';' order by part)) from (
    select concat_ws(' ', relname, relkind, relacl, pg_get_userbyid(relowner)) from pg_class
      where relnamespace = 'fleet'::regnamespace
    union all
    select concat_ws(' ', oid::regprocedure, prosecdef, proacl, proconfig, md5(prosrc)) from pg_proc
      where pronamespace = 'fleet'::regnamespace
    union all
    select concat_ws(' ', attrelid::regclass, attname, atttypid::regtype) from pg_attribute
      where attrelid in (select oid from pg_class where relnamespace = 'fleet'::regnamespace) and attnum > 0
    union all select 'version ' || version from fleet.about) as parts (part)"""


def psql(text, user="owner", database="fleet"):
    return fleet.psql(text, user, database, folder)


def refused(text, user, database="fleet"):
    """Whether the user lacks the right for this."""
    try:
        psql(text, user, database)
    except RuntimeError as why:
        return "permission denied" in str(why)
    return False


def address(database="fleet", user="owner"):
    return fleet.address(database, user, folder)


def tool(command, *arguments, database="fleet", user="owner"):
    return subprocess.run([TOOL, command, *arguments, address(database, user)], text=True, capture_output=True,
                          check=False)


def robots(*arguments, database="fleet", user="robot", timeout=None):
    return subprocess.run([ROBOTS, address(database, user), *arguments], text=True, capture_output=True, check=False,
                          timeout=timeout)


def submits(count, **where):
    """A robot's process submits that many orders."""
    return robots(*SUBMIT, str(count), "0", **where)


def empty(name="fleet"):
    psql(f"drop database if exists {name} with (force)", "postgres", "postgres")
    psql(f"create database {name} owner owner", "postgres", "postgres")


def whole(database="fleet"):
    """What the schema consists of, or nothing if there is none."""
    there = psql("select to_regnamespace('fleet') is not null", "owner", database) == "t"
    return psql(PARTS, "owner", database) if there else None


def row_10():
    def claim(what, value, wanted, ok):
        claims.claim(10, what, value, wanted, ok)

    def says(what, done, *sentences, status=2):
        """It ends with that status, and one line, in which these are."""
        said = done.stderr if status else done.stdout
        ok = done.returncode == status and all(s in said for s in sentences) and said.count("\n") == 1
        ok = ok and not (done.stdout if status else done.stderr)
        claim(what, f"{done.returncode}: {said.strip()}", f"{status}: ... {' ... '.join(sentences)}", ok)

    another_server("kept")
    psql("create role plain login; create role stranger login", "postgres", "postgres")
    strangers = begin_strangers()
    creating(claim, says)
    migrating(claim, says)
    dump = restored(claim, says)
    looking(claim, says)
    end_strangers(claim, strangers)
    elsewhere(claim, says, dump)
    server("-m", "immediate", "stop", data="kept/data")


# --- What robots say that cannot use the database ----------------------------------------------------------------


def begin_strangers():
    """Robots that cannot connect: each waits for a minute. (A password that is wrong must not look like a server that
    is away.)"""
    where = another_server("locked", "local all locked scram-sha-256\n")
    fleet.psql("create role locked login password 'right'", "postgres", "postgres", where)
    environment = os.environ | {"PGPASSWORD": "wrong"}
    return {
        sentence: subprocess.Popen([ROBOTS, f"host={where} dbname={database} user={user}", *SUBMIT, "1", "0"],
                                   text=True, env=environment, stderr=subprocess.STDOUT, stdout=subprocess.PIPE)
        for database, user, sentence in [
            ("postgres", "locked", 'password authentication failed for user "locked"'),
            ("nowhere", "owner", 'database "nowhere" does not exist'),
            ("postgres", "missing", 'role "missing" does not exist')]}


def end_strangers(claim, strangers):
    for sentence, process in strangers.items():
        said, _ = process.communicate(timeout=90)
        lines = said.splitlines()
        reports = [line for line in lines if "no connection for" in line and sentence in line]
        ends = [line for line in lines if "NoDatabase" in line and sentence.replace('"', '\\"') in line]
        claim(f"a robot that cannot connect says: {sentence}", f"{len(reports)} reports, {len(ends)} ends",
              "2 (of two connections), 1", len(reports) == 2 and len(ends) == 1)


# --- Creating ----------------------------------------------------------------------------------------------------


def creating(claim, says):
    empty()
    psql("alter database fleet owner to postgres; revoke create on database fleet from public", "postgres", "postgres")
    says("create without the right to create schemas", tool("create", user="plain"), "the role plain",
         "grant create on database fleet to plain")
    psql("grant create on database fleet to plain", "postgres", "postgres")
    says("create without the right to create roles", tool("create", user="plain"), "the role plain",
         "create role fleet_robot nologin; create role fleet_viewer nologin")
    psql("alter database fleet owner to owner", "postgres", "postgres")
    claim("after these there is", whole(), "None", whole() is None)
    missing_roles_at_once(claim)
    empty()
    says("create", tool("create"), "The schema is created", status=0)
    reference = whole()
    roles = psql("select string_agg(concat_ws(' ', rolname, rolcanlogin), ', ' order by rolname) from pg_roles "
                 "where rolname like 'fleet\\_%'")
    claim("roles", roles, "both, without login", roles == "fleet_robot f, fleet_viewer f")
    says("create again", tool("create"), "there is a fleet in this database already", "version 1",
         "nothing is to be done")
    claim("create again changes", whole() == reference, "nothing", whole() == reference)
    psql("create role robot login in role fleet_robot; create role viewer login in role fleet_viewer")
    at_once(claim, reference)
    killed(claim, reference)


def missing_roles_at_once(claim):
    """Two databases of one server, whose roles are missing."""
    right = 0
    for _ in range(10):
        for name in "one", "two":
            empty(name)
        psql("drop role if exists fleet_robot, fleet_viewer", "postgres", "postgres")
        with concurrent.futures.ThreadPoolExecutor() as both:
            ends = list(both.map(lambda name: tool("create", database=name), ["one", "two"]))
        right += [end.returncode for end in ends] == [0, 0] and whole("one") == whole("two")
    for name in "one", "two":
        psql(f"drop database {name} with (force)", "postgres", "postgres")
    claim("creates in two databases at once, without the roles: both succeed", right, "10 of 10", right == 10)


def at_once(claim, reference):
    right = 0
    for _ in range(10):
        empty()
        with concurrent.futures.ThreadPoolExecutor() as many:
            ends = list(many.map(lambda _: tool("create"), range(3)))
        losers = [end for end in ends if end.returncode]
        right += len(losers) == 2 and whole() == reference and all(
            end.returncode == 2 and "there is a fleet in this database already" in end.stderr for end in losers)
    claim("three creates at once: one succeeds, two are refused, the schema is whole", right, "10 of 10", right == 10)


def backends():
    """The server's processes for the owner's connections to the fleet's database."""
    found = []
    for process in family(postmaster("kept/data")):
        try:
            with open(f"/proc/{process}/cmdline", "rb") as file:
                if file.read().startswith(b"postgres: owner fleet "):
                    found.append(process)
        except OSError:
            pass
    return found


def begin_create():
    """A create that has connected."""
    empty()
    process = subprocess.Popen([TOOL, "create", address()], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and not backends():
        pass
    return process


def killed(claim, reference):
    times = []
    for _ in range(3):
        process = begin_create()
        begun = time.monotonic()
        process.wait()
        times.append(time.monotonic() - begun)
    nothing, everything, other, struck = 0, 0, 0, {"tool": 0, "server": 0}
    for n in range(20):
        process = begin_create()
        time.sleep(random.uniform(0, min(times)))
        if n % 2:
            struck["tool"] += process.poll() is None
            process.kill()
        else:
            struck["server"] += sum(sent(signal.SIGKILL, backend) for backend in backends())
        process.wait()
        wait_for_server()
        found = whole()
        nothing += found is None
        everything += found == reference
        other += found not in (None, reference)
    claim("creates of which the tool or the server's process was killed", struck, "some of each", all(struck.values()))
    claim("then there is nothing, all, something else", f"{nothing}, {everything}, {other}", "some, any, 0",
          nothing > 0 and other == 0)
    empty()
    again = tool("create")
    claim("create after that", f"{again.returncode}, {whole() == reference}", "0, True",
          again.returncode == 0 and whole() == reference)


def wait_for_server():
    until = time.monotonic() + 30
    while time.monotonic() < until:
        time.sleep(0.1)
        try:
            if psql("select count(*) from pg_stat_activity where datname = 'fleet'") == "1":
                return
        except RuntimeError:
            pass  # it recovers
    raise RuntimeError("the server does not come back")


# --- Migrating ---------------------------------------------------------------------------------------------------


def migrating(claim, says):
    says("migrate", tool("migrate"), "version 1", "nothing is to be done", status=0)
    says("migrate by a robot's user", tool("migrate", user="robot"), "belongs to the role owner")
    empty("other")
    says("migrate where there is no fleet", tool("migrate", database="other"), "run behavior-fleet create")
    says("status where there is no fleet", tool("status", database="other"), "run behavior-fleet create")
    robot_says(claim, "a robot where there is no fleet", "other",
               "there is no fleet in this database: run behavior-fleet create")
    robot_says(claim, "a stranger", "fleet", "grant fleet_robot", user="stranger")
    stepwise(claim)
    reference = whole()
    damaged = [
        ("a newer version", "update fleet.about set version = 7", "update fleet.about set version = 1",
         "version 7", "newer behavior-lang", "newer behavior-lang"),
        ("version 0", "update fleet.about set version = 0", "update fleet.about set version = 1",
         "does not say its version", "version 0", ""),
        ("no version", "alter table fleet.about rename version to edition",
         "alter table fleet.about rename edition to version", "does not say its version", "behavior-fleet migrate", ""),
        ("two rows", "create table fleet.about2 as table fleet.about; alter table fleet.about rename to about1; "
         "create view fleet.about as table fleet.about2 union all table fleet.about1",
         "drop view fleet.about; alter table fleet.about1 rename to about; drop table fleet.about2",
         "does not say its version", None, ""),
        ("a table that is missing", "alter table fleet.task rename to tusk", "alter table fleet.tusk rename to task",
         "it lacks fleet.task:", "behavior-fleet migrate", ""),
        ("a function that is missing", "alter function fleet.connect rename to connects",
         "alter function fleet.connects rename to connect", "it lacks fleet.connect:", "behavior-fleet migrate", ""),
    ]
    for what, harm, mend, sentence, robots_sentence, create_sentence in damaged:
        psql(harm)
        before = psql(PARTS) if "about" not in harm or "update" in harm else None
        says(f"{what}: migrate", tool("migrate"), sentence)
        says(f"{what}: new-epoch", tool("new-epoch"), sentence)
        says(f"{what}: create", tool("create"), create_sentence or sentence)
        if robots_sentence:
            robot_says(claim, f"{what}: a robot", "fleet", robots_sentence)
        if before:
            claim(f"{what}: changed by these", psql(PARTS) != before, "False", psql(PARTS) == before)
        psql(mend)
        claim(f"{what}: mended", whole() == reference, "True", whole() == reference)
    psql("create schema fleet; create table fleet.cars (name text)", database="other")
    for command in "migrate", "create", "new-epoch":
        says(f"another schema fleet: {command}", tool(command, database="other"),
             "not one that behavior-fleet has created")
    tables = psql("select string_agg(relname, ' ') from pg_class where relnamespace = 'fleet'::regnamespace",
                  database="other")
    claim("another schema fleet has then", tables, "cars", tables == "cars")


def stepwise(claim):
    """Versions that there are not yet: by the library's function, with scripts of the test's."""
    empty("steps")
    tool("create", database="steps")
    two = "alter table fleet.task add column note text;"
    broken = "alter table fleet.task add column more text; select 1 / 0;"

    def migrate(*scripts):
        return robots("migrate", *scripts, database="steps", user="owner")

    def state():
        return psql("select version || ' ' || (select count(*) from pg_attribute where attrelid = "
                    "'fleet.task'::regclass and attname in ('note', 'more')) from fleet.about", database="steps")

    done = migrate(two, broken)
    claim("migrate by two steps of which the second fails", f"{done.returncode}, version and columns {state()}",
          "1, 1 0", done.returncode == 1 and "division by zero" in done.stderr and state() == "1 0")
    done = migrate(two)
    claim("migrate by one step", f"{done.stdout.strip()}, version and columns {state()}", "(1,2), 2 1",
          done.stdout.strip() == "(1,2)" and state() == "2 1")
    done = migrate(two)
    claim("migrate by it again", done.stdout.strip(), "(2,2)", done.stdout.strip() == "(2,2)" and state() == "2 1")


def robot_says(claim, what, database, sentence, user="robot"):
    try:
        done = submits(1, database=database, user=user, timeout=10)
        said, ended = done.stderr.strip(), done.returncode
    except subprocess.TimeoutExpired as late:
        said, ended = str(late.stderr), "still runs"
    claim(what, f"{ended}: {said.splitlines()[-1:]}", f"1: WrongSchema ... {sentence}",
          ended == 1 and sentence in said.splitlines()[-1] and "WrongSchema" in said.splitlines()[-1])


# --- A database that was restored --------------------------------------------------------------------------------


def restored(claim, says):
    submits(20)
    psql("select * from fleet.claim('orders', '{amy,bob}', '{}', '1 hour')", "robot")
    empty("copy")
    dump = subprocess.run(["pg_dump", "-h", folder, "-U", "owner", "fleet"], capture_output=True, text=True, check=True)
    psql(dump.stdout, database="copy")
    claim("the copy has the parts of the original", whole("copy") == whole(), "True", whole("copy") == whole())
    shown = json.loads(tool("status", "--json", database="copy", user="viewer").stdout)["is_restored"]
    claim("status of the copy: is restored", shown, "True", shown is True)
    shown = tool("status", database="copy", user="viewer").stdout
    claim("status of the copy names new-epoch", "new-epoch" in shown, "True", "run behavior-fleet new-epoch" in shown)
    done = submits(25, database="copy")
    claim("a robot in the copy", f"{done.returncode}: {done.stderr.strip()}", "1: ... run behavior-fleet new-epoch",
          done.returncode == 1 and "RestoredFromCopy" in done.stderr and "run behavior-fleet new-epoch" in done.stderr)
    says("cancel in the copy", tool("cancel", "orders", "order 1", database="copy"), "run behavior-fleet new-epoch")
    says("retry in the copy", tool("retry", "orders", "order 1", database="copy"), "run behavior-fleet new-epoch")
    epoch = int(psql("select epoch from fleet.about", database="copy"))
    says("new-epoch by a robot's user", tool("new-epoch", database="copy", user="robot"), "belongs to the role owner")
    is_refused = refused("select fleet.new_epoch()", "robot", "copy")
    claim("fleet.new_epoch() by a robot's user is refused", is_refused, "True", is_refused)
    now = int(psql("select epoch from fleet.about", database="copy"))
    claim("the epoch then", now, epoch, now == epoch)
    done = tool("new-epoch", database="copy")
    says("new-epoch", done, "Start the robots", status=0)
    new = int(psql("select epoch from fleet.about", database="copy"))
    claim("the new epoch", new, f"more than {epoch}, and printed", new > epoch and f"epoch is {new}." in done.stdout)
    states = psql("select string_agg(concat_ws(' ', state, n), ', ') from (select state, count(*) as n from fleet.task "
                  "group by state) t", database="copy")
    claim("tasks in the copy", states, "waiting 20", states == "waiting 20")
    done = submits(25, database="copy")
    count = psql("select count(*) from fleet.task", database="copy")
    claim("a robot in the copy then", f"{done.returncode}, {count} tasks", "0, 25",
          done.returncode == 0 and count == "25")
    lease = int(psql("select lease from fleet.claim('orders', '{amy}', '{}', '1 hour')", "robot", "copy"))
    greatest = int(psql("select max(lease) from fleet.task"))
    claim("a lease in the copy is greater than all of the original", lease > greatest, "True", lease > greatest)
    first = int(psql("select min(task) from fleet.task where key = 'order 25'", database="copy"))
    claim("a task that is submitted then has a greater number than all of the original", first,
          f"{epoch} 000000 or more", first >= epoch * 10**6)
    shown = json.loads(tool("status", "--json", database="copy", user="viewer").stdout)["is_restored"]
    claim("status of the copy then: is restored", shown, "False", shown is False)
    return dump.stdout


def elsewhere(claim, says, dump):
    """On another server (that of the strangers, who have ended: a new database makes a server slow) there are no roles.
    The dump says who has which rights, and that is refused there."""
    where = f"{FOLDER}/locked"
    fleet.psql("create database moved owner owner", "postgres", "postgres", where)
    at = fleet.address("moved", "owner", where)
    done = subprocess.run([f"{fleet.BIN}/psql", "-Xq", at], input=dump, text=True, capture_output=True, check=False)
    claim("restored on a server without the roles: errors", done.stderr.count("does not exist"), "10 or more",
          done.stderr.count("does not exist") >= 10)

    def moved(command):
        return subprocess.run([TOOL, command, at], text=True, capture_output=True, check=False)

    says("create there", moved("create"), "run behavior-fleet migrate")
    says("migrate there", moved("migrate"), "Its roles and rights are there", status=0)
    says("new-epoch there", moved("new-epoch"), "Start the robots", status=0)
    fleet.psql("create role robot login in role fleet_robot; create role viewer login in role fleet_viewer",
               "postgres", "postgres", where)
    is_whole = fleet.psql(PARTS, "owner", "moved", where) == whole()
    claim("its parts and rights are those of the original", is_whole, "True", is_whole)
    done = subprocess.run([ROBOTS, fleet.address("moved", "robot", where), *SUBMIT, "25", "0"], text=True,
                          capture_output=True, check=False)
    claim("a robot there", f"{done.returncode} {done.stderr.strip()[-200:]}", "0", done.returncode == 0)


# --- Status ------------------------------------------------------------------------------------------------------

HOSTILE = "o'rd\"ers\n\x1b[2J\x1b]0;t\x07\u009b31m\u202e;\\,{}\U0001F916"


def fill():
    psql("truncate fleet.task, fleet.resource, fleet.place, fleet.process restart identity")
    name = "E'" + HOSTILE.replace("\\", "\\\\").replace("'", "\\'") + "'"
    psql(f"""
      select fleet.submit('orders', 'order ' || n, '1') from generate_series(1, 500) n;
      select fleet.submit('orders', 'later ' || n, '1', a_due := now() + '1 day') from generate_series(1, 7) n;
      select fleet.submit('queue ' || n, 'key', '1') from generate_series(1, 30) n;
      select fleet.submit({name}, {name}, '1', some_pauses := '{{}}');
      select fleet.fail(task, lease, {name}) from fleet.claim({name}, array[{name}], '{{}}', '1 hour');
      select fleet.complete_some(array_agg(task), array_agg(lease), array_agg('2'::jsonb))
        from fleet.claim('orders', array(select 'amy' from generate_series(1, 40) n), '{{}}', '1 hour');
      select * from fleet.claim('orders', array(select 'robot ' || n || {name} from generate_series(1, 33) n), '{{}}',
        '1 hour');
      select fleet.report(task, lease, to_jsonb({name} || repeat('progress', 130000)))
        from fleet.claim('orders', '{{long}}', '{{}}', '1 hour');
      select fleet.cancel('orders', 'later 1');
      select fleet.hold(gen_random_uuid(), array['door', {name}], {name}, '1 hour');
      select fleet.hold(gen_random_uuid(), array['room ' || n], 'bob', '1 hour') from generate_series(1, 25) n;
      select fleet.hold(gen_random_uuid(), array[{name}, 'door'], 'carl', '1 hour');
      select fleet.poll(gen_random_uuid(), {name}, {name}, array['amy', {name}], '1 hour');
      select fleet.poll(gen_random_uuid(), 'of two', null, array['amy'], '1 hour');
      select fleet.poll(gen_random_uuid(), 'host', null, array(select 'robot ' || n from generate_series(1, 30) n),
        '1 hour');
      select fleet.poll(gen_random_uuid(), 'host', null, array['dora', 'amy', repeat('a', 200)], '0');
    """, "robot")
    psql(f"""
      update fleet.task set state = 'dead', ended = now(), wakes = null,
        reasons = jsonb_build_array(jsonb_build_object('reason', {name} || repeat('reason', 200000)))
      where key in (select 'order ' || n from generate_series(100, 122) n);
      update fleet.place set until = now() + interval '1 hour';
    """)


def looking(claim, says):
    fill()
    done = tool("status", "--json", user="viewer")
    claim("status --json as viewer", done.returncode, "0, and only ASCII without control characters",
          done.returncode == 0 and re.fullmatch(r"[ -~]*\n", done.stdout) is not None)
    shown = json.loads(done.stdout)

    def table(text):
        return json.loads(psql(f"select coalesce(json_agg(t), '[]') from ({text}) t"))

    def same(section, text, fields, key=lambda it: json.dumps(it, sort_keys=True)):
        expected = sorted(table(text), key=key)
        found = sorted(({field: it[field] for field in fields} for it in shown[section]), key=key)
        claim(f"status --json: {section}", f"{len(found)} rows", f"those {len(expected)} of the tables",
              found == expected)

    states = "waiting later running done dead cancelled".split()
    counts = ", ".join(f"count(*) filter (where state = '{state}') as {state}" for state in states)
    same("queues", f"select queue, {counts} from fleet.task group by queue", ["queue", *states])
    same("starts_that_run", "select queue, key, task, lease, robot, starts as start, progress from fleet.task "
         "where state = 'running'", "queue key task lease robot start progress".split())
    same("dead_tasks", "select queue, key, task, starts, reasons from fleet.task where state = 'dead'",
         "queue key task starts reasons".split())
    same("holds", "select resource, robot, fence from fleet.resource where until > now()",
         "resource robot fence".split())
    same("waits", "select place, robot, resources from fleet.place", "place robot resources".split())
    rows = "select robot, host, page, process, {} as state from fleet.process, unnest(robots) robot where {}"
    same("robots", rows.format("'there'", "poll > '0'") + " union all "
         + rows.format("'gone'", "poll = '0' and robot <> 'amy'"), "robot host page process state".split())
    to_start = ("select count(*), md5(string_agg(concat_ws(' ', queue, key, task, state, needs), ';' order by task)) "
                "from ")
    is_same = psql(to_start + "fleet.to_start", "viewer") == psql(
        to_start + "fleet.task where state in ('later', 'waiting')")
    claim("fleet.to_start has the tasks that wait, or will", is_same, "True", is_same)
    dead = next(it for it in shown["dead_tasks"] if it["queue"] == HOSTILE)
    claim("status --json: a hostile name", dead["key"] == HOSTILE, "as it was given", dead["key"] == HOSTILE)
    ages = [row["expires_seconds"] for row in shown["starts_that_run"] + shown["holds"]]
    claim("status --json: leases expire in", f"{min(ages)} to {max(ages)} s", "3500 to 3600",
          3500 <= min(ages) and max(ages) <= 3600)
    in_tables(claim, shown)
    claim("status --json as owner has the same", "compared", "but for ages",
          [len(v) for v in json.loads(tool("status", "--json").stdout).values() if isinstance(v, list)]
          == [len(v) for v in shown.values() if isinstance(v, list)])
    rights(claim)
    by_hand(claim, says)
    psql("truncate fleet.task, fleet.resource, fleet.place, fleet.process")
    done = tool("status", user="viewer")
    claim("status of an empty fleet", done.stdout.count(": none\n"), "6", done.stdout.count(": none\n") == 6)


def in_tables(claim, shown):
    done = tool("status", user="viewer")
    bad = [c for c in done.stdout if not (c == "\n" or c == " " or c.isprintable())]
    claim("status: characters that are not printable", len(bad), "0", done.returncode == 0 and not bad)
    longest = max(map(len, done.stdout.splitlines()))
    claim("status: longest line", longest, "at most 300", longest <= 300)
    for title, rows in shown.items():
        if not isinstance(rows, list):
            continue
        part = done.stdout.split(f"\n{title.replace('_', ' ')}: ")[1].split("\n\n")[0].rstrip("\n").splitlines()
        more = len(rows) - 20
        ok = part[0] == str(len(rows)) and len(part) == 2 + min(20, len(rows)) + (more > 0)
        ok = ok and (more <= 0 or part[-1] == f"  and {more} more")
        claim(f"status: {title}", f"{part[0]}, in {len(part)} lines", f"{len(rows)}, of which 20", ok)
    for line in done.stdout.splitlines():
        if line.endswith("  orders"):
            queue = next(it for it in shown["queues"] if it["queue"] == "orders")
            numbers = [str(queue[state]) for state in "waiting later running done dead cancelled".split()]
            claim("status: the numbers of a queue", " ".join(line.split()[:6]), " ".join(numbers),
                  line.split()[:6] == numbers)
            break
    else:
        claim("status: the numbers of a queue", "missing", "there", False)
    done = tool("dead", user="viewer")
    claim("dead", len(done.stdout.splitlines()), "2 lines and one for each", len(done.stdout.splitlines())
          == 2 + len(shown["dead_tasks"]) and all(c == "\n" or c.isprintable() for c in done.stdout))


def rights(claim):
    """Robots have no right to a table, and those who look only to views and fleet.about."""
    def readable(user):
        return psql("select string_agg(relname, ' ' order by relname) from pg_class where relnamespace = "
                    "'fleet'::regnamespace and relkind in ('r', 'v', 'S') and (has_table_privilege(oid, "
                    "'select, insert, update, delete, truncate, references, trigger'))", user)
    claim("what a robot's user may read or write", readable("robot") or "nothing", "nothing", readable("robot") == "")
    claim("what a viewer may read or write", readable("viewer"), "about and the views",
          readable("viewer") == "about dead holds processes queues starts to_start waits")
    tables = "task", "resource", "place", "process"
    denied = [refused(f"select * from fleet.{name}", "robot") for name in (*tables, "about", "queues")]
    denied += [refused(f"select * from fleet.{name}", "viewer") for name in tables]
    denied += [refused("update fleet.about set version = 2", "viewer"), refused("select fleet.sweep()", "viewer")]
    claim("statements of theirs that are denied", denied.count(True), len(denied), all(denied))


def by_hand(claim, says):
    says("retry", tool("retry", "orders", "order 100", user="robot"), "It is waiting", status=0)
    state = psql("select state || ' ' || starts from fleet.task where key = 'order 100'")
    claim("it is", state, "waiting 0", state == "waiting 0")
    says("retry again", tool("retry", "orders", "order 100", user="robot"), "there is no dead task", '"order 100"')
    says("retry of a hostile name", tool("retry", HOSTILE, HOSTILE, user="robot"), "It is waiting", status=0)
    says("cancel", tool("cancel", "orders", "order 100", user="robot"), "It is cancelled", status=0)
    state = psql("select state from fleet.task where key = 'order 100'")
    claim("it is", state, "cancelled", state == "cancelled")
    running = psql("select key from fleet.task where state = 'running' limit 1")
    says("cancel of one that runs", tool("cancel", "orders", running, user="robot"), "It runs", status=0)
    says("cancel of one that is done", tool("cancel", "orders", "order 1", user="robot"),
         "it has ended already, and is done")
    says("cancel of none", tool("cancel", HOSTILE + "x", HOSTILE, user="robot"), "there is no task")
    says("cancel by a viewer", tool("cancel", "orders", "order 2", user="viewer"), "grant fleet_robot to USER")
    says("status by a robot's user", tool("status", user="robot"), "grant fleet_viewer to USER")
    for arguments in ([f"{address()} password=sec ret"], ["postgresql://owner:secret@/fleet"],
                      ["host=/x", "password=secret"], [f"host={folder} PassWord = 'secret' x"],
                      ["--secret", "password=secret"]):
        done = subprocess.run([TOOL, "status", *arguments], text=True, capture_output=True, check=False)
        said = done.stdout + done.stderr
        claim(f"status with a password, {arguments[0][:12]}...", f"{done.returncode}: {said.strip()[:60]}...",
              "2, and not the password", done.returncode == 2 and "PGPASSFILE" in said and "sec" not in said)
    for arguments in ([], ["fly"], ["retry", "orders"], ["status", "--csv"]):
        done = subprocess.run([TOOL, *arguments], text=True, capture_output=True, check=False)
        claim(f"behavior-fleet {' '.join(arguments)}", f"{done.returncode}: {done.stderr.splitlines()[0]}", "2",
              done.returncode == 2 and not done.stdout)
