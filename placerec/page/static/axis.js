// From frames to seconds and pixels, and back.

const STEPS = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200];

// Where the `count` frames lie on the axis: `edge(frame)` in seconds from the first frame, or in frames where they have
// no `times`; `edge(count)` is where the last one ends. `frameAt` is its inverse.
export function frameAxis(count, times) {
  if (!times || !count || Number.isNaN(times[0])) {
    const frameAt = (at) => clamp(Math.floor(at), 0, count - 1);
    return { count, timed: false, end: Math.max(count, 1), edge: (frame) => frame, frameAt };
  }
  const last = times[count - 1] - times[0];
  const end = last + (middleStep(times, count) || 1);
  const edge = (frame) => (frame < count ? times[frame] - times[0] : end);
  return { count, timed: true, end, edge, frameAt: (at) => lastNotAfter(times, count, at + times[0]) };
}

export function clamp(value, low, high) {
  return Math.max(low, Math.min(high, value));
}

function middleStep(times, count) {
  const steps = [];
  const stride = Math.max(1, Math.floor(count / 999));
  for (let frame = 1; frame < count; frame += stride) steps.push(times[frame] - times[frame - 1]);
  return steps.sort((a, b) => a - b)[steps.length >> 1];
}

function lastNotAfter(times, count, seconds) {
  let [low, high] = [0, count];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    // The seconds since 1970 have no more digits than this.
    if (times[middle] <= seconds + 5e-7) low = middle;
    else high = middle;
  }
  return low;
}

// The ticks of an axis between two places of it, at most one every `apart` of them: [place, text].
export function ticks(from, to, apart, timed) {
  let step = STEPS.find((one) => one >= apart);
  if (apart < 1 && timed) step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1].find((one) => one >= apart);
  if (!step || (!timed && step > 20)) {
    const power = 10 ** Math.floor(Math.log10(apart));
    step = power * [1, 2, 5, 10].find((one) => one * power >= apart);
  }
  const found = [];
  for (let at = Math.ceil(from / step - 1e-9); at * step <= to; at += 1) {
    found.push([at * step, timed ? clock(at * step, step) : String(at * step)]);
  }
  return found;
}

// Seconds as people read them: 7.2 s, 1:07, 1:02:07; `step`: what must be told apart.
export function clock(seconds, step = 1) {
  const digits = step < 1 ? Math.ceil(-Math.log10(step)) : 0;
  const whole = Number(seconds.toFixed(digits));
  if (whole < 60) return `${whole.toFixed(digits)} s`;
  const rest = (whole % 60).toFixed(digits).padStart(digits ? 3 + digits : 2, "0");
  const minutes = Math.floor(whole / 60);
  if (minutes < 60) return `${minutes}:${rest}`;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${rest}`;
}
