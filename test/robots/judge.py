"""Says how each row went: compares what the program believes with what the action servers have recorded.

judge.py FOLDER ROW...: the folder has the files "record" (of the servers), "lies" (of bridges that are none, in
bridge.py) and "believed-ROW" (of each program, by its first row). A line for each claim; the exit code is 1 if any has
failed.
"""

import collections
import glob
import json
import math
import os
import statistics
import sys

from claims import all_of, at_most, claim, end, percentile
from watching import whole_lines

FOLDER, ROWS = sys.argv[1], [int(row) for row in sys.argv[2:]]

# What the servers have recorded of each goal, and each topic: (time, event), in the order of time.
record = collections.defaultdict(list)
for line in sorted(whole_lines(FOLDER + "/record"), key=lambda line: float(line.split()[0])):
    when, name, order, event = line.split()
    record[int(order) or name].append((float(when), event))

# What the program believes, by row.
believed = collections.defaultdict(list)
for name in glob.glob(FOLDER + "/believed-*"):
    for line in whole_lines(name):
        entry = json.loads(line)
        believed[entry["row"]].append(entry)

# What each bridge that is none has recorded, by what it was started for.
lies_of = collections.defaultdict(list)
if os.path.exists(FOLDER + "/lies"):
    for line in whole_lines(FOLDER + "/lies"):
        entry = json.loads(line)
        lies_of[entry["mode"]].append(entry)

ENDS = ("canceled", "succeeded", "aborted", "rejected")


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


def lies(goal):
    """Whether what the program believes about a goal is not what its server has recorded."""
    ended, outcome = first(goal, *ENDS), goal["outcome"]
    if outcome == "stopped":
        # One whose stop was requested before it was sent was never accepted.
        return has(goal, "accepted") and (ended is None or ended > goal["ended"])
    if outcome == "completed":
        return not has(goal, "succeeded") or ended > goal["ended"] or not is_its_own(goal["result"], goal["order"])
    if outcome == "NotConfirmed":
        return ended is not None and ended < goal["ended"] - 0.02
    event = {"Aborted": "aborted", "Rejected": "rejected", "CancelledByOther": "canceled"}.get(outcome)
    if event:
        return not has(goal, event)
    return outcome == "other" or (outcome == "StillMoving" and has(goal, "accepted"))


def is_its_own(result, order):
    """Each server gives its goals' orders back."""
    return result in ({"sequence": [order]}, {"error_code": 0, "error_msg": str(order)})


def in_general(row):
    lost = [e["lost by the bridge"] for e in believed[row] if "lost by the bridge" in e]
    if lost:
        counts = ", ".join(f"{n} goals by {m}" for n, m in sorted(collections.Counter(lost).items()))
        print(f"row {row}: new bridges lost, before a goal reached its server: {counts}")
    ends = [e for e in believed[row] if "row ended" in e]
    if ends:
        print(f"row {row}: it took {ends[-1]['seconds']:.0f} s; a sleeping thread was late by {ends[-1]['late']:.3f} s")
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


def ways():
    """What the tree does if nothing interrupts it: (action with its door, how it ends)."""
    well = lambda *names: [(name, "succeeded") for name in names]
    front, back = well("open1", "pass_through1", "close1"), well("pass_through2", "do_task")
    yield front + well("do_task")
    for n in range(3):
        failed = front[:n] + [(front[n][0], "aborted")]
        yield failed + well("open2") + back
        yield failed + [("open2", "aborted"), ("smash2", "succeeded")] + back


def is_right(parts):
    """Whether these are ways that were broken off, and then one to its end."""
    begins = [way[:n] for way in ways() for n in range(len(way) + 1)]
    return parts[-1] in ways() and all(
        part in begins or (part[:-1] in begins and part[-1][1] == "canceled") for part in parts[:-1])


