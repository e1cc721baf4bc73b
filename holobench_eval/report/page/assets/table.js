// The board of a display: sorted by its headings, filtered, a row opening to its targets.

function drawTable() {
  const rows = shownRows();
  const floors = (data.floors[state.display] ?? []).map((floor) => `${floor.name} ${withUnit(floor.mean)}`);
  byId("table-note").textContent =
    `${rows.length} of ${data.rows[state.display].length} methods on ${state.display}. Brackets hold 95 % intervals. ` +
    (columns().some(({ key }) => key === "tier") ? "A letter holds the methods of a group that no test tells from its best. " : "") +
    (floors.length ? `Floor, ${data.headline.title}: ${floors.join(", ")}.` : "");
  const focused = document.activeElement?.dataset?.key;
  byId("rows").replaceChildren(
    element("caption", { class: "hidden" }, `Methods on ${state.display}`),
    element("thead", {}, element("tr", {}, heading("method", "method"), ...columns().map(({ key, heading: text }) => heading(key, text)))),
    element("tbody", {}, ...rows.flatMap((row, index) => [...groupRow(rows, index), ...bodyRows(row)]))
  );
  if (focused) byId("rows").querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

/** The columns that the display has anything in. */
const columns = () => data.columns.filter(({ key }) => data.rows[state.display].some((row) => (row.cells[key]?.value ?? null) !== null));

function heading(key, text) {
  const sorted = state.sort === key;
  const falling = (state.order === "best") === Boolean(data.columns.find((column) => column.key === key)?.higher);
  const turn = () => update({ sort: key, order: sorted && state.order === "best" ? "worst" : "best" });
  const arrow = element("span", { class: "arrow", "aria-hidden": "true" }, sorted ? (falling ? "▼" : "▲") : "↕");
  return element(
    "th",
    { scope: "col", "aria-sort": sorted ? (falling ? "descending" : "ascending") : "none" },
    element("button", { type: "button", "data-key": `sort ${key}`, click: turn }, text, arrow)
  );
}

/** The name of a group above its first row, where rows stand in the order of the board. */
function groupRow(rows, index) {
  const group = data.methods[rows[index].method].group;
  if (state.sort || (index && data.methods[rows[index - 1].method].group === group)) return [];
  return [element("tr", { class: "group" }, element("th", { scope: "rowgroup", colspan: columns().length + 1 }, group))];
}

function bodyRows(row) {
  const open = state.open === row.method;
  const name = element(
    "button",
    { type: "button", "aria-expanded": open, "data-key": `open ${row.method}`, click: () => update({ open: open ? "" : row.method }) },
    element("span", { class: "arrow", "aria-hidden": "true" }, open ? "▾" : "▸"),
    swatch(row.method),
    row.marked
  );
  const cells = columns().map(({ key }) => element("td", {}, ...shownCell(key, row)));
  const line = element("tr", { class: row.verdict }, element("th", { scope: "row" }, name), ...cells);
  return open ? [line, element("tr", { class: "opened" }, element("td", { colspan: cells.length + 1 }, targetTable(row)))] : [line];
}

/** A letter as a badge; a value, of the headline and of a difference with its interval; beside a difference its drawing. */
function shownCell(key, row) {
  const cell = row.cells[key];
  if (!cell) return ["–"];
  if (key === "tier") return [element("span", { class: cell.text === "A" ? "tier first" : "tier" }, cell.text)];
  const [value, interval] = cell.text.split(/ (?=\[)/);
  if (!interval || ![data.headline.key, "gain"].includes(key)) return [value];
  return [...(key === "gain" ? [forest(cell)] : []), value, element("span", { class: "interval" }, ` ${interval}`)];
}

/** Where a difference and its interval lie among those of the display, as the style sheet draws it. */
function forest({ low, value, high }) {
  const ends = data.rows[state.display].flatMap(({ cells }) => [cells.gain?.low ?? 0, cells.gain?.high ?? 0]);
  const [least, most] = [Math.min(...ends), Math.max(...ends)];
  const mark = element("span", { class: "forest", "aria-hidden": "true" });
  for (const [name, place] of Object.entries({ zero: 0, low, mean: value, high })) {
    mark.style.setProperty(`--${name}`, `${(100 * (place - least)) / (most - least || 1)}%`);
  }
  return mark;
}

/** Every target of a method: its scores, its difference to the baseline, and the way to its picture. */
function targetTable(row) {
  const compared = data.values[state.display][data.baseline] && row.method !== data.baseline;
  const headings = ["target", ...data.scores.map((score) => score.heading), ...(compared ? [`difference to ${data.baseline}`] : []), "picture"];
  const lines = data.targets.map((target, index) => {
    const values = data.scores.map(({ key, digits }) => data.values[state.display][row.method][key][index]?.toFixed(digits) ?? "–");
    if (compared) values.push(withUnit(differenceOf(row.method, index), true));
    const look = () => {
      update({ target, right: `capture:${row.method}` });
      byId("viewer").scrollIntoView();
      byId("panes").focus({ preventScroll: true });
    };
    const there = pictureOf(`capture:${row.method}`, target) !== null;
    const way = there ? element("button", { type: "button", click: look, "aria-label": `look at ${target}` }, "look") : "–";
    return element("tr", {}, element("th", { scope: "row" }, target), ...[...values, way].map((value) => element("td", {}, value)));
  });
  return element(
    "table",
    { class: "targets" },
    element("caption", {}, `${row.method} on ${state.display}, target by target`),
    element("thead", {}, element("tr", {}, ...headings.map((text) => element("th", { scope: "col" }, text)))),
    element("tbody", {}, ...lines)
  );
}

/** Headline score of a target above that of the baseline; null for a hole. */
function differenceOf(label, index) {
  const [ours, theirs] = [label, data.baseline].map((name) => data.values[state.display][name][data.headline.key][index]);
  return ours === null || theirs === null ? null : ours - theirs;
}

watch(["display", "sort", "order", "filter", "open"], drawTable);
document.addEventListener("keydown", (event) => event.key === "Escape" && update({ open: "" }));
