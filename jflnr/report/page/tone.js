// From numbers to colours.

const toSrgb = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const TONES = {
  gamma: (v) => v ** (1 / 2.2),
  srgb: toSrgb,
  reinhard: (v) => toSrgb(v / (1 + v)),
  filmic: (v) => toSrgb((v * (2.51 * v + 0.03)) / (v * (2.43 * v + 0.59) + 0.14)),
};

// Seventeen points of matplotlib's magma (CC0), as FLIP's own tools show it.
const MAGMA = (
  "000004 0a0822 1d1147 36106b 51127c 6a1c81 832681 9c2e7f b73779 d0416f e75263 " +
  "f56b5c fc8961 fea772 fec488 fde2a3 fcfdbf"
)
  .split(" ")
  .map((hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16)));

/** [R, G, B] for a share of 0..1. */
function magma(share) {
  const place = 16 * Math.min(Math.max(share, 0), 1),
    low = Math.min(Math.floor(place), 15);
  return MAGMA[low].map((v, c) => Math.round(v + (place - low) * (MAGMA[low + 1][c] - v)));
}

// Decades that the map of errors spans, as powers of ten.
const ERROR_RANGE = [-4, 1];
const MAPS = {
  error: {
    name: "relative squared error",
    title: "relative squared error of the reflected indirect light (logarithmic)",
    labels: ["1e-4", "1e-3", "0.01", "0.1", "1", "10"],
    share: (v) => (Math.log10(v) - ERROR_RANGE[0]) / (ERROR_RANGE[1] - ERROR_RANGE[0]),
  },
  flip: {
    name: "FLIP",
    title: "FLIP of the reflected indirect light, at the exposure of the metrics",
    labels: ["0", "0.2", "0.4", "0.6", "0.8", "1"],
  },
  told: {
    name: "error told by the method",
    title: "standard error that the method tells, over the mean brightness (logarithmic)",
    labels: ["1e-3", "0.01", "0.1", "1", "10"],
  },
  plan: {
    name: "where it is refined",
    title: "where method auto fits its finest models",
    labels: ["not refined", "refined"],
  },
};

/**
 * Display value 0..255 for the upper 16 bits of a float: 2^-9 of its value is far less than one
 * step. Not-a-numbers are shown black.
 */
function toneTable(scale, tone) {
  const bits = new Uint32Array(1),
    value = new Float32Array(bits.buffer);
  const table = new Uint8ClampedArray(65536);
  for (let i = 0; i < 65536; i++) {
    bits[0] = i << 16;
    const light = Math.max(value[0] * scale, 0);
    table[i] = light === Infinity ? 255 : 255 * Math.min(TONES[tone](light), 1);
  }
  return table;
}

function paintRadiance(pixels, values, table) {
  const bits = new Uint32Array(values.buffer),
    count = values.length / 3;
  for (let i = 0, at = 0; i < count; i++) {
    pixels[at++] = table[((bits[i] + 0x8000) >>> 16) & 65535];
    pixels[at++] = table[((bits[i + count] + 0x8000) >>> 16) & 65535];
    pixels[at++] = table[((bits[i + 2 * count] + 0x8000) >>> 16) & 65535];
    pixels[at++] = 255;
  }
}

function paintMap(pixels, values, share) {
  const colours = Array.from({ length: 256 }, (_, i) => [...magma(i / 255), 255]);
  values.forEach((value, i) => {
    const index = Math.round(255 * Math.min(Math.max(share(value), 0), 1)) || 0; // NaN: the darkest
    pixels.set(colours[index], 4 * i);
  });
}

/** The image as a canvas of its own size, painted anew only when a setting changes. */
function canvasOf(scene, image, { view, map, tone, stops, frame }) {
  if (image.frames) return image.frames[frame];
  const shown = mapShown(scene, image, map);
  const key = shown === "image" ? [view, tone, stops].join() : shown;
  const old = image.canvases[shown];
  if (old?.key === key) return old.canvas;
  const canvas = old?.canvas ?? new OffscreenCanvas(scene.width, scene.height);
  const context = canvas.getContext("2d");
  const data = context.createImageData(scene.width, scene.height);
  if (shown === "image") {
    const table = toneTable(scene.exposures[view] * 2 ** stops, tone);
    paintRadiance(data.data, radianceOf(scene, image, view), table);
  } else if (shown === "error") paintMap(data.data, errorOf(scene, image), MAPS.error.share);
  else paintMap(data.data, image.maps[shown], (v) => v / 255);
  context.putImageData(data, 0, 0);
  image.canvases[shown] = { key, canvas };
  return canvas;
}

/** The map to show of this image; the reference and what has no map are shown themselves. */
function mapShown(scene, image, map) {
  const there = map === "error" ? scene.reference && image !== scene.reference : image.maps[map];
  return there ? map : "image";
}
