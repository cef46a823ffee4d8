// The keyboard: one list that both acts and is shown.

const turn = (list, value, step) => list[(list.indexOf(value) + step + list.length) % list.length];
const options = (id) => [...$(id).options].filter((o) => !o.disabled).map((o) => o.value);

function step(side, by) {
  choose(side, turn(state.scene.images, state[side], by));
}

function swap() {
  [state.left, state.right] = [state.right, state.left];
  refresh();
}

function next(name) {
  if ($(name).parentElement.hidden) return;
  state[name] = turn(options(name), state[name], 1);
  name === "layout" ? fit() : refresh();
}

function zoomMiddle(factor) {
  const [pane] = panes();
  zoomAt(pane.x + pane.width / 2, pane.y + pane.height / 2, factor);
}

const SHORTCUTS = [
  { shown: "1 … 9", text: "image on the left; with Shift on the right" },
  {
    shown: "← →",
    keys: { ArrowLeft: () => step("left", -1), ArrowRight: () => step("left", 1) },
    text: "previous, next image; with Shift on the right",
  },
  {
    shown: "↑ ↓",
    keys: { ArrowUp: () => stepScene(-1), ArrowDown: () => stepScene(1) },
    text: "previous, next scene",
  },
  {
    shown: "x",
    keys: { x: swap },
    text: "swap left and right",
  },
  { shown: "l", keys: { l: () => next("layout") }, text: "layout: one, split, all" },
  {
    shown: "[ ]",
    keys: { "[": () => setSplit(state.split - 0.05), "]": () => setSplit(state.split + 0.05) },
    text: "move the split",
  },
  {
    shown: "e E",
    keys: { e: () => setStops(state.stops - 0.5), E: () => setStops(state.stops + 0.5) },
    text: "half a stop darker, brighter",
  },
  { shown: "v", keys: { v: () => next("view") }, text: "which light: reflected, picture, bare" },
  { shown: "m", keys: { m: () => next("map") }, text: "image, error, FLIP" },
  { shown: "t", keys: { t: () => next("tone") }, text: "tone curve" },
  {
    shown: "+ −",
    keys: {
      "+": () => zoomMiddle(1.5),
      "=": () => zoomMiddle(1.5),
      "-": () => zoomMiddle(1 / 1.5),
    },
    text: "zoom",
  },
  { shown: "f", keys: { f: () => fit() }, text: "fit the image into the window" },
  { shown: "Space", keys: { " ": () => play() }, text: "play a shot, or hold it" },
  {
    shown: ", .",
    keys: { ",": () => hold(state.frame - 1), ".": () => hold(state.frame + 1) },
    text: "previous, next frame of a shot",
  },
  { shown: "c", keys: { c: () => addCrop() }, text: "add a crop under the pointer" },
  { shown: "r", keys: { r: () => reset() }, text: "reset" },
  { shown: "?", keys: { "?": () => $("help").showModal() }, text: "this list" },
];
const ACTIONS = Object.assign({}, ...SHORTCUTS.map((shortcut) => shortcut.keys ?? {}));

function onKey(event) {
  // The browser has its own keys with Ctrl, Alt and Meta; fields keep arrows, Home, Enter ...
  if (event.ctrlKey || event.altKey || event.metaKey || $("help").open) return;
  if (event.target.matches("select, input") && event.key.length > 1) return;
  if (/^Arrow(Up|Down)$/.test(event.key) && CONTENT.scenes.length < 2) return; // they scroll
  if (/^[ ,.]$/.test(event.key) && !state.scene.rate) return; // Space scrolls
  if (event.key === " " && event.target.matches("select, button, summary")) return; // it presses
  const arrow = /^Arrow(Left|Right)$/.exec(event.key);
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code);
  if (event.target === $("divider") && arrow)
    setSplit(state.split + (arrow[1] === "Left" ? -0.02 : 0.02));
  else if (digit) {
    const image = state.scene.images[digit[1] - 1];
    if (image) choose(event.shiftKey ? "right" : "left", image);
  } else if (arrow && event.shiftKey) step("right", arrow[1] === "Left" ? -1 : 1);
  else if (ACTIONS[event.key]) ACTIONS[event.key]();
  else return;
  event.preventDefault();
}

function buildHelp() {
  $("shortcuts").replaceChildren(
    ...SHORTCUTS.map(({ shown, text }) =>
      element(
        "tr",
        {},
        element(
          "th",
          { scope: "row" },
          ...shown.split(" ").map((key) => (key === "…" ? "…" : element("kbd", {}, key))),
        ),
        element("td", {}, text),
      ),
    ),
  );
  $("help-button").addEventListener("click", () => $("help").showModal());
}
