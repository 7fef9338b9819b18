// A drive as a strip over its axis: pictures, rows of stretches and curves, a cursor, a marked stretch.
//
// createStrip(host, { picture, onFrame, onMark, onBorder }) -> strip; all are optional:
//   picture(frame) -> the address of its picture, onFrame(frame): the cursor moved, onMark([start, end] | null),
//   onBorder(row, border, frame, done): the border at frame `border` of row number `row` is dragged to `frame`.
// strip.show({ count, times, places, rows, end, view }): what is shown from now on.
//   count: frames; times: seconds of each, or null; places: names, by whose order they have colours;
//   end: what the axis spans at least (one scale for several drives), in seconds, or frames without times;
//   rows, each { name, height?, drag?, ... } with one of
//     stretches: [[start, end, place], ...] frames start to end - 1 are in places[place], -1: in none; faint: paler
//     levels: one number 0 to 1 a frame, drawn as a curve; shares: count * places.length beliefs, stacked
//     marks: [frame, ...] that are struck through in black.
// strip.frame, strip.mark: the cursor, the marked stretch; strip.go(frame), strip.setMark(mark), strip.look(from, to),
// strip.play(on), strip.key(event) -> whether a key of the strip was pressed: arrows step, with shift jump, Home, End,
// PageUp and PageDown go to borders, + - 0 zoom, space plays, Escape unmarks. The host hears keys while it has the focus;
// a page may hand on others, unless event.defaultPrevented.

import { clamp, clock, frameAxis } from "./axis.js";
import { lazyPictures } from "./film.js";
import { heights, paint } from "./paint.js";

const GRASP = 6; // pixels within which a border is grasped
const JUMP = 10;
const PLAIN_RATE = 10; // frames a second that frames without times are played at

export function createStrip(host, options = {}) {
  const canvas = document.createElement("canvas");
  host.classList.add("strip");
  host.append(canvas);
  host.tabIndex = 0;
  host.setAttribute("role", "slider");
  const strip = { frame: 0, mark: null, data: null, axis: frameAxis(0, null), view: { from: 0, to: 1 }, playing: false };
  let due = false;

  function redraw() {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      if (strip.data) paint(canvas, host, strip, film);
    });
  }

  const film = options.picture ? lazyPictures(options.picture, redraw) : null;

  strip.show = (data) => {
    const known = strip.data && strip.data.count === data.count && strip.data.times === data.times;
    strip.data = data;
    if (!known) {
      strip.axis = frameAxis(data.count, data.times);
      strip.view = { from: 0, to: whole(strip) };
      strip.frame = clamp(strip.frame, 0, Math.max(0, data.count - 1));
      strip.mark = null;
    }
    if (data.view) strip.view = { from: data.view[0], to: data.view[1] };
    const height = heights(strip, film).total;
    host.style.height = `${height}px`;
    describe(host, strip);
    redraw();
  };
  strip.go = (frame) => {
    strip.frame = clamp(Math.round(frame), 0, Math.max(0, strip.axis.count - 1));
    follow(strip);
    describe(host, strip);
    redraw();
    if (options.onFrame) options.onFrame(strip.frame);
  };
  strip.setMark = (mark) => {
    strip.mark = mark && mark[0] < mark[1] ? mark : null;
    redraw();
    if (options.onMark) options.onMark(strip.mark);
  };
  strip.look = (from, to) => {
    setView(strip, from, to);
    redraw();
  };
  strip.play = (on) => {
    if (on && !strip.playing) playFrom(strip);
    strip.playing = on;
  };
  strip.key = (event) => pressed(strip, event);
  strip.redraw = redraw;
  host.addEventListener("keydown", strip.key);

  listen(canvas, host, strip, options, film);
  new ResizeObserver(redraw).observe(host);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  return strip;
}

function whole(strip) {
  return Math.max(strip.axis.end, strip.data.end || 0);
}

function setView(strip, from, to) {
  const all = whole(strip);
  const least = (4 * strip.axis.end) / Math.max(strip.axis.count, 4);
  const span = clamp(to - from, Math.min(least, all), all);
  const start = clamp(from, 0, all - span);
  strip.view = { from: start, to: start + span };
}

// Keep the cursor in view, with something of what comes next.
function follow(strip) {
  const { from, to } = strip.view;
  const at = strip.axis.edge(strip.frame);
  const span = to - from;
  if (at < from) setView(strip, at - 0.2 * span, at + 0.8 * span);
  else if (strip.axis.edge(strip.frame + 1) > to) setView(strip, at - 0.8 * span, at + 0.2 * span);
}

