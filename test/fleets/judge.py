"""Says how each row of the fleets' table went, by what the users' own writes have put into their table, by the door's
record and by the database's figures.

judge.py ROW...: FLEET is the folder of the server and its socket, BUILT that of the robots' program (test/Fleets.hs).
A line for each claim; the exit code is 1 if any has failed. SEED chooses what is random.
"""

import concurrent.futures
import sys
import time

import agreeing
import away
import cost
import dying
import harmed
import keeping
from claims import claim, end
from fleet import SEED, kill_all, running

ROWS = {name: row for module in (dying, away, cost, agreeing, harmed, keeping) for name, row in vars(module).items()
        if name.startswith("row_")}

# These run beside another row, which mostly waits: they have a server of their own, or databases.
BESIDE = {7: 3, 10: 3, 6: 8}


def judged(row):
    begun = time.monotonic()
    try:
        ROWS[f"row_{row}"]()
    except Exception as problem:
        claim(row, "the row ended", f"{type(problem).__name__}: {problem}".splitlines()[0], "well", False)
    if row not in BESIDE:
        kill_all(running)  # those that a row that did not end has left
    print(f"row {row}: it took {time.monotonic() - begun:.0f} s", flush=True)


print(f"SEED={SEED}", flush=True)
chosen = list(map(int, sys.argv[1:]))
for row in chosen:
    if BESIDE.get(row) not in chosen:
        with concurrent.futures.ThreadPoolExecutor() as together:
            list(together.map(judged, [row, *(other for other in chosen if BESIDE.get(other) == row)]))
end()
