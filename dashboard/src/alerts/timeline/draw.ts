/** Paints alerts on plots: when they were, the moment, the band that was expected, and how strange each sample was. */

import type uPlot from "uplot";
import type { Alert, Severity } from "../../api/alerts";
import type { Palette } from "../../ui/theme";
import type { Expected } from "./band";
import { beganMs, endedMs } from "../words";

const HOLE_MS = 15_000;
/** From this score on a sample is an alert. */
const LOUD = 0.5;
/** A value is held against what was expected this near to it. */
const OUTSIDE_MS = 60_000;

export const colourOf = (severity: Severity, colours: Palette) => ({ error: colours.bad, warning: colours.warn, info: colours.accent })[severity];

const xAt = (plot: uPlot, ms: number) => plot.valToPos(ms / 1000, "x", true);

/** Paint within the plot's own area; the context is as it was afterwards. */
function within(plot: uPlot, paint: (context: CanvasRenderingContext2D, box: uPlot.BBox) => void): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  paint(ctx, bbox);
  ctx.restore();
}

/** A tint from beginning to end; of what goes on up to the edge. */
export function drawSpan(plot: uPlot, alert: Alert, colours: Palette, strength: number): void {
  within(plot, (context, { left, top, width, height }) => {
    const from = Math.max(left, xAt(plot, beganMs(alert)));
    const end = endedMs(alert);
    const to = end === null ? left + width : Math.min(left + width, xAt(plot, end));
    if (to <= from) return;
    context.fillStyle = colourOf(alert.severity, colours);
    context.globalAlpha = strength;
    context.fillRect(from, top, to - from, height);
  });
}

/** A line where it began, with a flag on top; a faint one on a plot that it is not about. */
export function drawMoment(plot: uPlot, alert: Alert, colours: Palette, faint: boolean): void {
  const unit = devicePixelRatio;
  within(plot, (context, { top, height }) => {
    const x = Math.round(xAt(plot, beganMs(alert)));
    context.fillStyle = colourOf(alert.severity, colours);
    context.globalAlpha = faint ? 0.45 : 1;
    context.fillRect(x - unit / 2, top, unit, height);
    context.beginPath();
    context.moveTo(x, top);
    context.lineTo(x + 8 * unit, top + 4 * unit);
    context.lineTo(x, top + 8 * unit);
    context.fill();
  });
}

/** The expected band: a soft ground between two dashed edges, broken where nothing was known. */
export function drawBand(plot: uPlot, band: readonly Expected[], colours: Palette): void {
  within(plot, (context, { top, height }) => {
    const y = (value: number) => (Number.isFinite(value) ? plot.valToPos(value, "y", true) : value > 0 ? top - 2 : top + height + 2);
    for (const piece of pieces(band)) {
      const highs = piece.map((one) => [xAt(plot, one.stampMs), y(one.high)] as const);
      const lows = piece.map((one) => [xAt(plot, one.stampMs), y(one.low)] as const);
      context.fillStyle = context.strokeStyle = colours.accent;
      context.globalAlpha = 0.13;
      context.beginPath();
      for (const [at, level] of [...highs, ...[...lows].reverse()]) context.lineTo(at, level);
      context.fill();
      context.globalAlpha = 0.55;
      context.lineWidth = devicePixelRatio;
      context.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
      for (const edge of [highs, lows]) {
        context.beginPath();
        for (const [at, level] of edge) context.lineTo(at, level);
        context.stroke();
      }
      context.setLineDash([]);
    }
  });
}

function pieces(band: readonly Expected[]): Expected[][] {
  const found: Expected[][] = [];
  let last: Expected | null = null;
  const hole = band.length > 2 ? Math.max(HOLE_MS, (6 * (band.at(-1)!.stampMs - band[0]!.stampMs)) / band.length) : Infinity;
  for (const one of band) {
    if (last === null || one.stampMs - last.stampMs > hole) found.push([]);
    found.at(-1)!.push(one);
    last = one;
  }
  return found;
}

/** What was out of the band once more, in the alert's colour: where a plot is looked at first. */
export function drawOutside(plot: uPlot, band: readonly Expected[], severity: Severity, colours: Palette): void {
  const [times, values] = plot.data as unknown as [number[], (number | null)[]];
  within(plot, (context) => {
    context.strokeStyle = colourOf(severity, colours);
    context.lineWidth = 2.2 * devicePixelRatio;
    context.lineJoin = "round";
    context.beginPath();
    let at = 0;
    let drawing = false;
    times.forEach((time, i) => {
      while (at + 1 < band.length && band[at + 1]!.stampMs <= time * 1000) at += 1;
      const expected = band[at];
      const value = values[i];
      const isOut = value != null && expected !== undefined && Math.abs(expected.stampMs - time * 1000) < OUTSIDE_MS && (value < expected.low || value > expected.high);
      if (isOut) {
        const [x, y] = [plot.valToPos(time, "x", true), plot.valToPos(value, "y", true)];
        if (drawing) context.lineTo(x, y);
        else context.moveTo(x, y);
      }
      drawing = isOut;
    });
    context.stroke();
  });
}

/** Along the bottom how strange each sample was; what would be an alert is taller. */
export function drawScores(plot: uPlot, band: readonly Expected[], severity: Severity, colours: Palette): void {
  const unit = devicePixelRatio;
  within(plot, (context, { top, height }) => {
    context.fillStyle = colourOf(severity, colours);
    band.forEach(({ stampMs, score }, i) => {
      if (score < 0.1) return;
      const from = xAt(plot, stampMs);
      const to = xAt(plot, band[i + 1]?.stampMs ?? stampMs + 1000);
      const tall = (score >= LOUD ? 7 : 4) * unit;
      context.globalAlpha = 0.2 + 0.8 * Math.min(1, score);
      context.fillRect(from, top + height - tall, Math.max(unit, Math.min(to - from, 12 * unit)), tall);
    });
  });
}