def row_1():
    events = [line.split() for line in whole_lines(FOLDER + "/missions")]
    starts = [i for i, (_, what, _, _) in enumerate(events) if what == "mission"] + [len(events)]
    believes = [e["how"] for e in believed[1] if "mission" in e]
    right = interrupted = running = rejected = both = unheeded = total = 0
    for begin, end in zip(starts, starts[1:]):
        # (The robot prepares some missions that do not take place, before the program knows that it is reached.)
        if not any(event == "accepted" for _, _, _, event in events[begin:end]):
            continue
        total += 1
        ended, runs, lows, charges, parts = [], None, [], [], [[]]
        for when, what, number, event in events[begin:end]:
            if event == "accepted":
                both += runs is not None
                runs = number
            elif event in ENDS and event != "rejected":
                both += runs != number
                runs = None
                ended.append(float(when))
                parts[-1].append((what, event))
                if what == "recharge" and event == "succeeded":
                    charges.append(float(when))
                    parts.append([])
            rejected += event == "rejected"
            if what == "battery":
                lows.append(float(when))
        running += runs is not None
        # What comes after the last goal of the tree belongs to the recharging.
        cut = [part[:next((i for i, (what, _) in enumerate(part) if what == "recharge"), len(part))] for part in parts]
        over = ended[-1] if ended else 0
        heeded = [low for low in lows if low > over - 0.3 or any(charge > low - 0.1 for charge in charges)]
        unheeded += len(lows) - len(heeded)
        interrupted += len(charges) > 0
        if is_right(cut) and believes[total - 1:total] == ["the task is done"]:
            right += 1
        else:
            print("    " + "\n    ".join(" ".join(event) for event in events[begin:end]))
    wanted = 100 if os.environ.get("LONG") else 20
    claim(1, "missions that ended right", right, f"all {wanted}", right == total == len(believes) == wanted)
    claim(1, "missions that were interrupted", interrupted, "at least half", interrupted >= total / 2)
    for what, count in (("goals left running", running), ("goals while another ran", both + rejected),
                        ("low batteries that were not heeded", unheeded)):
        claim(1, what, count, "0", count == 0)


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


def struck(row, kind, least, limit):
    """What came of goals whose bridge was struck."""
    entries = [e for e in believed[row] if "struck" in e and e["kind"] == kind]
    lost = [e for e in entries if e["thrown"].startswith("the link to") and e["struck"]]
    all_of(row, f"{kind}: LinkLost", lost, entries, least)
    took = max((e["ended"] - e["struck"] for e in lost), default=99)
    at_most(row, f"{kind}: from that until it was thrown", took, limit)
    all_of(row, f"{kind}: cleanups that ran once", [e for e in entries if e["cleanups"] == 1], entries)
    # Those that the servers went on with have to be counted as moving.
    runs_on = [e for e in entries if (first({"order": e["of"]}, *ENDS) or 1e9) > e["ended"] and record[e["of"]]]
    all_of(row, f"{kind}: goals that ran on, and were counted", (e for e in runs_on if e["moving"] > 0), runs_on, 0)


def row_5():
    struck(5, "in mid-goal", 30, 0.2)
    struck(5, "during a cancel", 10, 0.2)


def row_6():
    struck(6, "in mid-goal", 5, 0.5 + 0.5 + 0.1)


def row_7():
    for kind in ("killed", "ended"):
        struck(7, kind, 3, 0.2)
    back = [e["subscribed again after"] for e in believed[7] if "subscribed again after" in e]
    at_most(7, "from the start of the bridge to the next message", max(back, default=99), 2)
    others = goals(7, kind="other client")
    all_of(7, "goals of another client that went on", (g for g in others if g["outcome"] == "completed"), others, 6)
    again = goals(7, kind="again")
    for old in goals(7, kind="killed") + goals(7, kind="ended"):
        old["over"] = first(old, *ENDS)
        later = [g for g in again if g["begun"] > old["ended"]]
        old["tries"] = [g for g in later if g["begun"] < old["over"]]
        old["next"] = next((first(g, "accepted") for g in later if has(g, "accepted")), None)
    olds = goals(7, kind="killed") + goals(7, kind="ended")
    tries = [g for old in olds for g in old["tries"]]
    refused = [g for g in tries if g["outcome"] == "StillMoving" and not record[g["order"]]]
    all_of(7, "refused while the old goal ran", refused, tries, 3)
    then = [old["next"] - old["over"] for old in olds if old["next"]]
    all_of(7, "a new goal was accepted, after the end of the old one", (t for t in then if t > 0), olds, 6)
    print(f"row 7: how long after that: at most {max(then, default=99):.2f} s")


