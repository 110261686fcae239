"use strict";
// The live page: reads the robot's messages (docs/live-protocol.md), and shows what they say. Texts are set when a
// message comes, for a hidden tab draws no frames; only the bars wait for a frame. (What it has in common with the page
// of a hub is in page.js.)

const mostSpans = 20000; // that have ended
const mostReactions = 2000;
const mostRows = 300; // in a list
const mostLanes = 60; // of the timeline
const mostSeconds = 60; // of the timeline

// --- What is known ----------------------------------------------------------

let run = null; // from "hello"
let spans = new Map(); // by number, in the order in which they came
let reactions = []; // the oldest first
let stoppedBy = new Map(); // the outermost named span that a reaction stopped, by the reaction's number
let startedBy = new Map(); // the first one that it started
let next = null; // the number of the event that comes next, when one is known
let lost = 0; // by the robot
let missed = 0; // events of which only the summary came
let robotTime = 0; // of the last message that has one
let isOver = false;

const outcomeOf = (span) => (span.end ? span.end.how : "running");
const marks = { running: "▶", succeeded: "✓", failed: "✗", faulted: "‼", stopped: "■" };

function forget() {
  spans = new Map();
  stoppedBy = new Map();
  startedBy = new Map();
  reactions = [];
  next = null;
  lost = missed = robotTime = 0;
  isOver = false;
}

function learn(event) {
  if (event.event === "began" || event.event === "ended") {
    const { event: _, ...span } = event;
    spans.delete(span.number); // what has ended last comes last
    spans.set(span.number, span);
    if (span.kind === "named") {
      const cause = span.end?.cause;
      if (cause?.why === "signal" && !(stoppedBy.get(cause.reaction)?.number < span.number)) {
        stoppedBy.set(cause.reaction, span);
      }
      if (span.reaction !== undefined && !startedBy.has(span.reaction)) startedBy.set(span.reaction, span);
    }
    at(span.ended ?? span.began);
  } else if (event.event === "reacted") {
    reactions.push(event);
    at(event.time);
  }
}

function at(time) {
  if (typeof time === "number") robotTime = Math.max(robotTime, time);
}

function forgetOldest() {
  if (reactions.length > mostReactions) reactions.splice(0, reactions.length - mostReactions);
  for (const known of [stoppedBy, startedBy]) {
    for (const number of known.keys()) {
      if (known.size <= mostReactions) break;
      known.delete(number);
    }
  }
  if (spans.size <= mostSpans) return;
  let surplus = spans.size - mostSpans;
  for (const span of spans.values()) {
    if (surplus <= 0) break;
    if (span.end) {
      spans.delete(span.number);
      surplus--;
    }
  }
}

// --- Messages ---------------------------------------------------------------

function receive(message) {
  switch (message.message) {
    case "hello":
      refusal = null;
      if (run && run.run !== message.run) forget();
      isOver = false;
      run = message;
      break;
    case "snapshot":
      if (next !== null) missed += Math.max(0, message.next - next);
      next = message.next;
      spans = new Map([...spans].filter(([, span]) => span.end));
      for (const event of [...message.ended, ...message.running]) learn(event);
      reactions = reactions.filter((r) => message.reacted.every((s) => s.number !== r.number));
      for (const event of message.reacted) learn(event);
      break;
    case "events":
      message.events.forEach(learn);
      next = message.next;
      break;
    case "over":
      isOver = true;
      break;
    case "refused":
      refusal = message.why;
      break;
  }
  if (message.lost !== undefined) lost = message.lost;
  at(message.now);
  forgetOldest();
}

// --- What is shown ----------------------------------------------------------

let pausedAt = null; // the time that is shown; null: the present
let selected = null; // the number of a span or of a reaction
const shownTime = () => pausedAt ?? robotTime;
const runsAt = (span, time) => span.began <= time && (!span.end || span.ended > time);
let word = ""; // that is searched
let outcome = ""; // that is shown; "": all
const wanted = (span) =>
  (!word || span.name.toLowerCase().includes(word)) && (!outcome || outcomeOf(span) === outcome);

