// The wall: targets x methods of a display. All pictures show the same place; the style sheet puts them there.

const MOST_METHODS = 7; // of the wall, before the reader chooses: a row of a wide window
const MOST_TARGETS = 3;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
let drawing = 0; // counts the walls, so that a late picture does not stand in a newer one

/** The targets that have a picture here, those of most methods first. */
function picturedTargets() {
  const count = (target) => data.rows[state.display].filter(({ method }) => pictureOf(method, target) !== null).length;
  const counts = new Map(data.targets.map((target) => [target, count(target)]));
  return { counts, targets: data.targets.filter((target) => counts.get(target)).sort((a, b) => counts.get(b) - counts.get(a)) };
}

function wallTargets() {
  const { counts, targets } = picturedTargets();
  return targets.includes(state.target) ? [state.target] : targets.filter((name) => counts.get(name) === counts.get(targets[0])).slice(0, MOST_TARGETS);
}

/** The chosen methods; else those of the filter: named in the question, the baseline, the best of each group, the best. */
function wallMethods() {
  const rows = data.rows[state.display].map(({ method }) => method);
  const asked = state.methods.split("\n").filter((method) => rows.includes(method));
  if (asked.length) return asked;
  const names = wallTargets();
  const shown = shownRows().filter(({ method }) => names.some((target) => pictureOf(method, target) !== null));
  const score = ({ cells }) => (data.headline.higher ? -1 : 1) * (cells[data.headline.key] ?? -Infinity);
  const best = shown.toSorted((a, b) => score(a) - score(b)).map(({ method }) => method);
  const ofGroups = data.groups.map((group) => best.find((method) => data.methods[method].group === group));
  const named = best.filter((method) => method === data.baseline || data.question?.split(/[\s,?]+/).includes(method));
  const first = [...new Set([...named, ...ofGroups, ...best])].filter((method) => best.includes(method)).slice(0, MOST_METHODS);
  return best.filter((method) => first.includes(method));
}

/** Fill the controls and draw the wall, picture by picture. */
async function drawWall() {
  const turn = ++drawing;
  const [{ counts, targets }, methods, names] = [picturedTargets(), wallMethods(), wallTargets()];
  byId("viewer-title").textContent = `Pictures: ${state.display}`;
  byId("pictures").hidden = !targets.length;
  const option = (value, text) => element("option", { value }, text);
  byId("target").replaceChildren(option("", "with most methods"), ...targets.map((name) => option(name, `${name} (${counts.get(name)} methods)`)));
  byId("target").value = targets.includes(state.target) ? state.target : "";
  byId("methods").replaceChildren(byId("methods").firstElementChild, ...data.rows[state.display].map(({ method }) => tick(method, methods)));
  describeErrors();
  const tiles = [];
  const figure = (method, target) => {
    const canvas = element("canvas", { role: "img" });
    const caption = element("figcaption", {});
    if (pictureOf(method, target) !== null) tiles.push({ method, target, canvas, caption });
    else caption.append(`${method}: no picture`);
    return element("figure", {}, element("div", { class: "frame" }, canvas), caption);
  };
  const blocks = names.map((target) =>
    element("section", { "aria-label": target }, element("h3", {}, target), element("div", { class: "tiles" }, ...["", ...methods].map((method) => figure(method, target))))
  );
  byId("wall").replaceChildren(...blocks);
  for (const tile of tiles) {
    await drawTile(tile);
    if (turn !== drawing) return;
  }
  byId("wall").dataset.drawn = turn;
}

const tick = (method, methods) => element("label", { class: "tick" }, ticked(method, methods.includes(method)), method);

function ticked(method, checked) {
  const box = element("input", { type: "checkbox" });
  box.checked = checked;
  box.addEventListener("input", () => {
    const boxes = [...byId("methods").querySelectorAll("label")].filter((label) => label.firstElementChild.checked);
    update({ methods: boxes.map((label) => label.textContent).join("\n") });
    [...byId("methods").querySelectorAll("label")].find((label) => label.textContent === method).firstElementChild.focus();
  });
  return box;
}

async function drawTile(tile) {
  const { method, target, canvas, caption } = tile;
  const truth = await pixelsOf(pictureOf("", target));
  const pixels = method && state.mode !== "truth" ? await pixelsOf(pictureOf(method, target)) : truth;
  const score = method ? withUnit(valuesOf(method)[data.targets.indexOf(target)]) : "";
  let [image, text] = [null, score];
  if (method && ["error", "flip"].includes(state.mode) && truth.width === pixels.width && truth.height === pixels.height) {
    await new Promise((done) => setTimeout(done)); // the page answers between two maps
    tile.errors = state.mode === "flip" ? flipMap(pixels, truth) : absoluteErrors(pixels, truth);
    image = coloured(tile.errors, pixels.width, pixels.height, state.mode === "flip" ? 1 : Number(state.scale));
    if (state.mode === "flip") text = `FLIP ${(sum(tile.errors) / tile.errors.length).toFixed(3)}`;
  }
  put(canvas, image ?? seen(pixels));
  canvas.tile = Object.assign(tile, { pixels, truth });
  byId("wall").style.setProperty("--aspect", pixels.width / pixels.height);
  canvas.setAttribute("aria-label", `${method || sentence(data.words.truth)} ${text}`.trim());
  caption.replaceChildren(element("b", {}, method || sentence(data.words.truth)), " ", element("span", { class: "score" }, text));
}

