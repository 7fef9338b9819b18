// Stretches of a drive that are in a place: [start, end, place], in order, apart; frames start to end - 1 are in it.
// Every function gives back another list and leaves the one it is given as it is.

// The number of the stretch that holds a frame, -1 if none does.
export function stretchAt(stretches, frame) {
  return stretches.findIndex(([start, end]) => start <= frame && frame < end);
}

// What a frame's stretch is, also where it has no label: [start, end, place or ""].
export function pieceAt(stretches, frame, count) {
  const number = stretchAt(stretches, frame);
  if (number >= 0) return stretches[number];
  const before = stretches.findLast(([, end]) => end <= frame);
  const after = stretches.find(([start]) => start > frame);
  return [before ? before[1] : 0, after ? after[0] : count, ""];
}

// Frames `from` to `to` - 1 are in `place`, or have no label if that is "".
export function labelled(stretches, from, to, place) {
  const rest = stretches.flatMap(([start, end, name]) => [
    [start, Math.min(end, from), name],
    [Math.max(start, to), end, name],
  ]);
  const kept = rest.filter(([start, end]) => start < end);
  if (!place || from >= to) return sorted(kept);
  const before = kept.find(([, end, name]) => end === from && name === place);
  const after = kept.find(([start, , name]) => start === to && name === place);
  const whole = [before ? before[0] : from, after ? after[1] : to, place];
  return sorted([...kept.filter((one) => one !== before && one !== after), whole]);
}

function sorted(stretches) {
  return stretches.sort((one, other) => one[0] - other[0]);
}

// The stretch that holds `frame` is two from there on, which can be in two places.
export function split(stretches, frame) {
  return stretches.flatMap(([start, end, place]) =>
    start < frame && frame < end ? [[start, frame, place], [frame, end, place]] : [[start, end, place]]);
}

// The stretch that holds `frame` goes on over the next one, or over what has no label behind it.
export function joined(stretches, frame, count) {
  const number = stretchAt(stretches, frame);
  if (number < 0) return stretches;
  const [start, end, place] = stretches[number];
  const next = stretches[number + 1];
  const to = !next ? count : next[0] === end ? next[1] : next[0];
  return [...stretches.slice(0, number), [start, to, place], ...stretches.slice(number + (next && to === next[1] ? 2 : 1))];
}

// The border between two stretches, or between one and what has no label, is at `frame` in place of `border`; no
// stretch goes.
export function movedBorder(stretches, border, frame, count) {
  const left = stretches.find(([, end]) => end === border);
  const right = stretches.find(([start]) => start === border);
  if (!left && !right) return stretches;
  const before = stretches.findLast(([, end]) => end < border || (end === border && !left));
  const after = stretches.find(([start]) => start > border);
  const low = left ? left[0] + 1 : before ? before[1] : 0;
  const high = right ? right[1] - 1 : after ? after[0] : count;
  const to = Math.max(low, Math.min(high, frame));
  return stretches.map((one) => (one === left ? [one[0], to, one[2]] : one === right ? [to, one[1], one[2]] : one));
}

// The place `old` is called `name` in all stretches.
export function renamed(stretches, old, name) {
  return stretches.map(([start, end, place]) => [start, end, place === old ? name : place]);
}

// How many frames each place has: a Map.
export function framesOf(stretches) {
  const found = new Map();
  for (const [start, end, place] of stretches) found.set(place, (found.get(place) || 0) + end - start);
  return found;
}

// The stretches without a label.
export function gaps(stretches, count) {
  const found = [];
  let from = 0;
  for (const [start, end] of [...stretches, [count, count]]) {
    if (start > from) found.push([from, start]);
    from = end;
  }
  return found;
}