def row_8():
    silence, more = 0.5, 0.1
    faults = [e for e in believed[8] if "fault" in e]
    silent = [e for e in faults if e["fault"].startswith("no message on")]
    all_of(8, "no message: a fault", silent, faults, 15)
    none_of(8, "goals of a branch that should not have been chosen", (
        g for g in goals(8) if g["branch"] == "right" or not any(published_before(e, g["begun"]) for e in faults)))
    never = [e for e in silent if e["what"] == "without messages"]
    took = max(e["ended"] - e["begun"] for e in never)
    at_most(8, "without messages: from watching to the fault", took, silence + more)
    last = [e["ended"] - max(when for when, _ in record[e["topic"]] if when < e["ended"])
            for e in silent if e["what"] == "falling silent"]
    at_most(8, "falling silent: from the last message to the fault", max(last), silence + more)
    claim(8, "not before the expected silence", f"{min(last) * 1000:.1f} ms", "at least 500 ms", min(last) >= silence)
    readers = [e for e in believed[8] if "reader" in e]
    all_of(8, "latched: readers that had the value", (e for e in readers if e["read"] == 7), readers, 10)
    second = [e["ended"] - e["begun"] for e in readers if e["reader"] == "second"]
    arrived = [e["arrived"] - when for e in believed[8] if "arrived" in e
               for when, event in record["/bursts"] if event == str(e["number"])]
    print(f"row 8: from publishing until the program had a message: at most {max(arrived) * 1000:.1f} ms")
    print(f"row 8: latched: the second reader had it after at most {max(second) * 1000:.1f} ms")


def published_before(entry, when):
    return entry["what"] == "falling silent" and entry["begun"] <= when <= entry["ended"]


def row_9():
    lies = lies_of["flood"]
    end = next((e for e in lies if e["event"] == "end"), None)
    if not end:
        return claim(9, "the flood", "none", "some", False)
    rate = end["sent"] / end["took"]
    claim(9, "messages a second, sent by another process", f"{rate:.0f}", "at least 9900", rate >= 9900)
    for name in ("fast", "slow"):
        one = next((e for e in believed[9] if e.get("reader") == name), None)
        if not one:
            claim(9, f"{name} reader", "none", "one", False)
            continue
        total = one["handled"] + one["waiting"] + one["dropped"]
        counts = ", ".join(f"{one[what]} {what}" for what in ("handled", "waiting", "dropped"))
        claim(9, f"{name} reader: {counts}: together", total, f"{end['sent']}", total == end["sent"])
        claim(9, f"{name} reader: messages that were not later than the one before", one["disorder"], "0",
              one["disorder"] == 0)
        if name == "slow":
            claim(9, "slow reader: dropped", one["dropped"], "some", one["dropped"] > 0)
    begun = next(e["at"] for e in lies if e["event"] == "begin")
    memory = [e["most"] / 1e6 for e in lies if e["event"] == "memory" and begun + 1 < e["at"] <= end["at"]]
    third = len(memory) // 3
    early, late = statistics.median(memory[:third]), statistics.median(memory[-third:])
    claim(9, "memory in the first and the last third", f"{early:.1f} and {late:.1f} MB", "within 10 %",
          late <= 1.1 * early)
    took = [e["took"] for e in lies if e["event"] == "reaction"]
    print(f"row 9: reactions to another topic: median {statistics.median(took) * 1000:.1f} ms, "
          f"longest {max(took) * 1000:.1f} ms")
    claim(9, "reactions", len(took), "at least 49 a second", len(took) >= 49 * end["took"])
    at_most(9, "reactions: 99th percentile", percentile(took, 0.99), 0.05)
    claim(9, "connections", connections(lies), "1", connections(lies) == 1)
    for load in (e for e in believed[9] if "rate" in e):
        sent = [event for _, event in record[f"/load/{load['rate']}"]]
        print(f"row 9: the real bridge: of {load['wanted']} messages, sent at {sent[-1] if sent else '?'} a second, "
              f"{load['arrived']} arrived; the link: {load['end']}")


def connections(lies):
    return sum(e["event"] == "connected" for e in lies)


