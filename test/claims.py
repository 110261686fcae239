"""A line for each claim of a test that judges by the record of another process, and whether any has failed."""

import concurrent.futures
import sys
import time

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


def run_rows(modules, chosen, beside, after=lambda: None):
    """Runs the chosen rows of these modules, their functions row_NUMBER: one after the other, but beside[row], with
    it. After a row and those beside it runs what cleans up."""
    rows = {name: row for module in modules for name, row in vars(module).items() if name.startswith("row_")}

    def judged(row):
        begun = time.monotonic()
        try:
            rows[f"row_{row}"]()
        except Exception as problem:
            claim(row, "the row ended", f"{type(problem).__name__}: {problem}".splitlines()[0], "well", False)
        print(f"row {row}: it took {time.monotonic() - begun:.0f} s", flush=True)

    for row in chosen:
        if beside.get(row) not in chosen:
            with concurrent.futures.ThreadPoolExecutor() as together:
                list(together.map(judged, [row, *(other for other in chosen if beside.get(other) == row)]))
            after()


def end():
    sys.exit(1 if failed else 0)
