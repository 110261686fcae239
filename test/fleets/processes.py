"""Processes, as the system sees them."""

import os
import signal

from fleet import FOLDER
from watching import until

TICKS = os.sysconf("SC_CLK_TCK")


def postmaster(data="data"):
    """The server's first process."""
    with open(f"{FOLDER}/{data}/postmaster.pid", encoding="utf-8") as file:
        return int(file.readline())


def family(process):
    """The process, and those that it has started."""
    with open(f"/proc/{process}/task/{process}/children", encoding="utf-8") as children:
        return [process, *map(int, children.read().split())]


def sent(which, process):
    """Sends the signal: gives whether the process was still there."""
    try:
        os.kill(process, which)
    except ProcessLookupError:
        return False
    return True


def end(processes):
    """Kills them: a server has not even the time for its socket."""
    for process in processes:
        sent(signal.SIGKILL, process)
    until(lambda: not any(os.path.exists(f"/proc/{process}") for process in processes), 10, "their end")


def cpu(processes):
    """How many seconds they have worked, and those that they have started and that have ended. (Many that work little
    are counted by nanoseconds, not by ticks; but the time of threads that have ended is only in the ticks.)"""
    def worked(process):
        try:
            with open(f"/proc/{process}/stat", encoding="utf-8") as file:
                ticks = [int(word) / TICKS for word in file.read().rsplit(")", 1)[1].split()[11:15]]
            if len(os.listdir(f"/proc/{process}/task")) > 1:
                return sum(ticks)
            with open(f"/proc/{process}/schedstat", encoding="utf-8") as file:
                return int(file.read().split()[0]) / 1e9 + sum(ticks[2:])
        except (FileNotFoundError, ProcessLookupError):
            return 0  # It has ended, and its time is in that of the one that has started it.
    return sum(map(worked, processes))
