// The scene in 3-D, by WebGL 2: springs as flat bars of equal width, nodes as marks.

const TEXTURE_WIDTH = 1024;
const POSITION_OF = `
uniform highp sampler2D positions;
uniform mat4 matrix;
vec4 place(uint node) {
  ivec2 texel = ivec2(int(node) % ${TEXTURE_WIDTH}, int(node) / ${TEXTURE_WIDTH});
  return matrix * vec4(texelFetch(positions, texel, 0).xyz, 1.0);
}`;

const BAR_VERTEX = `#version 300 es
precision highp float;
${POSITION_OF}
layout(location = 0) in uvec2 ends;
/* At both ends from 0 to 1, below for none; and its state, or 4 for a part of a load's arrow. Of a broken
   spring the first is what is left of it at each end. */
layout(location = 1) in vec3 value;
uniform vec2 pixels;
uniform float width;
uniform int picked;
out float shade;
out float along;
out float part;
flat out float state;
void main() {
  vec4 a = place(ends.x), b = place(ends.y);
  float near = 1e-6;
  if (max(a.w, b.w) <= near) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  /* What is behind the eye is cut off. */
  if (a.w < near) a = mix(a, b, (near - a.w) / (b.w - a.w));
  if (b.w < near) b = mix(b, a, (near - b.w) / (a.w - b.w));
  vec2 step = (b.xy / b.w - a.xy / a.w) * 0.5 * pixels;
  float size = length(step);
  vec2 across = size > 0.0 ? vec2(-step.y, step.x) / size : vec2(0.0);
  bool second = gl_VertexID > 1;
  float side = (gl_VertexID & 1) == 1 ? 1.0 : -1.0;
  bool chosen = gl_InstanceID == picked;
  gl_Position = second ? b : a;
  gl_Position.xy += across * side * width * (chosen ? 2.2 : 1.0) / pixels * gl_Position.w;
  if (chosen) gl_Position.z -= 1e-3 * gl_Position.w;
  shade = second ? value.y : value.x;
  along = second ? size : 0.0;
  part = second ? 1.0 : 0.0;
  state = value.z;
}`;

const BAR_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 stops[5];
uniform vec3 slackColour;
uniform vec3 brokenColour;
uniform vec3 yieldedColour;
uniform vec3 loadColour;
uniform float dash;
in float shade;
in float along;
in float part;
flat in float state;
out vec4 colour;
void main() {
  if (state > 3.5) {
    colour = vec4(loadColour, 1.0);
  } else if (state > 2.5 && fract(along / dash) > 0.7) {
    colour = vec4(yieldedColour, 1.0);
  } else if (state > 1.5 && state < 2.5) {
    if (min(part, 1.0 - part) > shade) discard;
    colour = vec4(brokenColour, 1.0);
  } else if (state > 0.5 && state < 1.5) {
    if (fract(along / dash) > 0.55) discard;
    colour = vec4(slackColour, 1.0);
  } else if (shade < -0.5) {
    colour = vec4(slackColour, 1.0);
  } else {
    float place = clamp(shade, 0.0, 1.0) * 4.0;
    int stop = min(int(place), 3);
    colour = vec4(mix(stops[stop], stops[stop + 1], place - float(stop)), 1.0);
  }
}`;

const MARK_VERTEX = `#version 300 es
precision highp float;
${POSITION_OF}
layout(location = 0) in uint node;
layout(location = 1) in float kind;
uniform float size;
flat out float shape;
void main() {
  gl_Position = place(node);
  gl_Position.z -= 5e-4 * gl_Position.w;
  gl_PointSize = size * (kind > 2.5 ? 2.2 : kind > 0.5 ? 1.0 : 0.45);
  shape = kind;
}`;

const MARK_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 ink;
uniform vec3 accent;
flat in float shape;
out vec4 colour;
void main() {
  vec2 x = 2.0 * gl_PointCoord - 1.0;
  float r = length(x);
  colour = vec4(ink, 1.0);
  if (shape > 2.5) {
    if (r > 1.0 || r < 0.65) discard;
    colour = vec4(accent, 1.0);
  } else if (shape > 1.5) {
    if (abs(x.x) + abs(x.y) > 1.0) discard;
  } else if (shape < 0.5) {
    if (r > 1.0) discard;
  }
}`;

