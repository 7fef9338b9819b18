// The page of `placerec label`: keys and the mouse change labels, the strip shows them.

import { clock } from "./axis.js";
import { swatch } from "./colours.js";
import { labelDesk } from "./desk.js";
import { bordersOf, createStrip } from "./strip.js";
import { framesOf, gaps, joined, labelled, movedBorder, pieceAt, renamed, split } from "./stretches.js";

const HERE = new URL(".", import.meta.url);
// Letters that do something else pick no place.
const PLACE_KEYS = "123456789abcdefghiklopqtuvwxyz";
const byId = (id) => document.getElementById(id);
const page = { mark: null, proposal: null, looks: [], look: -1, dragged: null, times: new Map() };

async function ask(path, sent) {
  const post = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(sent) };
  const answer = await fetch(new URL(path, HERE), sent === undefined ? {} : post);
  const found = (answer.headers.get("Content-Type") || "").startsWith("application/json")
    ? await answer.json()
    : { error: await answer.text() };
  return found && typeof found === "object" ? Object.assign(found, { status: answer.status }) : {};
}

async function numbers(path, kind) {
  const answer = await fetch(new URL(path, HERE));
  return answer.ok ? new kind(await answer.arrayBuffer()) : null;
}

const desk = labelDesk(ask, () => show(), tell);
const strip = createStrip(byId("strip"), {
  picture: (frame) => new URL(`picture/${desk.now}/${frame}/small`, HERE).href,
  onFrame: () => showFrame(),
  onMark: () => {},
  onBorder: dragged,
});

// ---- what is shown

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

// A question stays until it is answered, or what is returned is called; of notices the newest is shown, below questions.
function tell(text, choices) {
  const line = element("p", "", { class: choices.length ? "warn bar" : "warn bar notice" });
  line.append(element("span", text));
  for (const [name, action] of choices.length ? choices : [["well", () => {}]]) {
    const button = element("button", name);
    button.onclick = () => {
      line.remove();
      action();
    };
    line.append(button);
  }
  if (choices.length) byId("trouble").prepend(line);
  else {
    document.querySelector("#trouble .notice")?.remove();
    byId("trouble").append(line);
  }
  return () => line.remove();
}

function show() {
  const { drive } = desk;
  if (!drive) return;
  const index = (place) => desk.places.indexOf(place);
  const labels = page.dragged || drive.stretches;
  const rows = [{
    name: "labels", drag: true, height: 34,
    stretches: [...labels.map(([a, b, place]) => [a, b, index(place)]), ...gaps(labels, drive.count).map((gap) => [...gap, -1])],
  }];
  if (page.proposal) {
    desk.learnOf(page.proposal.map(([, , place]) => place));
    rows.push({ name: "proposed", faint: true, stretches: page.proposal.map(([a, b, place]) => [a, b, index(place)]) });
    if (page.doubt) rows.push({ name: "how unsure that is", levels: page.doubt });
  }
  strip.show({ count: drive.count, times: page.times.get(desk.now) ?? null, places: desk.places, rows });
  byId("file").textContent = drive.file;
  const missing = gaps(drive.stretches, drive.count).reduce((sum, [a, b]) => sum + b - a, 0);
  const failed = drive.refused || drive.conflict ? "not saved" : desk.lost ? "not saved: placerec does not answer" : "";
  const state = failed || (desk.saving ? "saving" : "saved");
  byId("saved").textContent = `${state}; ${missing ? `${missing} of ${drive.count} frames without a label` : "every frame has a label"}`;
  byId("saved").className = failed ? "warn" : "soft";
  byId("undo").disabled = !desk.canUndo();
  byId("redo").disabled = !desk.canRedo();
  byId("learn").disabled = desk.busy;
  byId("accept").disabled = !page.proposal;
  byId("said").textContent = desk.said;
  showPlaces();
  showFrame();
  if (page.round !== desk.round) fetchProposal();
  else if (page.proposal && !desk.saving && page.version !== drive.version) fetchLooks();
}

function showPlaces() {
  const counts = framesOf(desk.drive.stretches);
  const here = pieceAt(desk.drive.stretches, strip.frame, desk.drive.count)[2];
  byId("places").replaceChildren(...desk.places.map((place, number) => {
    const button = element("button", "", { "aria-pressed": String(place === here) });
    const key = PLACE_KEYS[number];
    button.append(swatch(desk.places, number), ...(key ? [element("kbd", key)] : []), ` ${place} `);
    button.append(element("span", String(counts.get(place) || 0), { class: "soft" }));
    button.onclick = () => press(place);
    return button;
  }));
}

