// The report: strips of all drives, and the moment that is pointed at.

import { clamp, frameAxis } from "./axis.js";
import { KINDS, meantFrames, momentsOf, nearestPicture, stretchesOf, unpackReport } from "./beliefs.js";
import { swatch } from "./colours.js";
import { make, showMoment } from "./moment.js";
import { createStrip } from "./strip.js";

const BELIEF = 44;
const DECIDED = 13;
const MARKS = 7;
const MANY = 6; // more drives than this are a list of their own to scroll through

const data = unpackReport(document.getElementById("data").textContent);
const state = { drive: 0, frame: 0, a: 0, b: -1, kind: "all", place: -1 };
const strips = [];
const shown = {};

function start() {
  const host = document.getElementById("report");
  shown.controls = make("div", "bar controls");
  shown.legend = make("div", "bar legend");
  shown.drives = make("div", data.drives.length > MANY ? "drives many" : "drives");
  shown.moment = make("aside", "moment");
  shown.moment.setAttribute("aria-label", "The moment that is pointed at");
  host.replaceChildren(shown.controls, shown.legend, make("div", "columns", shown.drives, shown.moment), keysHelp());
  makeControls();
  makeLegend();
  makeStrips();
  const asked = readAddress();
  if (!asked) goToFirstError();
  showAll();
  if (asked) strips[state.drive].host.parentElement.scrollIntoView({ block: "nearest" });
  document.addEventListener("keydown", onKey);
  addEventListener("hashchange", () => readAddress() && showAll());
}

// Where something went wrong there is most to see.
function goToFirstError() {
  const [first] = momentsOf(data, "errors", state.a, -1, -1);
  if (first) [state.drive, state.frame] = first;
}

function chooser(title, options, value, changed) {
  const select = make("select", "");
  for (const [key, text] of options) {
    const option = make("option", "", text);
    option.value = key;
    select.append(option);
  }
  select.value = value;
  let pointed = false;
  select.addEventListener("pointerdown", () => (pointed = true));
  select.addEventListener("keydown", () => (pointed = false));
  select.addEventListener("change", () => {
    // Who chose with the mouse goes on with keys, which a list that keeps the focus would take.
    if (pointed) select.blur();
    changed(select.value);
  });
  return [make("label", "", make("span", "soft", `${title} `), select), select];
}

function makeControls() {
  const systems = data.systems.map((name, number) => [number, name || "beliefs"]);
  if (systems.length > 1) {
    const set = (name) => (value) => change({ [name]: Number(value) });
    [shown.labelA, shown.a] = chooser("beliefs of", systems, state.a, set("a"));
    [shown.labelB, shown.b] = chooser("beside", [[-1, "none"], ...systems], state.b, set("b"));
    shown.controls.append(shown.labelA, shown.labelB);
  }
  const kinds = Object.entries(KINDS).filter(([, kind]) => !kind.second || systems.length > 1);
  const titles = kinds.map(([name, kind]) => [name, kind.title]);
  [shown.labelKind, shown.kind] = chooser("step through", titles, state.kind, (kind) => change({ kind }));
  const before = make("button", "", "‹ previous");
  const after = make("button", "", "next ›");
  before.addEventListener("click", () => step(-1));
  after.addEventListener("click", () => step(1));
  shown.count = make("output", "soft");
  shown.controls.append(shown.labelKind, before, after, shown.count);
}

function makeLegend() {
  data.places.forEach((_, place) => {
    const button = make("button", "legend-place", swatch(data.places, place), data.titles[place]);
    button.setAttribute("aria-pressed", "false");
    button.title = "show only frames of this place";
    button.addEventListener("click", () => change({ place: state.place === place ? -1 : place }));
    shown.legend.append(button);
  });
}

function makeStrips() {
  data.drives.forEach((drive, number) => {
    const host = make("div", "");
    const title = make("h3", "", drive.name, " ");
    const note = make("span", "soft");
    title.append(note);
    shown.drives.append(make("section", "drive", title, host));
    const film = drive.pictures[0].length ? { picture: (frame) => drive.pictures[1][nearestPicture(drive, frame)] } : {};
    const strip = createStrip(host, { ...film, onFrame: (frame) => point(number, frame) });
    host.addEventListener("focus", () => state.drive === number || point(number, strip.frame));
    hover(host, strip, number);
    strips.push({ strip, host, note });
  });
}

