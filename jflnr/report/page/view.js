// `jflnr view`: frames come from the server, and versions of them when they are asked for.

const SECONDS = 0.5; // between looks at what is there
const KEPT = 8; // frames whose numbers stay in memory
const stamps = new Map(); // of the frames that are listed
let last = Promise.resolve(); // the work before this one: one thing is done at a time

async function ask(what, query = {}) {
  const answer = await fetch(`${what}?${new URLSearchParams(query)}`).catch(() => {
    throw new Error("jflnr view does not answer; it may have been ended");
  });
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.error);
  return found;
}

/** Do some work when what was asked for before is done, and say what goes wrong. */
function later(work) {
  last = last.then(work).catch((error) => say(error.message));
  return last;
}

function say(text) {
  $("said").textContent = text;
}

/** A list to choose from, of pairs of a value and what is shown. */
function chooser(id, label, options) {
  const made = options.map(([value, text]) => element("option", { value }, text));
  return element("label", {}, `${label} `, element("select", { id }, ...made));
}

function buildForm() {
  const plain = (names) => names.map((name) => [name, name]);
  const blocks = [4, 8, 16, 32].map((side) => [side, `${side} pixels`]);
  const follow = { id: "follow", type: "checkbox", checked: true };
  const form = element(
    "form",
    { id: "asked", className: "controls" },
    chooser("method", "Method", plain(CONTENT.view.methods)),
    element(
      "label",
      { className: "wide", hidden: true },
      "Refine from",
      element("input", { id: "worth", type: "range", min: 0.05, max: 1, step: 0.05 }),
      element("output", { id: "worth-text", htmlFor: "worth" }),
    ),
    chooser("guides", "Guides", [["", "all"]]),
    chooser("block", "Blocks", [["", "as usual"], ...blocks]),
    chooser("backend", "Back end", plain(CONTENT.view.backends)),
    element("button", {}, "Denoise"),
    element("label", { className: "wide" }, element("input", follow), " show and denoise what comes"),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    later(denoise);
  });
  const rows = { id: "versions", className: "scroll", tabIndex: 0, role: "region" };
  $("viewer").before(
    element(
      "section",
      { id: "view-form", ariaLabel: "Denoise" },
      form,
      element("p", { id: "said", role: "status" }, "There is no frame yet."),
    ),
  );
  $("viewer").after(element("section", { ...rows, ariaLabel: "What was denoised", hidden: true }));
}

/** How little method auto refines, where that is chosen. */
function showWorth() {
  $("worth").parentElement.hidden = $("method").value !== "auto";
  $("worth-text").textContent = `${Math.round(100 * $("worth").value)} % signal`;
}

/** Guides that the scene has: all, all but one, and each alone. */
function buildGuides() {
  const { guides } = state.scene;
  const but = (name) => guides.filter((other) => other !== name).join();
  const sets = guides.length > 1 ? guides.map((name) => [but(name), `without ${name}`]) : [];
  const alone = guides.length > 2 ? guides.map((name) => [name, `${name} only`]) : [];
  const chosen = $("guides").value;
  const options = [["", "all"], ...sets, ...alone];
  $("guides").replaceChildren(
    ...options.map(([value, text]) => element("option", { value }, text)),
  );
  if (options.some(([value]) => value === chosen)) $("guides").value = chosen;
}

/** What the form asks for, and a name for it. */
function asked() {
  const options = Object.fromEntries(
    ["method", "guides", "block", "backend"].map((name) => [name, $(name).value]),
  );
  const worth = Number($("worth").value);
  if (options.method === "auto" && worth !== CONTENT.view.worth) options.worth = worth;
  const text = (name) => $(name).selectedOptions[0].textContent;
  const name = [
    options.method,
    options.worth && `from ${$("worth-text").textContent}`,
    options.guides && text("guides"),
    options.block && `blocks of ${text("block")}`,
    options.backend !== CONTENT.view.backends[0] && text("backend"),
  ];
  return [options, name.filter(Boolean).join(", ")];
}

