"""Compares a trace file with what OpenTelemetry's own parser has read of the OTLP that was made of it.

otlp.py FILE PRINTED: the file of the trace, as docs/trace-format.md describes it; and what otlp/main.go has printed.
A line for each claim; the exit code is 1 if any has failed. (Python's json reads the file: no reader of ours does.)
"""

import calendar
import functools
import json
import re
import sys
import time
import unicodedata

import claims

claim = functools.partial(claims.claim, 11)


def all_equal(what, pairs):
    """Pairs of what is wanted and what was found."""
    pairs = list(pairs)
    wrong = [pair for pair in pairs if pair[0] != pair[1]]
    claim(what, f"{len(pairs) - len(wrong)} of {len(pairs)} equal", "all", not wrong)
    for wanted, found in wrong[:3]:
        print(f"    wanted {wanted}\n    found  {found}")


def shown(text, most):
    """A text of the user as docs/seeing-a-robot.md says: on one line, harmless, and not too long."""
    def harmless(c):
        if c in "\n\r\t" or unicodedata.category(c) in ("Zl", "Zp"):
            return " "
        code = ord(c)
        none = 0xFDD0 <= code <= 0xFDEF or code % 0x10000 >= 0xFFFE
        return "\ufffd" if none or unicodedata.category(c) in ("Cc", "Cf", "Cs") else c
    text = "".join(map(harmless, text))
    return text if len(text) <= most else text[:most - 1] + "…"


def name_of(text):
    return shown(text, 200) or "(no name)"


def seconds(t):
    return float(t)  # "inf", "-inf" and "nan" too


def nanoseconds(t):
    t = seconds(t)
    return 0 if t != t else round(max(-4e9, min(4e9, t)) * 1e9)


def unix(header):
    whole, fraction = re.fullmatch(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)(?:\.(\d+))?Z", header["zero"]).groups()
    return calendar.timegm(time.strptime(whole, "%Y-%m-%dT%H:%M:%S")) * 10**9 + int((fraction or "").ljust(9, "0")[:9])


def values(changes):
    found, seen = {}, {}
    for change in changes:
        name = name_of(change["signal"])
        seen[name] = seen.get(name, 0) + 1
        key = f"behavior.signal.{name}" + (f" {seen[name]}" if seen[name] > 1 else "")
        found.update({f"{key}.{which}": shown(change[which], 200) for which in ("before", "after") if which in change})
    return found


def signals(attributes):
    return {key: value for key, value in attributes.items() if key.startswith("behavior.signal.")}


with open(sys.argv[1], encoding="utf-8") as file:
    content = file.read().split("\n")
zero = unix(json.loads(content[0]))
events = [json.loads(line) for line in content[1:-1]]
with open(sys.argv[2], encoding="utf-8") as file:
    resource, *printed = map(json.loads, file)

spans, reactions = {}, {}
for event in events:
    if event["event"] == "began":
        spans.setdefault(event["number"], event)
    elif event["event"] == "ended":
        spans[event["number"]] = event
    elif event["event"] == "reacted":
        reactions[event["number"]] = event
times = [seconds(event[key]) for event in events for key in ("began", "ended", "time") if key in event]
last = max((t for t in times if t == t), default=0)

own = [s for s in printed if s["attributes"].get("behavior.kind") != "reaction"]
alone = [s for s in printed if s["attributes"].get("behavior.kind") == "reaction"]
found = {s["attributes"]["behavior.number"]: s for s in own}
identifier = {n: s["spanId"] for n, s in found.items()}
both = [(span, found[n]) for n, span in sorted(spans.items()) if n in found]


def end_of(span):
    return span.get("end", {})


def until(span):
    return max(nanoseconds(span["began"]), nanoseconds(span.get("ended", last)))


def parent_of(event):
    return event["parent"] if event["parent"] in spans else None


claim("spans of the file that were read", f"{len(both)} of {len(spans)}", f"all, and no other of {len(own)}",
      len(both) == len(spans) == len(own) > 0)
all_equal("names", ((name_of(span["name"]), s["name"]) for span, s in both))
all_equal("parents", ((identifier.get(parent_of(span), ""), s["parentSpanId"]) for span, s in both))
all_equal("beginnings, in ns", ((zero + nanoseconds(span["began"]), s["start"]) for span, s in both))
all_equal("durations, in ns", ((until(span) - nanoseconds(span["began"]), s["end"] - s["start"]) for span, s in both))
traces = {s["traceId"] for s in printed}
claim("traces", len(traces), "1, of 32 digits, not all zero",
      len(traces) == 1 and all(re.fullmatch("(?!0*$)[0-9a-f]{32}", t) for t in traces))
