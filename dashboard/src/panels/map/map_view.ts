/** Where the map looks: pan, zoom, pinch and follow, from pointer and wheel events. */

import type { View } from "../wall_tiles";

export const MIN_SCALE = 2;
export const MAX_SCALE = 400;

export class MapView implements View {
  x = 0;
  y = 0;
  scale = 32;
  follow = true;
  #pointers = new Map<number, { x: number; y: number }>();

  /** Zoom about a point given from the canvas's middle, so that what is under the pointer stays there. */
  zoom(factor: number, fromMiddleX = 0, fromMiddleY = 0): void {
    const scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, this.scale * factor));
    if (!this.follow) {
      this.x += fromMiddleX / this.scale - fromMiddleX / scale;
      this.y -= fromMiddleY / this.scale - fromMiddleY / scale;
    }
    this.scale = scale;
  }

  fit(box: { left: number; right: number; top: number; bottom: number }, width: number, height: number): void {
    this.follow = false;
    this.x = (box.left + box.right) / 2;
    this.y = (box.top + box.bottom) / 2;
    const wanted = 0.9 * Math.min(width / (box.right - box.left || 1), height / (box.top - box.bottom || 1));
    this.scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, wanted));
  }

  press(id: number, x: number, y: number): void {
    this.#pointers.set(id, { x, y });
  }

  /** One pointer pans and ends following; two pinch. Returns whether the view changed. */
  move(id: number, x: number, y: number): boolean {
    const before = this.#pointers.get(id);
    if (!before) return false;
    const other = [...this.#pointers].find(([pointer]) => pointer !== id)?.[1];
    if (other) {
      const length = (from: { x: number; y: number }) => Math.hypot(from.x - other.x, from.y - other.y) || 1;
      this.zoom(length({ x, y }) / length(before));
    } else {
      this.follow = false;
      this.x -= (x - before.x) / this.scale;
      this.y += (y - before.y) / this.scale;
    }
    this.#pointers.set(id, { x, y });
    return true;
  }

  lift(id: number): void {
    this.#pointers.delete(id);
  }
}