// The moment below the mouse is shown while it is there.
function hover(host, strip, number) {
  host.addEventListener("pointermove", (event) => {
    if (event.buttons || event.pointerType === "touch") return;
    const { from, to } = strip.view;
    const box = host.getBoundingClientRect();
    const at = from + ((event.clientX - box.left) * (to - from)) / box.width;
    if (at < strip.axis.end) present(number, strip.axis.frameAt(clamp(at, 0, strip.axis.end)));
  });
  host.addEventListener("pointerleave", () => present(state.drive, state.frame));
}

function systemsShown() {
  return [state.a, ...(state.b >= 0 && state.b !== state.a ? [state.b] : [])];
}

function present(number, frame) {
  if (data.drives[number].count) showMoment(shown.moment, data, number, frame, systemsShown());
}

function point(number, frame) {
  Object.assign(state, { drive: number, frame });
  strips.forEach(({ host }, one) => host.parentElement.classList.toggle("current", one === number));
  present(number, frame);
  showCount();
  history.replaceState(null, "", address());
}

function change(changes) {
  Object.assign(state, changes);
  if (KINDS[state.kind].second && state.b < 0) state.b = data.systems.findIndex((_, one) => one !== state.a);
  showAll();
  // To a moment of what was asked for, if the present one is none; of the least sure ones always to the first.
  if (changes.kind === "unsure" && shown.moments.length) go(...shown.moments[0]);
  else if (!shown.moments.some((one) => isHere(one))) step(1);
}

function isHere([number, frame]) {
  return number === state.drive && frame === state.frame;
}

function showAll() {
  const { a, b, kind, place } = state;
  if (shown.a) [shown.a.value, shown.b.value] = [a, b];
  shown.kind.value = kind;
  [...shown.legend.children].forEach((button, one) => button.setAttribute("aria-pressed", String(one === place)));
  shown.moments = momentsOf(data, kind, a, b, place);
  const axes = data.drives.map((drive) => frameAxis(drive.count, drive.times));
  const timed = axes.every((axis) => axis.timed);
  const end = Math.max(...axes.filter((axis) => axis.timed === timed).map((axis) => axis.end), 0);
  strips.forEach(({ strip, note }, number) => {
    const drive = data.drives[number];
    note.textContent = noteOf(drive);
    const rows = rowsOf(drive);
    const scale = axes[number].timed === timed ? { end } : {};
    strip.show({ count: drive.count, times: drive.times, places: data.places, rows, ...scale });
  });
  if (data.drives[state.drive].count) strips[state.drive].strip.go(state.frame);
}

function noteOf(drive) {
  return systemsShown().flatMap((number) => {
    const system = drive.systems[number];
    if (!system) return [];
    const judged = system.judged.filter((one) => one >= 0);
    if (!judged.length) return ["no frame has a label"];
    const right = judged.reduce((sum, one) => sum + one, 0);
    const text = `${((100 * right) / judged.length).toFixed(1)} % of ${judged.length} right`;
    return [systemsShown().length > 1 ? `${data.systems[number]}: ${text}` : text];
  }).join(", ");
}

function rowsOf(drive) {
  const rows = [{ name: "true", height: DECIDED + 3, stretches: stretchesOf(drive.truth) }];
  const systems = systemsShown().filter((number) => drive.systems[number]);
  for (const number of systems) {
    const { belief, best, judged } = drive.systems[number];
    const of = systems.length > 1 ? ` of ${data.systems[number]}` : "";
    rows.push({ name: `belief${of}`, height: BELIEF, shares: belief });
    rows.push({ name: `decided${of}, black where wrong`, height: DECIDED, stretches: stretchesOf(best) });
    rows.push({ height: MARKS, marks: [...judged.keys()].filter((frame) => judged[frame] === 0) });
  }
  if (systems.length > 1) {
    for (const kind of ["first", "second"]) {
      const name = `only ${data.systems[systems[Number(kind === "second")]]} is right`;
      rows.push({ name, height: MARKS, marks: meantFrames(drive, kind, state.a, state.b, -1) });
    }
  }
  if (state.kind !== "all" || state.place >= 0) {
    const own = shown.moments.filter(([number]) => data.drives[number] === drive).map(([, frame]) => frame);
    const marks = state.kind === "unsure" ? own : meantFrames(drive, state.kind, state.a, state.b, state.place);
    rows.push({ name: nameOfChoice(), height: MARKS, marks });
  }
  return rows;
}

