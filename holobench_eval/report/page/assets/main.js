// Pointer and keys on the pictures, and the start of what shows them. Pictures come last in the file: they are looked at
// once all of it is there, while the table stands before.

const GRIP = 14; // px around the slider's line that move it
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

const split = (to) => update({ split: Math.round(Math.min(100, Math.max(0, to))) });

/** Where a pointer is in its pane [px]. */
function position(event) {
  const boxes = [...byId("panes").children].map((pane) => pane.getBoundingClientRect());
  const box = boxes.findLast(({ left }) => left <= event.clientX) ?? boxes[0];
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

function setUpPointer(panes) {
  let held = null; // "slider", or the last event of a drag
  panes.addEventListener("pointerdown", (event) => {
    const line = (panes.clientWidth * Number(state.split)) / 100;
    held = state.mode === "slider" && Math.abs(position(event).x - line) < GRIP ? "slider" : event;
    panes.setPointerCapture(event.pointerId);
  });
  panes.addEventListener("pointermove", (event) => {
    readPixel(position(event));
    if (held === "slider") split((100 * position(event).x) / panes.clientWidth);
    else if (held) {
      move(event.clientX - held.clientX, event.clientY - held.clientY);
      held = event;
    }
  });
  for (const end of ["pointerup", "pointercancel"]) panes.addEventListener(end, () => (held = null));
  const onWheel = (event) => {
    if (!event.ctrlKey && document.activeElement !== panes && !document.fullscreenElement) return; // the page scrolls
    event.preventDefault();
    const { x, y } = position(event);
    zoomBy(event.deltaY < 0 ? 1.25 : 0.8, x, y);
  };
  panes.addEventListener("wheel", onWheel, { passive: false });
}

/** Say what stands at a position: the stored levels of both sides, and the errors. */
function readPixel({ x, y }) {
  const view = layout();
  const column = Math.floor(view.x + (x - view.wide / 2) / view.zoom);
  const row = Math.floor(view.y + (y - view.tall / 2) / view.zoom);
  if (column < 0 || row < 0 || column >= view.width || row >= view.height) return;
  const texts = sides.filter((side) => side.image).map(({ pixels, errors, caption }) => {
    const at = row * pixels.width + column;
    const levels = [...pixels.data.slice(4 * at, 4 * at + 3)].join(", ");
    return `${caption.split(":")[0]} ${errors ? errors[at].toFixed(3) : levels}`;
  });
  byId("pixel").textContent = `Column ${column}, row ${row}: ${texts.join("; ")} (stored levels: red, green, blue of 255)`;
}

/** Plain arrows move the slider, with Shift the picture. */
function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const [across, down] = ARROWS[event.key] ?? [0, 0];
  const keys = { "+": () => zoomBy(2), "=": () => zoomBy(2), "-": () => zoomBy(0.5), 0: showAll, " ": swap };
  const slide = across && (() => split(Number(state.split) - 2 * across));
  const action = event.shiftKey && (across || down) ? () => move(24 * across, 24 * down) : slide || keys[event.key];
  if (!action) return;
  event.preventDefault();
  action();
}

document.addEventListener("DOMContentLoaded", setUpViewer);
