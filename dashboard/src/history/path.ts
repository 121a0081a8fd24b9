/** A driven path from the series of a position. */

import type { Ranged } from "../api/history_types";

/** A silence of this length breaks the path. */
const HOLE_MS = 15_000;
const JUMP_M = 3;

/** x and y in turn, NaN where the path is broken: what MapModel's trail is. */
export function trailOf({ series }: Ranged): number[] {
  const [xs, ys] = ["x", "y"].map((axis) => series.find(({ name }) => name.endsWith(`.position.${axis}`)));
  if (!xs || !ys) return [];
  const yAt = new Map(ys.stamp_ms.map((stamp, i) => [stamp, ys.mean[i]!]));
  const trail: number[] = [];
  let last: [number, number, number] | null = null;
  xs.stamp_ms.forEach((stamp, i) => {
    const x = xs.mean[i]!;
    const y = yAt.get(stamp);
    if (y === undefined) return;
    if (last && (stamp - last[0] > HOLE_MS || Math.hypot(x - last[1], y - last[2]) > JUMP_M)) trail.push(NaN, NaN);
    trail.push(x, y);
    last = [stamp, x, y];
  });
  return trail;
}
