// The map of LDR-FLIP at 67 pixels a degree: P. Andersson et al., "FLIP: a difference evaluator for alternating images",
// Proc. ACM Comput. Graph. Interact. Tech. 3 (2020), equations 1 to 17. The scores in the tables are their authors' own
// code; a test compares the mean of this map with it.

const DEGREE = (0.7 * (3840 / 0.7) * Math.PI) / 180; // pixels a degree: 0.7 m from a display of 3840 pixels on 0.7 m
// Of the contrast sensitivity: a and b of two Gaussians for achromatic, red-green and blue-yellow
const SENSITIVITY = [[[1, 0.0047]], [[1, 0.0053]], [[34.1, 0.04], [13.5, 0.025]]];
const WIDEST = 0.04; // the largest b: all filters have one size
const [EXPONENT, KNEE, KNEE_TO, FEATURE_WIDTH] = [0.7, 0.4, 0.95, 0.082]; // qc, pc, pt; width of features [degrees]
const TO_XYZ = [[0.41238656, 0.35759149, 0.18045049], [0.21263682, 0.71518298, 0.0721802], [0.01933062, 0.11919716, 0.95037259]];
const FROM_XYZ = [[3.24100326, -1.53739899, -0.49861587], [-0.96922426, 1.87592999, 0.04155422], [0.05563942, -0.20401120, 1.05714897]];
const WHITE = [0.950428545, 1.0, 1.088900371];

const product = (matrix, r, g, b) => matrix.map((row) => row[0] * r + row[1] * g + row[2] * b);

/** Lightness and two opponent colours, linear in light: [Y, Cx, Cz], each a plane. */
function opponents(pixels) {
  const count = pixels.width * pixels.height;
  const planes = [0, 1, 2].map(() => new Float64Array(count));
  for (let i = 0; i < count; i++) {
    const [x, y, z] = product(TO_XYZ, ...[0, 1, 2].map((c) => LINEAR[pixels.data[4 * i + c]])).map((value, c) => value / WHITE[c]);
    planes[0][i] = 116 * y - 16;
    planes[1][i] = 500 * (x - y);
    planes[2][i] = 200 * (y - z);
  }
  return planes;
}

/** A plane filtered with one kernel along rows and another along columns; edges are repeated. */
function filtered(plane, width, height, across, down) {
  const pass = (from, kernel, length, step, other, stride) => {
    const radius = (kernel.length - 1) / 2;
    const made = new Float64Array(from.length);
    for (let line = 0; line < other; line++) {
      for (let i = 0; i < length; i++) {
        let sum = 0;
        for (let k = -radius; k <= radius; k++) sum += kernel[k + radius] * from[line * stride + step * Math.min(length - 1, Math.max(0, i + k))];
        made[line * stride + step * i] = sum;
      }
    }
    return made;
  };
  return pass(pass(plane, across, width, 1, height, width), down, height, width, width, 1);
}

const taps = (radius, value) => Float64Array.from({ length: 2 * radius + 1 }, (_, index) => value(index - radius));
const sum = (values) => values.reduce((a, b) => a + b, 0);

/** What the eye resolves of a picture, in the adjusted CIELAB of the paper: three planes. */
function perceived(planes, width, height) {
  const radius = Math.ceil(3 * Math.sqrt(WIDEST / (2 * Math.PI ** 2)) * DEGREE);
  const smooth = planes.map((plane, c) => {
    const parts = SENSITIVITY[c].map(([a, b]) => {
      const kernel = taps(radius, (x) => Math.exp((-(Math.PI ** 2) * (x / DEGREE) ** 2) / b));
      const weight = a * Math.sqrt(Math.PI / b);
      return { weight, total: weight * sum(kernel) ** 2, plane: filtered(plane, width, height, kernel, kernel) };
    });
    const total = sum(parts.map((part) => part.total));
    return Float64Array.from(plane, (_, i) => sum(parts.map((part) => part.weight * part.plane[i])) / total);
  });
  const made = [0, 1, 2].map(() => new Float64Array(width * height));
  for (let i = 0; i < width * height; i++) {
    const y = (smooth[0][i] + 16) / 116;
    const xyz = [smooth[1][i] / 500 + y, y, y - smooth[2][i] / 200].map((value, c) => value * WHITE[c]);
    const rgb = product(FROM_XYZ, ...xyz).map((value) => Math.min(1, Math.max(0, value)));
    adjustedLab(rgb).forEach((value, c) => (made[c][i] = value));
  }
  return made;
}

/** CIELAB of linear RGB in [0, 1], with the opponents scaled by lightness (Hunt). */
function adjustedLab(rgb) {
  const curve = (t) => (t > (6 / 29) ** 3 ? Math.cbrt(t) : t / (3 * (6 / 29) ** 2) + 4 / 29);
  const [x, y, z] = product(TO_XYZ, ...rgb).map((value, c) => curve(value / WHITE[c]));
  const lightness = 116 * y - 16;
  return [lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)];
}

const hyab = (a, b) => Math.abs(a[0] - b[0]) + Math.hypot(a[1] - b[1], a[2] - b[2]);

/** Strength of edges and of points in the lightness of a picture: two planes. */
function features(lightness, width, height) {
  const deviation = 0.5 * FEATURE_WIDTH * DEGREE;
  const radius = Math.ceil(3 * deviation);
  const bell = taps(radius, (x) => Math.exp(-(x ** 2) / (2 * deviation ** 2)));
  const even = bell.map((value) => value / sum(bell));
  const plane = lightness.map((value) => (value + 16) / 116);
  return [(x) => -x, (x) => (x / deviation) ** 2 - 1].map((shape) => {
    const raw = taps(radius, (x) => shape(x) * bell[x + radius]);
    const [above, below] = [sum(raw.filter((value) => value > 0)), -sum(raw.filter((value) => value < 0))];
    const kernel = raw.map((value) => value / (value > 0 ? above : below));
    const [across, down] = [filtered(plane, width, height, kernel, even), filtered(plane, width, height, even, kernel)];
    return across.map((value, i) => Math.hypot(value, down[i]));
  });
}

/** FLIP of two pictures of one size: a plane in [0, 1]. */
function flipMap(capture, truth) {
  const { width, height } = truth;
  const [ours, theirs] = [capture, truth].map((pixels) => {
    const planes = opponents(pixels);
    return { lab: perceived(planes, width, height), features: features(planes[0], width, height) };
  });
  const most = hyab(adjustedLab([0, 1, 0]), adjustedLab([0, 0, 1])) ** EXPONENT;
  const at = (planes, i) => planes.map((plane) => plane[i]);
  return Float64Array.from({ length: width * height }, (_, i) => {
    const error = hyab(at(ours.lab, i), at(theirs.lab, i)) ** EXPONENT;
    const colour = error < KNEE * most ? (error * KNEE_TO) / (KNEE * most) : KNEE_TO + ((error - KNEE * most) / (most - KNEE * most)) * (1 - KNEE_TO);
    const feature = Math.sqrt(Math.max(...[0, 1].map((kind) => Math.abs(ours.features[kind][i] - theirs.features[kind][i]))) / Math.SQRT2);
    return colour ** (1 - feature);
  });
}
