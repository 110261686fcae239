"""Says how each row went: compares what the program believes with what the action servers have recorded.

judge.py FOLDER ROW...: the folder has the files "record" (of the servers) and "believed" (of the program). A line for
each claim; the exit code is 1 if any has failed.
"""

import collections
import json
import statistics
import sys

FOLDER, ROWS = sys.argv[1], [int(row) for row in sys.argv[2:]]

# What the servers have recorded of each goal: (time, event), in the order of time.
record = collections.defaultdict(list)
for line in sorted(open(FOLDER + "/record"), key=lambda line: float(line.split()[0])):
    when, server, order, event = line.split()
    record[int(order)].append((float(when), event))

# What the program believes, by row.
believed = collections.defaultdict(list)
for line in open(FOLDER + "/believed"):
    entry = json.loads(line)
    believed[entry["row"]].append(entry)

ENDS = ("canceled", "succeeded", "aborted", "rejected")
failed = 0


def claim(row, what, figure, limit, holds):
    global failed
    failed += not holds
    print(f"row {row}: {what}: {figure} ({limit}): {'ok' if holds else 'FAILED'}")


def at_most(row, what, seconds, limit):
    claim(row, what, f"{seconds * 1000:.1f} ms", f"at most {limit * 1000:.0f} ms", seconds <= limit)


def all_of(row, what, good, every, least=1):
    good, every = list(good), list(every)
    claim(row, what, f"{len(good)} of {len(every)}", f"all, of {least} or more", len(good) == len(every) >= least)


def none_of(row, what, bad):
    bad = list(bad)
    claim(row, what, len(bad), "0", not bad)
    for one in bad[:5]:
        print(f"    {one}\n    {record[one['order']] if 'order' in one else ''}")


def goals(row, **same):
    return [e for e in believed[row] if "order" in e and all(e.get(name) == value for name, value in same.items())]


def first(goal, *events):
    """When the first of these happened to the goal, according to its server."""
    return next((when for when, event in record[goal["order"]] if event in events), None)


def has(goal, *events):
    return first(goal, *events) is not None


def percentile(numbers, share):
    numbers = sorted(numbers)
    return numbers[min(len(numbers) - 1, int(share * len(numbers)))]


def lies(goal):
    """Whether what the program believes about a goal is not what its server has recorded."""
    ended, outcome = first(goal, *ENDS), goal["outcome"]
    if outcome == "stopped":
        # One whose stop was requested before it was sent was never accepted.
        return has(goal, "accepted") and (ended is None or ended > goal["ended"])
    if outcome == "completed":
        return not has(goal, "succeeded") or ended > goal["ended"] or goal["result"]["sequence"] != [goal["order"]]
    if outcome == "NotConfirmed":
        return ended is not None and ended < goal["ended"] - 0.02
    event = {"Aborted": "aborted", "Rejected": "rejected", "CancelledByOther": "canceled"}.get(outcome)
    if event:
        return not has(goal, event)
    return outcome == "other" or (outcome == "StillMoving" and has(goal, "accepted"))


def in_general(row):
    for entry in believed[row]:
        if entry.get("lost by the bridge"):
            lost = f"goals that the bridge lost when it had just started: {entry['lost by the bridge']}"
            print(f"row {row}: {entry['server']}: {lost}")
    ends = [e for e in believed[row] if "row ended" in e]
    how = ends[-1]["row ended"] if ends else "it has not"
    claim(row, "the row ended", how, "well", how == "well")
    none_of(row, "goals that ended otherwise than the program believes", filter(lies, goals(row)))
    none_of(row, "goals that were accepted twice", (g for g in goals(row) if
            sum(event == "accepted" for _, event in record[g["order"]]) > 1))


def latencies(row, most, beyond, among):
    """From the request to stop until the program went on; and how much of that was not the server's own time."""
    for server in ("/fast", "/slow"):
        some = [g for g in among if g["server"] == server and g["outcome"] == "stopped" and has(g, "canceled")]
        if not some:
            claim(row, f"{server}: goals that were stopped", 0, "some", False)
            continue
        took = [g["ended"] - g["stop"] for g in some]
        rest = [t - (first(g, "canceled") - first(g, "cancel")) for g, t in zip(some, took)]
        print(f"row {row}: {server}: median {statistics.median(took) * 1000:.1f} ms, longest {max(took) * 1000:.1f} ms")
        if most:
            at_most(row, f"{server}: 99th percentile", percentile(took, 0.99), most)
        at_most(row, f"{server}: median beyond the server's own time", statistics.median(rest), beyond)


def row_2():
    good = [g for g in goals(2) if g["outcome"] in ("stopped", "NotConfirmed") and not lies(g)]
    all_of(2, "stopped, or NotConfirmed where the server did not answer", good, goals(2), 400)
    print(f"row 2: NotConfirmed: {len(goals(2, outcome='NotConfirmed'))}")
    latencies(2, 0.5, 0.05, goals(2))


def row_3():
    # (What takes from the call to the request contains what takes from sending to it.)
    soon = [g for g in goals(3) if g["stop"] and g["stop"] - g["begun"] <= 0.001 and has(g, "accepted")]
    stopped = [g for g in soon if g["outcome"] == "stopped" and has(g, "canceled")]
    all_of(3, "stopped, of those within 1 ms", stopped, soon, 200)
    latencies(3, None, 0.06, soon)


def row_4():
    patience = 2
    for kind in ("first", "replacing", "afterwards"):
        some = goals(4, kind=kind)
        given_up = [g for g in some if g["outcome"] == "NotConfirmed" and has(g, "cancel")]
        all_of(4, f"{kind}: NotConfirmed", given_up, some)
        at_most(4, f"{kind}: from the request to stop", max(g["ended"] - g["stop"] for g in some), patience + 0.1)
    some = goals(4, kind="refused")
    refused = [g for g in some if g["outcome"] == "StillMoving" and not record[g["order"]]]
    all_of(4, "refused: StillMoving, and never sent", refused, some)
    threads = [e for e in believed[4] if "threads after" in e]
    all_of(4, "no thread left", (e for e in threads if e["threads after"] == e["threads before"]), threads)


for row in ROWS:
    globals()[f"row_{row}"]()
    in_general(row)
sys.exit(1 if failed else 0)
