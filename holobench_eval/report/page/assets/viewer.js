// Two pictures of one target in one canvas: with a slider, side by side or in alternation, always at the same place.

const FLICKER = 600; // ms a side; slower than three flashes a second
const MOST_ZOOM = 64;
const GRIP = 14; // px around the slider's line that move it
const NAMES = { capture: "", error: "error of ", flip: "FLIP of " };
const SCALES = ["0.05", "0.1", "0.2", "0.5", "1"];
let sides = []; // of both sides: {canvas, pixels, caption}, or {caption} where there is no picture
let flickered = 0;
let drawing = 0; // counts the pictures asked for, so that a late one does not replace a newer one

function setUpViewer() {
  byId("picture-note").textContent = data.pictures.note;
  if (Object.values(data.pictures.targets).flat().every((number) => number === null)) {
    for (const part of byId("viewer").querySelectorAll(".controls, #stage, #strip, #viewer-help")) part.hidden = true;
    return;
  }
  for (const key of ["target", "left", "right", "mode", "values", "channel", "scale", "split"]) {
    byId(key).addEventListener("input", (event) => update({ [key]: event.target.value }));
  }
  byId("closer").addEventListener("click", () => zoomBy(2));
  byId("farther").addEventListener("click", () => zoomBy(0.5));
  byId("fit").addEventListener("click", () => update({ zoom: "", x: "", y: "" }));
  byId("pixels").addEventListener("click", () => update({ zoom: 4, ...middle() }));
  byId("swap").addEventListener("click", swap);
  byId("enlarge").addEventListener("click", () => enlarge(!byId("stage").classList.contains("enlarged")));
  setUpPointer(byId("canvas"));
  byId("canvas").addEventListener("keydown", onKey);
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || byId("copied").open) return;
    if (byId("stage").classList.contains("enlarged")) enlarge(false);
    else if (state.open) update({ open: "" });
  });
  watch((changed) => {
    if (["display", "target", "left", "right", "values", "channel", "scale"].some((key) => changed.has(key))) choose();
    else if (["mode", "split", "zoom", "x", "y"].some((key) => changed.has(key))) paint();
  });
  setUpStrip();
  new ResizeObserver(paint).observe(byId("stage"));
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
    setInterval(() => {
      if (state.mode !== "flicker" || document.hidden) return;
      flickered = 1 - flickered;
      paint();
    }, FLICKER);
  }
}

/** The side's choice; where nothing, or something that is not there, was chosen: the best method with a picture. */
function chosen(side) {
  const there = (option) => pictureOf(option, state.target) !== null;
  if (state[side] && there(state[side])) return state[side];
  if (side === "left") return "truth";
  const sign = data.headline.higher ? -1 : 1;
  const rows = (data.rows[state.display] ?? []).filter((row) => there(`capture:${row.method}`) && !data.methods[row.method].oracle);
  rows.sort((a, b) => sign * (a.cells[data.headline.key].value - b.cells[data.headline.key].value));
  return rows.length ? `capture:${rows[0].method}` : "truth";
}

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Fill the controls and fetch the pictures. */
async function choose() {
  const rows = data.rows[state.display] ?? [];
  const absent = (option) => pictureOf(option, state.target) === null;
  fill(byId("target"), data.targets.map((item) => [item.name, item.name, pictureOf("truth", item.name) === null]), state.target);
  for (const side of ["left", "right"]) {
    const group = (kind) => rows.map((row) => [`${kind}:${row.method}`, NAMES[kind] + row.marked, absent(`${kind}:${row.method}`)]);
    const options = [[data.words.truth, [["truth", data.words.truth, absent("truth")]]], [`${data.words.scored}s`, group("capture")], ["absolute errors", group("error")], ["FLIP", group("flip")]];
    fill(byId(side), options, chosen(side));
  }
  for (const key of ["mode", "values", "channel"]) byId(key).value = state[key];
  fill(byId("scale"), (SCALES.includes(state.scale) ? SCALES : [...SCALES, state.scale]).map((value) => [value, value]), state.scale);
  const asked = ++drawing;
  const loaded = await Promise.all(["left", "right"].map((side) => load(chosen(side))));
  if (asked !== drawing) return;
  sides = loaded;
  describeErrors();
  paint();
}

async function load(option) {
  const [number, truth] = [pictureOf(option, state.target), pictureOf("truth", state.target)];
  if (number === null) return { caption: `no picture of ${state.target} in this page` };
  const label = option.slice(option.indexOf(":") + 1);
  const index = data.targets.findIndex((item) => item.name === state.target);
  const score = option === "truth" ? "" : `: ${data.headline.title} ${withUnit(data.values[state.display][label][data.headline.key][index])}`;
  const pixels = await pixelsOf(number);
  const kind = option.slice(0, option.indexOf(":"));
  if (!["error", "flip"].includes(kind)) return { ...onCanvas(seen(pixels)), pixels, caption: option === "truth" ? sentence(data.words.truth) : `${label}${score}` };
  const reference = truth === null ? null : await pixelsOf(truth);
  if (!reference || reference.width !== pixels.width || reference.height !== pixels.height) return { caption: `${label} has another size than the ${data.words.truth}` };
  const errors = kind === "flip" ? flipMap(pixels, reference) : absoluteErrors(pixels, reference);
  const image = coloured(errors, pixels.width, pixels.height, kind === "flip" ? 1 : Number(state.scale));
  return { ...onCanvas(image), pixels, errors, caption: `${sentence(NAMES[kind])}${label}${kind === "flip" ? `: mean ${(sum(errors) / errors.length).toFixed(3)}` : score}` };
}

