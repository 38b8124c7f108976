// What happens in the page.

const at = (id) => document.getElementById(id);
const count = (n, word) => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : "s"}`;

/** Radians a pixel and a key, parts of the picture's height, and a factor. */
const TURN = 0.01;
const KEY_TURN = 0.12;
const KEY_MOVE = 0.05;
const KEY_ZOOM = 1.15;
/** Pixels that a pointer may move and still pick. */
const STILL = 5;
const REACH = { mouse: 9, touch: 22, pen: 14 };

/** What springs can be coloured by. */
const UNITS = { tension: "N", strain: "", speed: "m/s" };

/** Numbers that 96 % of a sample are between, and whether some are not. */
function rangeOf(number, frames, n) {
  const stride = Math.max(1, Math.ceil((frames * n) / 200000));
  const sample = [];
  for (let i = 0; i < frames * n; i += stride) {
    const value = number(Math.floor(i / n), i % n);
    if (value !== null) {
      sample.push(value);
    }
  }
  if (sample.length === 0) {
    return { low: 0, high: 0 };
  }
  const sorted = Float64Array.from(sample).sort();
  const place = (part) => sorted[Math.round(part * (sorted.length - 1))];
  const [least, largest] = [sorted[0], sorted[sorted.length - 1]];
  const [low, high] = [place(0.02), place(0.98)];
  return { low, high, least, largest };
}

/** How springs are coloured by something: a range, and numbers at both ends by frame. */
function colouringOf(run, name) {
  if (name === "speed") {
    const range = rangeOf((f, node) => run.speed.at(f, node), run.frames, run.nodes);
    const of = (node) => (frame) => run.speed.at(frame, node);
    return { ...range, low: 0, signed: false, ofEnds: (spring) => [of(run.ends[2 * spring]), of(run.ends[2 * spring + 1])] };
  }
  const hasStrain = (spring) => run.restLengths[spring] > 0;
  const number = name === "tension" ? (f, s) => run.tension.at(f, s) : (f, s) => (hasStrain(s) ? run.strainAt(f, s) : null);
  const range = rangeOf(number, run.frames, run.springs);
  // Where some are pushed, none is in the middle.
  const signed = range.low < -0.01 * range.high;
  const high = signed ? Math.max(-range.low, range.high) : range.high;
  const low = signed ? -high : Math.max(0, range.low) < 0.5 * high ? Math.min(0, range.low) : range.low;
  const ofEnds = (spring) => {
    const of = name === "tension" || hasStrain(spring) ? (frame) => number(frame, spring) : null;
    return [of, of];
  };
  return { ...range, low, high, signed, ofEnds };
}

/** Colours of the style sheet, red, green and blue from 0 to 1. */
function coloursOf(signed) {
  const style = getComputedStyle(document.documentElement);
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.trim().slice(i, i + 2), 16) / 255);
  const one = (name) => rgb(style.getPropertyValue(name));
  const stops = style.getPropertyValue(signed ? "--signed" : "--rising").split(",").map(rgb);
  const [slack, broken, yielded, load] = ["--slack", "--broken", "--yielded", "--load"].map(one);
  return { stops, slack, broken, yielded, load, support: one("--support"), accent: one("--accent") };
}

/** The box around all nodes at all frames: its middle and half of its edges. */
function boxOf(run) {
  const { low, step, whole } = run.position;
  const most = [0, 0, 0];
  for (let i = 0; i < whole.length; i++) {
    most[i % 3] = Math.max(most[i % 3], whole[i]);
  }
  const half = most.map((n, axis) => 0.5 * n * step[axis]);
  return { middle: half.map((h, axis) => low[axis] + h), half };
}

class View {
  constructor(run) {
    this.run = run;
    const { middle, half } = boxOf(run);
    this.arrows = new Arrows(run, 2 * Math.hypot(...half));
    this.picture = new Picture(at("scene"), run, middle, this.arrows);
    this.camera = new Camera(run.up, run.toward, half);
    this.camera.home(this.picture.aspect());
    [this.start, this.end] = [run.times[0], run.times[run.frames - 1]];
    this.time = this.start;
    this.isPlaying = false;
    this.plots = [];
    this.energyPlots = [];
    this.tell();
    this.listen();
    this.colourBy("tension");
    this.showEnergies();
    this.pick(null);
    this.seek(this.start);
    requestAnimationFrame((now) => this.tick(now));
  }

  // Words ------------------------------------------------------------------------------

  tell() {
    const { run } = this;
    const a = run.arrays;
    at("facts").textContent = `${count(run.nodes, "node")}, ${count(run.springs, "spring")}, ${count(run.frames, "frame")}, ${short(this.end - this.start)} s`;
    const strain = a.strain_error > 0 ? `${short(a.strain_error, 2)} in strains` : "nothing in strains";
    const loads = run.loads ? "" : " There are too many loads to draw.";
    const thinned = run.stride > 1 ? ` Only every ${run.stride}th frame of the run is here, and the last one.` : "";
    at("precision").textContent =
      `Numbers here are rounded. They are off by at most ${short(a.position.error, 2)} m in positions, ` +
      `${short(a.speed.error, 2)} m/s in speeds, ${short(a.tension.error, 2)} N in tensions and ${strain}. Tensions are without ` +
      `dashpots. Between frames the picture is interpolated.${thinned}${loads} trajectory.npz has all numbers as they were computed.`;
    const has = (kind) => run.supports.some(([, one]) => one === kind);
    at("mark-fixed").hidden = !has("fixed");
    at("mark-guided").hidden = !has("guided");
    at("mark-slack").hidden = !this.hasSlack();
    at("mark-broken").hidden = !run.broken.some((frame) => frame < run.frames);
    at("mark-yielded").hidden = !run.yielded.some((frame) => frame < run.frames);
    at("mark-load").hidden = this.arrows.largest === 0;
    at("largest-load").textContent = `load, ${short(this.arrows.largest, 4)} N at most`;
    at("scrub").max = Math.max(0, run.frames - 1);
    at("scene").setAttribute("aria-label", `The moving scene: ${at("facts").textContent}`);
  }

  hasSlack() {
    const { run } = this;
    for (let frame = 0; frame < run.frames; frame++) {
      for (let spring = 0; spring < run.springs; spring++) {
        if (run.state(frame, spring) === STATE.slack) return true;
      }
    }
    return false;
  }

  // Colours ----------------------------------------------------------------------------

  colourBy(name) {
    const colouring = colouringOf(this.run, name);
    this.colouring = colouring;
    this.colours = coloursOf(colouring.signed);
    at("colour").value = name;
    const { low, high, least, largest, signed } = colouring;
    at("ramp").style.setProperty("--stops", `var(--${signed ? "signed" : "rising"})`);
    at("ramp-low").textContent = `${least < low ? "≤ " : ""}${short(low, 3)}`;
    at("ramp-unit").textContent = UNITS[name];
    at("ramp-high").textContent = `${largest > high ? "≥ " : ""}${short(high, 3)}`;
    this.isStale = true;
  }

  // Time -------------------------------------------------------------------------------

  /** The frame before a time, and how far it is to the next. */
  frameAt(time) {
    const { times } = this.run;
    let [low, high] = [0, times.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle;
      else high = middle;
    }
    if (time >= times[high]) return [high, 0];
    return [low, Math.max(0, (time - times[low]) / (times[high] - times[low]))];
  }

  seek(time) {
    this.time = Math.max(this.start, Math.min(this.end, time));
    this.isStale = true;
  }

  play(isPlaying) {
    this.isPlaying = isPlaying && this.end > this.start;
    if (this.isPlaying && this.time >= this.end) {
      this.time = this.start;
    }
    this.lastTick = null;
    at("play").textContent = this.isPlaying ? "⏸" : "▶";
    at("play").setAttribute("aria-label", this.isPlaying ? "Pause" : "Play");
  }

  step(frames) {
    this.play(false);
    const [frame, fraction] = this.frameAt(this.time);
    const from = frames < 0 && fraction > 0 ? frame + 1 : frame;
    this.seek(this.run.times[Math.max(0, Math.min(this.run.frames - 1, from + frames))]);
  }

  tick(now) {
    if (this.isPlaying) {
      const passed = this.lastTick === null ? 0 : (now - this.lastTick) / 1000;
      this.lastTick = now;
      const time = this.time + passed * Number(at("pace").value);
      // It plays over and over.
      this.seek(this.time >= this.end ? this.start : time);
    }
    if (this.isStale) {
      this.isStale = false;
      this.show();
      this.isTurned = true;
    }
    if (this.isTurned) {
      this.isTurned = false;
      this.picture.draw(this.camera, this.colours);
    }
    requestAnimationFrame((next) => this.tick(next));
  }

  show() {
    const [frame, fraction] = this.frameAt(this.time);
    this.picture.show(frame, fraction, this.colouring);
    at("scrub").value = frame + Math.round(fraction);
    at("scrub").setAttribute("aria-valuetext", `${short(this.time)} s`);
    at("time").textContent = `${this.time.toFixed(this.end - this.start < 1 ? 4 : 3)} s`;
    for (const move of [...this.plots, ...this.energyPlots]) {
      move(this.time);
    }
    this.showValues(frame + Math.round(fraction));
  }

  // Numbers ----------------------------------------------------------------------------

  pick(picked) {
    this.picked = picked;
    this.picture.pick(picked);
    this.plots = [];
    at("plots").replaceChildren();
    at("picked").textContent = picked ? `${picked.kind} ${picked.index}` : "Click one in the picture, or give its index.";
    if (picked) {
      at("pick-kind").value = picked.kind;
      at("pick-index").value = picked.index;
      this.addPlots();
    }
    this.isStale = true;
  }

  addPlots() {
    const { run, picked } = this;
    const series = (number) => run.times.map((_, frame) => number(frame));
    const add = (title, unit, lines) => {
      this.plots.push(plot(at("plots"), title, unit, run.times, lines, (time) => this.seek(time)));
    };
    const i = picked.index;
    if (picked.kind === "node") {
      const axes = ["x", "y", "z"].map((name, axis) => ({
        name,
        values: series((f) => run.position.at(f, 3 * i + axis) - run.position.at(0, 3 * i + axis)),
      }));
      add("displacement", "m", axes);
      add("speed", "m/s", [{ name: "speed", values: series((f) => run.speed.at(f, i)) }]);
    } else {
      add("tension", "N", [{ name: "tension", values: series((f) => run.tension.at(f, i)) }]);
      if (run.restLengths[i] > 0) {
        add("strain", "1", [{ name: "strain", values: series((f) => run.strainAt(f, i)) }]);
      }
    }
  }

  /** Names and numbers of what is picked, at a frame. */
  valuesAt(frame) {
    const { run, picked } = this;
    const i = picked.index;
    if (picked.kind === "node") {
      const x = [0, 1, 2].map((axis) => run.position.at(frame, 3 * i + axis));
      const support = run.supports.find(([node]) => node === i);
      const held = support ? [["held", support[1] === "fixed" ? "fixed" : "in part"]] : [];
      const force = this.arrows.forceAt(i, run.times[frame]);
      const load = force ? [["load", `(${force.map((f) => short(f, 4)).join(", ")}) N`]] : [];
      return [["x", x[0], "m"], ["y", x[1], "m"], ["z", x[2], "m"], ["speed", run.speed.at(frame, i), "m/s"], ...load, ...held];
    }
    const hasStrain = run.restLengths[i] > 0;
    const tension = run.tension.at(frame, i);
    const found = run.state(frame, i);
    const isBroken = found === STATE.broken;
    const name = Object.keys(STATE).find((name) => STATE[name] === found);
    const state = found === STATE.whole ? (tension > 0 ? "taut" : "pushed") : name;
    return [
      ["nodes", `${run.ends[2 * i]} and ${run.ends[2 * i + 1]}`],
      ["tension", tension, "N"],
      ["strain", isBroken ? "none: it is broken" : hasStrain ? run.strainAt(frame, i) : "none: its rest length is 0"],
      ["rest length", run.restLengths[i], "m"],
      ["state", state],
    ];
  }

  showValues(frame) {
    const list = at("values");
    list.replaceChildren();
    if (!this.picked) return;
    for (const [name, value, unit = ""] of this.valuesAt(frame)) {
      element(list, "dt", {}, name);
      element(list, "dd", {}, typeof value === "number" ? `${short(value, 5)} ${unit}` : value);
    }
  }

  showEnergies() {
    const { energies } = this.run;
    if (!energies || energies.times.length < 2) return;
    element(at("energy"), "h2", {}, "Energy");
    const curves = energies.labels.map((name, k) => ({ name, isFlow: energies.flows[k], values: energies.columns[k] }));
    for (const [title, isFlow] of [["energy", false], ["since the start", true]]) {
      const moved = curves.filter((curve) => curve.isFlow === isFlow && curve.values.some((value) => value !== 0));
      if (moved.length > 0) {
        this.energyPlots.push(plot(at("energy"), title, "J", energies.times, moved, (time) => this.seek(time)));
      }
    }
  }

  // Hands ------------------------------------------------------------------------------

  listen() {
    at("play").addEventListener("click", () => this.play(!this.isPlaying));
    at("scrub").addEventListener("input", () => {
      this.play(false);
      this.seek(this.run.times[Number(at("scrub").value)]);
    });
    at("colour").addEventListener("change", () => this.colourBy(at("colour").value));
    at("home").addEventListener("click", () => this.home());
    at("pick").addEventListener("submit", (event) => {
      event.preventDefault();
      this.pickByIndex(at("pick-kind").value, Number(at("pick-index").value));
    });
    at("pick-none").addEventListener("click", () => this.pick(null));
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.colours = coloursOf(this.colouring.signed);
      this.isTurned = true;
    });
    new ResizeObserver(() => {
      this.isTurned = true;
    }).observe(at("scene"));
    document.addEventListener("keydown", (event) => this.key(event));
    this.listenToPointers();
  }

  pickByIndex(kind, index) {
    const n = kind === "node" ? this.run.nodes : this.run.springs;
    if (Number.isInteger(index) && index >= 0 && index < n) {
      this.pick({ kind, index });
    } else {
      this.pick(null);
      at("picked").textContent = n > 0 ? `There are ${kind}s 0 to ${n - 1}.` : `There are no ${kind}s.`;
    }
  }

  home() {
    this.camera.home(this.picture.aspect());
    this.isTurned = true;
  }

  key(event) {
    const isInField = event.target.closest("input, select, button, summary");
    if (event.ctrlKey || event.metaKey || event.altKey || isInField) return;
    const inPicture = event.target === at("scene");
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (event.key === " ") this.play(!this.isPlaying);
    else if (event.key === ",") this.step(-1);
    else if (event.key === ".") this.step(1);
    else if (event.key === "Escape") this.pick(null);
    else if (inPicture && event.key === "Home") this.home();
    else if (inPicture && ["+", "="].includes(event.key)) this.camera.zoomBy(KEY_ZOOM);
    else if (inPicture && event.key === "-") this.camera.zoomBy(1 / KEY_ZOOM);
    else if (inPicture && arrow && event.shiftKey) this.camera.moveBy(-KEY_MOVE * arrow[0], KEY_MOVE * -arrow[1]);
    else if (inPicture && arrow) this.camera.turnBy(KEY_TURN * arrow[0], -KEY_TURN * arrow[1]);
    else return;
    event.preventDefault();
    this.isTurned = true;
  }

  listenToPointers() {
    const canvas = at("scene");
    const pointers = new Map();
    let travelled = 0;
    const spread = () => {
      const [a, b] = [...pointers.values()];
      return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, size: Math.hypot(a.x - b.x, a.y - b.y) };
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      if (pointers.size === 0) travelled = 0;
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = pointers.get(event.pointerId);
      if (!last) return;
      const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
      travelled += Math.abs(dx) + Math.abs(dy);
      const before = pointers.size === 2 ? spread() : null;
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      const size = canvas.clientHeight;
      if (before) {
        const after = spread();
        this.camera.zoomBy(after.size / Math.max(1, before.size));
        this.camera.moveBy((after.x - before.x) / size, (after.y - before.y) / size);
      } else if (pointers.size === 1 && (event.shiftKey || event.buttons === 2)) {
        this.camera.moveBy(dx / size, dy / size);
      } else if (pointers.size === 1) {
        this.camera.turnBy(-TURN * dx, TURN * dy);
      }
      this.isTurned = true;
    });
    const release = (event) => {
      const wasAlone = pointers.size === 1;
      pointers.delete(event.pointerId);
      if (event.type === "pointerup" && wasAlone && travelled <= STILL && event.button === 0) {
        const box = canvas.getBoundingClientRect();
        this.pick(this.picture.at(event.clientX - box.left, event.clientY - box.top, REACH[event.pointerType] ?? REACH.mouse));
      }
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.camera.zoomBy(Math.exp(-0.0015 * event.deltaY * (event.deltaMode === 1 ? 16 : 1)));
        this.isTurned = true;
      },
      { passive: false },
    );
  }
}

try {
  const run = await readRun();
  if (run.frames === 0 || run.nodes === 0) {
    throw new Error("this run has no frames or no nodes to show");
  }
  // For the console, and for tests.
  window.view = new View(run);
  at("status").hidden = true;
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
    window.view.play(true);
  }
} catch (error) {
  const isOld = typeof DecompressionStream === "undefined";
  at("status").textContent = isOld ? "This browser is too old for this page: it has no DecompressionStream." : `This cannot be shown: ${error.message}.`;
  throw error;
}
