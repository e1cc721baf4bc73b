// The chosen target and its captures by all methods that pass the filter, small and side by side; a click compares one.

function drawStrip() {
  const score = (row) => withUnit(data.values[state.display][row.method][data.headline.key][targetIndex()]);
  const captures = shownRows().map((row) => ({ option: `capture:${row.method}`, text: row.marked, score: score(row) }));
  const tiles = [{ option: "truth", text: sentence(data.words.truth), score: "" }, ...captures];
  byId("strip").replaceChildren(...tiles.filter(({ option }) => pictureOf(option) !== null).map(({ option, text, score }) => {
    const canvas = element("canvas", { "aria-hidden": "true" });
    pixelsOf(pictureOf(option)).then((pixels) => put(canvas, seen(pixels)));
    const compare = () => {
      update({ right: option });
      byId("viewer").scrollIntoView();
    };
    const texts = [element("span", {}, text), element("span", { class: "interval" }, score)];
    return element("li", {}, element("button", { type: "button", "data-option": option, click: compare }, canvas, ...texts));
  }));
  pressStrip();
}

/** Mark the picture that stands on the right. */
function pressStrip() {
  for (const button of byId("strip").querySelectorAll("button")) button.setAttribute("aria-pressed", button.dataset.option === chosen("right"));
}
