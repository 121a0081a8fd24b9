/** Teleoperation input: keys and a pointer to speeds; forward is up, left is a positive turn, as in ROS. */

import type { Aim } from "../live/teleop";

export interface Limits {
  linear: number;
  angular: number;
}

/** [forward, left] of each key by its place on the keyboard. */
const KEYS: Record<string, [number, number]> = {
  KeyW: [1, 0],
  ArrowUp: [1, 0],
  KeyS: [-1, 0],
  ArrowDown: [-1, 0],
  KeyA: [0, 1],
  ArrowLeft: [0, 1],
  KeyD: [0, -1],
  ArrowRight: [0, -1],
};

const DEAD_ZONE = 0.12;
const clamp = (value: number) => Math.max(-1, Math.min(1, value));

export const isDriveKey = (code: string) => code in KEYS;

export function speedOfKeys(codes: Iterable<string>, limits: Limits): Aim {
  let forward = 0;
  let left = 0;
  for (const code of codes) {
    forward += KEYS[code]?.[0] ?? 0;
    left += KEYS[code]?.[1] ?? 0;
  }
  return { linear: clamp(forward) * limits.linear, angular: clamp(left) * limits.angular };
}

/** `x` to the right and `y` down, as parts of the pad's radius. */
export function speedOfPointer(x: number, y: number, limits: Limits): Aim {
  const live = (value: number) => (Math.abs(value) < DEAD_ZONE ? 0 : clamp(value));
  return { linear: -live(y) * limits.linear || 0, angular: -live(x) * limits.angular || 0 };
}