function nameOfChoice() {
  return `${KINDS[state.kind].title}${state.place < 0 ? "" : ` with ${data.titles[state.place]}`}`;
}

function showCount() {
  const at = shown.moments.findIndex((one) => isHere(one));
  const total = shown.moments.length;
  shown.count.textContent = total ? `${at < 0 ? "" : `${at + 1} of `}${total} moments` : "nothing of that kind";
}

// To the next moment of the chosen kind, or the one before.
function step(by) {
  const { moments } = shown;
  if (!moments.length) return;
  let at = moments.findIndex((one) => isHere(one));
  if (at < 0 && state.kind === "unsure") at = by > 0 ? -1 : moments.length;
  else if (at < 0) {
    const later = moments.findIndex(([number, frame]) => number > state.drive || (number === state.drive && frame > state.frame));
    at = later < 0 ? moments.length - (by < 0 ? 0 : 1) : later - (by > 0 ? 1 : 0);
    if (later < 0 && by > 0) at = -1;
  }
  go(...moments[(at + by + moments.length) % moments.length]);
}

function go(number, frame) {
  state.drive = number;
  strips[number].strip.go(frame);
  strips[number].host.parentElement.scrollIntoView({ block: "nearest" });
}

function goDrive(by) {
  const number = clamp(state.drive + by, 0, data.drives.length - 1);
  if (number !== state.drive) go(number, strips[number].strip.frame);
}

function onKey(event) {
  const held = event.ctrlKey || event.metaKey || event.altKey;
  if (event.defaultPrevented || held || event.target.tagName === "SELECT") return;
  const kind = Object.keys(KINDS).find((name) => KINDS[name].key === event.key);
  const actions = {
    n: () => step(1),
    p: () => step(-1),
    a: () => change({ kind: "all", place: -1 }),
    ArrowDown: () => goDrive(1),
    ArrowUp: () => goDrive(-1),
  };
  if (kind && (!KINDS[kind].second || data.systems.length > 1)) change({ kind });
  else if (Object.hasOwn(actions, event.key)) actions[event.key]();
  else {
    // A button that has the focus is pressed by the space bar.
    if (!(event.key === " " && event.target.tagName === "BUTTON")) strips[state.drive].strip.key(event);
    return;
  }
  event.preventDefault();
}

function keysHelp() {
  const keys = [
    ["← →", "a frame"], ["⇧ ← →", "ten"], ["↑ ↓", "another drive"], ["Page↑ Page↓", "a change"], ["n p", "next, previous of what is stepped through"],
    ["e", "errors"], ["c", "changes"], ["u", "least sure"], ["a", "all"], ["+ − 0", "zoom"], ["space", "play"],
  ];
  if (data.systems.length > 1) keys.push(["d", "where two differ"]);
  return make("p", "soft keys", ...keys.flatMap(([key, text]) => [make("kbd", "", key), ` ${text}  `]));
}

// The moment that is shown stands in the address, to be sent to others: #drive/frame.
function address() {
  return `#${encodeURIComponent(data.drives[state.drive].name)}/${state.frame}`;
}

function readAddress() {
  const [name, frame] = decodeAddress();
  const number = data.drives.findIndex((drive) => drive.name === name);
  if (number < 0) return false;
  Object.assign(state, { drive: number, frame: clamp(Number.parseInt(frame, 10) || 0, 0, Math.max(0, data.drives[number].count - 1)) });
  return true;
}

function decodeAddress() {
  try {
    return location.hash.slice(1).split("/").map(decodeURIComponent);
  } catch {
    return [];
  }
}

start();
