// What a strip looks like: film, ruler, rows, the marked stretch and the cursor, on its canvas.

import { clamp, ticks } from "./axis.js";
import { PALETTE, colourOf, emptyFill, fillOf, letterColour } from "./colours.js";
import { slots } from "./film.js";

const FILM = 60;
const RULER = 22;
const ROW = 26;
const NAME = 15;

// Where film, ruler and rows are, from the top: pixels.
export function heights(strip, film) {
  let top = film ? FILM : 0;
  const ruler = top;
  top += RULER;
  const rows = strip.data.rows.map((row) => {
    const place = { top: top + (row.name ? NAME : 4), height: row.height || ROW };
    top = place.top + place.height;
    return place;
  });
  return { ruler, rows, total: top + 4 };
}

// Draw `strip` on `canvas` as wide as `host` is; `film`: its pictures, if it has any.
export function paint(canvas, host, strip, film) {
  const { view, data } = strip;
  const [width, height] = [host.clientWidth, heights(strip, film).total];
  const density = devicePixelRatio || 1;
  canvas.width = Math.max(1, width * density);
  canvas.height = height * density;
  const context = canvas.getContext("2d");
  context.scale(density, density);
  const style = getComputedStyle(host);
  const colour = (name) => style.getPropertyValue(name).trim();
  const ink = { text: colour("--ink"), soft: colour("--soft"), line: colour("--line"), page: colour("--page") };
  context.font = `12px ${style.fontFamily}`;
  context.textBaseline = "middle";
  const x = (at) => ((at - view.from) * width) / (view.to - view.from);
  const sheet = { context, ink, width, x, places: data.places, axis: strip.axis, view };
  const place = heights(strip, film);
  if (film) paintFilm(sheet, film);
  paintRuler(sheet, place.ruler);
  data.rows.forEach((row, number) => paintRow(sheet, row, place.rows[number]));
  if (strip.mark) paintMark(sheet, strip.mark, place);
  paintCursor(sheet, strip.frame, place.total);
}

function paintFilm({ context, ink, width, axis, view }, film) {
  const some = slots(axis, view, width, FILM).map(([, frame]) => film.get(frame)).find(Boolean);
  const wide = some ? clamp((FILM * some.naturalWidth) / some.naturalHeight, 20, 160) : FILM * 1.33;
  const places = slots(axis, view, width, wide);
  for (const [left, frame] of places) {
    const image = film.get(frame);
    if (image) context.drawImage(image, left, 0, wide - 1, FILM);
    else {
      context.fillStyle = ink.line;
      context.fillRect(left, 0, wide - 1, FILM);
    }
  }
  film.want([...new Set(places.map(([, frame]) => frame))]);
}

function paintRuler({ context, ink, width, x, view, axis }, top) {
  context.fillStyle = context.strokeStyle = ink.soft;
  context.lineWidth = 1;
  for (const [at, text] of ticks(view.from, view.to, (70 * (view.to - view.from)) / width, axis.timed)) {
    context.beginPath();
    context.moveTo(Math.round(x(at)) + 0.5, top + RULER);
    context.lineTo(Math.round(x(at)) + 0.5, top + RULER - 5);
    context.stroke();
    context.fillText(text, x(at) + 3, top + RULER / 2);
  }
}

function paintRow(sheet, row, { top, height }) {
  const { context, ink, width } = sheet;
  if (row.name) {
    context.fillStyle = ink.soft;
    context.fillText(row.name, 2, top - NAME / 2);
  }
  if (row.stretches) paintStretches(sheet, row, top, height);
  if (row.shares) paintShares(sheet, row.shares, top, height);
  if (row.levels) paintLevels(sheet, row.levels, top, height);
  context.fillStyle = ink.text;
  for (const frame of row.marks || []) {
    const [left, right] = [frame, frame + 1].map((one) => Math.round(sheet.x(sheet.axis.edge(one))));
    if (right > 0 && left < width) context.fillRect(left, top, Math.max(1, right - left), height);
  }
}

