// The board of a display: groups of methods, sorted within by a heading, filtered, a row opening to its targets.

const MOST_COLUMNS = 9; // with the names of the methods

for (const { cells } of Object.values(data.rows).flat()) {
  cells.photographs = cells.captures === undefined ? null : (cells.training_captures ?? 0) + cells.captures; // that one picture needs
}

/** The headline metric by target of a method. */
const valuesOf = (method) => data.rows[state.display].find((row) => row.method === method)?.values;

/** The rows of the display that pass the filter, by group and sorted. */
function shownRows() {
  const words = state.filter.toLowerCase().split(/\s+/);
  const within = (value, most) => most === "" || (value !== null && value !== undefined && value <= Number(most));
  const rows = data.rows[state.display].filter(({ method, cells, marks }) => {
    const { title, registered, group } = data.methods[method];
    const text = [method, title, registered, group, ...marks].join(" ").toLowerCase();
    return words.every((word) => text.includes(word)) && within(cells.photographs, state.photographs) && within(cells.cpu_s, state.seconds);
  });
  const column = data.columns.find(({ key }) => key === state.sort);
  const sign = (state.order === "best" ? 1 : -1) * (column?.higher ? -1 : 1);
  const place = (row) => (column.key === "tier" ? row.tier || "~" : row.cells[column.key] ?? sign * Infinity); // holes stay below
  const compare = (a, b) => (column ? (place(a) === place(b) ? 0 : place(a) < place(b) ? -sign : sign) : sign * a.method.localeCompare(b.method, "en"));
  const lacks = (row) => row.cells.n < data.targets.length;
  rows.sort((a, b) => lacks(a) - lacks(b) || compare(a, b));
  return data.groups.flatMap((group) => rows.filter(({ method }) => data.methods[method].group === group));
}

/** The columns that the display has anything in: the most, or all. */
function columns() {
  const known = data.columns.filter(({ key }) => data.rows[state.display].some((row) => (key === "tier" ? row.tier : (row.cells[key] ?? null) !== null)));
  return state.all ? known : known.filter(({ first }) => first).slice(0, MOST_COLUMNS - 1);
}

