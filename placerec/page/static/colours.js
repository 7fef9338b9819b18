// The colours of places: those of the still pictures (placerec/figures/canvas.py), and hatching from the thirteenth on.

// Okabe & Ito (2008) and Tol's muted scheme: the first few are furthest apart for any colour vision.
export const PALETTE = [
  "#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#332288", "#f0e442",
  "#d55e00", "#0072b2", "#999933", "#882255", "#ddcc77", "#999999",
];
export const UNKNOWN = "unknown";
const GREY = "#c7c7c7";
const TILE = 8;

// The colour of the place with this index among `places`.
export function colourOf(places, index) {
  return places[index] === UNKNOWN ? GREY : PALETTE[index % PALETTE.length];
}

// Black or white, whichever is read better on a colour.
export function letterColour(colour) {
  const [red, green, blue] = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255);
  return 0.299 * red + 0.587 * green + 0.114 * blue > 0.45 ? "#000000" : "#ffffff";
}

// What fills the stretches of a place on a canvas: the colour, hatched where twelve places before have had it.
export function fillOf(context, places, index) {
  const colour = colourOf(places, index);
  const round = Math.floor(index / PALETTE.length);
  return round && places[index] !== UNKNOWN ? hatched(context, colour, letterColour(colour), round) : colour;
}

// What fills stretches without a label.
export function emptyFill(context, ground, line) {
  return hatched(context, ground, line, 1);
}

function hatched(context, ground, line, round) {
  const tile = new OffscreenCanvas(TILE, TILE);
  const pen = tile.getContext("2d");
  pen.fillStyle = ground;
  pen.fillRect(0, 0, TILE, TILE);
  pen.strokeStyle = line;
  pen.globalAlpha = 0.55;
  for (const [x, y, dx, dy] of HATCHES[(round - 1) % HATCHES.length]) {
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + dx, y + dy);
    pen.stroke();
  }
  return context.createPattern(tile, "repeat");
}

// Lines of a tile: x, y, and how far they go.
const RISING = [[-2, 2, 4, -4], [0, 8, 8, -8], [6, 10, 4, -4]];
const FALLING = [[-2, 6, 4, 4], [0, 0, 8, 8], [6, -2, 4, 4]];
const HATCHES = [RISING, FALLING, [...RISING, ...FALLING], [[0, 4, 8, 0]], [[4, 0, 0, 8]]];

// An element that shows the colour of a place: for legends and buttons.
export function swatch(places, index) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 16;
  canvas.className = "swatch";
  canvas.setAttribute("aria-hidden", "true");
  const context = canvas.getContext("2d");
  context.fillStyle = fillOf(context, places, index);
  context.fillRect(0, 0, 16, 16);
  return canvas;
}