identifiers = [s["spanId"] for s in printed]
claim("identifiers of spans", f"{len(set(identifiers))} of {len(identifiers)} differ",
      "all, of 16 digits, not all zero",
      len(set(identifiers)) == len(identifiers) and all(re.fullmatch("(?!0*$)[0-9a-f]{16}", i) for i in identifiers))
all_equal("kinds and outcomes", (
    ((span["kind"], end_of(span).get("how", "not ended"), "Internal"),
     (s["attributes"]["behavior.kind"], s["attributes"]["behavior.outcome"], s["kind"])) for span, s in both))
all_equal("failures and faults, with their texts", (
    ((2, shown(end_of(span)["text"], 1000)) if "text" in end_of(span) else (0, ""), (s["status"], s["message"]))
    for span, s in both))


def cause_of(span):
    cause = end_of(span).get("cause", {})
    known = {"why": cause.get("why"), "reaction": cause.get("reaction"), "limit": cause.get("limit")}
    known["sibling"] = name_of(cause["branch"]) if "branch" in cause else None
    known["exception"] = shown(cause["exception"], 1000) if "exception" in cause else None
    return {key: value for key, value in known.items() if value is not None}, values(cause.get("changes", []))


def cause_read(s):
    known = {key.rpartition(".")[2]: value for key, value in s["attributes"].items()
             if key.startswith("behavior.stopped.") and key != "behavior.stopped.text"}
    return known, signals(s["attributes"])


all_equal("causes of stops, with the values of signals", ((cause_of(span), cause_read(s)) for span, s in both))
all_equal("what a reaction started", (
    (span.get("reaction"), s["attributes"].get("behavior.started_by")) for span, s in both))

read = [(s["spanId"], e["time"], e["attributes"]) for s in own for e in s["events"]]
read += [("", s["start"], s["attributes"]) for s in alone]
read = {attributes["behavior.reaction"]: (span, t, attributes) for span, t, attributes in read}


def reaction_of(x):
    stopped = x.get("stopped")
    return (identifier.get(parent_of(x), ""), zero + nanoseconds(x["time"]), name_of(x["operator"]),
            values(x["changes"]), name_of(x["starts"]) if "starts" in x else None,
            (name_of(stopped["name"]), stopped["after"], stopped["took"]) if stopped else None)


def reaction_read(span, t, attributes):
    stopped = [attributes.get("behavior.stopped." + key) for key in ("branch", "after", "took")]
    return (span, t, attributes["behavior.operator"], signals(attributes), attributes.get("behavior.starts"),
            tuple(stopped) if stopped[0] is not None else None)


claim("reactions that were read", f"{len(read)} of {len(reactions)}", "all, of 1 or more, and no other",
      read.keys() == reactions.keys() != set())
all_equal("reactions, with the values of signals", (
    (reaction_of(x), reaction_read(*read[n])) for n, x in sorted(reactions.items()) if n in read))
stopped_by = {}
for span in spans.values():
    if span["kind"] == "named" and end_of(span).get("cause", {}).get("why") == "signal":
        stopped_by.setdefault(span["end"]["cause"]["reaction"], set()).add(identifier.get(span["number"]))
links = [(l["attributes"]["behavior.reaction"], l["spanId"], l["traceId"]) for s in own for l in s["links"]]
good = [l for l in links if l[1] in stopped_by.get(l[0], ()) and l[2] in traces]
claim("links that lead to what the reaction stopped", f"{len(good)} of {len(links)}", "all", len(good) == len(links))
all_equal("links of what was started where something was stopped", (
    (bool(stopped_by.get(span["reaction"])), bool(s["links"])) for span, s in both
    if span["kind"] == "named" and "reaction" in span))
lost = sum(event["count"] for event in events if event["event"] == "lost")
said, service = resource["resource"].get("behavior.lost"), resource["resource"].get("service.name")
claim("events that were lost", said, lost, said == lost)
claim("the service, and the scope", f"{service}, {resource['scope']}", "a name, behavior-lang",
      bool(service) and resource["scope"] == "behavior-lang")
claims.end()