function playFrom(strip) {
  const { axis, data } = strip;
  const begun = performance.now();
  const first = strip.frame >= axis.count - 1 ? 0 : strip.frame;
  const offset = axis.edge(first);
  let shown = first;
  strip.go(first);
  const step = (now) => {
    // Whoever moves the cursor ends the play.
    if (!strip.playing || strip.data.count !== data.count || strip.frame !== shown) {
      strip.playing = false;
      return;
    }
    const at = offset + ((now - begun) / 1000) * (axis.timed ? 1 : PLAIN_RATE);
    shown = axis.frameAt(at);
    if (shown !== strip.frame) strip.go(shown);
    if (shown >= axis.count - 1) strip.playing = false;
    else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

// The frames at which a stretch of any row begins, in order.
export function bordersOf(rows) {
  const found = new Set();
  for (const row of rows) for (const [start, end] of row.stretches || []) found.add(start).add(end);
  return [...found].sort((a, b) => a - b);
}

function pressed(strip, event) {
  if (!strip.data || event.ctrlKey || event.metaKey || event.altKey) return false;
  const { frame, axis, view } = strip;
  const borders = () => bordersOf(strip.data.rows).filter((one) => one < axis.count);
  const middle = axis.edge(frame);
  const zoom = (factor) => strip.look(middle - (middle - view.from) * factor, middle + (view.to - middle) * factor);
  const far = event.shiftKey ? JUMP : 1;
  const actions = {
    ArrowLeft: () => strip.go(frame - far),
    ArrowRight: () => strip.go(frame + far),
    Home: () => strip.go(0),
    End: () => strip.go(axis.count - 1),
    PageUp: () => strip.go(borders().findLast((one) => one < frame) ?? 0),
    PageDown: () => strip.go(borders().find((one) => one > frame) ?? axis.count - 1),
    "+": () => zoom(0.5),
    "-": () => zoom(2),
    0: () => strip.look(0, whole(strip)),
    " ": () => strip.play(!strip.playing),
    Escape: () => strip.setMark(null),
  };
  if (!Object.hasOwn(actions, event.key)) return false;
  event.preventDefault();
  actions[event.key]();
  return true;
}

function describe(host, strip) {
  const { frame, axis, data } = strip;
  const there = data.rows.flatMap((row) => {
    const found = (row.stretches || []).find(([start, end]) => start <= frame && frame < end);
    return found ? [`${row.name}: ${data.places[found[2]] ?? "none"}`] : [];
  });
  const time = axis.timed ? `, ${clock(axis.edge(frame), 0.01)}` : "";
  host.setAttribute("aria-valuemin", "0");
  host.setAttribute("aria-valuemax", String(Math.max(0, axis.count - 1)));
  host.setAttribute("aria-valuenow", String(frame));
  host.setAttribute("aria-valuetext", [`frame ${frame}${time}`, ...there].join(", "));
}

function listen(canvas, host, strip, options, film) {
  let drag = null;
  const at = (event) => {
    const { from, to } = strip.view;
    const x = event.clientX - canvas.getBoundingClientRect().left;
    return from + (x * (to - from)) / canvas.clientWidth;
  };
  const frameAt = (event) => strip.axis.frameAt(clamp(at(event), 0, strip.axis.end));
  // Of the borders between frames the nearest: a mark ends before one.
  const borderAt = (event) => {
    const frame = frameAt(event);
    const [start, end] = [strip.axis.edge(frame), strip.axis.edge(frame + 1)];
    return at(event) > (start + end) / 2 ? frame + 1 : frame;
  };
  const rowAt = (event) => {
    const y = event.clientY - canvas.getBoundingClientRect().top;
    return heights(strip, film).rows.findIndex(({ top, height }) => top <= y && y < top + height);
  };
  const grasped = (event) => {
    const row = rowAt(event);
    if (row < 0 || !strip.data.rows[row].drag || !options.onBorder) return null;
    const near = (GRASP * (strip.view.to - strip.view.from)) / canvas.clientWidth;
    const borders = bordersOf([strip.data.rows[row]]).filter((one) => one > 0 && one < strip.axis.count);
    const border = borders.find((one) => Math.abs(strip.axis.edge(one) - at(event)) <= near);
    return border === undefined ? null : { row, border };
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (!strip.data || event.button) return;
    host.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    const border = grasped(event);
    const onRow = rowAt(event) >= 0 && options.onMark;
    drag = { border, from: onRow ? borderAt(event) : null, moved: false, x: event.clientX };
    if (border) return;
    strip.play(false);
    strip.go(frameAt(event));
    if (onRow) strip.setMark(null);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!strip.data) return;
    if (!drag) {
      canvas.style.cursor = grasped(event) ? "ew-resize" : "default";
      return;
    }
    drag.moved ||= Math.abs(event.clientX - drag.x) > 3;
    if (!drag.moved) return;
    if (drag.border) options.onBorder(drag.border.row, drag.border.border, borderAt(event), false);
    else if (drag.from === null) strip.go(frameAt(event));
    else strip.setMark([Math.min(drag.from, borderAt(event)), Math.max(drag.from, borderAt(event))]);
  });
  const released = (event) => {
    if (drag?.border && drag.moved) options.onBorder(drag.border.row, drag.border.border, borderAt(event), true);
    drag = null;
  };
  canvas.addEventListener("pointerup", released);
  canvas.addEventListener("pointercancel", released);
  canvas.addEventListener("wheel", (event) => {
    // Without a key the wheel moves the page, as everywhere.
    const sideways = Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (!strip.data || !(event.ctrlKey || event.shiftKey || sideways)) return;
    event.preventDefault();
    const { from, to } = strip.view;
    if (event.ctrlKey) {
      const factor = 1.2 ** Math.sign(event.deltaY);
      strip.look(at(event) - (at(event) - from) * factor, at(event) + (to - at(event)) * factor);
    } else {
      const by = ((event.deltaX || event.deltaY) * (to - from)) / canvas.clientWidth;
      strip.look(from + by, to + by);
    }
  }, { passive: false });
}
