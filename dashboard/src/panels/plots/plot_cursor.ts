/** The line at the instant that a plot of the past shows. */

import type uPlot from "uplot";
import type { Palette } from "../../ui/theme";
import type { Frame } from "./frame";

export function drawCursor(plot: uPlot, { cursorMs }: Frame, colours: Palette): void {
  const { top, height } = plot.bbox;
  const x = Math.round(plot.valToPos(cursorMs / 1000, "x", true));
  plot.ctx.save();
  plot.ctx.fillStyle = colours["accent-2"];
  plot.ctx.fillRect(x - devicePixelRatio / 2, top, Math.max(1, 1.5 * devicePixelRatio), height);
  plot.ctx.restore();
  plot.root.parentElement!.dataset.atMs = String(cursorMs);
}
