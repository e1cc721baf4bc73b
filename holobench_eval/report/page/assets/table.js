// The table of a display: sorted by its headings, filtered, a row opening to its targets.

function setUpTable() {
  const displays = data.displays.map((name) => [name, name]);
  const options = data.changed.length ? [["displays", displays], ["changed displays", data.changed.map((name) => [name, name])]] : displays;
  fill(byId("display"), options, state.display);
  byId("display").addEventListener("change", (event) => update({ display: event.target.value }));
  byId("filter").addEventListener("input", (event) => update({ filter: event.target.value }));
  watch((changed) => {
    if (["display", "sort", "order", "filter", "open"].some((key) => changed.has(key))) drawTable();
  });
}

function drawTable() {
  byId("display").value = state.display;
  if (byId("filter").value !== state.filter) byId("filter").value = state.filter;
  const rows = shownRows();
  const all = (data.rows[state.display] ?? []).length;
  const floors = (data.floors[state.display] ?? []).map((floor) => `${floor.name} ${withUnit(floor.mean)}`);
  byId("table-note").textContent =
    `${rows.length} of ${all} methods on ${state.display}. Brackets hold 95 % intervals. ` +
    (floors.length ? `Floor, ${data.headline.title}: ${floors.join(", ")}.` : "");
  const focused = document.activeElement?.dataset?.key;
  byId("rows").replaceChildren(
    element("caption", { class: "hidden" }, `Methods on ${state.display}`),
    element("thead", {}, element("tr", {}, heading("method", "method"), ...columns().map((c) => heading(c.key, c.heading)))),
    element("tbody", {}, ...rows.flatMap((row, index) => [...groupRow(rows, index), ...bodyRows(row)]))
  );
  if (focused) byId("rows").querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

/** The columns that the display has anything in. */
function columns() {
  const rows = data.rows[state.display] ?? [];
  return data.columns.filter((column) => rows.some((row) => (row.cells[column.key]?.value ?? null) !== null));
}

function heading(key, text) {
  const sorted = state.sort === key;
  const column = data.columns.find((item) => item.key === key);
  const falling = (state.order === "best") === Boolean(column && column.higher);
  const turn = () => update({ sort: key, order: sorted && state.order === "best" ? "worst" : "best" });
  return element(
    "th",
    { scope: "col", "aria-sort": sorted ? (falling ? "descending" : "ascending") : "none" },
    element("button", { type: "button", "data-key": `sort ${key}`, click: turn }, text, element("span", { class: "arrow", "aria-hidden": "true" }, sorted ? (falling ? "▼" : "▲") : "↕"))
  );
}

/** The name of a group above its first row, where rows stand in the order of the board. */
function groupRow(rows, index) {
  const group = data.methods[rows[index].method].group;
  if (state.sort || (index && data.methods[rows[index - 1].method].group === group)) return [];
  return [element("tr", { class: "group" }, element("th", { scope: "rowgroup", colspan: String(columns().length + 1) }, group))];
}

function bodyRows(row) {
  const open = state.open === row.method;
  const toggle = () => update({ open: open ? "" : row.method });
  const name = element(
    "button",
    { type: "button", "aria-expanded": String(open), "data-key": `open ${row.method}`, click: toggle },
    element("span", { class: "arrow", "aria-hidden": "true" }, open ? "▾" : "▸"),
    swatch(row.method),
    row.marked
  );
  const holes = row.n < data.targets.length ? ` (${row.n} of ${data.targets.length} targets)` : "";
  const cells = columns().map((column) => element("td", {}, ...spaced(row.cells[column.key]?.text ?? "–")));
  const line = element("tr", {}, element("th", { scope: "row" }, name, holes), ...cells);
  return open ? [line, element("tr", { class: "opened" }, element("td", { colspan: String(cells.length + 1) }, targetTable(row)))] : [line];
}

/** A value and, where there is one, its interval, which may stand on a line of its own. */
function spaced(text) {
  const at = text.indexOf(" [");
  return at < 0 ? [text] : [text.slice(0, at), " ", element("span", { class: "interval" }, text.slice(at + 1))];
}

/** Every target of a method: its scores, its difference to the baseline, and the way to its picture. */
function targetTable(row) {
  const values = data.values[state.display][row.method];
  const baseline = data.values[state.display][data.baseline];
  const compared = baseline && row.method !== data.baseline;
  const headings = ["target", ...data.scores.map((score) => score.heading), ...(compared ? [`difference to ${data.baseline}`] : []), "picture"];
  const lines = data.targets.map((target, index) => {
    const scores = data.scores.map((score) => {
      const value = values[score.key][index];
      return element("td", {}, value === null ? "–" : value.toFixed(score.digits));
    });
    const difference = compared ? [element("td", {}, withUnit(differenceOf(row.method, index), true))] : [];
    const there = pictureOf(`capture:${row.method}`, target.name) !== null;
    const look = () => {
      update({ target: target.name, right: `capture:${row.method}` });
      byId("viewer").scrollIntoView();
      byId("canvas").focus({ preventScroll: true });
    };
    const way = there ? element("button", { type: "button", click: look, "aria-label": `look at ${target.name}` }, "look") : "–";
    return element("tr", {}, element("th", { scope: "row" }, target.name), ...scores, ...difference, element("td", {}, way));
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
  const [ours, theirs] = [label, data.baseline].map((name) => data.values[state.display][name]?.[data.headline.key][index] ?? null);
  return ours === null || theirs === null ? null : ours - theirs;
}
