// One moment of a drive: the frame, what was believed and decided, the words, what argued for and against.

import { clock } from "./axis.js";
import { nearestPicture } from "./beliefs.js";
import { swatch } from "./colours.js";

// A new element with a class, texts and elements in it; texts are never read as HTML.
export function make(tag, name, ...inside) {
  const element = document.createElement(tag);
  if (name) element.className = name;
  element.append(...inside.filter((one) => one !== null && one !== undefined));
  return element;
}

// Show frame `frame` of drive number `number` in `host`, as the systems `shown` (their numbers) saw it.
export function showMoment(host, data, number, frame, shown) {
  const drive = data.drives[number];
  const systems = shown.filter((one) => drive.systems[one]);
  const first = drive.systems[systems[0]];
  const verdicts = systems.map((one) => verdict(data, drive, frame, one, systems));
  const judged = make("div", "verdicts", trueLine(data, drive, frame), ...verdicts);
  host.replaceChildren(heading(data, drive, frame), make("div", "seen", ...pictureOf(data, drive, frame), judged));
  host.append(bars(data, drive, frame, systems));
  if (!first) return;
  host.append(...wordsOf(data, drive, first, frame));
  const reasons = first.reasons[frame];
  if (reasons) host.append(argumentsOf(data, first, reasons, frame), models(data, first, reasons, frame));
}

function heading(data, drive, frame) {
  const time = drive.times ? `, ${clock(drive.times[frame] - drive.times[0], 0.1)}` : "";
  const title = make("h2", "", `${drive.name}, frame ${frame}${time}`);
  return make("div", "", title, make("p", "soft name", drive.frames[frame]));
}

function pictureOf(data, drive, frame) {
  const nearest = nearestPicture(drive, frame);
  if (nearest < 0) return [];
  const image = make("img", "frame");
  const shown = drive.pictures[0][nearest];
  image.src = drive.pictures[1][nearest];
  image.alt = `Frame ${shown} of ${drive.name}`;
  const note = shown === frame ? null : make("figcaption", "soft", `frame ${shown}, the nearest that this file holds`);
  return [make("figure", "", image, note)];
}

function placeName(data, place) {
  return place < 0 ? make("span", "soft", "no label") : make("span", "", swatch(data.places, place), data.titles[place]);
}

function trueLine(data, drive, frame) {
  return make("div", "", make("span", "soft", "true"), placeName(data, drive.truth[frame]));
}

const SIGNS = { 1: ["✓", "right"], 0: ["✕", "wrong"], "-1": ["", "no label"] };

function verdict(data, drive, frame, number, systems) {
  const system = drive.systems[number];
  const [sign, meaning] = SIGNS[system.judged[frame]];
  const name = systems.length > 1 ? data.systems[number] : "decided";
  const mark = make("strong", meaning === "wrong" ? "warn" : "", sign);
  mark.title = meaning;
  const held = system.selected[frame] ? null : make("span", "soft", " (a frame that was not taken in)");
  const which = make("span", systems.length > 1 ? `system-${systems.indexOf(number)}` : "soft", name);
  return make("div", "", which, placeName(data, system.best[frame]), mark, held);
}

// The places' probabilities, of each system a bar.
function bars(data, drive, frame, systems) {
  const list = make("div", "beliefs");
  const size = data.places.length;
  const of = (number, place) => drive.systems[number].belief[frame * size + place];
  data.places.forEach((_, place) => {
    // Two bars leave room for the name alone.
    const name = systems.length > 1 ? data.places[place] : data.titles[place];
    const row = make("div", "belief", make("span", "place", swatch(data.places, place), name));
    if (place === drive.truth[frame]) row.classList.add("true");
    for (const number of systems) {
      const share = of(number, place);
      const bar = make("meter");
      bar.max = 1;
      bar.value = share;
      bar.title = data.systems[number] || "belief";
      row.append(make("span", "amount", bar, make("span", "number", `${(100 * share).toFixed(1)} %`)));
    }
    list.append(row);
  });
  return list;
}

