"""The server, the robots' processes, and what is asked of the database beside them."""

import os
import random
import shutil
import signal
import subprocess
import sys

from watching import whole_lines

FOLDER, BUILT, BIN = os.environ["FLEET"], os.environ["BUILT"], os.environ["bin"]
SEED = int(os.environ.get("SEED") or random.randrange(10**6))


def address(database="fleet", user="robot", host=FOLDER):
    return f"host={host} dbname={database} user={user}"


# A clock of the database's owner: it runs at a rate, and steps.
CLOCK = """
drop table if exists clock;
create table clock (since timestamptz default clock_timestamp(), rate float default 1, step float default 0);
insert into clock default values;
grant select on clock to public;
create or replace function fleet.clock() returns timestamptz language sql volatile as $$
  select since + (clock_timestamp() - since) * rate + step * interval '1 s' from public.clock
$$
"""
TRUE_CLOCK = """
create or replace function fleet.clock() returns timestamptz language sql volatile as 'select clock_timestamp()'
"""


def psql(text, user="owner", database="fleet", host=FOLDER):
    """What the statements give; each is a transaction of its own."""
    # (Debian's own psql is a program in Perl, which starts this one.)
    done = subprocess.run([f"{BIN}/psql", "-XqAt", "-v", "ON_ERROR_STOP=1", "-h", host, "-U", user, "-d", database],
                          input=text, text=True, capture_output=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stdout.strip()


def number(text, **where):
    return int(psql(text, **where) or 0)


def as_server(program, *arguments, check=True):
    """Runs a program of the server's, by the server's user."""
    subprocess.run(["runuser", "-u", "postgres", "--", f"{BIN}/{program}", *arguments], check=check,
                   stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL)


def server(*arguments, data="data"):
    as_server("pg_ctl", "-D", f"{FOLDER}/{data}", "-w", "-l", f"{FOLDER}/{data}.log", *arguments)


def another_server(name, rules=""):
    """A server of its own, with its socket in that folder, and the user "owner"; its folder."""
    folder = f"{FOLDER}/{name}"
    os.mkdir(folder)
    shutil.chown(folder, "postgres")
    as_server("initdb", "-D", f"{folder}/data", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8")
    with open(f"{folder}/data/postgresql.conf", "a", encoding="utf-8") as settings:
        settings.write(f"unix_socket_directories = '{folder}'\nlisten_addresses = ''\n"
                       "dynamic_shared_memory_type = mmap\n")
    with open(f"{folder}/data/pg_hba.conf", "r+", encoding="utf-8") as file:
        text = file.read()
        file.seek(0)
        file.write(rules + text)
    server("start", data=f"{name}/data")
    psql("create role owner login createrole", user="postgres", database="postgres", host=folder)
    return folder


def fresh(host=FOLDER):
    """There is no task and no resource, and the users' own table is empty."""
    psql("""
      truncate fleet.task, fleet.resource, fleet.place, fleet.process;
      drop table if exists delivered;
      create table delivered (n int, robot text, at timestamptz default clock_timestamp());
      grant insert on delivered to robot
    """, host=host)


running = set()


class Robot:
    """A process with one robot or several: of test/Fleets.hs, or robot.py. What it says is in a file of its own."""

    def __init__(self, mode, name, *arguments, python=False, database=address()):
        self.name, self.said = name, f"{FOLDER}/{name}.said"
        begin = [sys.executable, "test/fleets/robot.py"] if python else [f"{BUILT}/fleets"]
        self.command = [*begin, f"{database} application_name={name}", mode, name, *map(str, arguments)]
        if os.path.exists(self.said):
            os.remove(self.said)  # of another row
        self.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()

    def start(self):
        running.add(self)
        with open(self.said, "a", encoding="utf-8") as said:
            self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=said, stderr=said)

    def kill(self):
        running.discard(self)
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()

    def freeze(self):
        self.process.send_signal(signal.SIGSTOP)

    def thaw(self):
        self.process.send_signal(signal.SIGCONT)

    def lines(self):
        """What it has said, in words: the first is when, by the clock of time.monotonic."""
        return [line.split() for line in whole_lines(self.said)]

    def last(self):
        """The last line that it has said."""
        return next(iter(self.lines()[-1:]), [])

    def says(self, word):
        return [line for line in self.lines() if line[1:2] == [word]]


def kill_all(robots):
    for robot in list(robots):
        robot.process.kill()
    for robot in list(robots):
        robot.kill()
