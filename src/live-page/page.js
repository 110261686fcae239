"use strict";
// What the page of a robot and that of a hub have in common: the connection, and how texts of others are shown.

const mostSilence = 700; // milliseconds: of the next two beats none has come
const mostPatience = 10000; // and then another connection is tried
const $ = (id) => document.getElementById(id);

// --- The connection ---------------------------------------------------------

let silence = null; // the timer of what happens when no message comes
let since = null; // when it was disconnected
let refusal = null; // why nothing else comes

// The page has: receive (a message), show, attach (what it says first, besides the version and the token), and isOver
// (whether nothing more is to come).
function connect(page) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}${location.pathname}live`);
  // A robot that is stopped closes nothing: it only falls silent. One whose machine has vanished remains so.
  const waitFor = (time, then) => {
    clearTimeout(silence);
    silence = setTimeout(then, time);
  };
  const giveUp = () => {
    socket.onmessage = socket.onclose = null;
    socket.close();
    connect(page);
  };
  const isSilent = () => {
    if (refusal) return;
    if (!page.isOver()) since ??= new Date(Date.now() - mostSilence);
    page.show();
    waitFor(mostPatience, giveUp);
  };
  waitFor(mostPatience, giveUp);
  socket.onopen = () => {
    const attach = { version: 1, ...page.attach() };
    if (location.hash.length > 1) attach.token = token(location.hash.slice(1));
    socket.send(JSON.stringify(attach));
  };
  socket.onmessage = ({ data }) => {
    waitFor(mostSilence, isSilent);
    since = null;
    page.receive(JSON.parse(data));
    page.show();
  };
  socket.onclose = () => {
    if (!page.isOver() && !refusal) since ??= new Date();
    page.show();
    clearTimeout(silence);
    if (!refusal) setTimeout(connect, 1000, page);
  };
}

function token(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text; // no address that the robot has printed
  }
}

// --- Texts of others ---------------------------------------------------------

const inertly = /[\p{Cc}\p{Cf}\p{Cs}\p{Co}\p{Zl}\p{Zp}]/gu;

// A text of the robot's, on one line and of bounded length; nothing in it can act.
function inert(text, most = 200) {
  const short = text.length > most ? text.slice(0, most) + "…" : text;
  return short.replace(inertly, (c) => `\\u{${c.codePointAt(0).toString(16)}}`);
}

const during = (time) => (time < 10 ? time.toFixed(1) : Math.round(time).toString()) + " s";

function changeText(change) {
  const was = change.before === undefined ? "" : ` (was ${inert(change.before, 60)})`;
  return `${inert(change.signal, 60)} ${inert(change.after, 60)}${was}`;
}

function element(name, texts = [], attributes = {}) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...texts);
  return made;
}

// Rows that stay: their texts change, and so the focus stays where it is.
function fill(list, items, make, write) {
  const known = new Map([...list.children].map((row) => [row.dataset.key, row]));
  let before = null;
  for (const [key, item] of items) {
    let row = known.get(key);
    if (!row) {
      row = make(item);
      row.dataset.key = key;
    }
    known.delete(key);
    const here = before ? before.nextSibling : list.firstChild;
    if (here !== row) list.insertBefore(row, here);
    write(row, item);
    before = row;
  }
  for (const row of known.values()) row.remove();
}

function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
