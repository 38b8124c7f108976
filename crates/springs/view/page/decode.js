// The data of the page, unpacked. How they are packed is said in quantized.rs and contents.rs.

/** The bytes of an element of the page: base64 of deflated bytes. */
async function inflated(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) {
    bytes[i] = text.charCodeAt(i);
  }
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Whole numbers of all frames, from their differences to predictions. */
function undifferenced(bytes, width, order) {
  const numbers = new Uint16Array(bytes.length / 2);
  for (let start = 0, frame = 0; start < numbers.length; start += width, frame++) {
    const degree = Math.min(order, frame);
    for (let i = 0; i < width; i++) {
      const coded = bytes[2 * start + i] | (bytes[2 * start + width + i] << 8);
      let number = (coded >>> 1) ^ -(coded & 1);
      const at = start + i;
      if (degree === 1) {
        number += numbers[at - width];
      } else if (degree === 2) {
        number += 2 * numbers[at - width] - numbers[at - 2 * width];
      } else if (degree === 3) {
        number += 3 * numbers[at - width] - 3 * numbers[at - 2 * width] + numbers[at - 3 * width];
      }
      // Modulo 65536.
      numbers[at] = number;
    }
  }
  return numbers;
}

/** Numbers of all frames on a grid. */
class Numbers {
  constructor(packed, bytes) {
    this.width = packed.width;
    this.low = packed.low;
    this.step = packed.step;
    this.whole = undifferenced(bytes, packed.width, packed.order);
  }

  at(frame, index) {
    const component = index % this.low.length;
    return this.low[component] + this.step[component] * this.whole[frame * this.width + index];
  }
}

/** Of each frame, bit by bit, which springs are slack. */
function unmarked(bytes, nSprings) {
  const width = Math.ceil(nSprings / 8);
  for (let i = width; i < bytes.length; i++) {
    bytes[i] ^= bytes[i - width];
  }
  return (frame, spring) => ((bytes[frame * width + (spring >> 3)] >> (spring & 7)) & 1) === 1;
}

/** Of each spring, from which frame on it is broken, or has yielded. */
function changed(bytes, nSprings) {
  const frames = new Uint32Array(bytes.slice(0, 8 * nSprings).buffer);
  return [frames.subarray(0, nSprings), frames.subarray(nSprings)];
}

/** What a spring is. */
const STATE = { whole: 0, slack: 1, broken: 2, yielded: 3 };

/** Everything that the page knows of the run; SI units. */
async function readRun() {
  const run = JSON.parse(document.getElementById("run").textContent);
  const { arrays, springs: k } = run;
  const numbers = async (id, packed) => new Numbers(packed, await inflated(id));
  run.position = await numbers("position", arrays.position);
  run.speed = await numbers("speed", arrays.speed);
  run.tension = await numbers("tension", arrays.tension);
  run.isSlack = unmarked(await inflated("slack"), k);
  [run.broken, run.yielded] = changed(await inflated("changes"), k);
  run.state = (frame, spring) => {
    if (frame >= run.broken[spring]) return STATE.broken;
    if (frame >= run.yielded[spring]) return STATE.yielded;
    return run.isSlack(frame, spring) ? STATE.slack : STATE.whole;
  };
  const fixed = await inflated("springs");
  run.ends = new Uint32Array(fixed.slice(0, 8 * k).buffer);
  run.restLengths = new Float64Array(fixed.slice(8 * k, 16 * k).buffer);
  const compliances = new Float64Array(fixed.slice(16 * k, 24 * k).buffer);
  if (arrays.strain) {
    const strain = await numbers("strain", arrays.strain);
    run.strainAt = (frame, spring) => strain.at(frame, spring);
  } else {
    run.strainAt = (frame, spring) => run.tension.at(frame, spring) * compliances[spring];
  }
  run.frames = run.times.length;
  return run;
}
