// Quality against its cost, sweeps of a display, and the places of methods over draws of a bench.

const SYMBOLS = { "open loop": "circle", calibrated: "square", online: "diamond", given: "circle" };
const COSTS = [
  { key: "total_captures", type: "symlog", note: "captures in total, of training and of all targets (zero at the left)" },
  { key: "solving_s", type: "log", note: "computing time" },
];

function setUpCharts() {
  const list = byId("chart-list");
  const drawers = [...COSTS.map((cost) => (host) => drawFrontier(host, cost)), ...data.sweeps.map((sweep) => (host) => drawSweep(host, sweep)), ...data.ranks.map((found) => (host) => drawRanks(host, found))];
  const hosts = drawers.map((draw) => ({ draw, host: list.appendChild(element("div", { class: "plot" })) }));
  redrawn(list, ["display", "filter"], () => {
    for (const { draw, host } of hosts) draw(host);
    const any = hosts.some(({ host }) => host.hasChildNodes());
    byId("charts").hidden = byId("to-charts").hidden = !any;
  });
}

/** A heading and a sentence above a plot, and the place of the plot. */
function framed(host, title, note) {
  const place = element("div");
  host.replaceChildren(element("h3", {}, title), element("p", {}, note), place);
  return place;
}

/** Rows with a mean over every target: only these may be compared. */
const complete = (rows) => rows.filter((row) => row.n === data.targets.length && row.cells[data.headline.key].value !== null);

function drawFrontier(host, cost) {
  const column = data.columns.find((item) => item.key === cost.key);
  const all = complete(data.rows[state.display] ?? []);
  const rows = complete(shownRows()).filter((row) => {
    const spent = row.cells[cost.key]?.value ?? null;
    return spent !== null && !data.methods[row.method].oracle && (cost.type === "symlog" || spent > 0);
  });
  if (!column || rows.length < 2 || !rows.some((row) => row.cells[cost.key].value > 0)) return host.replaceChildren();
  const place = framed(
    host,
    `Quality against ${column.heading}`,
    `${data.headline.heading} on ${state.display}, against ${cost.note}. Bars: 95 % interval of the paired difference to ` +
      "the baseline, else of the mean. Pale steps: the best quality for a cost. Circles are open loop, squares calibrated, diamonds use the camera for the scored image."
  );
  const marks = rows.map((row) => frontierMark(row, cost));
  const front = bestFor(marks);
  const lines = [data.baseline, data.oracles[state.display]].flatMap((name, index) => {
    const found = all.find((row) => row.method === name);
    return found ? [{ value: found.cells[data.headline.key].value, text: index ? (name === "oracle" ? name : `oracle ${name}`) : `baseline ${name}` }] : [];
  });
  const dashed = lines.map((item) => `${item.text}, ${withUnit(item.value)}`).join("; ");
  if (dashed) place.previousSibling.append(` Dashed: ${dashed}.`);
  show(
    place,
    {
      width: plotWidth(host),
      height: 360,
      marginLeft: 50,
      marginRight: 20,
      marginTop: 20,
      marginBottom: 44,
      x: { type: cost.type, label: column.heading, labelAnchor: "center", labelArrow: "none", nice: true, ...(cost.type === "symlog" ? { constant: 10, ticks: 6 } : { ticks: NARROW.matches ? 4 : 8, tickFormat: "~g" }) },
      y: { label: data.headline.heading, grid: true, nice: true, labelArrow: "none" },
      marks: [
        Plot.ruleY(lines, { y: "value", stroke: "currentColor", strokeDasharray: "5 4" }),
        Plot.line(front, { x: "cost", y: "value", curve: "step-after", stroke: "currentColor", strokeOpacity: 0.25, strokeWidth: 4 }),
        Plot.ruleX(marks.filter((mark) => "low" in mark), { x: "cost", y1: "low", y2: "high", stroke: (mark) => colourOf(mark.method) }),
        Plot.dot(marks, { x: "cost", y: "value", r: 5, symbol: (mark) => SYMBOLS[mark.track] ?? "circle", fill: (mark) => colourOf(mark.method), stroke: "var(--page)", className: "row" }),
        Plot.text(NARROW.matches ? [] : front, { x: "cost", y: "value", text: "method", dy: 14, textAnchor: "start", dx: 6, stroke: "var(--page)", fill: "currentColor" }),
        Plot.tip(marks, Plot.pointer({ x: "cost", y: "value", title: "text" })),
      ],
      symbol: { type: "identity" },
    },
    "row",
    marks.map((mark) => mark.text)
  );
}