function tileOf(data, word) {
  const tile = Object.hasOwn(data.tiles, word) ? data.tiles[word] : null;
  if (!tile) return null;
  const [number, frame] = tile;
  const drive = data.drives[number];
  const nearest = nearestPicture(drive, frame);
  if (nearest < 0) return null;
  const image = make("img", "tile");
  image.src = drive.pictures[1][nearest];
  image.alt = "";
  image.title = `${word}: its most typical frame here, ${frame} of ${drive.name}`;
  return image;
}

function wordsOf(data, drive, system, frame) {
  const reasons = system.reasons[frame];
  const words = reasons ? reasons.said.map(([word]) => word) : [system.vocabulary[system.words[frame]]].filter(Boolean);
  if (!words.length) return [];
  const tiles = words.map((word) => make("span", "word", tileOf(data, word), ...breakable(word)));
  return [make("h3", "", words.length > 1 ? "Words" : "Word"), make("div", "words", ...tiles)];
}

// A word that may go on in a new line behind the name of its dictionary.
function breakable(word) {
  const at = word.lastIndexOf(".") + 1;
  return at ? [word.slice(0, at), make("wbr"), word.slice(at)] : [word];
}

function factor(log10) {
  const times = 10 ** Math.abs(log10);
  return `${log10 < 0 ? "÷" : "×"} ${times >= 100 ? Math.round(times) : times.toPrecision(2)}`;
}

function agoOf(ago) {
  const [newest, oldest] = [Math.min(...ago), Math.max(...ago)];
  if (!oldest) return "now";
  return newest === oldest ? `${oldest} ago` : `${newest || "now"} to ${oldest} ago`;
}

function argumentsOf(data, system, reasons, frame) {
  const best = data.titles[system.best[frame]];
  const rows = [...reasons.for.map((one) => ["for", ...one]), ...reasons.against.map((one) => ["against", ...one])];
  const about = reasons.rival ? `: odds of ${best} to ${titleOf(data, reasons.rival)}` : "";
  const table = make("table", "arguments");
  for (const [side, word, odds, ago] of rows) {
    const [what, moved, when] = [make("td", "", tileOf(data, word), word), factor(odds), agoOf(ago)];
    table.append(make("tr", "", make("td", side, side), what, make("td", "number", moved), make("td", "soft", when)));
  }
  const none = rows.length ? null : make("p", "soft", "Nothing moved the odds.");
  return make("div", "", make("h3", "", `What argued${about}`), rows.length ? table : none);
}

function titleOf(data, place) {
  return data.titles[data.places.indexOf(place)] ?? place;
}

function scientific(log10) {
  if (log10 === null) return "0";
  const p = 10 ** log10;
  return p >= 0.001 ? p.toPrecision(2) : p.toExponential(1);
}

function models(data, system, reasons, frame) {
  const head = ["place", ...reasons.said.map(([word]) => `p of ${word}`), "together", "belief before"];
  const table = make("table", "models");
  table.append(make("thead", "", make("tr", "", ...head.map((text) => make("th", "", text)))));
  const rows = system.columns.map((place, column) => {
    const said = reasons.said.map(([, , log10, orders]) => {
      const cell = make("td", "number", scientific(log10[column]));
      if (orders[column]) cell.title = `an n-gram of ${orders[column]} answered`;
      return cell;
    });
    const together = make("td", "number", scientific(reasons.weighed[column]));
    const before = make("td", "number", reasons.before[column] === null ? "0" : reasons.before[column].toPrecision(2));
    return make("tr", "", make("td", "", titleOf(data, place)), ...said, together, before);
  });
  table.append(make("tbody", "", ...rows));
  const history = reasons.said.map(([word, before]) => [...before, word].join(" ")).join("; ");
  const alpha = reasons.alpha ? ` Together: their product to the power of ${reasons.alpha}.` : "";
  const note = make("p", "soft", `Words seen: ${history}.${alpha}${unknownOf(reasons)}`);
  return make("details", "", make("summary", "", "What the places' models said"), make("div", "wide", table), note);
}

function unknownOf(reasons) {
  if (!reasons.unknown) return "";
  const [ratio, before, after] = reasons.unknown.map((one) => one ?? 0);
  return ` That it is none of these: ${before.toPrecision(2)} before, odds ${factor(ratio)}, then ${after.toPrecision(2)}.`;
}
