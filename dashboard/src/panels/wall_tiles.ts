/**
 * Where scans have hit so far, as faint ink on small canvases: what is hit again and again becomes a wall.
 *
 * Odometry drifts, so walls are right near the robot and wrong far back along its path: ink fades as it drives on.
 */

export const TILE_M = 12.8;
const PIXELS_PER_M = 20;
const TILE_PIXELS = TILE_M * PIXELS_PER_M;
const TILES_KEPT = 256;
const INK = 0.14;
const FADE = 0.09;
/** The ink fades once every so many metres driven: half of it is gone after about 37 m. */
export const FADE_EVERY_M = 5;

export interface View {
  /** World position of the middle of the canvas and pixels a metre. */
  x: number;
  y: number;
  scale: number;
}

export class WallTiles {
  #tiles = new Map<string, CanvasRenderingContext2D>();
  #box = { left: Infinity, bottom: Infinity, right: -Infinity, top: -Infinity };

  /** What has been seen so far, or null before anything was. */
  get box() {
    return Number.isFinite(this.#box.left) ? this.#box : null;
  }

  clear(): void {
    this.#tiles.clear();
    this.#box = { left: Infinity, bottom: Infinity, right: -Infinity, top: -Infinity };
  }

  add(points: Float32Array, colour: string): void {
    for (let i = 0; i < points.length; i += 2) {
      const x = points[i]!;
      const y = points[i + 1]!;
      const column = Math.floor(x / TILE_M);
      const row = Math.floor(y / TILE_M);
      const tile = this.#tile(column, row);
      tile.fillStyle = colour;
      tile.fillRect(Math.floor((x - column * TILE_M) * PIXELS_PER_M), TILE_PIXELS - 1 - Math.floor((y - row * TILE_M) * PIXELS_PER_M), 1, 1);
      this.#box.left = Math.min(this.#box.left, x);
      this.#box.right = Math.max(this.#box.right, x);
      this.#box.bottom = Math.min(this.#box.bottom, y);
      this.#box.top = Math.max(this.#box.top, y);
    }
  }

  fade(): void {
    for (const tile of this.#tiles.values()) {
      tile.globalCompositeOperation = "destination-out";
      tile.globalAlpha = FADE;
      tile.fillRect(0, 0, TILE_PIXELS, TILE_PIXELS);
      tile.globalCompositeOperation = "source-over";
      tile.globalAlpha = INK;
    }
  }

  draw(context: CanvasRenderingContext2D, view: View, width: number, height: number): void {
    const size = TILE_M * view.scale;
    for (const [key, tile] of this.#tiles) {
      const [column, row] = key.split(",").map(Number) as [number, number];
      const left = width / 2 + (column * TILE_M - view.x) * view.scale;
      const top = height / 2 - ((row + 1) * TILE_M - view.y) * view.scale;
      if (left > width || top > height || left + size < 0 || top + size < 0) continue;
      context.drawImage(tile.canvas, left, top, size, size);
    }
  }

  #tile(column: number, row: number): CanvasRenderingContext2D {
    const key = `${column},${row}`;
    let tile = this.#tiles.get(key);
    if (!tile) {
      const canvas = document.createElement("canvas");
      canvas.width = canvas.height = TILE_PIXELS;
      tile = canvas.getContext("2d")!;
      tile.globalAlpha = INK;
      this.#tiles.set(key, tile);
      if (this.#tiles.size > TILES_KEPT) this.#tiles.delete(this.#tiles.keys().next().value!);
    }
    return tile;
  }
}
