// From the text of the page to numbers: planes of R, G and B in one Float32Array per layer.

const HALVES = (() => {
  const table = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const sign = bits & 0x8000 ? -1 : 1,
      exponent = (bits >> 10) & 31,
      fraction = bits & 1023;
    if (exponent === 31) table[bits] = fraction ? NaN : sign * Infinity;
    else if (exponent === 0) table[bits] = sign * fraction * 2 ** -24;
    else table[bits] = sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
  }
  return table;
})();

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The high bytes of all half floats come first, then the low ones; `unit` is what 1 means. */
async function unpack(text, unit) {
  const bytes = await inflate(text);
  const count = bytes.length / 2;
  const values = new Float32Array(count);
  for (let i = 0; i < count; i++) values[i] = unit * HALVES[(bytes[i] << 8) | bytes[count + i]];
  return values;
}

async function loadPicture(text) {
  const picture = new Image();
  picture.src = `data:image/png;base64,${text}`;
  await picture.decode();
  return picture;
}

/** One version of a scene with its numbers, and maps of 0..255; of a shot, with its pictures. */
async function loadImage(stored, unit) {
  const image = { ...stored, maps: {}, canvases: {}, radiance: {} };
  if (stored.frames) image.frames = await Promise.all(stored.frames.map(loadPicture));
  else image.light = await unpack(stored.light, unit);
  for (const [name, text] of Object.entries(stored.maps)) image.maps[name] = await inflate(text);
  return image;
}

/** A scene with its numbers, from what the page holds, or from where it is. */
async function loadScene(stored) {
  if (stored.from) stored = await stored.from();
  const scene = { ...stored, layers: {}, images: [] };
  for (const [name, text] of Object.entries(stored.layers))
    scene.layers[name] = await unpack(text, name === "albedo" ? 1 : stored.unit);
  for (const image of stored.images) scene.images.push(await loadImage(image, stored.unit));
  if (!scene.rate) scene.reference = scene.images.find((image) => image.name === "reference");
  return scene;
}

/** Linear values of one view of an image: `reflected`, `picture` or `light`. */
function radianceOf(scene, image, view) {
  const { albedo, direct, emission } = scene.layers;
  if (view === "light" || !albedo) return image.light;
  return (image.radiance[view] ??= image.light.map((value, i) =>
    view === "reflected"
      ? albedo[i] * value
      : albedo[i] * (direct ? direct[i] + value : value) + (emission ? emission[i] : 0),
  ));
}

/** (x - y)^2 / (y^2 + epsilon mean(y)^2), mean over channels: its mean is the table's rMSE. */
function errorOf(scene, image) {
  return (image.error ??= (() => {
    const x = radianceOf(scene, image, "reflected");
    const y = radianceOf(scene, scene.reference, "reflected");
    const mean = y.reduce((sum, value) => sum + value, 0) / y.length;
    const floor = CONTENT.epsilon * mean * mean;
    const ratio = (i) => (x[i] === y[i] ? 0 : (x[i] - y[i]) ** 2 / (y[i] ** 2 + floor));
    const count = scene.width * scene.height;
    return Float32Array.from(
      { length: count },
      (_, i) => (ratio(i) + ratio(i + count) + ratio(i + 2 * count)) / 3,
    );
  })());
}