def row_10():
    lies = lies_of["hostile"]
    beside = [e for e in lies if e["event"] == "memory"]
    frames = [e for e in lies if e["event"] == "frame"]
    alone = [e for e in frames if e["alone"]]
    sent = sum(e["kind"] != "allowed" for e in frames)
    claim(10, "frames, sent by another process", sent, "10000", sent == 10000)
    wrong = [e for e in alone if e["answer"] is None or not is_answer(e["answer"], e["wanted"])]
    claim(10, "answered otherwise than by one short line, or the right judgement", len(wrong), "0", not wrong)
    for kind, n in collections.Counter(e["kind"] for e in wrong).items():
        example = next(e for e in wrong if e["kind"] == kind)
        print(f"    {n} {kind}: for example {str(example['answer'])[:200]!r}, instead of {example['wanted']}")
    took, calm = collections.defaultdict(list), [e for e in alone if is_calm(beside, e)]
    for e in calm:
        took[e["kind"]].append(e["heard"] - e["sent"])
    allowed = took.pop("allowed", [])
    slowest = max(took, key=lambda kind: max(took[kind]))
    every = [seconds for some in took.values() for seconds in some]
    print(f"row 10: answered after {statistics.median(every) * 1000:.2f} ms (median); slowest: {slowest}")
    longest = max(e["heard"] - e["sent"] for e in alone if e["heard"] and e["kind"] != "allowed")
    print(f"row 10: {len(calm)} of {len(alone)} came while no thread beside it was late by 10 ms; of all the longest "
          f"took {longest * 1000:.1f} ms")
    at_most(10, "from when all of it was sent until the answer was there", max(every), 0.05)
    claim(10, "frames in calm times", len(every), "at least a third", len(every) >= 3000)
    refused = [e for e in frames if e["wanted"] == "line" and e["kind"] not in ("complaints", "allowed")]
    counted = next((e["refused"] for e in believed[10] if "refused" in e), None)
    claim(10, "refused, and counted", counted, len(refused), counted == len(refused))
    begin, end = (next((e["at"] for e in lies if e["event"] == event), 0) for event in ("begin", "end"))
    memory = [(e["ended"], e["most"] / 1e6) for e in beside]
    before = statistics.median(most for at, most in memory if at < begin)
    more = max(most for at, most in memory if at < end + 0.1) - before
    if allowed:
        print(f"row 10: frames of 1 MiB, which is allowed, full of the smallest values: {max(allowed) * 1000:.0f} ms")
    claim(10, f"memory: {before:.1f} MB, and then at most more", f"{more:.1f} MB", "under 50 MB", more < 50)
    completed = [g for g in goals(10) if g["outcome"] == "completed"]
    all_of(10, "goals that ran meanwhile: completed with their own result", completed, goals(10), 2)
    claim(10, "connections", connections(lies), "1", connections(lies) == 1)


def is_calm(beside, entry):
    """Whether it was answered while the machine had time: no sleeping thread of another process was late by 10 ms."""
    return entry["heard"] and all(
        e["late"] < 0.01 for e in beside if e["begun"] < entry["heard"] and entry["sent"] < e["ended"])


def is_answer(answer, wanted):
    if wanted == "line":
        return answer not in ("True", "False") and len(answer.splitlines()) == 1 and 10 <= len(answer) <= 300
    return answer == wanted


def row_12():
    theirs, ours = goals(12, client="theirs"), goals(12, client="ours")
    completed = [g for g in theirs if g["outcome"] == "completed" and not has(g, "cancel")]
    all_of(12, "the other client's: completed with their own result, never cancelled", completed, theirs, 500)
    good = [g for g in ours if g["outcome"] in ("completed", "stopped") and not lies(g)]
    all_of(12, "ours: completed with their own result, or stopped", good, ours, 500)
    print(f"row 12: of ours {sum(has(g, 'canceled') for g in ours)} were cancelled")


def row_13():
    struck(13, "dying", 5, 0.2)
    other = goals(13, kind="other robot")
    all_of(13, "the other robot's goals completed", (g for g in other if g["outcome"] == "completed"), other, 20)
    took = [g["ended"] - g["begun"] for g in other]
    print(f"row 13: the other robot's goals took {statistics.median(took):.3f} s, at most {max(took):.3f} s")


