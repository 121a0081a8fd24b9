/** The one sign of missing data: slanted lines over a faint ground, on every canvas alike. */

const STEP = 7;

/** Hatch a rectangle of a canvas, in the canvas's own units. */
export function hatched(context: CanvasRenderingContext2D, x: number, y: number, width: number, height: number, colour: string): void {
  context.save();
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
  context.fillStyle = context.strokeStyle = colour;
  context.globalAlpha = 0.1;
  context.fillRect(x, y, width, height);
  context.globalAlpha = 0.55;
  context.lineWidth = 1;
  context.beginPath();
  // Lines hang on the canvas, not on the rectangle, so that neighbours join.
  for (let at = Math.floor((x - height) / STEP) * STEP; at < x + width; at += STEP) {
    context.moveTo(at, y + height);
    context.lineTo(at + height, y);
  }
  context.stroke();
  context.restore();
}
