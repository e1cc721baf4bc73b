// Pictures: decoded when they are first looked at, and turned into what is to be seen of them.

const decoded = new Map(); // number of a picture: a promise of its ImageData
const MOST_DECODED = 64;

/** The number of a capture in this page, or of the target without a method; null where there is none. */
const pictureOf = (method, target) => data.pictures[state.display]?.[method]?.[data.targets.indexOf(target)] ?? null;

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
  const bitmap = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none" });
  const context = element("canvas", { width: bitmap.width, height: bitmap.height }).getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  return context.getImageData(0, 0, bitmap.width, bitmap.height);
}

/** Show an image on a canvas, pixel for pixel. */
function put(canvas, image) {
  [canvas.width, canvas.height] = [image.width, image.height];
  canvas.getContext("2d").putImageData(image, 0, 0);
}

// IEC 61966-2-1: sRGB value to linear light
const LINEAR = Float32Array.from({ length: 256 }, (_, level) => {
  const value = level / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
});

/** A stored level in [0, 255] as the value in [0, 1] that is looked at. */
const valueOf = (level) => (state.values === "linear" ? LINEAR[level] : level / 255);

/** The colours that are looked at: all, or one of them. */
const colours = () => (state.channel === "all" ? [0, 1, 2] : [Number(state.channel)]);

/** The picture as it is seen: one colour in gray, and linear light in levels of its own. */
function seen(pixels) {
  const made = new ImageData(pixels.width, pixels.height);
  const shown = colours();
  for (let at = 0; at < pixels.data.length; at += 4) {
    for (let c = 0; c < 3; c++) made.data[at + c] = Math.round(255 * valueOf(pixels.data[at + shown[c % shown.length]]));
    made.data[at + 3] = 255;
  }
  return made;
}

/** Absolute difference at every pixel in the values looked at: of one colour, or the mean over all. */
function absoluteErrors(capture, truth) {
  const shown = colours();
  const difference = (at) => Math.abs(valueOf(capture.data[at]) - valueOf(truth.data[at]));
  return Float64Array.from({ length: truth.width * truth.height }, (_, index) => sum(shown.map((c) => difference(4 * index + c))) / shown.length);
}

/** An error map `(width * height)`, magma from 0 to `most`. */
function coloured(errors, width, height, most) {
  const made = new ImageData(width, height);
  errors.forEach((error, index) => made.data.set([...data.magma[Math.min(255, Math.round((255 * error) / most))], 255], 4 * index));
  return made;
}
