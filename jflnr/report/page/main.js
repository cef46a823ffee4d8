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
  if (!loaded.has(index)) loaded.set(index, await loadScene(CONTENT.scenes[index]));
  const scene = (state.scene = loaded.get(index));
  // The same names as before, so that flipping between scenes compares like with like.
  const named = (image) => scene.images.find((other) => other.name === image?.name);
  state.left = named(state.left) ?? scene.images[Math.min(1, scene.images.length - 1)];
  state.right = named(state.right) ?? scene.images.at(-1);
  $("unpacking").hidden = true;
  $("viewer").hidden = false;
  buildPanel();
  buildCrops();
  buildMetrics();
  fit();
}

function stepScene(by) {
  const count = CONTENT.scenes.length;
  return showScene((Number($("scene").value) + by + count) % count);
}

async function start() {
  buildHelp();
  buildTables();
  if (!CONTENT.scenes.length) return;
  $("scene").append(
    ...CONTENT.scenes.map((scene, i) => element("option", { value: i }, scene.name)),
  );
  $("scene-label").hidden = CONTENT.scenes.length < 2;
  $("scene").addEventListener("change", () => showScene(Number($("scene").value)));
  listenToControls();
  await showScene(0);
  listenToPointers();
  document.addEventListener("keydown", onKey);
  new ResizeObserver(() => refresh()).observe($("stage"));
}

if (typeof DecompressionStream === "undefined") {
  $("trouble").textContent = "This page needs a browser of 2023 or newer.";
  $("trouble").hidden = false;
} else start();
