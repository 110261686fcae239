"""Says how each row of the live page's table went, by what a browser shows, what a robot has recorded of itself, and
what the system knows of connections.

judge.py ROW...: BROWSER is the folder with the robot (test/Browser.hs). A line for each claim; the exit code is 1 if
any has failed. Each row waits for what it looks for, and gives up after a limit; none waits for a time to pass, but
row 5, which is about fifty seconds.
"""

import sys

import harmed
import many
import shown
import used
from claims import end, run_rows

MODULES = (shown, harmed, used, many)

# These run beside another row: all three mostly wait.
BESIDE = {4: 14, 13: 14}

run_rows(MODULES, list(map(int, sys.argv[1:])), BESIDE)
end()