let asked = 0;
function showFrame() {
  const { drive } = desk;
  if (!drive) return;
  const frame = strip.frame;
  const label = pieceAt(drive.stretches, frame, drive.count)[2];
  const proposed = page.proposal ? pieceAt(page.proposal, frame, drive.count)[2] : "";
  const time = strip.axis.timed ? `${clock(strip.axis.edge(frame), 0.01)} · ` : "";
  const words = `${time}frame ${frame} of ${drive.count} · ${label || "no label"}`;
  byId("caption").textContent = proposed && proposed !== label ? `${words} · proposed: ${proposed}` : words;
  for (const button of byId("places").children) {
    button.setAttribute("aria-pressed", String(button === byId("places").children[desk.places.indexOf(label)]));
  }
  const turn = (asked += 1);
  // The newest one alone, however fast one scrolls.
  setTimeout(async () => {
    if (turn !== asked) return;
    byId("picture").src = new URL(`picture/${desk.now}/${frame}/large`, HERE).href;
    byId("picture").alt = `frame ${frame}`;
    const { name } = await ask(`frame/${desk.now}/${frame}`).catch(() => ({}));
    if (turn === asked && name) byId("caption").title = name;
  }, strip.playing ? 0 : 30);
}

byId("picture").addEventListener("error", async () => {
  const source = byId("picture").src;
  const reason = await fetch(source).then((answer) => answer.text(), () => "");
  if (source === byId("picture").src && reason) byId("picture").alt = reason;
});

// ---- drives and proposals

async function openDrive(number) {
  desk.now = number;
  page.proposal = page.doubt = null;
  page.looks = [];
  page.round = -1;
  if (desk.drive.timed && !page.times.has(number)) page.times.set(number, await numbers(`times/${number}`, Float64Array));
  strip.frame = 0;
  show();
}

async function fetchProposal() {
  page.round = desk.round;
  if (!desk.round) return;
  const number = desk.now;
  const [found, doubt] = await Promise.all([ask(`proposal/${number}`), numbers(`doubt/${number}`, Float32Array)]);
  if (number !== desk.now || !found.stretches) return;
  page.proposal = found.stretches;
  page.doubt = doubt;
  takeLooks(found);
  show();
}

// What is to be looked at depends on the labels, as they are saved.
async function fetchLooks() {
  const number = desk.now;
  page.version = desk.drive.version;
  const found = await ask(`proposal/${number}`).catch(() => ({}));
  if (number === desk.now && found.looks) takeLooks(found);
}

function takeLooks({ looks }) {
  page.version = desk.drive.version;
  page.looks = looks;
  page.look = -1;
  showLooks();
}

// What is done already needs no look any more.
function openLooks() {
  const { drive } = desk;
  return page.looks.filter(({ start, end, place }) => {
    const [from, to, label] = pieceAt(drive.stretches, start, drive.count);
    return !(from <= start && end <= to && label === place);
  });
}

function showLooks() {
  const looks = page.proposal ? openLooks() : [];
  byId("looking").hidden = !looks.length;
  byId("looks").replaceChildren(...looks.slice(0, 50).map((look, number) => {
    const what = look.label ? `labelled ${look.label}, proposed ${look.place}` : look.place;
    const button = element("button", `${what}: frames ${look.start} to ${look.end - 1}, ${Math.round(100 * look.doubt)} % unsure`);
    button.classList.toggle("here", number === page.look);
    button.onclick = () => lookAt(number);
    const item = element("li", "");
    item.append(button);
    return item;
  }));
}

function lookAt(number) {
  const looks = openLooks();
  if (!looks.length) return;
  page.look = Math.max(0, Math.min(looks.length - 1, number));
  strip.go(looks[page.look].start);
  showLooks();
}

// ---- changes

function edit(stretches) {
  const real = desk.change([[desk.now, stretches]]);
  // The first that is left is the next to look at.
  if (real) page.look = -1;
  if (page.proposal) showLooks();
  return real;
}

function press(place) {
  const { drive } = desk;
  const { frame } = strip;
  const [from, to] = strip.mark || [frame, pieceAt(drive.stretches, frame, drive.count)[1]];
  edit(labelled(drive.stretches, from, to, place));
  strip.setMark(null);
  page.mark = null;
}

function clear() {
  const { drive } = desk;
  const [from, to] = strip.mark || pieceAt(drive.stretches, strip.frame, drive.count);
  edit(labelled(drive.stretches, from, to, ""));
  strip.setMark(null);
}

function moveBorder(by) {
  const { drive } = desk;
  const borders = bordersOf([{ stretches: drive.stretches }]);
  if (!borders.length) return;
  const near = borders.reduce((best, one) => (Math.abs(one - strip.frame) < Math.abs(best - strip.frame) ? one : best));
  const moved = movedBorder(drive.stretches, near, near + by, drive.count);
  if (edit(moved)) strip.go(Math.min(near + by, drive.count - 1));
}

