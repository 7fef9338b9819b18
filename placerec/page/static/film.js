// Pictures of frames along the axis, fetched when they are looked at.

const KEPT = 400;
const PATIENCE = 60; // milliseconds that a view must last before its pictures are asked for

// `address(frame)`: where the picture of a frame is; `changed()`: called when one has come.
export function lazyPictures(address, changed) {
  const known = new Map();
  let wanted = [];
  let timer = 0;

  function ask() {
    for (const [frame, image] of known) {
      // Whoever scrolls on waits for no picture that has gone by.
      if (!image.complete && !wanted.includes(frame)) {
        image.src = "";
        known.delete(frame);
      }
    }
    for (const frame of wanted.filter((one) => !known.has(one))) {
      const image = new Image();
      image.onload = changed;
      image.src = address(frame);
      known.set(frame, image);
    }
    for (const frame of [...known.keys()].slice(0, Math.max(0, known.size - KEPT))) {
      if (!wanted.includes(frame)) known.delete(frame);
    }
  }

  return {
    // The picture of a frame if it is there.
    get(frame) {
      const image = known.get(frame);
      return image && image.complete && image.naturalWidth ? image : null;
    },
    // Ask for the pictures of these frames, and for no others any more.
    want(frames) {
      wanted = frames;
      clearTimeout(timer);
      timer = setTimeout(ask, PATIENCE);
    },
  };
}

// Which frames stand where in a film of this width: [left, frame] of slots `wide` pixels each.
export function slots(axis, view, width, wide) {
  const scale = (view.to - view.from) / width;
  const first = axis.frameAt(Math.max(view.from, 0));
  const last = axis.frameAt(Math.min(view.to, axis.end));
  // The same pictures serve while one zooms and moves.
  const stride = 2 ** Math.max(0, Math.floor(Math.log2(((last - first + 1) * wide) / width / 2)));
  const found = [];
  for (let left = 0; left < width; left += wide) {
    const at = view.from + left * scale;
    const middle = Math.min(at + (wide / 2) * scale, axis.end);
    if (at >= 0 && at < axis.end) found.push([left, Math.floor(axis.frameAt(middle) / stride) * stride]);
  }
  return found;
}