function pathOf(span) {
  const names = [];
  for (let s = span; s && names.length < 50; s = spans.get(s.parent)) names.unshift(inert(s.name, 60));
  return names;
}

// Each row about a span or a reaction has a button, which shows its details.
function detailedRow() {
  const button = element("button", [], { type: "button" });
  const row = element("li", [button, element("span", [], { class: "age" })]);
  button.addEventListener("click", () => {
    selected = Number(row.dataset.number);
    show();
  });
  return row;
}

function writeSpan(row, span, more) {
  const how = outcomeOf(span);
  row.dataset.number = span.number;
  row.firstChild.className = `span ${how}` + (word && wanted(span) ? " found" : "");
  setText(row.firstChild, `${marks[how]} ${inert(span.name)}`);
  setText(row.lastChild, ` ${more}`);
}

function show() {
  const time = shownTime();
  showState(time);
  showTree(time);
  showInterruptions(time);
  showFailures(time);
  showSignals(time);
  showBars(time);
  showDetails();
  askForFrame();
}

function showState(time) {
  const name = run ? inert(run.robot, 80) : "robot";
  setText($("robot"), name);
  if (document.title !== name) document.title = name;
  document.body.classList.toggle("disconnected", Boolean(since || refusal));
  setText(
    $("state"),
    refusal ? `refused: ${inert(refusal)}`
      : since ? `disconnected since ${since.toTimeString().slice(0, 8)}`
        : isOver ? "the run is over"
          : !run ? "connecting"
            : pausedAt !== null ? "paused" : "live");
  setText($("shown"), `at ${time.toFixed(1)} s`);
  const told = [];
  if (lost > 0) told.push(`the trace has lost ${lost} events`);
  if (missed > 0) told.push(`gap: of ${missed} events only a summary came`);
  const open = isOver ? [...spans.values()].filter((span) => !span.end).length : 0;
  if (open > 0) told.push(`no end has come of ${open} of what ran`);
  setText($("told"), told.join("; "));
  $("pause").setAttribute("aria-pressed", String(pausedAt !== null));
  setText($("pause"), pausedAt === null ? "Pause" : "Go on");
  if (pausedAt === null) $("time").value = $("time").max;
}

function showTree(time) {
  const rows = [];
  const shown = [...spans.values()].filter((s) => s.kind === "named" && runsAt(s, time));
  shown.sort((a, b) => a.number - b.number);
  const inside = new Map();
  const numbers = new Set(shown.map((s) => s.number));
  const outer = (span) => {
    let parent = span.parent;
    for (let i = 0; i < 50 && spans.has(parent) && !numbers.has(parent); i++) parent = spans.get(parent).parent;
    return numbers.has(parent) ? parent : 0;
  };
  for (const span of shown) {
    const p = outer(span);
    if (!inside.has(p)) inside.set(p, []);
    inside.get(p).push(span);
  }
  const walk = (p, depth) => {
    for (const span of inside.get(p) ?? []) {
      if (rows.length < mostRows) rows.push([String(span.number), { span, depth }]);
      walk(span.number, depth + 1);
    }
  };
  walk(0, 0);
  fill($("tree"), rows, detailedRow, (row, { span, depth }) => {
    writeSpan(row, { ...span, end: undefined }, `since ${span.began.toFixed(1)} s, for ${during(time - span.began)}`);
    row.style.paddingLeft = `${Math.min(depth, 12)}rem`;
  });
}

// What a reaction says: when, why, and what it did.
function partsOf(reaction) {
  const causes = reaction.changes.map(changeText).join(" → ") || inert(reaction.operator, 60);
  const [was, is] = [stoppedBy.get(reaction.number), startedBy.get(reaction.number)];
  const effects = [];
  if (reaction.stopped) {
    const [name, after] = was ? [was.name, reaction.time - was.began] : [reaction.stopped.name, reaction.stopped.after];
    effects.push(`stopped ${inert(name, 60)} after ${during(after)}`);
  }
  if (is || reaction.starts) effects.push(`starts ${inert(is ? is.name : reaction.starts, 60)}`);
  return [`${reaction.time.toFixed(1)} s: `, causes, `: ${effects.join(", ") || "nothing starts"}`];
}

