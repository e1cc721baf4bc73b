// What is shown, kept in the address after "#", so that a link leads to the same view.

const DEFAULTS = {
  display: data.displays[0],
  sort: "", // a column; empty: the order of the table
  order: "best", // or "worst"
  filter: "",
  open: "", // the method whose targets are listed
  target: data.pictures.first,
  left: "truth",
  right: "", // "capture:METHOD", "error:METHOD" or "flip:METHOD"; empty: the best method that has a picture
  mode: "slider",
  split: "50", // [%] of the width
  zoom: "", // screen pixels a pixel; empty: the whole picture
  x: "", // the pixel in the middle
  y: "",
  values: "srgb",
  channel: "all",
  scale: "0.5", // errors from 0 to here have colours of their own
};
const CONTROLS = ["display", "filter", "target", "mode", "values", "channel", "scale", "split"]; // with the value of the view
const LISTS = { open: Object.keys(data.methods), order: ["best", "worst"], sort: ["method", ...data.columns.map(({ key }) => key)] };
const ADDRESS_DELAY = 200; // ms

let state = { ...DEFAULTS };
const listeners = [];
let addressTimer = 0;

/** Call `listener()` now, and whenever one of the names changes. */
function watch(names, listener) {
  listeners.push({ names, listener });
  listener();
}

/** Change what is shown, and the address with it. */
function update(changes) {
  const changed = Object.keys(changes).filter((key) => state[key] !== String(changes[key]));
  if (!changed.length) return;
  for (const key of changed) state[key] = String(changes[key]);
  clearTimeout(addressTimer); // browsers refuse an address that changes at every move of a pointer
  addressTimer = setTimeout(writeAddress, ADDRESS_DELAY);
  for (const { names, listener } of listeners) if (names.some((name) => changed.includes(name))) listener();
}

function writeAddress() {
  const chosen = Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key]);
  history.replaceState(null, "", `#${new URLSearchParams(chosen)}`);
}

/** Take the view from the address; what it does not name, or names wrongly, is as at the start. */
function readAddress() {
  const named = [...new URLSearchParams(location.hash.slice(1))];
  return { ...DEFAULTS, ...Object.fromEntries(named.filter(([key, value]) => Object.hasOwn(DEFAULTS, key) && isPossible(key, value))) };
}

function isPossible(key, value) {
  if (["split", "zoom", "x", "y"].includes(key)) return value !== "" && Number.isFinite(Number(value));
  const choices = LISTS[key] ?? (CONTROLS.includes(key) && byId(key).options && [...byId(key).options].map((option) => option.value));
  return !choices || choices.includes(value);
}

state = readAddress();
window.addEventListener("hashchange", () => {
  if (location.hash.includes("=")) update(readAddress());
  else writeAddress(); // a link within the page keeps the view
});
for (const key of CONTROLS) byId(key).addEventListener("input", (event) => update({ [key]: event.target.value }));
watch(CONTROLS, () => CONTROLS.forEach((key) => (byId(key).value = state[key])));

/** The rows of the display that pass the filter, sorted. */
function shownRows() {
  const words = state.filter.toLowerCase().split(/\s+/);
  const rows = data.rows[state.display].filter((row) => {
    const { registered, group } = data.methods[row.method];
    const text = `${row.marked} ${registered} ${group}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
  if (!state.sort) return rows;
  const column = data.columns.find(({ key }) => key === state.sort);
  const sign = (state.order === "best" ? 1 : -1) * (column?.higher ? -1 : 1);
  if (!column) return rows.sort((a, b) => sign * a.marked.localeCompare(b.marked, "en"));
  const value = (row) => row.cells[column.key]?.value ?? sign * Infinity; // holes stay below
  return rows.sort((a, b) => (value(a) === value(b) ? 0 : sign * (value(a) - value(b))));
}
