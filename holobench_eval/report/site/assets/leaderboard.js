"use strict";
// The leaderboard: filters, sorting, and the view in the address after "#". Without scripts all rows are shown.

const byId = (id) => document.getElementById(id);
const table = document.querySelector("table.board");
const groups = [...table.tBodies];
const home = new Map(groups.flatMap((group) => [...group.rows].slice(1).map((row) => [row, group])));
const rows = [...home.keys()];
const everything = table.createTBody(); // of all groups, where they are shown together
const headings = [...table.tHead.rows[0].cells].filter((cell) => cell.dataset.key);
const alone = headings.filter((cell) => cell.classList.contains("within")).map((cell) => cell.dataset.key); // in a group
const better = Object.fromEntries(headings.map((cell) => [cell.dataset.key, cell.dataset.better]));

const DEFAULTS = {
  arrange: "within", // groups, or "across": all of them with one measure and metric, by differences alone
  display: "",
  category: "",
  measure: "",
  version: "new", // without other ones; empty: all
  captures: "", // at most
  seconds: "",
  text: "",
  sort: "", // a column; empty: best score first
  order: "best",
};
const FILTERS = ["arrange", "display", "category", "measure", "version", "captures", "seconds", "text"];
const NUMBERS = ["score", "gain", "above", "captures", "seconds", "targets"];
let state = { ...DEFAULTS };

/** Whether a value may stand in the address under a name. */
function isPossible(key, value) {
  const select = byId(key);
  if (select?.tagName === "SELECT") return [...select.options].some((option) => option.value === value);
  if (key === "sort") return value === "" || Object.hasOwn(better, value);
  if (key === "order") return ["best", "worst"].includes(value);
  if (["captures", "seconds"].includes(key)) return value === "" || (Number.isFinite(Number(value)) && Number(value) >= 0);
  return Object.hasOwn(DEFAULTS, key);
}

/** The view in the address, or null where it names a part of the page. */
function inAddress() {
  if (location.hash && !location.hash.includes("=")) return null;
  const found = [...new URLSearchParams(location.hash.slice(1))].filter(([key, value]) => isPossible(key, value));
  return settled({ ...DEFAULTS, ...Object.fromEntries(found) });
}

const link = () => new URLSearchParams(Object.entries(state).filter(([key, value]) => value !== DEFAULTS[key])).toString();

/** The view with one measure and metric where groups are shown together: differences in others do not compare. */
function settled(view) {
  return view.arrange === "across" && !view.measure ? { ...view, measure: byId("measure").options[1].value } : view;
}

function update(changes) {
  state = settled({ ...state, ...changes });
  history.replaceState(null, "", link() ? `#${link()}` : `${location.pathname}${location.search}`);
  draw();
}

/** Whether a row passes the filters. What is unknown is not below a limit. */
function passes(row) {
  const known = row.dataset;
  const words = state.text.toLowerCase().split(/\s+/).filter(Boolean);
  const below = (key) => state[key] === "" || (known[key] !== "" && Number(known[key]) <= Number(state[key]));
  return (
    ["display", "category", "measure"].every((key) => state[key] === "" || known[key] === state[key]) &&
    (state.version === "" || known.version !== "another version") &&
    below("captures") &&
    below("seconds") &&
    words.every((word) => known.text.includes(word))
  );
}

/** Rows in the order that is asked for; holes stay below. */
function sorted(found, key) {
  if (!key) return found;
  const sign = (state.order === "best" ? 1 : -1) * (better[key] === "down" ? -1 : 1);
  return found.slice().sort((a, b) => {
    const [first, second] = [a.dataset[key] ?? "", b.dataset[key] ?? ""];
    if (first === "" || second === "") return (first === "") - (second === "");
    return sign * (NUMBERS.includes(key) ? Number(first) - Number(second) : first.localeCompare(second, "en"));
  });
}

function draw() {
  const together = state.arrange === "across";
  for (const key of FILTERS) if (byId(key).value !== state[key]) byId(key).value = state[key];
  const shown = new Set(rows.filter(passes));
  for (const row of rows) row.hidden = !shown.has(row);
  const key = together && (!state.sort || alone.includes(state.sort)) ? "gain" : state.sort;
  if (together) everything.append(...sorted(rows, key));
  else for (const group of groups) group.append(...sorted(rows.filter((row) => home.get(row) === group), key));
  for (const group of groups) group.hidden = together || ![...group.rows].some((row) => shown.has(row));
  table.classList.toggle("all", together);
  for (const cell of headings) mark(cell, key);
  const older = state.version === "" ? 0 : rows.filter((row) => row.dataset.version === "another version").length;
  byId("status").textContent =
    `${shown.size} of ${rows.length} rows.` +
    (older ? ` ${older} rows of other versions are left out.` : "") +
    (together ? " Scores of different groups do not compare: differences in one metric, each to the baseline of its study, are shown." : "");
}

/** Say on a heading whether the rows are sorted by it. */
function mark(cell, key) {
  const ours = cell.dataset.key === key;
  const falling = (state.order === "best") === (cell.dataset.better === "down");
  cell.setAttribute("aria-sort", ours ? (falling ? "descending" : "ascending") : "none");
  cell.querySelector(".arrow").textContent = ours ? (falling ? "▼" : "▲") : "↕";
}

for (const cell of headings) {
  const button = document.createElement("button");
  const arrow = document.createElement("span");
  button.type = "button";
  arrow.className = "arrow";
  arrow.setAttribute("aria-hidden", "true");
  button.append(cell.textContent, " ", arrow);
  button.addEventListener("click", () => {
    const key = cell.dataset.key;
    update({ sort: key, order: state.sort === key && state.order === "best" ? "worst" : "best" });
  });
  cell.replaceChildren(button);
}
for (const key of FILTERS) {
  byId(key).addEventListener("input", () => isPossible(key, byId(key).value) && update({ [key]: byId(key).value }));
}
byId("reset").addEventListener("click", () => update(DEFAULTS));
byId("copy-link").addEventListener("click", async () => {
  const address = `${location.href.split("#")[0]}${link() ? `#${link()}` : ""}`;
  try {
    await navigator.clipboard.writeText(address);
    byId("status").textContent = "The link is copied.";
  } catch {
    byId("status").textContent = `The address of this view: ${address}`; // a browser may refuse the clipboard
  }
});
window.addEventListener("hashchange", () => {
  const wanted = inAddress();
  if (wanted) state = wanted;
  draw();
});
document.querySelector(".controls").hidden = false;
state = inAddress() ?? state;
draw();
