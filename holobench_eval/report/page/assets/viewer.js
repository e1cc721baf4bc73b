// Two pictures of one target: with a slider, side by side or in alternation, always at the same place. The style sheet
// lays the panes over or beside each other; here each picture gets its place in its pane.

const MOST_ZOOM = 64;
const KINDS = { capture: "", error: "error of ", flip: "FLIP of " };
const SIDES = ["left", "right"];
let sides = []; // of both: {caption, and where there is a picture image, pixels and, of a map, errors}
let drawing = 0; // counts the pictures asked for, so that a late one does not replace a newer one

function setUpViewer() {
  byId("strip").hidden = byId("pictures").hidden = Object.values(data.pictures.targets).flat().every((number) => number === null);
  if (byId("pictures").hidden) return;
  const actions = {
    closer: () => zoomBy(2),
    farther: () => zoomBy(0.5),
    fit: showAll,
    pixels: () => update({ zoom: 4 }),
    swap,
    enlarge: () => (document.fullscreenElement ? document.exitFullscreen() : byId("stage").requestFullscreen()),
  };
  for (const [id, action] of Object.entries(actions)) byId(id).addEventListener("click", action);
  for (const side of SIDES) byId(side).addEventListener("input", (event) => update({ [side]: event.target.value }));
  byId("enlarge").hidden = !document.fullscreenEnabled;
  setUpPointer(byId("panes"));
  byId("panes").addEventListener("keydown", onKey);
  watch(["display", "target", "left", "right", "values", "channel", "scale"], choose);
  watch(["mode", "split", "zoom", "x", "y"], paint);
  new ResizeObserver(paint).observe(byId("stage"));
  watch(["display", "target", "filter", "sort", "order", "values", "channel"], drawStrip);
  watch(["right"], pressStrip);
}

/** The side's choice; where nothing, or something that is not there, was chosen: the best method with a picture. */
function chosen(side) {
  if (state[side] && pictureOf(state[side]) !== null) return state[side];
  if (side === "left") return "truth";
  const score = ({ cells }) => (data.headline.higher ? -1 : 1) * cells[data.headline.key].value;
  const rows = data.rows[state.display].filter(({ method }) => pictureOf(`capture:${method}`) !== null && !data.methods[method].oracle);
  const best = rows.sort((a, b) => score(a) - score(b))[0];
  return best ? `capture:${best.method}` : "truth";
}

/** Fill the controls and fetch the pictures. */
async function choose() {
  const option = (value, text) => {
    const made = element("option", { value }, text);
    made.disabled = pictureOf(value) === null;
    return made;
  };
  const group = (label, kind) => {
    const options = data.rows[state.display].map((row) => option(`${kind}:${row.method}`, KINDS[kind] + row.marked));
    return element("optgroup", { label }, ...options);
  };
  for (const target of byId("target").options) target.disabled = pictureOf("truth", target.value) === null;
  for (const side of SIDES) {
    const kinds = [group(`${data.words.scored}s`, "capture"), group("absolute errors", "error"), group("FLIP", "flip")];
    byId(side).replaceChildren(option("truth", data.words.truth), ...kinds);
    byId(side).value = chosen(side);
  }
  const asked = ++drawing;
  const loaded = await Promise.all(SIDES.map((side) => load(chosen(side))));
  if (asked !== drawing) return;
  sides = loaded;
  document.querySelectorAll(".pane > canvas").forEach((canvas, index) => put(canvas, sides[index].image));
  SIDES.forEach((side, index) => (byId(`caption-${side}`).textContent = sides[index].caption));
  byId("panes").setAttribute("aria-label", `${state.target} on ${state.display}. Left: ${sides[0].caption}. Right: ${sides[1].caption}.`);
  describeErrors();
  paint();
}