function describeErrors() {
  const which = state.channel === "all" ? "mean over colours" : ["red", "green", "blue"][Number(state.channel)];
  const values = state.values === "linear" ? "linear light" : "sRGB values";
  byId("error-note").dataset.mode = state.mode;
  byId("error-note").textContent = {
    error: `Absolute error, ${which}, in ${values} with full scale 1: black is 0, the brightest colour ${state.scale} and more.`,
    flip: "FLIP (Andersson et al. 2020) at 67 pixels a degree, from 0 to 1, of all colours in sRGB.",
  }[state.mode] ?? "";
}

function place() {
  const wall = byId("wall");
  for (const key of ["zoom", "x", "y", "size"]) wall.style.setProperty(`--${key}`, state[key]);
  wall.classList.toggle("near", Number(state.zoom) > 1);
}

const limited = (key, value) => Math.min(LIMITS[key][1], Math.max(LIMITS[key][0], value)).toFixed(4).replace(/\.?0+$/, "");
const showAll = () => update({ zoom: 1, x: 0.5, y: 0.5 });
const move = (dx, dy) => update({ x: limited("x", Number(state.x) + dx), y: limited("y", Number(state.y) + dy) });

/** Zoom, keeping what is at (across, down) of a picture's frame, as shares, in its place. */
function zoomBy(factor, [across, down] = [0.5, 0.5]) {
  const before = Number(state.zoom);
  const zoom = limited("zoom", before * factor);
  const shift = 1 / before - 1 / Number(zoom);
  update({ zoom, x: limited("x", Number(state.x) + (across - 0.5) * shift), y: limited("y", Number(state.y) + (down - 0.5) * shift) });
}

/** Where a pointer is in the frame that it is in, as shares, and the width of that. */
function position(event) {
  const box = (event.target.closest(".frame") ?? byId("wall")).getBoundingClientRect();
  return { at: [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height], width: box.width, height: box.height };
}

/** Say what stands at a pointer: the stored levels of the target and the capture, and the error. */
function readPixel(event) {
  const tile = event.target.closest(".frame")?.firstElementChild.tile;
  if (!tile) return;
  const { at } = position(event);
  const [x, y] = [Number(state.x), Number(state.y)].map((middle, axis) => middle + (at[axis] - 0.5) / Number(state.zoom));
  const [column, row] = [Math.floor(x * tile.pixels.width), Math.floor(y * tile.pixels.height)];
  if (column < 0 || row < 0 || column >= tile.pixels.width || row >= tile.pixels.height) return;
  const levels = ({ data: values, width }) => [...values.slice(4 * (row * width + column), 4 * (row * width + column) + 3)].join(", ");
  const error = tile.errors ? `; error ${tile.errors[row * tile.pixels.width + column].toFixed(3)}` : "";
  const capture = tile.method ? `; ${tile.method} ${levels(tile.pixels)}` : "";
  byId("pixel").textContent = `Column ${column}, row ${row}: ${data.words.truth} ${levels(tile.truth)}${capture}${error} (stored levels: red, green, blue of 255)`;
}

function setUpWall(wall) {
  let held = null; // the last event of a drag
  wall.addEventListener("pointerdown", (event) => (held = event.target.closest(".frame") && event));
  wall.addEventListener("pointermove", (event) => {
    readPixel(event);
    if (!held || !event.buttons) return (held = null);
    const { width, height } = position(held);
    move((held.clientX - event.clientX) / width / Number(state.zoom), (held.clientY - event.clientY) / height / Number(state.zoom));
    held = event;
  });
  const onWheel = (event) => {
    if (!event.ctrlKey && document.activeElement !== wall && !document.fullscreenElement) return; // the page scrolls
    event.preventDefault();
    zoomBy(event.deltaY < 0 ? 1.25 : 0.8, position(event).at);
  };
  wall.addEventListener("wheel", onWheel, { passive: false });
  const toggle = (mode) => () => update({ mode: state.mode === mode ? "capture" : mode });
  const keys = { "+": () => zoomBy(2), "=": () => zoomBy(2), "-": () => zoomBy(0.5), 0: showAll, e: toggle("error"), t: toggle("truth") };
  wall.addEventListener("keydown", (event) => {
    const arrow = ARROWS[event.key];
    const action = arrow ? () => move(...arrow.map((step) => (0.1 * step) / Number(state.zoom))) : keys[event.key.toLowerCase()];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  });
  const full = () => (document.fullscreenElement ? document.exitFullscreen() : byId("pictures").requestFullscreen());
  const buttons = { closer: keys["+"], farther: keys["-"], fit: showAll, enlarge: full };
  for (const [id, action] of Object.entries(buttons)) byId(id).addEventListener("click", action);
  byId("enlarge").hidden = !document.fullscreenEnabled;
  byId("target").addEventListener("input", (event) => update({ target: event.target.value }));
}

setUpWall(byId("wall"));
watch(["zoom", "x", "y", "size"], place);

watch(["display", "target", "methods", "filter", "photographs", "seconds", "mode", "values", "channel", "scale"], drawWall);
if (location.hash.includes("=")) land();
