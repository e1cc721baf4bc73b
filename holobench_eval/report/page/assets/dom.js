// Elements are made here, and text becomes text nodes only: nothing from the data is ever read as markup.

const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("data").textContent);

/** An element with attributes (functions are listeners, false and null are left out) and children (text or nodes). */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(key, value);
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

/** The coloured mark of a method, as in the plots. */
function swatch(label) {
  const mark = element("span", { class: "swatch", "aria-hidden": "true" });
  mark.style.background = data.methods[label].oracle ? "none" : colourOf(label);
  mark.style.borderColor = colourOf(label);
  return mark;
}

/** The colour of a method; on a dark page mixed with white, where the registry's dark hues would not be seen. */
const colourOf = (label) => `color-mix(in oklab, ${data.methods[label].colour} var(--pure), white)`;

/** Fill a select; options: [value, text, disabled], or [heading, options] for a group of them. */
function fill(select, options, value) {
  const option = ([key, text, disabled]) => element("option", { value: key, disabled: Boolean(disabled) }, text);
  select.replaceChildren(
    ...options.map((item) =>
      Array.isArray(item[1]) ? element("optgroup", { label: item[0] }, ...item[1].map(option)) : option(item)
    )
  );
  select.value = value;
}

/** A number of the headline metric with its digits and unit. */
function withUnit(value, signed = false) {
  if (value === null || value === undefined) return "–";
  const rounded = value.toFixed(data.headline.digits);
  const text = Number(rounded) === 0 ? rounded.replace("-", "") : rounded;
  return `${signed && !text.startsWith("-") ? "+" : ""}${text}${data.headline.unit ? ` ${data.headline.unit}` : ""}`;
}

const NARROW = window.matchMedia("(max-width: 600px)");
