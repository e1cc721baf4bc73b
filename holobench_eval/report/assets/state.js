// What is shown, kept in the address after "#", so that a link leads to the same view, and the page to its place.

const DEFAULTS = {
  display: data.displays[0] ?? data.changed[0],
  sort: data.headline.key, // a column
  order: "best", // or "worst"
  filter: "",
  photographs: "", // at most so many
  seconds: "",
  all: "", // "yes": all columns
  open: "", // the method whose targets are listed
  target: "", // empty: the first that have the pictures of all methods
  methods: "", // a line each; empty: a choice for the display
  mode: "capture", // "error", "flip" or "truth"
  size: "9.5rem", // least width of a picture
  zoom: "1", // times the whole picture
  x: "0.5", // what is in the middle, as shares of the picture
  y: "0.5",
  values: "srgb",
  channel: "all",
  scale: "0.5", // errors from 0 to here have colours of their own
};
const CONTROLS = ["display", "filter", "photographs", "seconds", "mode", "size", "values", "channel", "scale"]; // with the value of the view
const OF_BOARD = ["sort", "order", "filter", "photographs", "seconds", "all", "open"];
const LISTS = {
  open: Object.keys(data.methods),
  order: ["best", "worst"],
  all: ["yes"],
  sort: ["method", ...data.columns.map(({ key }) => key)],
  target: data.targets,
};
const LIMITS = { photographs: [0, Infinity], seconds: [0, Infinity], zoom: [1, 64], x: [0, 1], y: [0, 1] };
const ADDRESS_DELAY = 200; // ms

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

const chosen = () => Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key]);

function writeAddress() {
  byId("link").href = `#${new URLSearchParams([["display", state.display], ...chosen().filter(([key]) => key !== "display")])}`;
  history.replaceState(null, "", byId("link").href);
}

/** Take the view from the address; what it does not name, or names wrongly, is as at the start. */
function readAddress() {
  const named = [...new URLSearchParams(location.hash.slice(1))];
  return { ...DEFAULTS, ...Object.fromEntries(named.filter(([key, value]) => Object.hasOwn(DEFAULTS, key) && isPossible(key, value))) };
}

function isPossible(key, value) {
  if (LIMITS[key]) return value.trim() !== "" && Number(value) >= LIMITS[key][0] && Number(value) <= LIMITS[key][1];
  const choices = LISTS[key] ?? (byId(key)?.options && [...byId(key).options].map((option) => option.value));
  return !choices || choices.includes(value);
}

/** Show the part that a link of this page is about: the pictures, or the board where it names nothing else. */
function land() {
  const keys = chosen().map(([key]) => key);
  if (keys.length) byId(keys.every((key) => OF_BOARD.includes(key)) ? "table" : "viewer").scrollIntoView();
}

const state = readAddress();
byId("link").href = `#${new URLSearchParams({ display: state.display })}`;
history.scrollRestoration = "manual";
window.addEventListener("hashchange", () => {
  if (!location.hash.includes("=")) return writeAddress(); // a link within the page keeps the view
  update(readAddress());
  land();
});
for (const key of CONTROLS) byId(key).addEventListener("input", (event) => update({ [key]: event.target.value }));
watch(CONTROLS, () => CONTROLS.forEach((key) => (byId(key).value = state[key])));

/** Sentences and charts of the chosen display, and those of no display. */
watch(["display"], () => {
  const others = [...data.displays, ...data.changed].filter((name) => name !== state.display && !state.display.startsWith(`${name},`));
  for (const line of byId("answer").querySelectorAll("li")) line.hidden = others.some((name) => [": ", ", "].some((end) => line.textContent.startsWith(name + end)));
  for (const chart of byId("charts").querySelectorAll("[data-name]")) chart.hidden = others.some((name) => chart.dataset.name.endsWith(`-${name}`));
});