const sentence = (reaction) => partsOf(reaction).join("");

function showInterruptions(time) {
  const some = reactions.filter((r) => r.stopped && r.time <= time).slice(-20).reverse();
  const make = () => {
    const row = detailedRow();
    row.firstChild.append(element("span"), element("strong"), element("span"));
    return row;
  };
  fill($("interruptions"), some.map((r) => [String(r.number), r]), make, (row, r) => {
    row.dataset.number = r.number;
    partsOf(r).forEach((text, i) => setText(row.firstChild.children[i], text));
  });
}

function endText(end) {
  if (!end) return "it runs";
  if (end.how !== "stopped") {
    return end.how + (end.text === undefined ? "" : `: ${inert(end.text.replace("the behaviour failed: ", ""))}`);
  }
  const cause = end.cause;
  const why = {
    signal: () => cause.changes.map(changeText).join(" → ") || "its signal changed",
    "sibling finished": () => `${inert(cause.branch)} finished`,
    "sibling failed": () => `${inert(cause.branch)} failed`,
    "time limit": () => `its time was up (${during(cause.limit)})`,
    "from outside": () => `from outside: ${inert(cause.exception)}`,
    abandoned: () => "it was abandoned",
  }[cause.why];
  return `stopped: ${why ? why() : inert(String(cause.why))}`;
}

function showFailures(time) {
  const isFailure = (span) => span.end && span.ended <= time && ["failed", "faulted"].includes(span.end.how);
  const some = [...spans.values()].filter(isFailure).slice(-10).reverse();
  fill($("failures"), some.map((s) => [String(s.number), s]), detailedRow, (row, s) =>
    writeSpan(row, s, `at ${s.ended.toFixed(1)} s ${endText(s.end)}`));
}

function showSignals(time) {
  const values = new Map();
  for (const r of reactions) {
    if (r.time > time) break;
    for (const c of r.changes) values.set(c.signal, { value: c.after, time: r.time });
  }
  const rows = [...values].slice(-mostRows).map(([name, v]) => [name, { name, ...v }]);
  const cells = () => [element("th", [], { scope: "row" }), element("td"), element("td", [], { class: "age" })];
  fill($("signals"), rows, () => element("tr", cells()), (row, v) => {
    setText(row.children[0], inert(v.name, 60));
    setText(row.children[1], inert(v.value, 60));
    setText(row.children[2], `${during(time - v.time)} ago`);
  });
}

// --- The timeline -----------------------------------------------------------

const laneHeight = 18;
let seconds = 1; // that the timeline shows

function barsAt(time) {
  let first = time;
  for (const span of spans.values()) first = Math.min(first, span.began);
  seconds = Math.min(mostSeconds, Math.max(1, time - first));
  const isShown = (span) => span.kind === "named" && span.began <= time && (span.ended ?? time) >= time - seconds;
  return [...spans.values()].filter((span) => isShown(span) && wanted(span));
}

function showBars(time) {
  if (!$("bars").parentElement.open) return;
  const some = barsAt(time).slice(-mostRows).reverse();
  fill($("bars"), some.map((s) => [String(s.number), s]), detailedRow, (row, s) =>
    writeSpan(row, s, `${outcomeOf(s)}, ${s.began.toFixed(1)} s to ${s.end ? s.ended.toFixed(1) + " s" : "now"}`));
}

