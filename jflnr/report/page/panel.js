// What stands around the stage: settings, images with pixel values, the colour bar, crops.

const VIEWS = {
  reflected: "indirect, reflected",
  picture: "whole picture",
  light: "indirect, without albedo",
};

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes))
    name in made ? (made[name] = value) : made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** Brightness `stops` above the exposure of the metrics. */
function setStops(stops) {
  state.stops = clamp(stops, -8, 8);
  refresh();
}

function choose(side, image) {
  state[side] = image;
  refresh();
}

function listenToControls() {
  for (const name of ["layout", "view", "map", "tone"])
    $(name).addEventListener("change", () => {
      state[name] = $(name).value;
      name === "layout" ? fit() : refresh();
    });
  $("exposure").addEventListener("input", () => setStops(Number($("exposure").value)));
  $("reset").addEventListener("click", reset);
  $("play").addEventListener("click", () => play());
  $("frame").addEventListener("input", () => hold(Number($("frame").value)));
}

function reset() {
  Object.assign(state, { stops: 0, tone: "gamma", map: "image", split: 0.5 });
  fit();
}

/** Lists that depend on the scene. */
function buildPanel() {
  const { scene } = state;
  const views = Object.keys(VIEWS).filter((view) => view in scene.exposures);
  $("view").replaceChildren(
    ...views.map((view) => element("option", { value: view }, VIEWS[view])),
  );
  $("view").parentElement.hidden = views.length < 2;
  for (const name of ["tone", "exposure"]) $(name).parentElement.hidden = Boolean(scene.rate);
  if (!views.includes(state.view)) state.view = views[0];
  const there = (map) => scene.images.some((image) => mapShown(scene, image, map) === map);
  const maps = Object.entries(MAPS).filter(([map]) => there(map));
  $("map").replaceChildren(
    element("option", { value: "image" }, "image"),
    ...maps.map(([map, { name }]) => element("option", { value: map }, name)),
  );
  $("map").parentElement.hidden = !maps.length;
  if (!there(state.map)) state.map = "image";
  $("images").replaceChildren(
    ...scene.images.map((image, i) => {
      const pick = { type: "button", className: "left", onclick: () => choose("left", image) };
      const other = { type: "button", className: "right", onclick: () => choose("right", image) };
      return element(
        "li",
        {},
        element("button", pick, element("kbd", {}, String(i + 1)), ` ${image.name}`),
        element("button", { ...other, title: `${image.name} on the right` }, "right"),
        element("span", { className: "value" }),
      );
    }),
  );
}

/** Everything that shows a setting, brought up to date. */
function showPanel() {
  for (const name of ["layout", "view", "map", "tone"]) $(name).value = state[name];
  $("exposure").value = state.stops;
  $("stops").textContent = `${state.stops > 0 ? "+" : ""}${state.stops} EV`;
  const percent = Math.round(100 * state.split);
  $("divider").hidden = state.layout !== "split";
  $("divider").style.left = `${100 * state.split}%`;
  $("divider").setAttribute("aria-valuenow", percent);
  $("canvas").setAttribute(
    "aria-label",
    state.layout === "split"
      ? `${state.left.name} left, ${state.right.name} right`
      : state.left.name,
  );
  showImages();
  showPlayer();
  showBar();
}

function showImages() {
  const { scene, pointer } = state;
  const place = pointer ? `pixel ${pointer.join(", ")}` : "point at a pixel to read it";
  $("place").textContent = scene.rate ? scene.frames[state.frame] : place;
  [...$("images").children].forEach((row, i) => {
    const [left, right, value] = row.children,
      image = scene.images[i];
    left.setAttribute("aria-pressed", image === state.left);
    right.setAttribute("aria-pressed", image === state.right);
    right.hidden = state.layout !== "split";
    if (scene.rate) value.textContent = errorText(image);
    else value.textContent = pointer ? pixelText(scene, image, pointer) : "";
  });
}

function pixelText(scene, image, [x, y]) {
  const at = y * scene.width + x,
    count = scene.width * scene.height;
  const values = radianceOf(scene, image, state.view);
  const text = [0, 1, 2].map((c) => number(values[at + c * count])).join("  ");
  if (!scene.reference || image === scene.reference) return text;
  const error = `\nerror ${number(errorOf(scene, image)[at])}`;
  return text + error + (image.maps.flip ? `  FLIP ${number(image.maps.flip[at] / 255)}` : "");
}

function number(value) {
  if (typeof value !== "number") return value == null ? "–" : String(value);
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "NaN" : value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e9) return String(value);
  return size < 1e-3 || size >= 1e5 ? value.toExponential(2) : value.toPrecision(4);
}

function showBar() {
  const map = MAPS[state.map];
  $("bar").hidden = !map;
  if (!map) return;
  const context = $("bar-colours").getContext("2d");
  for (let i = 0; i < 256; i++) {
    context.fillStyle = `rgb(${magma(i / 255).join()})`;
    context.fillRect(i, 0, 1, 1);
  }
  $("bar-labels").replaceChildren(...map.labels.map((label) => element("span", {}, label)));
  $("bar-title").textContent = map.title;
}

/** One row per crop, one tile per image; a click looks at the place in that image. */
function buildCrops() {
  const { scene } = state;
  $("crops").hidden = !scene.crops.length;
  $("crop-rows").replaceChildren(
    ...scene.crops.map((crop) => {
      const tiles = scene.images.map((image) =>
        element(
          "button",
          { type: "button", className: "tile", onclick: () => lookAt(crop, image) },
          element("canvas", { width: crop.size, height: crop.size, ariaHidden: "true" }),
          element("span", { className: "name" }, image.name),
        ),
      );
      const remove = () => {
        scene.crops = scene.crops.filter((c) => c !== crop);
        buildCrops();
      };
      const label = `Remove the crop at ${crop.x}, ${crop.y}`;
      return element(
        "div",
        { className: "crop" },
        ...tiles,
        element(
          "button",
          { type: "button", className: "remove", ariaLabel: label, onclick: remove },
          "×",
        ),
      );
    }),
  );
  showCrops();
}

function showCrops() {
  const { scene } = state;
  [...$("crop-rows").children].forEach((row, i) => {
    const { x, y, size } = scene.crops[i];
    scene.images.forEach((image, j) => {
      const context = row.children[j].querySelector("canvas").getContext("2d");
      context.clearRect(0, 0, size, size);
      context.drawImage(canvasOf(scene, image, state), -x, -y);
    });
  });
}

function lookAt(crop, image) {
  const [pane] = panes();
  state.left = image;
  state.zoom = (0.8 * Math.min(pane.width, pane.height)) / crop.size;
  [state.x, state.y] = [crop.x + crop.size / 2, crop.y + crop.size / 2];
  refresh();
  $("stage").scrollIntoView({ block: "nearest" });
}

/** A crop around the pointer, or around the middle of the stage. */
function addCrop() {
  const { scene } = state,
    size = Math.min(64, scene.width, scene.height);
  const [x, y] = state.pointer ?? [state.x, state.y];
  const corner = (at, length) => clamp(Math.floor(at - size / 2), 0, length - size);
  scene.crops.push({ x: corner(x, scene.width), y: corner(y, scene.height), size });
  buildCrops();
}
