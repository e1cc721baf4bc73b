// What is shown, kept in the address after "#", so that a link leads to the same view.

const DEFAULTS = {
  display: data.displays[0],
  sort: "", // a column; empty: the order of the table
  order: "best", // or "worst"
  filter: "",
  open: "", // the method whose targets are listed
  target: data.pictures.first,
  left: "truth",
  right: "", // "capture:METHOD" or "error:METHOD"; empty: the best method that has a picture
  mode: "slider",
  split: "50", // [%] of the width
  zoom: "", // screen pixels a pixel; empty: the whole picture
  x: "", // the pixel in the middle
  y: "",
  values: "srgb",
  channel: "all",
  scale: "0.5", // errors from 0 to here have colours of their own
};

let state = { ...DEFAULTS };
const listeners = [];
const ADDRESS_DELAY = 200; // ms
let addressTimer = 0;

/** Call `listener(changed)` now and at every change; `changed` is a set of names. */
function watch(listener) {
  listeners.push(listener);
  listener(new Set(Object.keys(DEFAULTS)));
}

/** Change what is shown, and the address with it. */
function update(changes) {
  const changed = new Set(Object.keys(changes).filter((key) => state[key] !== String(changes[key])));
  if (!changed.size) return;
  for (const key of changed) state[key] = String(changes[key]);
  clearTimeout(addressTimer); // browsers refuse an address that changes at every move of a pointer
  addressTimer = setTimeout(() => history.replaceState(null, "", `#${link()}`), ADDRESS_DELAY);
  for (const listener of listeners) listener(changed);
}

/** The part of the address that stands for this view. */
function link() {
  const chosen = Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key]);
  return new URLSearchParams(chosen).toString();
}

/** Take the view from the address; what it does not name, or names wrongly, is as at the start. */
function readAddress() {
  const found = new URLSearchParams(location.hash.slice(1));
  const known = [...found].filter(([key, value]) => key in DEFAULTS && isPossible(key, value));
  return known.length || !location.hash || location.hash.includes("=") ? { ...DEFAULTS, ...Object.fromEntries(known) } : null;
}

function isPossible(key, value) {
  const choices = {
    display: [...data.displays, ...data.changed],
    target: data.targets.map((target) => target.name),
    open: Object.keys(data.methods),
    order: ["best", "worst"],
    sort: ["method", ...data.columns.map((column) => column.key)],
    mode: ["slider", "side", "flicker"],
    values: ["srgb", "linear"],
    channel: ["all", "0", "1", "2"],
  };
  if (key in choices) return choices[key].includes(value);
  if (["split", "zoom", "x", "y", "scale"].includes(key)) return value !== "" && Number.isFinite(Number(value));
  return true;
}

state = readAddress() ?? state;
window.addEventListener("hashchange", () => {
  const wanted = readAddress();
  if (wanted) update(wanted);
  else if (link()) history.replaceState(null, "", `#${link()}`); // a link within the page keeps the view
});

/** The rows of the display that pass the filter, sorted. */
function shownRows() {
  const words = state.filter.toLowerCase().split(/\s+/).filter(Boolean);
  const rows = (data.rows[state.display] ?? []).filter((row) => {
    const method = data.methods[row.method];
    const text = `${row.marked} ${method.registered} ${method.group}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
  if (!state.sort) return rows;
  const column = data.columns.find((item) => item.key === state.sort);
  const sign = (state.order === "best" ? 1 : -1) * (column && column.higher ? -1 : 1);
  if (!column) return rows.slice().sort((a, b) => sign * a.marked.localeCompare(b.marked, "en"));
  const value = (row) => row.cells[column.key]?.value ?? null;
  return rows.slice().sort((a, b) => {
    const [first, second] = [value(a), value(b)];
    if (first === null || second === null) return (first === null) - (second === null); // holes stay below
    return sign * (first - second);
  });
}
