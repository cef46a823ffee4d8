// A shot: which of its frames is shown, and playing them at their rate.

/** Show a frame, counted round. */
function setFrame(index) {
  const count = state.scene.frames.length;
  state.frame = ((index % count) + count) % count;
  refresh();
}

/** Play from the frame that is shown, or hold it. */
function play(on = !state.playing) {
  const { scene, frame } = state;
  const mine = (state.playing = on && scene.rate ? {} : null);
  let start;
  const tick = (now) => {
    if (state.playing !== mine) return;
    start ??= now;
    setFrame(frame + Math.floor(((now - start) / 1000) * scene.rate));
    requestAnimationFrame(tick);
  };
  if (mine) requestAnimationFrame(tick);
  refresh();
}

/** Hold what plays, and show a frame. */
function hold(index) {
  play(false);
  setFrame(index);
}

function showPlayer() {
  const { rate, frames } = state.scene;
  $("player").hidden = !rate;
  if (!rate) return;
  $("play").textContent = state.playing ? "Pause" : "Play";
  Object.assign($("frame"), { max: frames.length - 1, value: state.frame });
  const text = `${state.frame + 1} of ${frames.length}, ${number(rate)} a second`;
  $("frame").setAttribute("aria-valuetext", text);
  $("frame-text").textContent = text;
}

function errorText({ warped }) {
  const error = warped[state.frame];
  return error === null ? "warped error –" : `warped error ${number(error)}`;
}

/** A shot plays by itself, unless less motion is asked for. */
document.addEventListener("scene", () => {
  state.frame = 0;
  play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
});
