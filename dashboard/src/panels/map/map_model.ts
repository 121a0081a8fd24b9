/** Geometry of the map card, free of any canvas: poses in time, scans in the world, the driven trail. */

export interface Pose {
  stampMs: number;
  x: number;
  y: number;
  yaw: number;
}

export interface Scan {
  stampMs: number;
  ranges: ArrayLike<number>;
  angleMin: number;
  angleStep: number;
  rangeMin: number;
  rangeMax: number;
}

export const POSES_KEPT = 200;
export const TRAIL_POINTS = 20_000;
const TRAIL_STEP_M = 0.03;
const JUMP_M = 3;
const SCANS_WAITING = 20;
/** At an instant after which nothing came, the last scan is put where the robot was within this time of it. */
const NEAR_MS = 1500;

export const yawOf = (q: { x: number; y: number; z: number; w: number }) =>
  Math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));

/** World positions, x and y in turn, of the rays that hit something. */
export function scanPoints(scan: Scan, pose: Pose): Float32Array {
  const points = new Float32Array(scan.ranges.length * 2);
  const farthest = scan.rangeMax > 0 ? scan.rangeMax * 0.995 : Infinity;
  let count = 0;
  for (let i = 0; i < scan.ranges.length; i++) {
    const range = scan.ranges[i]!;
    if (!(range >= scan.rangeMin && range > 0 && range < farthest)) continue;
    const angle = pose.yaw + scan.angleMin + i * scan.angleStep;
    points[count++] = pose.x + range * Math.cos(angle);
    points[count++] = pose.y + range * Math.sin(angle);
  }
  return points.subarray(0, count);
}

function between(a: Pose, b: Pose, stampMs: number): Pose {
  const part = b.stampMs === a.stampMs ? 1 : (stampMs - a.stampMs) / (b.stampMs - a.stampMs);
  const turn = Math.atan2(Math.sin(b.yaw - a.yaw), Math.cos(b.yaw - a.yaw));
  return { stampMs, x: a.x + part * (b.x - a.x), y: a.y + part * (b.y - a.y), yaw: a.yaw + part * turn };
}

export class MapModel {
  pose: Pose | null = null;
  /** x and y in turn; NaN where the robot was put somewhere else. */
  trail: number[] = [];
  /** The newest scan's hits and the pose they were seen from. */
  hits: Float32Array = new Float32Array(0);
  seenFrom: Pose | null = null;
  /** Whether that scan looked all around, so that its outline needs no sides to the robot. */
  allAround = false;
  scans = 0;
  travelledM = 0;
  /** The instant that is shown: poses after it only help to place scans. Null: the newest pose is shown. */
  untilMs: number | null = null;
  #poses: Pose[] = [];
  #waiting: Scan[] = [];

  constructor(private readonly onHits: (points: Float32Array) => void) {}

  /** Begin at another instant: everything but the trail is forgotten. */
  begin(untilMs: number): void {
    this.untilMs = untilMs;
    this.pose = this.seenFrom = null;
    this.hits = new Float32Array(0);
    this.#poses = [];
    this.#waiting = [];
  }

  addPose(pose: Pose): void {
    const last = this.pose;
    if (last && (pose.stampMs < last.stampMs || Math.hypot(pose.x - last.x, pose.y - last.y) > JUMP_M)) {
      this.#poses = [];
      this.#waiting = [];
      this.trail.push(NaN, NaN);
    } else if (last) {
      this.travelledM += Math.hypot(pose.x - last.x, pose.y - last.y);
    }
    this.#poses.push(pose);
    if (this.#poses.length > POSES_KEPT) this.#poses.shift();
    if (this.untilMs === null) {
      this.pose = pose;
      this.#extendTrail(pose);
    } else {
      this.pose = pose.stampMs <= this.untilMs ? pose : (this.poseAt(this.untilMs) ?? this.pose);
    }
    this.#place();
  }

  addScan(scan: Scan): void {
    this.#waiting.push(scan);
    if (this.#waiting.length > SCANS_WAITING) this.#waiting.shift();
    this.#place();
  }

  /** The pose at an instant, between the two that enclose it; null before the first and after the newest. */
  poseAt(stampMs: number): Pose | null {
    const poses = this.#poses;
    for (let i = poses.length - 1; i >= 0; i--) {
      if (poses[i]!.stampMs > stampMs) continue;
      const next = poses[i + 1];
      if (next) return between(poses[i]!, next, stampMs);
      return poses[i]!.stampMs === stampMs ? poses[i]! : null;
    }
    return null;
  }

  /** Put each waiting scan into the world once a pose on either side of it is known. */
  #place(): void {
    const oldest = this.#poses[0];
    this.#waiting = this.#waiting.filter((scan) => {
      const pose = this.poseAt(scan.stampMs);
      if (pose) {
        this.hits = scanPoints(scan, pose);
        this.seenFrom = pose;
        this.allAround = Math.abs(scan.angleStep) * scan.ranges.length > 6.2;
        this.scans += 1;
        this.onHits(this.hits);
        return false;
      }
      return !oldest || scan.stampMs >= oldest.stampMs;
    });
    if (this.untilMs !== null && this.seenFrom === null) this.#placeNear();
  }

  /** The newest waiting scan at the nearest pose, for want of one on either side; it leaves no ink. */
  #placeNear(): void {
    const scan = this.#waiting.at(-1);
    const pose = this.#poses.at(-1);
    if (!scan || !pose || Math.abs(scan.stampMs - pose.stampMs) > NEAR_MS) return;
    this.hits = scanPoints(scan, pose);
    this.seenFrom = { ...pose, stampMs: scan.stampMs };
    this.allAround = Math.abs(scan.angleStep) * scan.ranges.length > 6.2;
  }

  #extendTrail(pose: Pose): void {
    const [x, y] = this.trail.slice(-2) as [number?, number?];
    if (x === undefined || y === undefined || !(Math.hypot(pose.x - x, pose.y - y) < TRAIL_STEP_M)) {
      this.trail.push(pose.x, pose.y);
    }
    if (this.trail.length > TRAIL_POINTS * 2) this.trail = thinned(this.trail);
  }
}

/** Every second point of a path. */
function thinned(path: number[]): number[] {
  return path.filter((_, i) => (i >> 1) % 2 === 0);
}
