"""A line for each claim of a test that judges by the record of another process, and whether any has failed."""

import statistics
import sys
import time

failed = missed = 0
looks = []  # of each look at the machine: the least time of the same work, and the median


def claim(row, what, figure, limit, holds):
    global failed
    failed += not holds
    print(f"row {row}: {what}: {figure} ({limit}): {'ok' if holds else 'FAILED'}", flush=True)


def timed(row, what, figure, limit, holds):
    """A claim about time or work. One that does not hold fails on a quiet machine only: see end."""
    global missed
    missed += not holds
    print(f"row {row}: {what}: {figure} ({limit}): {'ok' if holds else 'MISSED'}", flush=True)


def at_most(row, what, seconds, limit):
    timed(row, what, f"{seconds * 1000:.1f} ms", f"at most {limit * 1000:.0f} ms", seconds <= limit)


def all_of(row, what, good, every, least=1):
    good, every = list(good), list(every)
    claim(row, what, f"{len(good)} of {len(every)}", f"all, of {least} or more", len(good) == len(every) >= least)


def percentile(numbers, share):
    numbers = sorted(numbers)
    return numbers[min(len(numbers) - 1, int(share * len(numbers)))]


def look():
    """Looks for some seconds at the machine, while nothing of ours runs: how much of the processor's time the same work
    takes."""
    times, ends = [], time.monotonic() + 10
    while time.monotonic() < ends:
        begun, n = time.thread_time(), 0
        for i in range(3000):
            n += i
        times.append(time.thread_time() - begun)
    looks.append((min(times), statistics.median(times)))


def end():
    """Says whether all went well. If claims about time do not hold it looks at the machine first: the same work takes
    about its least time, unless others use the same processors."""
    if not missed:
        sys.exit(failed > 0)
    look()
    leasts, medians = zip(*looks)
    uneven = max(medians) / min(leasts)
    if uneven > 1.3:
        print(f"not judged: {missed} claims about time, for this machine is shared: the same work takes {uneven:.1f} "
              "times its least time", flush=True)
    else:
        print(f"FAILED: {missed} claims about time, on a quiet machine: the same work takes {uneven:.1f} times its "
              "least time", flush=True)
    sys.exit(failed > 0 or uneven <= 1.3)
