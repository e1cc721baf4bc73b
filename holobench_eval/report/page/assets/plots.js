// What all plots share, and the plot of paired differences. Plots are drawn by Observable Plot.

const FONT = "12px system-ui, sans-serif";
const CHARACTER = 7.2; // width of a rather wide character of that font [px]

/** Width of a plot [px]: that of the page. */
const plotWidth = (host) => Math.max(280, Math.min(1000, host.clientWidth || 1000));

/** Room for names left of a plot [px]. */
const nameRoom = (names) => Math.min(NARROW.matches ? 120 : 260, 16 + CHARACTER * Math.max(4, ...names.map((name) => name.length)));

/** A name cut to the room there is. */
function shortName(name, room) {
  const most = Math.floor((room - 14) / CHARACTER);
  return name.length > most ? `${name.slice(0, most - 1)}…` : name;
}

/**
 * A plot with what it takes to be read without a pointer: marks of the class `mark` are reached by Tab and read out.
 * click: called with what is under the pointer.
 */
function show(host, options, mark, texts, click) {
  const figure = Plot.plot({ className: "chart", style: { font: FONT, overflow: "visible" }, ...options });
  for (const sheet of figure.querySelectorAll("style")) sheet.remove(); // page.css has its rules; the policy forbids others
  const readout = element("p", { class: "readout", role: "status" });
  for (const group of figure.querySelectorAll("g[aria-label]")) group.removeAttribute("aria-label"); // "dot", "tick"
  const marks = figure.querySelectorAll(`.${mark} > *`);
  marks.forEach((node, index) => {
    node.setAttribute("tabindex", "0");
    node.setAttribute("role", "img");
    node.setAttribute("aria-label", texts[index] ?? "");
    node.addEventListener("focus", () => (readout.textContent = texts[index] ?? ""));
  });
  if (marks.length) figure.setAttribute("role", "group"); // an image would hide its marks from a screen reader
  if (click) {
    figure.addEventListener("click", () => figure.value && click(figure.value));
    figure.style.cursor = "pointer";
  }
  host.replaceChildren(figure, readout);
}

/** Draw again when the width changes, and now. */
function redrawn(host, keys, draw) {
  watch((changed) => {
    if (keys.some((key) => changed.has(key))) draw();
  });
  let width = host.clientWidth;
  new ResizeObserver(() => {
    if (host.clientWidth !== width) {
      width = host.clientWidth;
      draw();
    }
  }).observe(host);
}

function setUpPaired() {
  if (!data.baseline) {
    byId("paired").hidden = true;
    return;
  }
  redrawn(byId("paired-plot"), ["display", "filter", "sort", "order"], drawPaired);
}

function drawPaired() {
  const host = byId("paired-plot");
  const rows = shownRows().filter((row) => row.cells.gain);
  if (!state.sort) rows.sort((a, b) => (data.headline.higher ? -1 : 1) * (a.cells.gain.value - b.cells.gain.value));
  byId("paired-note").textContent = rows.length
    ? `${data.headline.heading}, of each target above that of ${data.baseline}, on ${state.display}. Small dots are targets, ` +
      `the large one below is their mean with its 95 % interval. ${data.headline.higher ? "Right" : "Left"} of zero is better. A click on a dot shows its pictures.`
    : `No method on ${state.display} passes the filter and has a difference to ${data.baseline ?? "a baseline"}.`;
  if (!rows.length) return host.replaceChildren();
  const dots = rows.flatMap((row) =>
    data.targets.map((target, index) => ({ method: row.method, target: target.name, value: differenceOf(row.method, index) }))
  ).filter((dot) => dot.value !== null);
  const means = rows.map((row) => ({ method: row.method, oracle: data.methods[row.method].oracle, ...row.cells.gain }));
  const names = rows.map((row) => row.method);
  const room = nameRoom(names);
  show(
    host,
    {
      width: plotWidth(host),
      height: 60 + 34 * rows.length,
      marginLeft: room,
      marginTop: 10,
      marginBottom: 44,
      x: { label: `difference to ${data.baseline}${data.headline.unit ? ` [${data.headline.unit}]` : ""}`, grid: true, labelAnchor: "center", labelArrow: "none" },
      y: { domain: names, label: null, tickSize: 0, tickFormat: (name) => shortName(name, room) },
      marks: [
        Plot.ruleX([0], { stroke: "currentColor", strokeWidth: 1.5 }),
        Plot.dot(dots, { x: "value", y: "method", r: 2.5, dy: -8, fill: (dot) => colourOf(dot.method), fillOpacity: 0.6 }),
        Plot.ruleY(means.filter((mean) => "low" in mean), { x1: "low", x2: "high", y: "method", stroke: "currentColor", strokeWidth: 2 }),
        Plot.dot(means, {
          x: "value", y: "method", r: 5.5, stroke: "currentColor", strokeWidth: 1.5, className: "mean",
          fill: (mean) => (mean.oracle ? "var(--page)" : colourOf(mean.method)),
        }),
        Plot.tip(dots, Plot.pointer({ x: "value", y: "method", dy: -8, title: (dot) => `${dot.method}\n${dot.target}: ${withUnit(dot.value, true)}` })),
      ],
    },
    "mean",
    means.map((mean) => `${mean.method}: mean difference ${mean.text}${data.headline.unit ? ` ${data.headline.unit}` : ""}`),
    (dot) => {
      update({ target: dot.target, right: `capture:${dot.method}` });
      byId("status").textContent = `The pictures now show ${dot.target}, ${dot.method}.`;
    }
  );
}
