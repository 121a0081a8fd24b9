/** Paints the time bar's strip: density, losses, spells without a link, recordings and ticks. */

import type { Density, Recording } from "../../api/history_types";
import { ticksOf, xOf, type Window } from "../../history/span";
import type { Surface } from "../../ui/canvas";
import { clockTime, dayText } from "../../ui/format";
import { hatched } from "../../ui/hatch";
import type { Palette } from "../../ui/theme";

export const TICKS_PX = 17;
const MARKS_PX = 8;
const LEAST_GAP_PX = 3;

export interface Strip {
  window: Window;
  density: Density | null;
  recordings: Recording[];
}

export function drawStrip(surface: Surface, strip: Strip, colours: Palette): void {
  const { height } = surface;
  const ground = height - TICKS_PX;
  drawTicks(surface, strip, colours, ground);
  if (strip.density) {
    drawOffline(surface, strip, colours, ground);
    drawBars(surface, strip, colours, ground);
    drawLosses(surface, strip, colours, ground);
  }
  drawMarks(surface, strip, colours);
}

function drawTicks({ context, width, height }: Surface, { window }: Strip, colours: Palette, ground: number): void {
  context.strokeStyle = colours.line;
  context.fillStyle = colours.muted;
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.lineWidth = 1;
  context.beginPath();
  const days = window.endMs - window.startMs > 2 * 86_400_000;
  for (const tick of ticksOf(window, width)) {
    const x = Math.round(xOf(window, width, tick)) + 0.5;
    context.moveTo(x, 0);
    context.lineTo(x, ground);
    const text = days || clockTime(tick) === "00:00:00" ? dayText(tick) : clockTime(tick).slice(0, window.endMs - window.startMs < 1_000_000 ? 8 : 5);
    if (x > 26 && x < width - 26) context.fillText(text, x, height - 4);
  }
  context.moveTo(0, ground + 0.5);
  context.lineTo(width, ground + 0.5);
  context.stroke();
}

/** The left and right of a span in pixels, at least `least` wide; null when it is out of view. */
function extent({ width }: Surface, window: Window, fromMs: number, toMs: number, least: number): [number, number] | null {
  const from = xOf(window, width, fromMs);
  const to = Math.max(from + least, xOf(window, width, toMs));
  return to > 0 && from < width ? [Math.max(0, from), Math.min(width, to)] : null;
}

function drawOffline(surface: Surface, { window, density }: Strip, colours: Palette, ground: number): void {
  surface.context.fillStyle = colours.line;
  surface.context.globalAlpha = 0.55;
  for (const { from_ms, to_ms } of density!.offline ?? []) {
    const found = extent(surface, window, from_ms, to_ms, 1);
    if (found) surface.context.fillRect(found[0], MARKS_PX, found[1] - found[0], ground - MARKS_PX);
  }
  surface.context.globalAlpha = 1;
}

/** Heights are square roots, so that a robot that sends little is still seen beside one that sends much. */
function drawBars(surface: Surface, { window, density }: Strip, colours: Palette, ground: number): void {
  const { context } = surface;
  const { start_ms, width_ms, messages, rows } = density!;
  const top = Math.max(1, ...messages.map((count, i) => count + rows[i]!));
  const room = ground - MARKS_PX - 4;
  messages.forEach((count, i) => {
    const total = count + rows[i]!;
    if (total === 0) return;
    const found = extent(surface, window, start_ms + i * width_ms, start_ms + (i + 1) * width_ms, 1);
    if (!found) return;
    const tall = Math.max(2, room * Math.sqrt(total / top));
    const part = tall * (count / total);
    const wide = Math.max(1, found[1] - found[0] - (found[1] - found[0] > 3 ? 1 : 0));
    context.fillStyle = colours.accent;
    context.globalAlpha = 0.38;
    context.fillRect(found[0], ground - tall, wide, tall);
    context.globalAlpha = 0.5;
    context.fillRect(found[0], ground - part, wide, part);
  });
  context.globalAlpha = 1;
}

function drawLosses(surface: Surface, { window, density }: Strip, colours: Palette, ground: number): void {
  for (const { from_ms, to_ms } of density!.gaps) {
    const found = extent(surface, window, from_ms, to_ms, LEAST_GAP_PX);
    if (found) hatched(surface.context, found[0], MARKS_PX, found[1] - found[0], ground - MARKS_PX, colours.warn);
  }
}

function drawMarks(surface: Surface, { window, recordings }: Strip, colours: Palette): void {
  const { context } = surface;
  for (const { start, end, state } of recordings) {
    const found = extent(surface, window, Date.parse(start), Date.parse(end), 4);
    if (!found || state === "failed") continue;
    context.fillStyle = colours["accent-2"];
    context.globalAlpha = state === "stored" ? 1 : 0.45;
    context.beginPath();
    context.roundRect(found[0], 1, found[1] - found[0], 4, 2);
    context.fill();
  }
  context.globalAlpha = 1;
}