// The bars by path: a lane inside of another comes after it, and otherwise what began first comes first.
function lanesOf(bars) {
  const top = { inside: new Map() };
  const lanes = new Map(); // by parent and name: there are fewer of these than of spans
  for (const span of bars) {
    const key = `${span.parent} ${span.name}`;
    if (!lanes.has(key)) {
      let lane = top;
      pathOf(span).forEach((name, depth) => {
        if (!lane.inside.has(name)) {
          const label = "\u2002".repeat(depth) + name;
          lane.inside.set(name, { label, bars: [], began: Infinity, inside: new Map() });
        }
        lane = lane.inside.get(name);
      });
      lanes.set(key, lane);
    }
    const lane = lanes.get(key);
    lane.bars.push(span);
    lane.began = Math.min(lane.began, span.began);
  }
  const rows = [];
  const walk = (lane) => {
    if (rows.length < mostLanes && lane.bars?.length > 0) rows.push(lane);
    [...lane.inside.values()].sort((a, b) => a.began - b.began).forEach(walk);
  };
  walk(top);
  return rows;
}

let frame = null;
let drawn = []; // rectangles and their spans, for clicks

function askForFrame() {
  frame ??= requestAnimationFrame(draw);
}

function draw() {
  frame = null;
  const time = shownTime();
  const canvas = $("timeline");
  const bars = barsAt(time);
  const rows = lanesOf(bars);
  const g = canvas.getContext("2d");
  const font = "12px system-ui, sans-serif";
  g.font = font;
  const labels = rows.map((lane) => lane.label);
  const wide = canvas.clientWidth;
  const left = Math.min(0.4 * wide, 12 + Math.max(0, ...labels.map((label) => g.measureText(label).width)));
  const high = laneHeight * (rows.length + 1) + 4;
  const scale = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(wide * scale) || canvas.height !== Math.round(high * scale)) {
    canvas.width = Math.round(wide * scale);
    canvas.height = Math.round(high * scale);
    canvas.style.height = `${high}px`;
  }
  const style = getComputedStyle(document.documentElement);
  const names = [...Object.keys(marks), "ground", "text", "line"];
  const colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`)]));
  const x = (t) => Math.max(left, wide - ((time - t) / seconds) * (wide - left));
  g.setTransform(scale, 0, 0, scale, 0, 0);
  g.clearRect(0, 0, wide, high);
  g.font = font;
  drawAxis(g, x, time, wide, high, colours);
  drawn = [];
  rows.forEach((lane, i) => {
    const top = 2 + laneHeight * i;
    g.fillStyle = colours.text;
    g.fillText(labels[i], 2, top + 12, left - 6);
    const painted = new Map(); // the outcome of what is narrower than a pixel, by its place
    for (const span of lane.bars) {
      const [from, to] = [x(span.began), x(Math.min(span.ended ?? time, time))];
      const how = span.end && span.ended <= time ? outcomeOf(span) : "running";
      if (to - from < 1) {
        if (painted.get(Math.floor(from)) === how) continue;
        painted.set(Math.floor(from), how);
      }
      g.fillStyle = colours[how];
      g.fillRect(from, top, Math.max(1, to - from), laneHeight - 3);
      if (to - from > 14) {
        g.fillStyle = colours.ground;
        g.fillText(marks[how], from + 2, top + 12);
      }
      drawn.push([from, top, to, span.number]);
    }
  });
}

// Lines at round times, at most eight of them.
function drawAxis(g, x, time, wide, high, colours) {
  const step = [0.2, 0.5, 1, 2, 5, 10, 20].find((s) => seconds / s <= 8);
  for (let t = step * Math.ceil((time - seconds) / step); t <= time; t += step) {
    if (t < 0) continue;
    g.fillStyle = colours.line;
    g.fillRect(Math.round(x(t)), 0, 1, high);
    g.fillStyle = colours.text;
    const label = `${step < 1 ? t.toFixed(1) : t} s`;
    g.fillText(label, Math.min(x(t) + 3, wide - g.measureText(label).width), high - 5);
  }
}

$("timeline").addEventListener("click", (event) => {
  const { left, top } = event.target.getBoundingClientRect();
  const [x, y] = [event.clientX - left, event.clientY - top];
  const isHit = ([from, t, to]) => x >= from - 2 && x <= to + 2 && y >= t && y < t + laneHeight;
  const hit = drawn.filter(isHit).pop();
  if (hit) {
    selected = hit[3];
    show();
  }
});

// --- Details, and what the reader asks for -----------------------------------

function spanDetails(span) {
  const rows = [
    ["what", pathOf(span).join(" / ")],
    ["from", `${span.began.toFixed(3)} s`],
    ["to", span.end ? `${span.ended.toFixed(3)} s, after ${during(span.ended - span.began)}` : "it runs"],
    ["how", `${marks[outcomeOf(span)]} ${endText(span.end)}`],
  ];
  const reaction = reactions.find((r) => r.number === span.reaction);
  if (reaction) rows.push(["started by", sentence(reaction)]);
  return rows;
}

function reactionDetails(reaction) {
  const rows = [
    ["what", sentence(reaction)],
    ["where", [...pathOf(spans.get(reaction.parent)), inert(reaction.operator, 60)].join(" / ")],
    ["changed", reaction.changes.map(changeText).join(" → ")],
  ];
  if (reaction.stopped) {
    const { name, took, end } = reaction.stopped;
    rows.push(["stopped", `${inert(name)}, which took ${(1000 * took).toFixed(1)} ms: ${endText(end)}`]);
  }
  return rows;
}

function showDetails() {
  const span = spans.get(selected);
  const reaction = span ? undefined : reactions.find((r) => r.number === selected);
  const rows = span ? spanDetails(span)
    : reaction ? reactionDetails(reaction)
      : [["", "none is chosen: choose what runs, an interruption, or a bar"]];
  const details = $("details");
  while (details.children.length > 2 * rows.length) details.lastChild.remove();
  rows.forEach(([name, text], i) => {
    if (details.children.length < 2 * i + 2) details.append(element("dt"), element("dd"));
    setText(details.children[2 * i], name);
    setText(details.children[2 * i + 1], text);
  });
}

$("pause").addEventListener("click", () => {
  pausedAt = pausedAt === null ? robotTime : null;
  show();
});

$("time").addEventListener("input", () => {
  let first = robotTime;
  for (const span of spans.values()) first = Math.min(first, span.began);
  pausedAt = first + (robotTime - first) * (Number($("time").value) / Number($("time").max));
  show();
});

$("search").addEventListener("input", (event) => {
  word = event.target.value.trim().toLowerCase();
  show();
});

$("outcome").addEventListener("change", (event) => {
  outcome = event.target.value;
  show();
});

$("bars").parentElement.addEventListener("toggle", show);
document.querySelector("form").addEventListener("submit", (event) => event.preventDefault());
window.addEventListener("resize", askForFrame);

// What the page holds, as a file that behavior-trace reads.
$("save").addEventListener("click", () => {
  if (!run) return;
  const timed = [];
  for (const span of spans.values()) {
    const { ended, end, ...began } = span;
    timed.push([span.began, 0, { event: "began", ...began }]);
    if (end) timed.push([ended, 1, { event: "ended", ...span }]);
  }
  for (const r of reactions) timed.push([r.time, 2, r]);
  timed.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const events = timed.map(([, , event]) => event);
  if (lost + missed > 0) events.push({ event: "lost", count: lost + missed });
  const lines = [{ format: "behavior-trace", version: 1, zero: run.zero }, ...events].map(line);
  const link = element("a", [], { download: "run.jsonl" });
  link.href = URL.createObjectURL(new Blob(lines, { type: "application/jsonl" }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
});

function line(event) {
  const unit = (c) => "\\u" + c.charCodeAt(0).toString(16).padStart(4, "0");
  const escaped = (c) => c.split("").map(unit).join("");
  return JSON.stringify(event).replace(/[<>&]/g, escaped).replace(inertly, escaped) + "\n";
}

for (const [how, mark] of Object.entries(marks)) {
  $("key").append(element("span", [`${mark} ${how}`], { class: how }), " ");
}

connect({
  receive: (message) => receive(message),
  show: () => show(),
  attach: () => (next === null ? {} : { run: run.run, next }),
  isOver: () => isOver,
});
