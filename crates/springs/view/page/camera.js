// From where the scene is seen. Vectors are arrays of three numbers.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => a.map((x) => x * s);
const plus = (a, b) => a.map((x, i) => x + b[i]);
const unit = (a) => scaled(a, 1 / Math.hypot(...a));

/** Half of the angle of view from top to bottom. */
const HALF_VIEW = (17 * Math.PI) / 180;
const STEEPEST = (89 * Math.PI) / 180;

/** Turns about a point of the scene, upright. */
class Camera {
  /** @param half half of the edges of a box around the origin that holds everything */
  constructor(up, toward, half) {
    this.up = up;
    this.half = half;
    this.size = Math.hypot(...half) || 1;
    this.right = unit(cross(up, toward));
    this.front = cross(this.right, up);
    this.startHeight = Math.asin(Math.max(-1, Math.min(1, dot(toward, up))));
    this.home(1);
  }

  /** Shows all of it in a picture of this width per height. */
  home(aspect) {
    this.centre = [0, 0, 0];
    this.turn = 0;
    this.height = this.startHeight;
    const [right, above, toward] = this.axes();
    const tangent = Math.tan(HALF_VIEW);
    this.distance = 1e-9 * this.size;
    for (let corner = 0; corner < 8; corner++) {
      const x = this.half.map((h, axis) => ((corner >> axis) & 1 ? h : -h));
      const needed = Math.max(Math.abs(dot(x, right)) / (tangent * aspect), Math.abs(dot(x, above)) / tangent);
      this.distance = Math.max(this.distance, dot(x, toward) + 1.12 * needed);
    }
  }

  /** Right, up and toward the viewer. */
  axes() {
    const level = plus(scaled(this.front, Math.cos(this.turn)), scaled(this.right, Math.sin(this.turn)));
    const toward = plus(scaled(level, Math.cos(this.height)), scaled(this.up, Math.sin(this.height)));
    const right = unit(cross(this.up, toward));
    return [right, cross(toward, right), toward];
  }

  turnBy(across, along) {
    this.turn += across;
    this.height = Math.max(-STEEPEST, Math.min(STEEPEST, this.height + along));
  }

  /** Moves the scene by parts of the height of the picture. */
  moveBy(across, along) {
    const [right, above] = this.axes();
    const scale = 2 * this.distance * Math.tan(HALF_VIEW);
    this.centre = plus(this.centre, plus(scaled(right, -across * scale), scaled(above, along * scale)));
  }

  zoomBy(factor) {
    this.distance = Math.max(1e-4 * this.size, Math.min(100 * this.size, this.distance / factor));
  }

  /** From the scene to clip space, column by column. */
  matrix(aspect) {
    const [right, above, toward] = this.axes();
    const eye = plus(this.centre, scaled(toward, this.distance));
    const near = 0.01 * this.distance;
    const far = this.distance + 3 * this.size + Math.hypot(...this.centre);
    const y = 1 / Math.tan(HALF_VIEW);
    const [a, b] = [(far + near) / (near - far), (2 * far * near) / (near - far)];
    const rows = [
      [...scaled(right, y / aspect), (-dot(right, eye) * y) / aspect],
      [...scaled(above, y), -dot(above, eye) * y],
      [...scaled(toward, a), -dot(toward, eye) * a + b],
      [...scaled(toward, -1), dot(toward, eye)],
    ];
    return new Float32Array([0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));
  }
}
