"""Says how each row of the fleets' table went, by what the users' own writes have put into their table, by the door's
record and by the database's figures.

judge.py ROW...: FLEET is the folder of the server and its socket, BUILT that of the robots' program (test/Fleets.hs).
A line for each claim; the exit code is 1 if any has failed. SEED chooses what is random.
"""

import sys

import agreeing
import away
import cost
import dying
import harmed
import keeping
from claims import end, run_rows
from fleet import SEED, kill_all, running

MODULES = (dying, away, cost, agreeing, harmed, keeping)

# These run beside another row, which mostly waits: they have a server of their own, or databases.
BESIDE = {7: 3, 10: 3, 6: 8}

print(f"SEED={SEED}", flush=True)
# (What a row that did not end has left is killed.)
run_rows(MODULES, list(map(int, sys.argv[1:])), BESIDE, after=lambda: kill_all(running))
end()
