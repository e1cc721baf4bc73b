// Pictures: decoded when they are first looked at, and turned into what is to be seen of them.

const decoded = new Map(); // number of a picture: a promise of its ImageData
const MOST_DECODED = 24;

/** The number of a picture in this page, or null; option: "truth", or a kind and a method, "capture:METHOD". */
function pictureOf(option, target) {
  const index = data.targets.findIndex((item) => item.name === target);
  if (option === "truth") return data.pictures.targets[state.display]?.[index] ?? null;
  const label = option.slice(option.indexOf(":") + 1);
  return data.pictures.cells[state.display]?.[label]?.[index] ?? null;
}

/** The pixels of a picture as they are stored. */
function pixelsOf(number) {
  if (!decoded.has(number)) {
    if (decoded.size >= MOST_DECODED) decoded.delete(decoded.keys().next().value);
    decoded.set(number, decode(byId(`picture-${number}`).textContent));
  }
  return decoded.get(number);
}

async function decode(base64) {
  const bytes = Uint8Array.from(atob(base64), (char) => char.charCodeAt(0));
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
  const canvas = element("canvas", { width: String(bitmap.width), height: String(bitmap.height) });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height);
}

// IEC 61966-2-1: sRGB value to linear light
const LINEAR = Float32Array.from({ length: 256 }, (_, level) => {
  const value = level / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
});

/** A stored level in [0, 255] as the value in [0, 1] that is looked at. */
const valueOf = (level) => (state.values === "linear" ? LINEAR[level] : level / 255);

/** The picture as it is seen: one colour in gray, and linear light in levels of its own. */
function seen(pixels) {
  const made = new ImageData(pixels.width, pixels.height);
  const one = state.channel === "all" ? null : Number(state.channel);
  for (let at = 0; at < pixels.data.length; at += 4) {
    for (let c = 0; c < 3; c++) {
      const level = pixels.data[at + (one ?? c)];
      made.data[at + c] = state.values === "linear" ? Math.round(255 * LINEAR[level]) : level;
    }
    made.data[at + 3] = 255;
  }
  return made;
}

/** Absolute difference at a pixel in the values looked at: of one colour, or the mean over all. */
function errorAt(capture, truth, at) {
  if (state.channel !== "all") {
    const one = at + Number(state.channel);
    return Math.abs(valueOf(capture.data[one]) - valueOf(truth.data[one]));
  }
  let sum = 0;
  for (let c = 0; c < 3; c++) sum += Math.abs(valueOf(capture.data[at + c]) - valueOf(truth.data[at + c]));
  return sum / 3;
}

const MAGMA = Array.from({ length: 256 }, (_, index) => d3.rgb(d3.interpolateMagma(index / 255)));

/** An error map `(width * height)`, magma from 0 to `most`. */
function coloured(errors, width, height, most) {
  const made = new ImageData(width, height);
  errors.forEach((error, index) => {
    const colour = MAGMA[Math.min(255, Math.round((255 * error) / most))];
    made.data.set([colour.r, colour.g, colour.b, 255], 4 * index);
  });
  return made;
}

/** The absolute error of a capture at every pixel; both pictures have one size. */
const absoluteErrors = (capture, truth) => Float64Array.from({ length: truth.width * truth.height }, (_, index) => errorAt(capture, truth, 4 * index));
