// The chosen target and its captures by all methods that pass the filter, small and side by side; a click compares one.

function setUpStrip() {
  const watcher = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    watcher.disconnect(); // pictures are decoded once somebody comes near
    watch((changed) => {
      if (["display", "target", "filter", "sort", "order", "values", "channel"].some((key) => changed.has(key))) drawStrip();
      else if (changed.has("right")) pressStrip();
    });
  }, { rootMargin: "300px" });
  watcher.observe(byId("strip"));
}

function drawStrip() {
  const index = data.targets.findIndex((item) => item.name === state.target);
  const captures = shownRows().map((row) => ({
    option: `capture:${row.method}`,
    text: row.marked,
    score: withUnit(data.values[state.display][row.method][data.headline.key][index]),
  }));
  const tiles = [{ option: "truth", text: sentence(data.words.truth), score: "" }, ...captures].filter((tile) => pictureOf(tile.option, state.target) !== null);
  byId("strip").replaceChildren(...tiles.map(({ option, text, score }) => {
    const canvas = element("canvas", { "aria-hidden": "true" });
    pixelsOf(pictureOf(option, state.target)).then((pixels) => {
      [canvas.width, canvas.height] = [pixels.width, pixels.height];
      canvas.getContext("2d").putImageData(seen(pixels), 0, 0);
    });
    const compare = () => {
      update({ right: option });
      byId("viewer").scrollIntoView();
    };
    return element("li", {}, element("button", { type: "button", "data-option": option, click: compare }, canvas, element("span", {}, text), element("span", { class: "interval" }, score)));
  }));
  pressStrip();
}

/** Mark the picture that stands on the right. */
function pressStrip() {
  for (const button of byId("strip").querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.dataset.option === chosen("right")));
}
