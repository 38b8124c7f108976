// Numbers over time as SVG.

const SVG = "http://www.w3.org/2000/svg";
const PLOT = { width: 360, height: 150, left: 52, right: 8, top: 8, bottom: 22 };

function element(parent, name, attributes = {}, text = "") {
  const space = parent.namespaceURI === SVG || name === "svg" ? SVG : "http://www.w3.org/1999/xhtml";
  const made = document.createElementNS(space, name);
  for (const [key, value] of Object.entries(attributes)) {
    made.setAttribute(key, value);
  }
  made.textContent = text;
  parent.append(made);
  return made;
}

/** A number in few characters. */
function short(number, digits = 4) {
  if (number === 0) {
    return "0";
  }
  const size = Math.abs(number);
  const text = size >= 1e5 || size < 1e-3 ? number.toExponential(digits - 1) : number.toPrecision(digits);
  return text.replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "").replace("-", "−");
}

/** Round numbers from low to high, about so many. */
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= rough);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) {
    found.push(i * step);
  }
  return found;
}

/** At most so many points of a line that look the same: the least and the largest of each group. */
function thinned(values, most) {
  if (values.length <= most) {
    return values.map((_, i) => i);
  }
  const kept = [];
  const group = Math.ceil((2 * values.length) / most);
  for (let start = 0; start < values.length; start += group) {
    const end = Math.min(values.length, start + group);
    let [least, largest] = [start, start];
    for (let i = start; i < end; i++) {
      if (values[i] < values[least]) least = i;
      if (values[i] > values[largest]) largest = i;
    }
    kept.push(Math.min(least, largest), Math.max(least, largest));
  }
  return kept;
}

/**
 * Draws lines over time.
 * @param lines each has a name and values at the times
 * @param seek is called with a time that is pointed at
 * @returns a function that moves the mark of the present time
 */
function plot(parent, title, unit, times, lines, seek) {
  const figure = element(parent, "figure", { class: "plot" });
  const caption = element(figure, "figcaption");
  element(caption, "strong", {}, `${title}, ${unit}`);
  const { width, height, left, right, top, bottom } = PLOT;
  const svg = element(figure, "svg", { viewBox: `0 0 ${width} ${height}`, role: "img" });
  let [low, high] = [Infinity, -Infinity];
  for (const { values } of lines) {
    for (const value of values) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  svg.setAttribute("aria-label", `${title} over time, from ${short(low)} to ${short(high)} ${unit}`);
  if (!(high > low)) {
    const room = Math.abs(low) * 0.1 || 1;
    [low, high] = [low - room, high + room];
  }
  const [start, end] = [times[0], Math.max(times[times.length - 1], times[0] + 1e-300)];
  const x = (time) => left + ((time - start) / (end - start)) * (width - left - right);
  const y = (value) => top + ((high - value) / (high - low)) * (height - top - bottom);
  for (const tick of ticks(low, high, 4)) {
    element(svg, "line", { class: "grid", x1: left, x2: width - right, y1: y(tick), y2: y(tick) });
    element(svg, "text", { x: left - 5, y: y(tick) + 4, "text-anchor": "end" }, short(tick));
  }
  for (const tick of ticks(start, end, 5)) {
    element(svg, "text", { x: x(tick), y: height - 6, "text-anchor": "middle" }, `${short(tick)}${tick === 0 ? " s" : ""}`);
  }
  lines.forEach(({ name, values }, index) => {
    const colour = `var(--plot-${index % 8})`;
    const points = thinned(values, 1200).map((i) => `${x(times[i]).toFixed(1)} ${y(values[i]).toFixed(1)}`);
    element(svg, "path", { d: `M${points.join("L")}`, style: `stroke: ${colour}` });
    if (lines.length > 1) {
      const label = element(caption, "span");
      element(label, "i", { style: `border-color: ${colour}` });
      label.append(name);
    }
  });
  const now = element(svg, "line", { class: "now", y1: top, y2: height - bottom });
  const point = (event) => {
    const box = svg.getBoundingClientRect();
    const place = ((event.clientX - box.left) / box.width) * width;
    seek(start + Math.max(0, Math.min(1, (place - left) / (width - left - right))) * (end - start));
  };
  svg.addEventListener("pointerdown", point);
  svg.addEventListener("pointermove", (event) => event.buttons && point(event));
  return (time) => {
    now.setAttribute("x1", x(time));
    now.setAttribute("x2", x(time));
  };
}