function paintStretches({ context, ink, width, x, axis, places }, row, top, height) {
  for (const [start, end, place] of row.stretches) {
    const [left, right] = [Math.max(x(axis.edge(start)), -1), Math.min(x(axis.edge(end)), width + 1)];
    if (right < 0 || left > width) continue;
    context.globalAlpha = row.faint && place >= 0 ? 0.45 : 1;
    context.fillStyle = place < 0 ? emptyFill(context, ink.page, ink.soft) : fillOf(context, places, place);
    context.fillRect(left, top, Math.max(right - left, 0.5), height);
    context.globalAlpha = 1;
    // A thin line between stretches, also between two of one place.
    context.fillStyle = ink.page;
    if (right - left > 3) context.fillRect(left - 0.5, top, 1, height);
    if (right - left < 24) continue;
    context.save();
    context.beginPath();
    context.rect(left, top, right - left, height);
    context.clip();
    if (place >= 0) paintName(context, places, place, row.faint ? ink.text : null, Math.max(left, 0) + 5, top, height);
    context.restore();
  }
}

function paintName(context, places, place, letters, left, top, height) {
  if (place >= PALETTE.length && !letters) {
    // Letters on hatching are hard to read.
    context.fillStyle = colourOf(places, place);
    context.fillRect(left - 2, top + 3, context.measureText(places[place]).width + 4, height - 6);
  }
  context.fillStyle = letters || letterColour(colourOf(places, place));
  context.fillText(places[place], left, top + height / 2);
}

// One column a pixel: of the frames in it the one in the middle.
function paintShares({ context, width, x, axis, view, places }, shares, top, height) {
  const fills = places.map((_, place) => fillOf(context, places, place));
  const right = Math.min(width, x(axis.end));
  for (let left = Math.max(0, Math.floor(x(0))); left < right; left += 1) {
    const frame = axis.frameAt(view.from + ((left + 0.5) * (view.to - view.from)) / width);
    let below = top + height;
    for (let place = 0; place < places.length; place += 1) {
      const share = shares[frame * places.length + place] * height;
      if (share < 0.2) continue;
      context.fillStyle = fills[place];
      context.fillRect(left, below - share, 1, share);
      below -= share;
    }
  }
}

function paintLevels({ context, ink, width, x, axis, view }, levels, top, height) {
  context.fillStyle = ink.line;
  context.fillRect(0, top + height - 1, width, 1);
  context.strokeStyle = ink.text;
  context.lineWidth = 1.2;
  context.beginPath();
  const last = axis.frameAt(view.to);
  let column = -Infinity;
  let [low, high] = [1, 0];
  for (let frame = axis.frameAt(view.from); frame <= last; frame += 1) {
    const left = Math.floor(x((axis.edge(frame) + axis.edge(frame + 1)) / 2));
    if (left !== column) [low, high] = [1, 0];
    column = left;
    low = Math.min(low, levels[frame]);
    high = Math.max(high, levels[frame]);
    context.lineTo(left, top + height - low * height);
    if (high > low) context.lineTo(left, top + height - high * height);
  }
  context.stroke();
}

function paintMark({ context, ink, x, axis }, [start, end], { ruler, total }) {
  const [left, right] = [x(axis.edge(start)), x(axis.edge(end))];
  context.fillStyle = ink.text;
  context.globalAlpha = 0.15;
  context.fillRect(left, ruler, right - left, total - ruler);
  context.globalAlpha = 1;
  context.strokeStyle = ink.text;
  context.setLineDash([4, 3]);
  context.strokeRect(left, ruler + 0.5, right - left, total - ruler - 1);
  context.setLineDash([]);
}

function paintCursor({ context, ink, x, axis }, frame, total) {
  const [left, right] = [x(axis.edge(frame)), x(axis.edge(frame + 1))];
  context.fillStyle = ink.text;
  context.globalAlpha = 0.25;
  context.fillRect(left, 0, Math.max(right - left, 1), total);
  context.globalAlpha = 1;
  context.fillRect(left - 0.75, 0, 1.5, total);
}