/** Kinds of marks. */
const MARK = { free: 0, fixed: 1, guided: 2, picked: 3 };
/** With more nodes than this, free ones have no marks. */
const MOST_MARKS = 200;
/** Beside the states of springs. */
const PART_OF_ARROW = 4;
/** What is left of a broken spring at each end, as a part of its length. */
const STUB = 0.3;

class Picture {
  /**
   * @param origin what is taken off all positions, so that they are precise enough
   * @param arrows those of the loads
   */
  constructor(canvas, run, origin, arrows) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    if (!gl) {
      throw new Error("this browser has no WebGL 2, which the moving picture needs");
    }
    Object.assign(this, { canvas, run, origin, arrows, gl });
    this.bars = this.program(BAR_VERTEX, BAR_FRAGMENT);
    this.marks = this.program(MARK_VERTEX, MARK_FRAGMENT);
    const points = run.nodes + ARROW_POINTS * arrows.nodes.length;
    this.rows = Math.max(1, Math.ceil(points / TEXTURE_WIDTH));
    this.positions = new Float32Array(4 * TEXTURE_WIDTH * this.rows);
    const bars = arrows.bars(run.nodes);
    this.count = run.springs + bars.length / 2;
    this.values = new Float32Array(3 * this.count);
    for (let bar = run.springs; bar < this.count; bar++) {
      this.values.set([-1, -1, PART_OF_ARROW], 3 * bar);
    }
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, TEXTURE_WIDTH, this.rows);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.enable(gl.DEPTH_TEST);

    this.barArrays = gl.createVertexArray();
    gl.bindVertexArray(this.barArrays);
    this.buffer(Uint32Array.from([...run.ends, ...bars]));
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 2, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(0, 1);
    this.valueBuffer = this.buffer(this.values);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttribDivisor(1, 1);

    const kinds = new Map(run.supports.map(([node, kind]) => [node, MARK[kind]]));
    if (run.nodes <= MOST_MARKS) {
      for (let node = 0; node < run.nodes; node++) {
        kinds.set(node, kinds.get(node) ?? MARK.free);
      }
    }
    this.allMarks = this.markArrays([...kinds.keys()], [...kinds.values()]);
    this.picked = null;
  }

  program(vertex, fragment) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      throw new Error(`the picture cannot be drawn: ${gl.getProgramInfoLog(program)}`);
    }
    const at = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name.replace("[0]", "");
      at[name] = gl.getUniformLocation(program, name);
    }
    return { program, at };
  }

  buffer(numbers) {
    const gl = this.gl;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.DYNAMIC_DRAW);
    return buffer;
  }

  markArrays(nodes, kinds) {
    const gl = this.gl;
    const arrays = gl.createVertexArray();
    gl.bindVertexArray(arrays);
    this.buffer(new Uint32Array(nodes));
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    this.buffer(new Float32Array(kinds));
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 1, gl.FLOAT, false, 0, 0);
    return { arrays, count: nodes.length };
  }

  /** Puts nodes and colours where they are between two frames. */
  show(frame, fraction, colouring) {
    const { run, origin, positions, values } = this;
    const next = Math.min(frame + 1, run.frames - 1);
    const between = (at) => {
      const start = at(frame);
      return fraction > 0 ? start + fraction * (at(next) - start) : start;
    };
    for (let node = 0; node < run.nodes; node++) {
      for (let axis = 0; axis < 3; axis++) {
        const index = 3 * node + axis;
        positions[4 * node + axis] = between((f) => run.position.at(f, index)) - origin[axis];
      }
    }
    const time = run.times[frame] + fraction * (run.times[next] - run.times[frame]);
    this.arrows.place(time, positions, run.nodes);
    const { low, high } = colouring;
    const shade = (at) => (high > low ? (between(at) - low) / (high - low) : 0.5);
    for (let spring = 0; spring < run.springs; spring++) {
      const [a, b] = colouring.ofEnds(spring);
      values[3 * spring] = a ? Math.max(0, shade(a)) : -1;
      values[3 * spring + 1] = b === a ? values[3 * spring] : Math.max(0, shade(b));
      const state = run.state(fraction < 0.5 ? frame : next, spring);
      values[3 * spring + 2] = state;
      if (state === STATE.broken) {
        const stub = this.stub(spring);
        values.set([stub, stub], 3 * spring);
      }
    }
    const gl = this.gl;
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, TEXTURE_WIDTH, this.rows, gl.RGBA, gl.FLOAT, positions);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.valueBuffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, values);
  }

  /** What is left of a broken spring at each end; ends that have flown apart are joined by nothing. */
  stub(spring) {
    const [a, b] = [0, 1].map((end) => 4 * this.run.ends[2 * spring + end]);
    const length = Math.hypot(...[0, 1, 2].map((axis) => this.positions[b + axis] - this.positions[a + axis]));
    return Math.min(STUB, (0.5 * this.run.restLengths[spring]) / length);
  }

  /** Width per height. */
  aspect() {
    return this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
  }

  draw(camera, colours) {
    const { gl, canvas, run } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) => Math.round(size * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      [canvas.width, canvas.height] = [width, height];
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.matrix = camera.matrix(this.aspect());

    let at = this.use(this.bars);
    gl.uniform2f(at.pixels, width, height);
    gl.uniform1f(at.width, ratio * (run.springs > 1000 ? 1.2 : 2.2));
    gl.uniform1f(at.dash, 7 * ratio);
    gl.uniform1i(at.picked, this.picked?.kind === "spring" ? this.picked.index : -1);
    gl.uniform3fv(at.stops, colours.stops.flat());
    gl.uniform3fv(at.slackColour, colours.slack);
    gl.uniform3fv(at.brokenColour, colours.broken);
    gl.uniform3fv(at.yieldedColour, colours.yielded);
    gl.uniform3fv(at.loadColour, colours.load);
    gl.bindVertexArray(this.barArrays);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);

    at = this.use(this.marks);
    gl.uniform1f(at.size, 10 * ratio);
    gl.uniform3fv(at.ink, colours.support);
    gl.uniform3fv(at.accent, colours.accent);
    for (const { arrays, count } of [this.allMarks, this.pickedMark].filter(Boolean)) {
      gl.bindVertexArray(arrays);
      gl.drawArrays(gl.POINTS, 0, count);
    }
  }

  use({ program, at }) {
    this.gl.useProgram(program);
    this.gl.uniformMatrix4fv(at.matrix, false, this.matrix);
    this.gl.uniform1i(at.positions, 0);
    return at;
  }

  /** Marks a node or spring, or none. */
  pick(picked) {
    this.picked = picked;
    this.pickedMark = picked?.kind === "node" ? this.markArrays([picked.index], [MARK.picked]) : null;
  }

  /** Where a node is in the picture, from its upper left corner, and whether before the eye. */
  project(node) {
    const m = this.matrix;
    const x = this.positions.subarray(4 * node, 4 * node + 3);
    const [clipX, clipY, , w] = [0, 1, 2, 3].map((row) => m[row] * x[0] + m[4 + row] * x[1] + m[8 + row] * x[2] + m[12 + row]);
    const { clientWidth, clientHeight } = this.canvas;
    return { x: (0.5 + (0.5 * clipX) / w) * clientWidth, y: (0.5 - (0.5 * clipY) / w) * clientHeight, depth: w };
  }

  /** The node or spring at a place of the picture, within so many pixels. Nodes go first. */
  at(x, y, reach) {
    const places = Array.from({ length: this.run.nodes }, (_, node) => this.project(node));
    let best = null;
    const consider = (kind, index, distance, depth) => {
      const score = distance + (kind === "spring" ? 0.4 * reach : 0);
      if (depth > 0 && distance <= reach && (!best || score < best.score - 0.5 || (score < best.score + 0.5 && depth < best.depth))) {
        best = { kind, index, score, depth };
      }
    };
    places.forEach((place, node) => consider("node", node, Math.hypot(place.x - x, place.y - y), place.depth));
    for (let spring = 0; spring < this.run.springs; spring++) {
      const [a, b] = [places[this.run.ends[2 * spring]], places[this.run.ends[2 * spring + 1]]];
      const [dx, dy] = [b.x - a.x, b.y - a.y];
      const square = dx * dx + dy * dy;
      const along = square > 0 ? Math.max(0, Math.min(1, ((x - a.x) * dx + (y - a.y) * dy) / square)) : 0;
      const distance = Math.hypot(a.x + along * dx - x, a.y + along * dy - y);
      consider("spring", spring, distance, Math.min(a.depth, b.depth));
    }
    return best && { kind: best.kind, index: best.index };
  }
}