async function denoise() {
  const { scene } = state;
  if (!scene) return;
  const [options, name] = asked();
  say(`${scene.name}: ${name} …`);
  const made = await ask("denoise", { frame: scene.name, ...options });
  const image = { ...(await loadImage(made.image, scene.unit)), name, told: made };
  const old = scene.images.findIndex((other) => other.name === name);
  const end = scene.images.length - (scene.reference ? 1 : 0);
  if (old < 0) scene.images.splice(end, 0, image);
  else scene.images[old] = image;
  say([`${scene.name}: ${name}, ${timeOf(made)}`, ...made.warnings].join("; "));
  if (scene !== state.scene) return;
  state.left = image;
  const others = scene.images.filter((other) => other !== image);
  if (!others.includes(state.right)) state.right = scene.reference ?? others[0];
  buildLists();
  refresh();
}

function timeOf({ seconds, compile_seconds: compiling }) {
  const text = seconds < 1 ? `${Math.round(1000 * seconds)} ms` : `${seconds.toFixed(1)} s`;
  return compiling > 0.05 ? `${text} (and ${compiling.toFixed(1)} s the first time)` : text;
}

/** Time, plan and map of errors of each version, side by side. */
function buildVersions() {
  const { scene } = state;
  const made = scene.images.filter((image) => image.told);
  $("versions").hidden = !made.length;
  const head = ["version", "time", "back end", "picture", "errors", "plan"];
  const rows = made.map((image) => {
    const errors = scene.reference ? "error" : "told";
    const pick = { type: "button", onclick: () => choose("left", image) };
    const cells = [
      element("button", pick, image.name),
      timeOf(image.told),
      image.told.backend,
      small(image, "image"),
      small(image, errors),
      element("div", {}, small(image, "plan"), image.told.plan ?? ""),
    ];
    return element("tr", {}, ...cells.map((cell) => element("td", {}, cell)));
  });
  const headings = head.map((text) => element("th", { scope: "col" }, text));
  const titles = element("thead", {}, element("tr", {}, ...headings));
  $("versions").replaceChildren(element("table", {}, titles, element("tbody", {}, ...rows)));
}

/** A small picture of a version or of one of its maps, if it has that. */
function small(image, map) {
  const { scene } = state;
  if (mapShown(scene, image, map) !== map) return "–";
  const width = 240,
    height = Math.round((width * scene.height) / scene.width);
  const label = map === "image" ? image.name : `${image.name}: ${MAPS[map].title}`;
  const canvas = element("canvas", { width, height, role: "img", ariaLabel: label });
  const painted = canvasOf(scene, image, { ...state, map });
  canvas.getContext("2d").drawImage(painted, 0, 0, width, height);
  return canvas;
}

const indexOf = (name) => CONTENT.scenes.findIndex((scene) => scene.name === name);

/** Look at what is there; show what is new or has changed, and denoise it. */
async function look() {
  const { frames } = await ask("frames");
  const fresh = frames.filter(([name, stamp]) => stamps.get(name) !== stamp);
  for (const [name, stamp] of fresh) {
    stamps.set(name, stamp);
    if (loaded.delete(indexOf(name)) || indexOf(name) >= 0) continue;
    const scene = { name, from: () => ask("scene", { frame: name }) };
    listScene(scene, CONTENT.scenes.push(scene) - 1);
  }
  const names = fresh.map(([name]) => name);
  const follow = $("follow").checked || !state.scene;
  const name = follow ? names.at(-1) : names.find((name) => name === state.scene.name);
  if (name === undefined) return;
  await (state.scene ? showScene : begin)(indexOf(name));
  if (loaded.size > KEPT) loaded.delete(loaded.keys().next().value);
  if ($("follow").checked && loaded.get(indexOf(name)) === state.scene) await denoise();
}

function watch() {
  later(look).then(() => setTimeout(watch, 1000 * SECONDS));
}

addEventListener("load", () => {
  buildForm();
  $("worth").value = CONTENT.view.worth;
  $("asked").addEventListener("input", showWorth);
  const usual = () => [($("method").value = state.scene.method), showWorth()];
  document.addEventListener("scene", usual, { once: true });
  document.addEventListener("scene", () => [buildGuides(), buildVersions()]);
  watch();
});