function drawBoard() {
  const [rows, all] = [shownRows(), data.rows[state.display]];
  const floor = data.floors[state.display] ?? null;
  byId("table-title").textContent = `Board: ${state.display}`;
  byId("table-note").textContent =
    (rows.length < all.length ? `${all.length - rows.length} of ${all.length} methods are hidden by the filter. ` : `${all.length} methods. `) +
    "Brackets: 95 % intervals. " +
    (columns().some(({ key }) => key === "tier") ? "A letter holds the methods of a group that no test tells from its best. " : "") +
    (floor === null ? "" : `A gray picture scores ${withUnit(floor)}.`);
  const focused = document.activeElement?.dataset?.key;
  byId("rows").replaceChildren(
    element("caption", { class: "hidden" }, `Methods on ${state.display}`),
    element("thead", {}, element("tr", {}, heading("method", "method"), ...columns().map(({ key, heading: text }) => heading(key, text)))),
    ...data.groups.map((group) => groupBody(group, rows.filter(({ method }) => data.methods[method].group === group))).filter(Boolean)
  );
  byId("all").checked = Boolean(state.all);
  if (focused) byId("rows").querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

function heading(key, text) {
  const sorted = state.sort === key;
  const falling = (state.order === "best") === Boolean(data.columns.find((column) => column.key === key)?.higher);
  const turn = () => update({ sort: key, order: sorted && state.order === "best" ? "worst" : "best" });
  const arrow = element("span", { class: "arrow", "aria-hidden": "true" }, sorted ? (falling ? "▼" : "▲") : "↕");
  const order = sorted ? (falling ? "descending" : "ascending") : "none";
  return element("th", { scope: "col", "aria-sort": order }, element("button", { type: "button", "data-key": `sort ${key}`, click: turn }, text, arrow));
}

function groupBody(group, rows) {
  const name = element("th", { scope: "rowgroup", colspan: columns().length + 1 }, group);
  return rows.length && element("tbody", {}, element("tr", { class: "group" }, name), ...rows.flatMap(bodyRows));
}

function bodyRows(row) {
  const { title, colour, oracle } = data.methods[row.method];
  const open = state.open === row.method;
  const swatch = element("span", { class: oracle ? "swatch hollow" : "swatch", "aria-hidden": "true" });
  swatch.style.setProperty("--colour", colour); // as in the figures
  const lacking = row.cells.n < data.targets.length ? [`${row.cells.n} of ${data.targets.length} targets`] : [];
  const quiet = (kind, text) => element("span", { class: `quiet ${kind}` }, text && ` ${text}`);
  const attributes = { type: "button", "aria-expanded": open, "data-key": `open ${row.method}`, click: () => update({ open: open ? "" : row.method }) };
  const arrow = element("span", { class: "arrow", "aria-hidden": "true" }, open ? "▾" : "▸");
  const names = element("span", {}, title, quiet("code", title === row.method ? "" : row.method), quiet("marks", [...row.marks, ...lacking].join(", ")));
  const name = element("button", attributes, arrow, swatch, names);
  const cells = columns().map((column) => element("td", {}, ...shownCell(column, row)));
  const line = element("tr", { class: row.verdict, "data-method": row.method }, element("th", { scope: "row" }, name), ...cells);
  return open ? [line, element("tr", { class: "opened" }, element("td", { colspan: cells.length + 1 }, targetTable(row)))] : [line];
}

/** A letter as a badge; photographs in words; of the headline and a difference the interval, of this a drawing, too. */
function shownCell({ key, low, high, digits, signed }, { method, tier, cells }) {
  if (key === "tier") return tier ? [element("span", { class: tier === "A" ? "tier first" : "tier" }, tier)] : ["–"];
  if (key === "photographs" && cells.photographs) {
    return [[cells.training_captures && `${number(cells.training_captures)} once`, cells.captures && `${number(cells.captures)} a picture`].filter(Boolean).join(" + ")];
  }
  const value = cells[key] ?? null;
  if (signed && method === data.baseline) return ["baseline"];
  if (key === "p" && value !== null && value < 0.001) return ["< 0.001"];
  const ends = [cells[low], cells[high]];
  if (!(signed || key === data.headline.key) || value === null || ends[0] == null) return [number(value, digits, signed)];
  const interval = element("span", { class: "interval" }, ` [${ends.map((end) => number(end, digits, signed)).join(", ")}]`);
  return [...(signed ? [forest(ends[0], value, ends[1])] : []), number(value, digits, signed), interval];
}

/** Where a difference and its interval lie among those of the display, as the style sheet draws it. */
function forest(low, mean, high) {
  const ends = data.rows[state.display].flatMap(({ cells }) => [cells.lowest ?? 0, cells.highest ?? 0]);
  const [least, most] = [Math.min(...ends), Math.max(...ends)];
  const mark = element("span", { class: "forest", "aria-hidden": "true" });
  for (const [name, place] of Object.entries({ zero: 0, low, mean, high })) {
    mark.style.setProperty(`--${name}`, `${(100 * (place - least)) / (most - least || 1)}%`);
  }
  return mark;
}

/** Every target of a method: its score, its difference to the baseline, and the way to its picture. */
function targetTable({ method }) {
  const [ours, theirs] = [valuesOf(method), valuesOf(data.baseline)];
  const compared = theirs && method !== data.baseline;
  const headings = ["target", data.headline.title, ...(compared ? [`difference to ${data.baseline}`] : []), "picture"];
  const lines = data.targets.map((target, index) => {
    const holes = [ours[index], theirs?.[index] ?? null].includes(null);
    const values = [withUnit(ours[index]), ...(compared ? [holes ? "–" : withUnit(ours[index] - theirs[index], true)] : [])];
    const look = () => {
      update({ target, methods: [...new Set([...wallMethods(), method])].join("\n") });
      byId("viewer").scrollIntoView();
      byId("wall").focus({ preventScroll: true });
    };
    const way = pictureOf(method, target) === null ? "–" : element("button", { type: "button", click: look, "aria-label": `look at ${target}` }, "look");
    return element("tr", {}, element("th", { scope: "row" }, target), ...[...values, way].map((value) => element("td", {}, value)));
  });
  return element(
    "table",
    { class: "targets" },
    element("caption", {}, `${method} on ${state.display}, target by target`),
    element("thead", {}, element("tr", {}, ...headings.map((text) => element("th", { scope: "col" }, text)))),
    element("tbody", {}, ...lines)
  );
}

watch(["display", "sort", "order", "filter", "photographs", "seconds", "all", "open"], drawBoard);
byId("all").addEventListener("input", (event) => update({ all: event.target.checked ? "yes" : "" }));
document.addEventListener("keydown", (event) => event.key === "Escape" && update({ open: "" }));
