"""A line for each claim of a test that judges by the record of another process, and whether any has failed."""

import sys

failed = 0


def claim(row, what, figure, limit, holds):
    global failed
    failed += not holds
    print(f"row {row}: {what}: {figure} ({limit}): {'ok' if holds else 'FAILED'}", flush=True)


def at_most(row, what, seconds, limit):
    claim(row, what, f"{seconds * 1000:.1f} ms", f"at most {limit * 1000:.0f} ms", seconds <= limit)


def all_of(row, what, good, every, least=1):
    good, every = list(good), list(every)
    claim(row, what, f"{len(good)} of {len(every)}", f"all, of {least} or more", len(good) == len(every) >= least)


def percentile(numbers, share):
    numbers = sorted(numbers)
    return numbers[min(len(numbers) - 1, int(share * len(numbers)))]


def end():
    sys.exit(1 if failed else 0)
