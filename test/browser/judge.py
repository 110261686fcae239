"""Says how each row of the live page's table went, by what a browser shows, what a robot has recorded of itself, and
what the system knows of connections.

judge.py ROW...: BROWSER is the folder with the robot (test/Browser.hs). A line for each claim; the exit code is 1 if
any has failed. Each row waits for what it looks for, and gives up after a limit; none waits for a time to pass, but
row 5, which is about fifty seconds.
"""

import sys
import time

import harmed
import many
import shown
import used
from claims import claim, end

MODULES = (shown, harmed, used, many)
ROWS = {name: row for module in MODULES for name, row in vars(module).items() if name.startswith("row_")}

for row in map(int, sys.argv[1:]):
    begun = time.monotonic()
    try:
        ROWS[f"row_{row}"]()
    except Exception as problem:
        claim(row, "the row ended", f"{type(problem).__name__}: {problem}".splitlines()[0], "well", False)
    print(f"row {row}: it took {time.monotonic() - begun:.0f} s", flush=True)
end()