function onCanvas(image) {
  const canvas = element("canvas", { width: String(image.width), height: String(image.height) });
  canvas.getContext("2d").putImageData(image, 0, 0);
  return { canvas };
}

function describeErrors() {
  const context = byId("error-bar").getContext("2d");
  MAGMA.forEach((colour, index) => {
    context.fillStyle = colour.formatHex();
    context.fillRect(index, 0, 1, 10);
  });
  const shown = ["left", "right"].map((side) => chosen(side).split(":")[0]);
  const which = state.channel === "all" ? "mean over colours" : ["red", "green", "blue"][Number(state.channel)];
  byId("error-bar").hidden = byId("error-note").hidden = !shown.includes("error") && !shown.includes("flip");
  const absolute = `Absolute error, ${which}, in ${state.values === "linear" ? "linear light" : "sRGB values"} with full scale 1: black is 0, the brightest colour ${state.scale} and more. `;
  const flip = "FLIP (Andersson et al. 2020) at 67 pixels a degree, from 0 to 1, of all colours in sRGB.";
  byId("error-note").textContent = (shown.includes("error") ? absolute : "") + (shown.includes("flip") ? flip : "");
}

/** Where the picture lies: size of a pane [px], zoom [screen pixels a pixel], the pixel in the middle of the pane. */
function layout() {
  const canvas = byId("canvas");
  const first = sides.find((side) => side.canvas)?.canvas;
  const [width, height] = first ? [first.width, first.height] : [1, 1];
  const wide = state.mode === "side" ? canvas.clientWidth / 2 : canvas.clientWidth;
  const tall = canvas.clientHeight;
  const fit = Math.min(wide / width, tall / height);
  const zoom = Number(state.zoom) || fit;
  const at = (text, middle) => (text === "" ? middle : Number(text));
  return { wide, tall, zoom, fit, x: at(state.x, width / 2), y: at(state.y, height / 2), width, height };
}

const middle = () => (({ x, y }) => ({ x, y }))(layout());

function paint() {
  const canvas = byId("canvas");
  const first = sides.find((side) => side.canvas)?.canvas;
  const enlarged = byId("stage").classList.contains("enlarged");
  const panes = state.mode === "side" ? 2 : 1;
  const room = byId("stage").clientWidth;
  const aspect = first ? first.height / first.width : 1;
  const tall = Math.round(Math.min((enlarged ? 0.75 : 0.7) * window.innerHeight, (room / panes) * aspect));
  canvas.style.height = `${tall}px`;
  canvas.style.width = byId("captions").style.maxWidth = `${Math.round((panes * tall) / aspect)}px`;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const { wide } = layout();
  const line = (wide * Number(state.split)) / 100;
  if (state.mode === "side") [0, 1].forEach((index) => paintSide(context, sides[index], index * wide, wide, 0, wide));
  else if (state.mode === "flicker") paintSide(context, sides[flickered], 0, wide, 0, wide);
  else [[0, line], [line, wide]].forEach(([from, to], index) => paintSide(context, sides[index], 0, wide, from, to));
  context.fillStyle = "white";
  if (state.mode === "slider") {
    context.fillRect(line - 1, 0, 2, tall);
    context.beginPath();
    context.arc(line, tall / 2, 9, 0, 7);
    context.fill();
    context.strokeStyle = "black";
    context.stroke();
  } else if (state.mode === "side") context.fillRect(wide - 1, 0, 2, tall);
  byId("mode").value = state.mode;
  byId("split").value = state.split;
  byId("split").disabled = state.mode !== "slider";
  caption(byId("caption-left"), sides[0], state.mode !== "flicker" || flickered === 0);
  caption(byId("caption-right"), sides[1], state.mode !== "flicker" || flickered === 1);
  canvas.setAttribute("aria-label", `${state.target} on ${state.display}. Left: ${sides[0]?.caption}. Right: ${sides[1]?.caption}.`);
}

function caption(place, side, isSeen) {
  place.textContent = side?.caption ?? "";
  place.classList.toggle("unseen", !isSeen);
}

/** A picture in the pane that begins at `left`, seen between `from` and `to` of the pane. */
function paintSide(context, side, left, wide, from, to) {
  const { tall, zoom, x, y } = layout();
  context.save();
  context.beginPath();
  context.rect(left + from, 0, to - from, tall);
  context.clip();
  context.fillStyle = "#777";
  context.fillRect(left, 0, wide, tall);
  context.imageSmoothingEnabled = zoom < 1;
  if (side?.canvas) context.drawImage(side.canvas, left + wide / 2 - x * zoom, tall / 2 - y * zoom, side.canvas.width * zoom, side.canvas.height * zoom);
  context.restore();
}

function swap() {
  if (state.mode === "flicker") {
    flickered = 1 - flickered;
    return paint();
  }
  update({ left: chosen("right"), right: chosen("left") });
}

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

function enlarge(on) {
  byId("stage").classList.toggle("enlarged", on);
  byId("enlarge").setAttribute("aria-pressed", String(on));
  byId("enlarge").textContent = on ? "Leave the full window (Esc)" : "Fill the window";
  paint();
}
