// The stage: where images lie, and how hands move them.

const $ = (id) => document.getElementById(id);
const state = {
  scene: null,
  left: null,
  right: null, // which images
  layout: "split",
  split: 0.5,
  view: "reflected",
  map: "image",
  tone: "gamma",
  stops: 0,
  zoom: 1,
  x: 0,
  y: 0, // screen pixels per image pixel; the point of the image in the middle
  pointer: null, // the pixel [x, y] under the pointer
  frame: 0,
  playing: null, // of a shot; an object for each time that it is played
};

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** Rectangles of the stage in screen pixels, each with the image that it shows. */
function panes() {
  const { clientWidth: width, clientHeight: height } = $("canvas");
  if (state.layout !== "grid") return [{ image: state.left, x: 0, y: 0, width, height }];
  const { images } = state.scene;
  const shape = width / height / (state.scene.width / state.scene.height);
  const columns = clamp(Math.round(Math.sqrt(images.length * shape)), 1, images.length);
  const rows = Math.ceil(images.length / columns);
  return images.map((image, i) => ({
    image,
    x: ((i % columns) * width) / columns,
    y: (Math.floor(i / columns) * height) / rows,
    width: width / columns - 2,
    height: height / rows - 2,
  }));
}

function fit() {
  const [{ width, height }] = panes();
  state.zoom = Math.min(width / state.scene.width, height / state.scene.height);
  [state.x, state.y] = [state.scene.width / 2, state.scene.height / 2];
  refresh();
}

function draw() {
  const canvas = $("canvas"),
    ratio = devicePixelRatio;
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  for (const pane of panes()) drawPane(context, pane, pane.image, pane.x, pane.width);
  if (state.layout === "split") {
    const [pane] = panes(),
      from = state.split * pane.width;
    context.clearRect(from, 0, pane.width - from, pane.height);
    drawPane(context, pane, state.right, from, pane.width - from);
  }
}

/** One image in its pane, clipped to the columns `from` to `from + width`. */
function drawPane(context, pane, image, from, width) {
  const { zoom, x, y, scene } = state;
  context.save();
  context.beginPath();
  context.rect(from, pane.y, width, pane.height);
  context.clip();
  context.imageSmoothingEnabled = zoom * devicePixelRatio < 1;
  context.imageSmoothingQuality = "high";
  context.drawImage(
    canvasOf(scene, image, state),
    pane.x + pane.width / 2 - x * zoom,
    pane.y + pane.height / 2 - y * zoom,
    scene.width * zoom,
    scene.height * zoom,
  );
  if (state.layout !== "single") drawName(context, pane, image, from, width);
  context.restore();
}

function drawName(context, pane, image, from, width) {
  const right = state.layout === "split" && image === state.right && from > 0;
  context.font = "13px system-ui, sans-serif";
  const length = context.measureText(image.name).width;
  const at = right ? from + width - length - 12 : from + 6;
  context.fillStyle = "#000a";
  context.fillRect(at - 4, pane.y + 5, length + 8, 20);
  context.fillStyle = "#fff";
  context.fillText(image.name, at, pane.y + 19);
}

function paneAt(px, py) {
  const inside = (p) => px >= p.x && px < p.x + p.width && py >= p.y && py < p.y + p.height;
  return panes().find(inside) ?? panes()[0];
}

/** The point of the image under a point of the stage. */
function toImage(px, py) {
  const pane = paneAt(px, py);
  return [
    (px - pane.x - pane.width / 2) / state.zoom + state.x,
    (py - pane.y - pane.height / 2) / state.zoom + state.y,
  ];
}

/** Zoom by `factor`; the point of the image under (px, py) stays there. */
function zoomAt(px, py, factor) {
  const [x, y] = toImage(px, py),
    old = state.zoom;
  state.zoom = clamp(old * factor, 0.05, 100);
  state.x = x + (state.x - x) * (old / state.zoom);
  state.y = y + (state.y - y) * (old / state.zoom);
  refresh();
}

function move(dx, dy) {
  state.x = clamp(state.x - dx / state.zoom, 0, state.scene.width);
  state.y = clamp(state.y - dy / state.zoom, 0, state.scene.height);
  refresh();
}

function setSplit(share) {
  state.split = clamp(share, 0, 1);
  refresh();
}

function point(px, py) {
  const [x, y] = toImage(px, py).map(Math.floor);
  const inside = x >= 0 && y >= 0 && x < state.scene.width && y < state.scene.height;
  state.pointer = inside ? [x, y] : null;
  refresh();
}

/** One pointer moves, two zoom; the wheel zooms; the line between the halves is dragged. */
function listenToPointers() {
  const canvas = $("canvas"),
    divider = $("divider"),
    down = new Map();
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const middle = ([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
  const distance = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1]);
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, place(event));
    point(...place(event));
  });
  canvas.addEventListener("pointermove", (event) => {
    const old = down.get(event.pointerId),
      now = place(event);
    if (!old || down.size === 1) point(...now);
    if (!old) return;
    const before = [...down.values()];
    down.set(event.pointerId, now);
    if (down.size === 1) return move(now[0] - old[0], now[1] - old[1]);
    const after = [...down.values()];
    const from = middle(before),
      to = middle(after);
    zoomAt(...from, distance(after) / Math.max(distance(before), 1));
    move(to[0] - from[0], to[1] - from[1]);
  });
  for (const kind of ["pointerup", "pointercancel"])
    canvas.addEventListener(kind, (event) => down.delete(event.pointerId));
  canvas.addEventListener("pointerleave", () => {
    state.pointer = null;
    refresh();
  });
  canvas.addEventListener("dblclick", fit);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      zoomAt(...place(event), Math.exp(-0.002 * event.deltaY * (event.deltaMode ? 30 : 1)));
    },
    { passive: false },
  );
  divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
  divider.addEventListener("pointermove", (event) => {
    if (divider.hasPointerCapture(event.pointerId)) setSplit(place(event)[0] / canvas.clientWidth);
  });
  // After dragging, the arrows flip images again; who came by Tab moves the line with them.
  divider.addEventListener("pointerup", () => divider.blur());
}
