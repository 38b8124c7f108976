// Loads, drawn as arrows of bars.

/** Arrows that a picture has at most; more hide what they act on. */
const MOST_ARROWS = 300;
/** Length of the arrow of the largest force, in parts of the box around all nodes, and of its head. */
const ARROW = 0.14;
const HEAD = 0.25;
/** Points of an arrow beside the node that it begins at: its tip, and four barbs. */
const ARROW_POINTS = 5;

/** What a force is multiplied by, so many seconds after the end of the run. */
function factorAt(overTime, time) {
  if (overTime.kind === "ramp") {
    return Math.max(0, Math.min(1, (time - overTime.from) / (overTime.to - overTime.from)));
  }
  if (overTime.kind === "sine") {
    return Math.sin(2 * Math.PI * overTime.frequency * time + overTime.phase);
  }
  if (overTime.kind === "table") {
    const { points } = overTime;
    const after = points.findIndex(([point]) => point > time);
    if (after === 0 || points.length === 0) return points[0]?.[1] ?? 0;
    if (after < 0) return points[points.length - 1][1];
    const [[t0, f0], [t1, f1]] = [points[after - 1], points[after]];
    return f0 + ((f1 - f0) * (time - t0)) / (t1 - t0);
  }
  return 1;
}

/** The arrows of the loads of a run. */
class Arrows {
  /** @param size length of the diagonal of the box around all nodes */
  constructor(run, size) {
    this.loads = run.loads ?? [];
    this.end = run.times[run.frames - 1];
    const nodes = [...new Set(this.loads.flatMap(({ nodes }) => nodes))].sort((a, b) => a - b);
    const stride = Math.max(1, Math.ceil(nodes.length / MOST_ARROWS));
    this.nodes = nodes.filter((_, index) => index % stride === 0);
    this.places = new Map(this.nodes.map((node, index) => [node, index]));
    this.forces = new Float64Array(3 * this.nodes.length);
    // The largest force at any frame is as long as arrows get.
    this.largest = 0;
    const looks = Math.min(run.frames, 500);
    for (let look = 0; look < looks; look++) {
      this.sum(run.times[Math.round((look * (run.frames - 1)) / Math.max(1, looks - 1))]);
      for (let i = 0; i < this.nodes.length; i++) {
        this.largest = Math.max(this.largest, Math.hypot(...this.forces.subarray(3 * i, 3 * i + 3)));
      }
    }
    this.scale = this.largest > 0 ? (ARROW * size) / this.largest : 0;
  }

  /** Sums up the forces at a time of the run, in N. */
  sum(time) {
    this.forces.fill(0);
    for (const { nodes, force, over_time } of this.loads) {
      const factor = factorAt(over_time, time - this.end);
      for (const node of nodes) {
        const place = this.places.get(node);
        if (place !== undefined) force.forEach((f, axis) => (this.forces[3 * place + axis] += factor * f));
      }
    }
  }

  /** The force on a node at a time, in N; null where none acts. */
  forceAt(node, time) {
    const place = this.places.get(node);
    if (place === undefined) return null;
    this.sum(time);
    return [...this.forces.subarray(3 * place, 3 * place + 3)];
  }

  /** Ends of bars, where the points of the arrows begin at index `first`. */
  bars(first) {
    return this.nodes.flatMap((node, index) => {
      const tip = first + ARROW_POINTS * index;
      return [node, tip, ...[1, 2, 3, 4].flatMap((barb) => [tip, tip + barb])];
    });
  }

  /** Puts the points of the arrows behind those of the nodes, four numbers each. */
  place(time, positions, first) {
    this.sum(time);
    this.nodes.forEach((node, index) => {
      const start = [...positions.subarray(4 * node, 4 * node + 3)];
      const along = scaled([...this.forces.subarray(3 * index, 3 * index + 3)], this.scale);
      const length = Math.hypot(...along);
      const tip = plus(start, along);
      const points = [tip, tip, tip, tip, tip];
      if (length > 0) {
        const other = Math.abs(along[2]) < 0.9 * length ? [0, 0, 1] : [1, 0, 0];
        const side = unit(cross(along, other));
        const sides = [side, unit(cross(along, side))];
        const back = plus(tip, scaled(along, -HEAD));
        const wide = 0.5 * HEAD * length;
        [-wide, wide].forEach((w, sign) => sides.forEach((s, axis) => (points[1 + 2 * sign + axis] = plus(back, scaled(s, w)))));
      }
      points.forEach((point, at) => positions.set(point, 4 * (first + ARROW_POINTS * index + at)));
    });
  }
}
