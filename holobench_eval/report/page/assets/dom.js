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

/** The coloured mark of a method, as in the figures; on a dark page the style sheet mixes its colour with white. */
function swatch(label) {
  const mark = element("span", { class: data.methods[label].oracle ? "swatch hollow" : "swatch", "aria-hidden": "true" });
  mark.style.setProperty("--colour", data.methods[label].colour);
  return mark;
}

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** A number of the headline metric with its digits and unit. */
function withUnit(value, signed = false) {
  if (value === null) return "–";
  const rounded = value.toFixed(data.headline.digits);
  const text = Number(rounded) === 0 ? rounded.replace("-", "") : rounded;
  return `${signed && !text.startsWith("-") ? "+" : ""}${text} ${data.headline.unit}`.trim();
}