function frontierMark(row, cost) {
  const headline = row.cells[data.headline.key];
  const gain = row.cells.gain;
  const ends =
    gain && "low" in gain
      ? { low: headline.value + gain.low - gain.value, high: headline.value + gain.high - gain.value }
      : row.method !== data.baseline && "low" in headline ? { low: headline.low, high: headline.high } : {};
  const text = `${row.marked}\n${data.headline.title} ${headline.text}\n${row.cells[cost.key].text} ${data.columns.find((item) => item.key === cost.key).heading}`;
  return { method: row.method, track: data.methods[row.method].track, cost: row.cells[cost.key].value, value: headline.value, text, ...ends };
}

/** The marks that no cheaper one equals, cheapest first. */
function bestFor(marks) {
  const better = (a, b) => (data.headline.higher ? a > b : a < b);
  const found = [];
  for (const mark of marks.slice().sort((a, b) => a.cost - b.cost || (better(a.value, b.value) ? -1 : 1))) {
    if (!found.length || better(mark.value, found[found.length - 1].value)) found.push(mark);
  }
  return found;
}

function drawSweep(host, sweep) {
  const here = sweep.display === state.display || sweep.points.some((point) => point.condition === state.display);
  const wanted = new Set(shownRows().map((row) => row.method));
  const marks = !here ? [] : sweep.points.flatMap((point) =>
    complete(data.rows[point.condition] ?? []).filter((row) => wanted.has(row.method)).map((row) => {
      const cell = row.cells[data.headline.key];
      const [low, high] = sweep.ends[point.condition]?.[row.method] ?? [];
      return { method: row.method, at: point.value, value: cell.value, low, high, text: `${row.method}\n${point.value} ${sweep.unit}: ${cell.text}` };
    })
  );
  if (!marks.length) return host.replaceChildren();
  const place = framed(host, `Sweep: ${sweep.words}`, `${data.headline.heading} on ${sweep.display} as it is changed. Bars: 95 % interval of the paired loss against the unchanged display.`);
  const names = [...new Set(marks.map((mark) => mark.method))];
  const stroke = (mark) => colourOf(mark.method);
  show(
    place,
    {
      width: plotWidth(host),
      height: 340,
      marginLeft: 50,
      marginTop: 20,
      marginBottom: 44,
      x: { type: sweep.numeric ? "linear" : "point", domain: sweep.numeric ? undefined : sweep.points.map((point) => point.value), label: `${sweep.words}${sweep.unit ? ` [${sweep.unit}]` : ""}`, labelAnchor: "center", labelArrow: "none" },
      y: { label: data.headline.heading, grid: true, nice: true, labelArrow: "none" },
      marks: [
        Plot.ruleX(marks.filter((mark) => mark.low !== undefined), { x: "at", y1: "low", y2: "high", stroke }),
        Plot.line(marks, { x: "at", y: "value", z: "method", stroke }),
        Plot.dot(marks, { x: "at", y: "value", fill: stroke, r: 3.5, className: "point" }),
        Plot.tip(marks, Plot.pointer({ x: "at", y: "value", title: "text" })),
      ],
    },
    "point",
    marks.map((mark) => mark.text)
  );
  host.append(element("ul", { class: "legend" }, ...names.map((name) => element("li", {}, swatch(name), name))));
}

function drawRanks(host, found) {
  const wanted = new Set(shownRows().map((row) => row.method));
  const kept = found.methods.filter((name) => wanted.has(name));
  if (found.display !== state.display || !kept.length) return host.replaceChildren();
  const place = framed(host, "Places over draws of the bench", `Share of ${found.draws} random draws of ${found.display} in which a method has a place; methods in their order on the display itself.`);
  const cells = kept.flatMap((name) => found.shares[found.methods.indexOf(name)].map((share, index) => ({ name, place: index + 1, share })));
  const room = nameRoom(kept);
  show(
    place,
    {
      width: Math.min(plotWidth(host), room + 90 * found.methods.length),
      height: 60 + 30 * kept.length,
      marginLeft: room,
      marginBottom: 40,
      x: { type: "band", label: "place", labelAnchor: "center", labelArrow: "none" },
      y: { type: "band", domain: kept, label: null, tickSize: 0, tickFormat: (name) => shortName(name, room) },
      marks: [
        Plot.cell(cells, { x: "place", y: "name", fill: "var(--accent)", fillOpacity: (cell) => 0.05 + 0.6 * cell.share, className: "share", inset: 0.5 }),
        Plot.text(cells.filter((cell) => cell.share > 0), { x: "place", y: "name", text: (cell) => `${Math.round(100 * cell.share)} %` }),
        Plot.tip(cells, Plot.pointer({ x: "place", y: "name", title: (cell) => `${cell.name}\nplace ${cell.place}: ${Math.round(100 * cell.share)} % of draws` })),
      ],
      opacity: { type: "identity" },
    },
    "share",
    cells.map((cell) => `${cell.name}, place ${cell.place}: ${Math.round(100 * cell.share)} % of draws`)
  );
}
