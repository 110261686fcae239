"use strict";
// The page of a hub: what it last said of all robots (docs/live-protocol.md). It keeps nothing else.

let latest = null;

function show() {
  const robots = latest ? latest.robots : [];
  const name = latest ? inert(latest.hub, 80) : "robots";
  setText($("hub"), name);
  if (document.title !== name) document.title = name;
  document.body.classList.toggle("disconnected", Boolean(since || refusal));
  setText($("state"), refusal ? `refused: ${inert(refusal)}` : since ? `disconnected ${sinceText(since)}`
    : latest ? "live" : "connecting");
  const told = [];
  const live = robots.filter((robot) => robot.state === "live").length;
  if (latest) told.push(`${live} of ${robots.length} robots are live`);
  if (latest?.others > 0) told.push(`${latest.others} others are not followed`);
  setText($("told"), told.join("; "));
  fill($("robots"), robots.map((robot) => [robot.name, robot]), card, write);
}

const sinceText = (time) => `since ${time.toTimeString().slice(0, 8)}`;

function card() {
  return element("li", [
    element("h2", [element("a")]),
    element("p", [], { class: "standing" }),
    element("ul"),
    element("p", [], { class: "why" }),
  ]);
}

function write(row, robot) {
  const [title, standing, runs, why] = row.children;
  setText(title.firstChild, inert(robot.name, 80) || "(no name)");
  // (Such names are no part of an address.)
  if (!["", ".", ".."].includes(robot.name)) {
    title.firstChild.href = `/robots/${encodeURIComponent(robot.name)}/${location.hash}`;
  }
  row.classList.toggle("gone", !["live", "over"].includes(robot.state));
  setText(standing, standingText(robot));
  const items = robot.running.map((doing, i) => [String(i), doing]);
  if (robot.more > 0) items.push(["more", { path: [`and ${robot.more} more`] }]);
  const make = () => element("li", [element("span"), element("span", [], { class: "age" })]);
  fill(runs, items, make, (item, doing) => {
    setText(item.firstChild, doing.path.map((name) => inert(name, 60)).join(" / "));
    setText(item.lastChild, doing.began === undefined ? "" : ` for ${during(Math.max(0, robot.now - doing.began))}`);
  });
  setText(why, robot.interruption ? interruptionText(robot.interruption) : "");
}

function standingText(robot) {
  const why = robot.why === undefined ? "" : ` (${inert(robot.why)})`;
  switch (robot.state) {
    case "over":
      return "the run is over";
    case "refused":
      return `refused${why}`;
    case "disconnected":
      return (robot.since === undefined ? "not reached" : `disconnected ${sinceText(new Date(robot.since))}`) + why;
    default:
      return robot.state;
  }
}

function interruptionText({ time, operator, changes, stopped, after, starts }) {
  const causes = changes.map(changeText).join(" → ") || inert(operator, 60);
  const then = starts === undefined ? "" : `, starts ${inert(starts, 60)}`;
  return `${time.toFixed(1)} s: ${causes}: stopped ${inert(stopped, 60)} after ${during(after)}${then}`;
}

connect({
  receive: (message) => {
    if (message.message === "robots") {
      latest = message;
      refusal = null;
    } else if (message.message === "refused") refusal = message.why;
  },
  show,
  attach: () => ({}),
  isOver: () => false,
});
