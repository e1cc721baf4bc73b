// Elements are made here, and text becomes text nodes only: nothing from the data is ever read as markup.

const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("data").textContent);

/** An element with attributes (functions are listeners, null is left out) and children (text or nodes). */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(key, value);
    else if (value !== null) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/** A number with so many digits, or three that count; a dash for null. */
function number(value, digits, signed = false) {
  if (value === null || value === undefined) return "–";
  const rounded = digits === undefined ? String(Math.abs(value) < 1000 ? Number(value.toPrecision(3)) : Math.round(value)) : value.toFixed(digits);
  const text = Number(rounded) === 0 ? rounded.replace("-", "") : rounded;
  return `${signed && !text.startsWith("-") ? "+" : ""}${text}`;
}

/** A value of the headline metric with its unit. */
const withUnit = (value, signed) => `${number(value, data.headline.digits, signed)} ${data.headline.unit}`.trim();

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);
