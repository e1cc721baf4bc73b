// Pointer and keys on the pictures, and the start of everything. Pictures come last in the file: they are looked at
// once all of it is there, while table and plots stand before.

function setUpPointer(canvas) {
  const position = (event) => {
    const box = canvas.getBoundingClientRect();
    const { wide } = layout();
    const x = event.clientX - box.left;
    return { x, paneX: state.mode === "side" && x > wide ? x - wide : x, y: event.clientY - box.top };
  };
  let held = null; // "slider", or the last position of a drag
  canvas.addEventListener("pointerdown", (event) => {
    const at = position(event);
    const line = (canvas.clientWidth * Number(state.split)) / 100;
    held = state.mode === "slider" && Math.abs(at.x - line) < GRIP ? "slider" : at;
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const at = position(event);
    readPixel(at);
    if (held === "slider") update({ split: Math.round(Math.min(100, Math.max(0, (100 * at.x) / canvas.clientWidth))) });
    else if (held) {
      move(at.x - held.x, at.y - held.y);
      held = at;
    }
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (held = null));
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas && !byId("stage").classList.contains("enlarged")) return; // the page scrolls until the picture was clicked
      event.preventDefault();
      const at = position(event);
      zoomBy(event.deltaY < 0 ? 1.25 : 0.8, at.paneX, at.y);
    },
    { passive: false }
  );
}

/** Say what stands at a position: the stored levels of both sides, and the errors. */
function readPixel({ paneX, y }) {
  const view = layout();
  const column = Math.floor(view.x + (paneX - view.wide / 2) / view.zoom);
  const row = Math.floor(view.y + (y - view.tall / 2) / view.zoom);
  if (column < 0 || row < 0 || column >= view.width || row >= view.height) return;
  const texts = sides.filter((side) => side.pixels).map((side) => {
    const at = 4 * (row * side.pixels.width + column);
    const levels = [...side.pixels.data.slice(at, at + 3)].join(", ");
    return side.errors ? `${side.caption.split(":")[0]} ${side.errors[at / 4].toFixed(3)}` : `${side.caption.split(":")[0]} ${levels}`;
  });
  byId("pixel").textContent = `Column ${column}, row ${row}: ${texts.join("; ")} (stored levels: red, green, blue of 255)`;
}

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const step = 24; // screen pixels
  const split = (by) => update({ split: Math.min(100, Math.max(0, Number(state.split) + by)) });
  const actions = {
    ArrowLeft: () => (event.shiftKey ? move(step, 0) : split(-2)),
    ArrowRight: () => (event.shiftKey ? move(-step, 0) : split(2)),
    ArrowUp: event.shiftKey ? () => move(0, step) : null,
    ArrowDown: event.shiftKey ? () => move(0, -step) : null,
    "+": () => zoomBy(2),
    "=": () => zoomBy(2),
    "-": () => zoomBy(0.5),
    0: () => update({ zoom: "", x: "", y: "" }),
    " ": swap,
  };
  const action = actions[event.key];
  if (!action) return;
  event.preventDefault();
  action();
}

setUpTable();
setUpCopies();
setUpPaired();
document.addEventListener("DOMContentLoaded", setUpViewer);
