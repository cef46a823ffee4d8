// Putting it together.

let waiting = false;

/** Draw everything once before the next frame, however many settings changed. */
function refresh() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    draw();
    showPanel();
    showCrops();
  });
}

const loaded = new Map();

async function showScene(index) {
  $("scene").value = index;
  $("unpacking").hidden = loaded.has(index);
  $("trouble").hidden = true;
  try {
    if (!loaded.has(index)) loaded.set(index, await loadScene(CONTENT.scenes[index]));
  } catch (error) {
    return trouble(error.message);
  }
  if (Number($("scene").value) !== index) return; // another one was chosen meanwhile
  const scene = (state.scene = loaded.get(index));
  // The same names as before, so that flipping between scenes compares like with like.
  const named = (image) => scene.images.find((other) => other.name === image?.name);
  state.left = named(state.left) ?? scene.images[Math.min(1, scene.images.length - 1)];
  state.right = named(state.right) ?? scene.images.at(-1);
  $("unpacking").hidden = true;
  $("viewer").hidden = false;
  buildLists();
  fit();
}

function trouble(text) {
  $("trouble").textContent = text;
  $("trouble").hidden = false;
  $("unpacking").hidden = true;
}

/** What there is one of for each image of the scene. */
function buildLists() {
  buildPanel();
  buildCrops();
  buildMetrics();
  document.dispatchEvent(new Event("scene"));
}

function stepScene(by) {
  const count = CONTENT.scenes.length;
  return showScene((Number($("scene").value) + by + count) % count);
}

function listScene({ name }, index) {
  $("scene").append(element("option", { value: index }, name));
  $("scene-label").hidden = index < 1;
}

async function start() {
  buildHelp();
  buildTables();
  CONTENT.scenes.forEach(listScene);
  $("scene").addEventListener("change", () => showScene(Number($("scene").value)));
  if (CONTENT.scenes.length) await begin(0);
}

/** Show the first scene, and listen. */
async function begin(index) {
  await showScene(index);
  if (!state.scene) return;
  listenToControls();
  listenToPointers();
  document.addEventListener("keydown", onKey);
  new ResizeObserver(() => refresh()).observe($("stage"));
}

if (typeof DecompressionStream === "undefined") trouble("This page needs a browser of 2023 or newer.");
else start();
