// What Python packed of the drives (placerec/page/drives.py), and which moments of them are worth a look.

export const SURE = 100; // how many of the least sure moments are stepped through

// The page's data with arrays in place of packed texts.
export function unpackReport(text) {
  const data = JSON.parse(text);
  for (const drive of data.drives) {
    const count = drive.frames.length;
    drive.count = count;
    drive.times = drive.times && new Float64Array(bytesOf(drive.times));
    drive.truth = spread(drive.truth, count);
    drive.pictures = drive.pictures || [[], []];
    for (const system of drive.systems.filter(Boolean)) {
      for (const name of ["best", "judged", "selected", "words"]) system[name] = spread(system[name], count);
      system.belief = Float32Array.from(new Uint16Array(bytesOf(system.belief)), (value) => value / 65535);
      system.reasons = system.reasons || {};
    }
  }
  return data;
}

function bytesOf(packed) {
  return Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0)).buffer;
}

// Runs [value, how often, ...] one by one.
function spread(runs, count) {
  const values = new Int32Array(count);
  let at = 0;
  for (let run = 0; run < runs.length; run += 2) {
    values.fill(runs[run], at, at + runs[run + 1]);
    at += runs[run + 1];
  }
  return values;
}

// Values one by one as stretches [start, end, value].
export function stretchesOf(values) {
  const found = [];
  for (let frame = 0; frame < values.length; frame += 1) {
    const last = found.at(-1);
    if (last && last[2] === values[frame]) last[1] = frame + 1;
    else found.push([frame, frame + 1, values[frame]]);
  }
  return found;
}

// The belief in what a system decided at each frame.
export function surenessOf(system, places) {
  return Float32Array.from(system.best, (best, frame) => system.belief[frame * places.length + best]);
}

// What can be stepped through: of each kind a title, and whether a frame of a drive is meant. `second`: it needs two
// systems.
export const KINDS = {
  all: { title: "all frames", meant: () => () => true },
  errors: { title: "errors", key: "e", meant: (one) => (frame) => one.judged[frame] === 0 },
  changes: {
    title: "changes of place",
    key: "c",
    meant: (one, other, drive) => (frame) =>
      frame > 0 && (drive.truth[frame] !== drive.truth[frame - 1] || one.best[frame] !== one.best[frame - 1]),
  },
  unsure: { title: "least sure first", key: "u", meant: () => () => true },
  first: {
    title: "only the first is right", second: true,
    meant: (one, other) => (frame) => one.judged[frame] === 1 && other.judged[frame] === 0,
  },
  second: {
    title: "only the second is right", second: true,
    meant: (one, other) => (frame) => one.judged[frame] === 0 && other.judged[frame] === 1,
  },
  differ: {
    title: "they differ", second: true, key: "d",
    meant: (one, other) => (frame) => one.best[frame] !== other.best[frame],
  },
};

// The frames of a drive that are meant, for the systems number `a` and `b` (-1: none) and a place (-1: any).
export function meantFrames(drive, kind, a, b, place) {
  const [one, other] = [drive.systems[a], drive.systems[b]];
  if (!one || (KINDS[kind].second && !other)) return [];
  const meant = KINDS[kind].meant(one, other, drive);
  const there = (frame) =>
    place < 0 || drive.truth[frame] === place || one.best[frame] === place || (other && other.best[frame] === place);
  return [...drive.truth.keys()].filter((frame) => there(frame) && meant(frame));
}

// The moments to step through, [drive number, frame]: where runs of meant frames begin, or the least sure ones.
export function momentsOf(data, kind, a, b, place) {
  const found = data.drives.flatMap((drive, number) => {
    const frames = meantFrames(drive, kind, a, b, place);
    if (kind === "unsure") return leastSure(drive, data, a, frames).map((one) => [number, ...one]);
    return (kind === "all" ? frames : runStarts(drive, a, b, frames)).map((frame) => [number, frame]);
  });
  if (kind !== "unsure") return found;
  return found.sort((x, y) => x[2] - y[2]).slice(0, SURE).map(([number, frame]) => [number, frame]);
}

// A run goes on while the same is decided.
function runStarts(drive, a, b, frames) {
  return frames.filter((frame, at) => {
    const goesOn = at > 0 && frames[at - 1] === frame - 1;
    const systems = [a, b].map((number) => drive.systems[number]).filter(Boolean);
    return !goesOn || systems.some(({ best }) => best[frame] !== best[frame - 1]);
  });
}

// Frames that are less sure than those before and after: [frame, belief].
function leastSure(drive, data, a, frames) {
  const sureness = surenessOf(drive.systems[a], data.places);
  const lower = (frame, other) => !(sureness[other] < sureness[frame]);
  return frames
    .filter((frame) => lower(frame, frame - 1) && lower(frame, frame + 1) && sureness[frame] !== sureness[frame - 1])
    .map((frame) => [frame, sureness[frame]]);
}

// The number of the shown picture that is nearest to a frame, -1 without pictures.
export function nearestPicture(drive, frame) {
  const [at] = drive.pictures;
  let [low, high] = [0, at.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (at[middle] < frame) low = middle + 1;
    else high = middle;
  }
  if (!at.length) return -1;
  if (low === at.length) return low - 1;
  return low > 0 && frame - at[low - 1] < at[low] - frame ? low - 1 : low;
}
