/** Paints the map card: grid, walls seen so far, the live scan, the trail, the robot, a scale bar. */

import type { Palette } from "../../ui/theme";
import type { MapModel, Pose } from "./map_model";
import type { View, WallTiles } from "../wall_tiles";

interface Frame {
  context: CanvasRenderingContext2D;
  width: number;
  height: number;
  view: View;
  colours: Palette;
}

const SCALE_STEPS_M = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];

const sx = (frame: Frame, x: number) => frame.width / 2 + (x - frame.view.x) * frame.view.scale;
const sy = (frame: Frame, y: number) => frame.height / 2 - (y - frame.view.y) * frame.view.scale;

/** The distance whose bar is nearest to, and not over, `pixels`. */
export function scaleStep(scale: number, pixels: number): number {
  return SCALE_STEPS_M.filter((metres) => metres * scale <= pixels).at(-1) ?? SCALE_STEPS_M[0]!;
}

export function drawMap(frame: Frame, model: MapModel, walls: WallTiles): void {
  drawGrid(frame);
  if (model.seenFrom) drawFan(frame, model.hits, model.allAround ? null : model.seenFrom);
  walls.draw(frame.context, frame.view, frame.width, frame.height);
  drawTrail(frame, model.trail);
  drawHits(frame, model.hits);
  if (model.pose) drawRobot(frame, model.pose);
  drawScale(frame);
}

function drawGrid(frame: Frame): void {
  const { context, width, height, view, colours } = frame;
  const step = scaleStep(view.scale, 90);
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  context.beginPath();
  for (let x = Math.ceil((view.x - width / 2 / view.scale) / step) * step; sx(frame, x) <= width; x += step) {
    context.moveTo(Math.round(sx(frame, x)) + 0.5, 0);
    context.lineTo(Math.round(sx(frame, x)) + 0.5, height);
  }
  for (let y = Math.ceil((view.y - height / 2 / view.scale) / step) * step; sy(frame, y) >= 0; y += step) {
    context.moveTo(0, Math.round(sy(frame, y)) + 0.5);
    context.lineTo(width, Math.round(sy(frame, y)) + 0.5);
  }
  context.stroke();
}

/** The free space between the robot and what it sees. */
function drawFan(frame: Frame, hits: Float32Array, from: Pose | null): void {
  const { context, colours } = frame;
  context.beginPath();
  if (from) context.moveTo(sx(frame, from.x), sy(frame, from.y));
  for (let i = 0; i < hits.length; i += 2) context.lineTo(sx(frame, hits[i]!), sy(frame, hits[i + 1]!));
  context.closePath();
  context.globalAlpha = 0.07;
  context.fillStyle = colours.accent;
  context.fill();
  context.globalAlpha = 1;
}

function drawHits(frame: Frame, hits: Float32Array): void {
  const { context, colours } = frame;
  const size = Math.max(2, Math.min(4, frame.view.scale / 14));
  context.fillStyle = colours.accent;
  for (let i = 0; i < hits.length; i += 2) {
    context.fillRect(sx(frame, hits[i]!) - size / 2, sy(frame, hits[i + 1]!) - size / 2, size, size);
  }
}

function drawTrail(frame: Frame, trail: number[]): void {
  const { context, colours } = frame;
  context.strokeStyle = colours["accent-2"];
  context.lineWidth = 1.75;
  context.lineJoin = "round";
  context.globalAlpha = 0.85;
  context.beginPath();
  let down = false;
  for (let i = 0; i < trail.length; i += 2) {
    const x = trail[i]!;
    if (Number.isNaN(x)) {
      down = false;
      continue;
    }
    if (down) context.lineTo(sx(frame, x), sy(frame, trail[i + 1]!));
    else context.moveTo(sx(frame, x), sy(frame, trail[i + 1]!));
    down = true;
  }
  context.stroke();
  context.globalAlpha = 1;
}

function drawRobot(frame: Frame, pose: Pose): void {
  const { context, colours } = frame;
  const size = Math.max(9, Math.min(22, frame.view.scale * 0.28));
  context.save();
  context.translate(sx(frame, pose.x), sy(frame, pose.y));
  context.rotate(-pose.yaw);
  context.beginPath();
  context.moveTo(size, 0);
  context.lineTo(-size * 0.72, size * 0.68);
  context.lineTo(-size * 0.4, 0);
  context.lineTo(-size * 0.72, -size * 0.68);
  context.closePath();
  context.lineWidth = 3;
  context.strokeStyle = colours.surface;
  context.stroke();
  context.fillStyle = colours["accent-2"];
  context.fill();
  context.restore();
}

function drawScale(frame: Frame): void {
  const { context, height, view, colours } = frame;
  const metres = scaleStep(view.scale, 110);
  const length = metres * view.scale;
  const y = height - 14.5;
  context.strokeStyle = colours.text;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(14, y - 4);
  context.lineTo(14, y);
  context.lineTo(14 + length, y);
  context.lineTo(14 + length, y - 4);
  context.stroke();
  context.fillStyle = colours.text;
  context.font = "12px system-ui, sans-serif";
  context.fillText(`${metres} m`, 20 + length, y + 2);
}