def row_15():
    # A list for each of the five turns: a machine is faster in one than in the next, so the ratio is taken in each.
    took = collections.defaultdict(list)
    for entry in believed[15]:
        for what, seconds in entry.get("took", {}).items():
            took[entry["client"], what].append(seconds)
    for what, other, most in ("message", "roslibpy", 1), ("goal", "roslibpy", 1), ("cancel", "roslibpy", 1), (
            "reaction", "bare", 1.5):
        ours, theirs = took["ours", what], took[other, what]
        wanted = {"cancel": 5 * [40], "reaction": 25 * [100]}.get(what, 5 * [200])
        if not list(map(len, ours)) == list(map(len, theirs)) == wanted:
            claim(15, f"{what}: measured, ours and {other}", f"{list(map(len, ours))} and {list(map(len, theirs))}",
                  wanted, False)
            continue
        mine, its = list(map(statistics.median, ours)), list(map(statistics.median, theirs))
        ratio = statistics.median(a / b for a, b in zip(mine, its))
        claim(15, f"{what}: ours {statistics.median(mine) * 1e6:.0f} us, {other} {statistics.median(its) * 1e6:.0f} us"
              " (medians): ratio", f"{ratio:.2f}", f"at most {most}", ratio <= most)
    watched = took["ours", "reaction to a topic that must not be silent"]
    if watched:
        typical = statistics.median(sum(watched, []))
        print(f"row 15: a reaction to a topic that must not be silent: {typical * 1e6:.0f} us")


def row_16():
    cases = [e for e in believed[16] if "case" in e]
    all_of(16, "cases that end as with fake robots", (e for e in cases if e["gave"] == e["expected"]), cases, 12)
    for case in cases:
        if case["gave"] != case["expected"]:
            print(f"    {case}")


def row_17():
    kinds = {"succeeds": "completed", "is aborted": "Aborted", "is rejected": "Rejected", "is stopped": "stopped",
             "is replaced": "Aborted", "replaces": "completed"}
    for kind, outcome in kinds.items():
        every = goals(17, kind=kind)
        all_of(17, f"a goal that {kind}: {outcome}", (g for g in every if g["outcome"] == outcome), every, 20)
    told = [(g, g.get("why", "")) for g in goals(17, kind="is aborted")]
    all_of(17, "an aborted goal's error text and code", (
        g for g, why in told if f"no way to {g['order']}" in why and '"error_code":2' in why), told, 20)
    every = [(e["of"], e["sent"]) for e in believed[17] if "sent" in e and event_of(e["of"], "goal:")]
    all_of(17, "goals that came as they were sent", (
        sent for order, sent in every if is_same(sent, json.loads(event_of(order, "goal:")[0]))), every, 120)
    every = [(e["of"], e["feedback"]) for e in believed[17] if "feedback" in e]
    all_of(17, "feedback that was read as it was published", (
        one for order, one in every if is_published(one, order)), every, 120)


def event_of(order, beginning):
    return [event[len(beginning):] for _, event in record[order] if event.startswith(beginning)]


def is_same(sent, came):
    """Whether a goal came as it was sent. (The bridge's reading of a number may be another one in its last bit.)"""
    frame, numbers, tree = came
    pose = sent["pose"]["pose"]
    wanted = [pose[part][axis] for part, axes in (("position", "xyz"), ("orientation", "xyzw")) for axis in axes]
    return ([frame, tree] == [sent["pose"]["header"]["frame_id"], sent["behavior_tree"]]
            and all(math.isclose(a, b, rel_tol=1e-15) for a, b in zip(wanted, numbers, strict=True)))


def is_published(feedback, order):
    """Whether it is what navigator.py makes of one of the ticks that it has recorded of this goal."""
    tick = feedback["navigation_time"]["sec"]
    return (str(tick) in event_of(order, "feedback:")
            and feedback["navigation_time"]["nanosec"] == 250_000_000
            and feedback["estimated_time_remaining"] == {"sec": -tick, "nanosec": 0}
            and feedback["number_of_recoveries"] == tick - 2
            and feedback["distance_remaining"] == (None if tick == 1 else tick / 4)
            and feedback["current_pose"]["pose"]["position"]["x"] == order)


for row in ROWS:
    globals()[f"row_{row}"]()
    in_general(row)
end()
