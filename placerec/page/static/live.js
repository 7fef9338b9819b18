// The page of `placerec decode --live --page`: the newest frame, the belief, its last minute, and places named here.

import { colourOf, swatch } from "./colours.js";
import { createStrip } from "./strip.js";

const BELOW = new URL(".", import.meta.url);
const OFTEN = 150; // milliseconds between two questions
const MINUTE = 60;
const found = (id) => document.getElementById(id);
// `order`: places as they became known, by which they have colours and keys.
const live = { known: 0, rows: [], places: [], order: [], pictured: -1, state: null };
const film = createStrip(found("strip"));

async function answerTo(path, sent) {
  const post = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(sent) };
  const answer = await fetch(new URL(path, BELOW), sent === undefined ? {} : post);
  return answer.json();
}

async function keepAsking() {
  for (;;) {
    try {
      const state = await answerTo(`now/${live.known}`);
      found("trouble").hidden = true;
      takeIn(state);
      draw();
    } catch {
      found("trouble").textContent = "placerec does not answer: it has ended, or is not reached";
      found("trouble").hidden = false;
    }
    await new Promise((resolve) => setTimeout(resolve, document.hidden ? 10 * OFTEN : OFTEN));
  }
}

function takeIn(state) {
  if (JSON.stringify(state.places) !== JSON.stringify(live.places)) {
    // Other columns: what was believed before is of another model.
    live.rows = [];
    live.places = state.places;
  }
  live.state = state;
  for (const place of state.known) if (!live.order.includes(place)) live.order.push(place);
  live.rows.push(...state.rows);
  if (live.rows.length) live.known = live.rows.at(-1).k;
  const last = live.rows.at(-1)?.t ?? 0;
  live.rows = live.rows.filter(({ t }) => t === null || t >= last - MINUTE);
}

function draw() {
  const { state } = live;
  found("source").textContent = state.name;
  found("counts").textContent = `${state.seen} frames seen, ${state.dropped} dropped`;
  if (state.frame !== live.pictured && found("picture").complete) {
    live.pictured = state.frame;
    found("picture").src = new URL(`picture/${state.frame}`, BELOW).href;
  }
  const row = live.rows.at(-1);
  found("caption").textContent = row ? `frame ${state.frame} · word ${row.w || "none"}${row.u === null ? "" : ` · unknown ${percent(row.u)}`}` : "no frame yet";
  if (row) drawBars(row);
  drawNaming();
  drawMinute();
}

function percent(share) {
  return `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`;
}

function drawBars(row) {
  const names = [...live.order, "unknown"];
  const shown = live.places.map((place, number) => [place, row.b[number], names.indexOf(place)]);
  if (row.u !== null) shown.push(["unknown", row.u, live.order.length]);
  const list = found("bars");
  while (list.children.length > shown.length) list.lastChild.remove();
  shown.forEach(([place, share, number], index) => {
    const item = list.children[index] || list.appendChild(newBar());
    const [name, track, text] = item.children;
    if (name.title !== place) {
      name.title = place;
      name.replaceChildren(swatch(names, number), place);
      track.firstChild.style.background = colourOf(names, number);
    }
    track.firstChild.style.width = `${100 * share}%`;
    text.textContent = percent(share);
    item.classList.toggle("best", share === Math.max(...row.b) && index < live.places.length);
  });
}

function newBar() {
  const item = document.createElement("li");
  for (const kind of ["name", "track", "share"]) {
    const part = document.createElement("span");
    part.className = kind;
    item.append(part);
  }
  const bar = document.createElement("span");
  bar.className = "fill";
  item.children[1].append(bar);
  return item;
}

function drawNaming() {
  const { state } = live;
  const list = found("places");
  const known = JSON.stringify([live.order, state.place]);
  if (list.dataset.known !== known) {
    list.dataset.known = known;
    list.replaceChildren(...live.order.map((place, number) => {
      const button = document.createElement("button");
      const key = document.createElement("kbd");
      key.textContent = String(number + 1);
      button.append(...(number < 9 ? [key, " "] : []), place);
      button.setAttribute("aria-pressed", String(place === state.place));
      button.onclick = () => nameIt(place);
      return button;
    }));
  }
  const where = state.folder ? `${state.kept} frames are kept in ${state.folder}` : "nothing is kept yet";
  found("kept").textContent = state.keeps
    ? `${state.place ? `The camera is in ${state.place}; ` : ""}${where}`
    : "To name places, start decode with --keep FOLDER/";
  for (const id of ["name"]) found(id).disabled = !state.keeps;
  for (const button of document.querySelectorAll("#naming button, #places button")) button.disabled = !state.keeps;
  found("stop").disabled = !state.place;
  found("teach").disabled = state.busy || !state.kept;
  if (state.said || !live.complaint) found("said").textContent = state.busy ? "teaching the model" : state.said;
}

function drawMinute() {
  const { rows, places } = live;
  const names = live.order;
  const columns = places.map((place) => names.indexOf(place));
  const shares = new Float32Array(rows.length * names.length);
  rows.forEach(({ b }, number) => columns.forEach((column, place) => {
    shares[number * names.length + column] = b[place];
  }));
  const stretches = [];
  rows.forEach(({ l }, number) => {
    const place = l ? names.indexOf(l) : -1;
    const last = stretches.at(-1);
    if (last && last[2] === place) last[1] = number + 1;
    else stretches.push([number, number + 1, place]);
  });
  const timed = rows.length && rows.every(({ t }) => t !== null);
  film.show({
    count: rows.length, places: names, times: timed ? rows.map(({ t }) => t) : null, end: timed ? MINUTE : 0,
    rows: [{ name: "belief in the last minute", shares, height: 90 }, { name: "named", stretches }],
  });
  film.frame = Math.max(0, rows.length - 1);
}

async function nameIt(place) {
  const answer = await answerTo("name", { place });
  live.complaint = Boolean(answer.error);
  found("said").textContent = answer.error || "";
}

async function teach() {
  const answer = await answerTo("teach", {});
  live.complaint = Boolean(answer.error);
  found("said").textContent = answer.error || "";
}

found("naming").addEventListener("submit", (event) => {
  event.preventDefault();
  const place = found("name").value.trim();
  found("name").value = "";
  found("name").blur();
  if (place) nameIt(place);
});
found("stop").onclick = () => nameIt("");
found("teach").onclick = teach;

document.addEventListener("keydown", (event) => {
  if (event.target.matches("input") || event.ctrlKey || event.metaKey || event.altKey || !live.state) {
    if (event.key === "Escape") found("name").blur();
    return;
  }
  const number = "123456789".indexOf(event.key);
  if (number >= 0 && event.key.length === 1 && live.order[number]) nameIt(live.order[number]);
  else if (event.key === "n") found("name").focus();
  else if (event.key === "t") teach();
  else if (event.key === "Escape") nameIt("");
  else return;
  event.preventDefault();
});

keepAsking();