async function load(option) {
  const [number, truth] = [pictureOf(option), pictureOf("truth")];
  if (number === null) return { caption: `no picture of ${state.target} in this page` };
  const pixels = await pixelsOf(number);
  if (option === "truth") return { image: seen(pixels), pixels, caption: sentence(data.words.truth) };
  const [kind, label] = [option.slice(0, option.indexOf(":")), option.slice(option.indexOf(":") + 1)];
  const score = `${data.headline.title} ${withUnit(data.values[state.display][label][data.headline.key][targetIndex()])}`;
  if (kind === "capture") return { image: seen(pixels), pixels, caption: `${label}: ${score}` };
  const reference = truth === null ? null : await pixelsOf(truth);
  if (reference?.width !== pixels.width || reference.height !== pixels.height) return { caption: `${label} has another size than the ${data.words.truth}` };
  const errors = kind === "flip" ? flipMap(pixels, reference) : absoluteErrors(pixels, reference);
  const image = coloured(errors, pixels.width, pixels.height, kind === "flip" ? 1 : Number(state.scale));
  return { image, pixels, errors, caption: `${sentence(KINDS[kind])}${label}: ${kind === "flip" ? `mean ${(sum(errors) / errors.length).toFixed(3)}` : score}` };
}

function describeErrors() {
  const shown = SIDES.map((side) => chosen(side).split(":")[0]);
  const which = state.channel === "all" ? "mean over colours" : ["red", "green", "blue"][Number(state.channel)];
  const values = state.values === "linear" ? "linear light" : "sRGB values";
  const absolute = `Absolute error, ${which}, in ${values} with full scale 1: black is 0, the brightest colour ${state.scale} and more. `;
  const flip = "FLIP (Andersson et al. 2020) at 67 pixels a degree, from 0 to 1, of all colours in sRGB.";
  byId("error-note").textContent = (shown.includes("error") ? absolute : "") + (shown.includes("flip") ? flip : "");
}

/** The picture in a pane: sizes of both, zoom [screen pixels a pixel], the pixel in the middle of the pane. */
function layout() {
  const { width, height } = sides.find(({ image }) => image)?.image ?? { width: 1, height: 1 };
  const { clientWidth: wide, clientHeight: tall } = byId("panes").firstElementChild;
  const fit = Math.min(wide / width, tall / height);
  const [x, y] = [state.x === "" ? width / 2 : Number(state.x), state.y === "" ? height / 2 : Number(state.y)];
  return { width, height, wide, tall, fit, zoom: Number(state.zoom) || fit, x, y };
}

function paint() {
  const { width, height } = layout();
  const stage = byId("stage");
  stage.dataset.mode = state.mode;
  stage.style.setProperty("--aspect", ((state.mode === "side" ? 2 : 1) * width) / height);
  stage.style.setProperty("--split", `${state.split}%`);
  byId("split").disabled = state.mode !== "slider";
  const { wide, tall, zoom, x, y } = layout(); // of panes of the new shape
  for (const canvas of document.querySelectorAll(".pane > canvas")) {
    canvas.style.transform = `translate(${wide / 2 - x * zoom}px, ${tall / 2 - y * zoom}px) scale(${zoom})`;
    canvas.style.imageRendering = zoom < 1 ? "auto" : "pixelated";
  }
}

const showAll = () => update({ zoom: "", x: "", y: "" });
const swap = () => update({ left: chosen("right"), right: chosen("left") });

/** Zoom, keeping the pixel under (px, py) of the pane, by default its middle, in its place. */
function zoomBy(factor, px, py) {
  const { wide, tall, zoom, fit, x, y } = layout();
  const to = Math.min(MOST_ZOOM, Math.max(Math.min(1, fit) / 2, zoom * factor));
  const [dx, dy] = [(px ?? wide / 2) - wide / 2, (py ?? tall / 2) - tall / 2];
  update({ zoom: to.toFixed(3), x: (x + dx / zoom - dx / to).toFixed(1), y: (y + dy / zoom - dy / to).toFixed(1) });
}

function move(dx, dy) {
  const { zoom, x, y } = layout();
  update({ zoom, x: (x - dx / zoom).toFixed(1), y: (y - dy / zoom).toFixed(1) });
}
