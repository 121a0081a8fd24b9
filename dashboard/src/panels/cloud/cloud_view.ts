/** Where a cloud is looked at from: an orbit around a point, moved by pointers and keys, and its matrix for WebGL. */

type Vector = [number, number, number];
/** Column by column, as WebGL has it. */
export type Matrix = Float32Array;

const NEAREST_M = 0.3;
const FARTHEST_M = 500;
const FIELD_RAD = 0.9;
const STEEPEST = Math.PI / 2 - 0.01;
const TURN_PER_PX = 0.007;
const HOME = { yaw: -2.5, pitch: 0.6, distance: 18 };

export class CloudView {
  yaw = HOME.yaw;
  pitch = HOME.pitch;
  distance = HOME.distance;
  target: Vector = [0, 0, 0];
  #pointers = new Map<number, { x: number; y: number }>();

  /** Back to where one begins; `reachM` is how far the cloud goes. */
  reset(reachM = 0): void {
    Object.assign(this, HOME, { target: [0, 0, 0] });
    if (reachM > 0) this.distance = clamp(reachM * 2, NEAREST_M, FARTHEST_M);
  }

  orbit(yaw: number, pitch: number): void {
    this.yaw = (this.yaw + yaw) % (2 * Math.PI);
    this.pitch = clamp(this.pitch + pitch, -STEEPEST, STEEPEST);
  }

  zoom(factor: number): void {
    if (factor > 0 && Number.isFinite(factor)) this.distance = clamp(this.distance / factor, NEAREST_M, FARTHEST_M);
  }

  /** Along the screen, in pixels of a picture so high. */
  pan(dx: number, dy: number, height: number): void {
    const metres = (2 * this.distance * Math.tan(FIELD_RAD / 2)) / Math.max(1, height);
    const { right, up } = this.#axes();
    for (const axis of [0, 1, 2] as const) this.target[axis] = clamp(this.target[axis] - (right[axis] * dx - up[axis] * dy) * metres, -FARTHEST_M, FARTHEST_M);
  }

  press(id: number, x: number, y: number): void {
    this.#pointers.set(id, { x, y });
  }

  lift(id: number): void {
    this.#pointers.delete(id);
  }

  /** One pointer turns, or moves along with `along`; two move along and zoom. Whether anything changed. */
  move(id: number, x: number, y: number, height: number, along = false): boolean {
    const pointer = this.#pointers.get(id);
    if (!pointer) return false;
    const [dx, dy] = [x - pointer.x, y - pointer.y];
    const other = [...this.#pointers].find(([key]) => key !== id)?.[1];
    if (other) {
      const before = Math.hypot(pointer.x - other.x, pointer.y - other.y);
      this.zoom(Math.hypot(x - other.x, y - other.y) / Math.max(1, before));
      this.pan(dx / 2, dy / 2, height);
    } else if (along) this.pan(dx, dy, height);
    else this.orbit(-dx * TURN_PER_PX, dy * TURN_PER_PX);
    Object.assign(pointer, { x, y });
    return dx !== 0 || dy !== 0;
  }

  /** Arrows turn, with shift they move along; + and − zoom. Whether the key was one of them. */
  key(key: string, shift: boolean, height: number): boolean {
    const arrow = ARROWS[key];
    if (arrow && shift) this.pan(-40 * arrow[0], -40 * arrow[1], height);
    else if (arrow) this.orbit(0.1 * arrow[0], -0.1 * arrow[1]);
    else if (key === "+" || key === "=") this.zoom(1.25);
    else if (key === "-") this.zoom(0.8);
    else return false;
    return true;
  }

  /** From the cloud's metres to clip space. */
  matrix(width: number, height: number): Matrix {
    const { right, up, back } = this.#axes();
    const eye = this.target.map((value, axis) => value + back[axis]! * this.distance) as Vector;
    const [near, far] = [this.distance / 100, this.distance * 4 + FARTHEST_M];
    const flat = 1 / Math.tan(FIELD_RAD / 2);
    const wide = flat / (Math.max(1, width) / Math.max(1, height));
    const depth = [(far + near) / (near - far), (2 * far * near) / (near - far)] as const;
    const matrix = new Float32Array(16);
    for (const axis of [0, 1, 2] as const) {
      matrix[4 * axis] = wide * right[axis];
      matrix[4 * axis + 1] = flat * up[axis];
      matrix[4 * axis + 2] = depth[0] * back[axis];
      matrix[4 * axis + 3] = -back[axis];
    }
    matrix[12] = -wide * dot(right, eye);
    matrix[13] = -flat * dot(up, eye);
    matrix[14] = -depth[0] * dot(back, eye) + depth[1];
    matrix[15] = dot(back, eye);
    return matrix;
  }

  /** The screen's axes in the cloud's frame, z up; `back` points to the eye. */
  #axes(): { right: Vector; up: Vector; back: Vector } {
    const [cos, sin] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const [flat, steep] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    return { right: [-sin, cos, 0], up: [-steep * cos, -steep * sin, flat], back: [flat * cos, flat * sin, steep] };
  }
}

const ARROWS: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const clamp = (value: number, low: number, high: number) => Math.min(high, Math.max(low, value));
const dot = (a: Vector, b: Vector) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