function dragged(row, border, frame, done) {
  const { drive } = desk;
  const moved = movedBorder(drive.stretches, border, frame, drive.count);
  page.dragged = done ? null : moved;
  if (done) edit(moved);
  else show();
}

function accept(all) {
  const { drive } = desk;
  if (!page.proposal) return;
  const free = (from, to) => gaps(drive.stretches, drive.count)
    .map(([a, b]) => [Math.max(a, from), Math.min(b, to)]).filter(([a, b]) => a < b);
  let stretches = drive.stretches;
  const chosen = all ? page.proposal : [pieceAt(page.proposal, strip.frame, drive.count)];
  for (const [from, to, place] of chosen) {
    const parts = free(from, to);
    // One that is labelled otherwise is replaced only where it is looked at.
    for (const [a, b] of parts.length || all ? parts : [[from, to]]) stretches = labelled(stretches, a, b, place);
  }
  edit(stretches);
}

function rename() {
  const { drive } = desk;
  const place = pieceAt(drive.stretches, strip.frame, drive.count)[2];
  if (!place) return;
  byId("name").value = place;
  byId("name").focus();
  byId("name").select();
  page.renames = place;
}

async function named(name) {
  const old = page.renames;
  page.renames = null;
  byId("name").value = "";
  byId("strip").focus({ preventScroll: true });
  if (!name || name === old) return;
  if (/[\s/\\]/.test(name) || name.startsWith(".")) {
    tell(`${name}: a place is a file's name: no blanks, no / and no dot in front`, []);
    return;
  }
  if (!old) {
    press(name);
    return;
  }
  desk.places = [...new Set(desk.places.map((place) => (place === old ? name : place)))];
  desk.change(desk.drives.map((drive, number) => [number, renamed(drive.stretches, old, name)]));
}

function learn() {
  if (!desk.busy) ask("learn", {}).then(() => { desk.busy = true; show(); }, () => {});
}

function setMark() {
  if (page.mark === null) page.mark = strip.frame;
  else {
    strip.setMark([Math.min(page.mark, strip.frame), Math.max(page.mark, strip.frame) + 1]);
    page.mark = null;
  }
}

// ---- keys

const KEYS = {
  n: () => byId("name").focus(),
  m: setMark,
  s: () => edit(split(desk.drive.stretches, strip.frame)),
  j: () => edit(joined(desk.drive.stretches, strip.frame, desk.drive.count)),
  r: learn,
  Delete: clear,
  Backspace: clear,
  F2: rename,
  Enter: () => accept(false),
  ArrowDown: () => lookAt(page.look + 1),
  ArrowUp: () => lookAt(page.look - 1),
};

document.addEventListener("keydown", (event) => {
  if (event.defaultPrevented || !desk.drive) return;
  if (event.target.matches("input, select, button, summary") && !(event.target.matches("button") && event.key !== " " && event.key !== "Enter")) {
    if (event.key === "Escape") byId("strip").focus();
    return;
  }
  const action = actionOf(event);
  if (action) {
    event.preventDefault();
    action();
  } else strip.key(event);
});

function actionOf(event) {
  const { key } = event;
  if (event.ctrlKey || event.metaKey) {
    if (key.toLowerCase() === "z") return event.shiftKey ? desk.redo : desk.undo;
    return key === "y" ? desk.redo : null;
  }
  if (event.altKey) return { ArrowLeft: () => moveBorder(-1), ArrowRight: () => moveBorder(1) }[key];
  if (key === "Enter" && event.shiftKey) return () => accept(true);
  const number = key.length === 1 ? PLACE_KEYS.indexOf(key) : -1;
  if (number >= 0) return number < desk.places.length ? () => press(desk.places[number]) : () => {};
  return Object.hasOwn(KEYS, key) && !event.shiftKey ? KEYS[key] : null;
}

byId("undo").onclick = desk.undo;
byId("redo").onclick = desk.redo;
byId("learn").onclick = learn;
byId("accept").onclick = () => accept(true);
byId("drive").onchange = () => openDrive(Number(byId("drive").value));
byId("naming").addEventListener("submit", (event) => {
  event.preventDefault();
  named(byId("name").value.trim());
});
byId("name").addEventListener("blur", () => {
  byId("name").value = "";
  page.renames = null;
});

await desk.open();
byId("drive").replaceChildren(...desk.drives.map((drive, number) => element("option", drive.name, { value: String(number) })));
await openDrive(0);
byId("strip").focus({ preventScroll: true });
