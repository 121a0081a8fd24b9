/**
 * sensor_msgs/msg/PointCloud2 and metaros_msgs/msg/QuantizedCloud to typed arrays, at most so many points and so long.
 *
 * What a message says of itself is checked before anything is read. A cloud of more points than there is room for is
 * decimated: every second of them, every third, and so on; `total` says how many there were.
 */

/** Three numbers a point, in the cloud's frame; `intensities` one, or null where it has none. */
export interface Cloud {
  positions: Float32Array<ArrayBuffer>;
  intensities: Float32Array<ArrayBuffer> | null;
  total: number;
  frame: string;
  /** From where to where most of the points are: 2 % beyond on either side. */
  height: Span;
  distance: Span;
  intensity: Span;
}

export type Span = [number, number];

export interface Budget {
  points: number;
  ms: number;
}

interface Field {
  name: string;
  offset: number;
  datatype: number;
  count: number;
}

interface PointCloud2 {
  header: { frame_id: string };
  height: number;
  width: number;
  fields: Field[];
  is_bigendian: boolean;
  point_step: number;
  row_step: number;
  data: Uint8Array;
}

interface QuantizedCloud {
  header: { frame_id: string };
  count: number;
  origin: ArrayLike<number>;
  step_m: number;
  has_intensity: boolean;
  data: Uint8Array;
}

/** Reads point `index` into `into` at `at`: x, y, z. Its intensity is another's business. */
interface Source {
  total: number;
  frame: string;
  axis: (index: number, axis: 0 | 1 | 2) => number;
  intensity: ((index: number) => number) | null;
}

type Getter = (view: DataView, at: number, little: boolean) => number;

/** By PointField's numbers: bytes and how to read them. */
const TYPES: ({ size: number; get: Getter } | null)[] = [
  null,
  { size: 1, get: (view, at) => view.getInt8(at) },
  { size: 1, get: (view, at) => view.getUint8(at) },
  { size: 2, get: (view, at, little) => view.getInt16(at, little) },
  { size: 2, get: (view, at, little) => view.getUint16(at, little) },
  { size: 4, get: (view, at, little) => view.getInt32(at, little) },
  { size: 4, get: (view, at, little) => view.getUint32(at, little) },
  { size: 4, get: (view, at, little) => view.getFloat32(at, little) },
  { size: 8, get: (view, at, little) => view.getFloat64(at, little) },
];
const MOST_FIELDS = 256;
const MOST_STEP = 1 << 20;
const LEAST_POINTS = 1000;
const SAMPLED = 512;
const OUTSIDE = 0.02;

/** Decodes within a budget of time too: it remembers how fast it was. */
export class CloudReader {
  #perMs = Infinity;

  constructor(
    private readonly budget: Budget,
    private readonly nowMs: () => number = () => performance.now(),
  ) {}

  /** An Error says what is wrong with the message. */
  read(message: Record<string, unknown>): Cloud {
    const begun = this.nowMs();
    const room = Math.max(LEAST_POINTS, Math.min(this.budget.points, Math.floor(this.#perMs * this.budget.ms)));
    const source = "point_step" in message ? ofPoints(message as unknown as PointCloud2) : ofQuantized(message as unknown as QuantizedCloud);
    const cloud = gathered(source, Math.min(room, this.budget.points));
    const spent = this.nowMs() - begun;
    const seen = Math.min(source.total, room);
    if (spent > 0 && seen >= LEAST_POINTS) this.#perMs = Math.min(seen / spent, 2 * this.#perMs);
    return cloud;
  }
}

function ofPoints(cloud: PointCloud2): Source {
  const { height, width, fields, point_step: step, row_step: row, data } = cloud;
  if (!(step > 0 && step <= MOST_STEP) || fields.length > MOST_FIELDS) throw new Error(`${fields.length} fields in points of ${step} bytes`);
  if (height > 1 && row < step * width) throw new Error(`rows of ${row} bytes are too short for ${width} points of ${step}`);
  const stride = height > 1 ? row : step * width;
  const needed = height > 0 && width > 0 ? stride * (height - 1) + step * width : 0;
  if (data.length < needed) throw new Error(`the cloud is cut off: ${data.length} of ${needed} bytes`);
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const reader = (name: string, wanted: boolean) => {
    const field = fields.find((one) => one.name === name);
    const type = field && TYPES[field.datatype];
    if (!field || !type || field.offset + type.size > step) {
      if (wanted || field) throw new Error(field ? `the field ${name} does not fit into a point` : `the cloud has no ${name}`);
      return null;
    }
    return (index: number) => {
      const line = height > 1 ? Math.floor(index / width) : 0;
      return type.get(view, line * stride + (index - line * width) * step + field.offset, !cloud.is_bigendian);
    };
  };
  const axes = [reader("x", true)!, reader("y", true)!, reader("z", true)!];
  return { total: needed ? height * width : 0, frame: cloud.header.frame_id, axis: (index, axis) => axes[axis]!(index), intensity: reader("intensity", false) };
}

function ofQuantized({ header, count, origin, step_m: step, has_intensity: bright, data }: QuantizedCloud): Source {
  const needed = count * (bright ? 7 : 6);
  if (data.length < needed) throw new Error(`the cloud is cut off: ${data.length} of ${needed} bytes`);
  if (!(step > 0 && Number.isFinite(step))) throw new Error(`a cloud of step ${step}`);
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  return {
    total: count,
    frame: header.frame_id,
    axis: (index, axis) => origin[axis]! + step * view.getUint16(index * 6 + axis * 2, true),
    intensity: bright ? (index) => view.getUint8(count * 6 + index) : null,
  };
}

function gathered({ total, frame, axis, intensity }: Source, room: number): Cloud {
  const every = Math.max(1, Math.ceil(total / room));
  const positions = new Float32Array(3 * Math.ceil(total / every));
  const intensities = intensity && new Float32Array(positions.length / 3);
  let count = 0;
  for (let index = 0; index < total; index += every) {
    const x = Math.fround(axis(index, 0));
    const y = Math.fround(axis(index, 1));
    const z = Math.fround(axis(index, 2));
    if (!Number.isFinite(x + y + z)) continue;
    positions[3 * count] = x;
    positions[3 * count + 1] = y;
    positions[3 * count + 2] = z;
    if (intensities) intensities[count] = finite(intensity!(index));
    count += 1;
  }
  const kept = positions.slice(0, 3 * count);
  const bright = intensities && intensities.slice(0, count);
  return {
    positions: kept,
    intensities: bright,
    total,
    frame,
    height: spanOf(count, (point) => kept[3 * point + 2]!),
    distance: spanOf(count, (point) => Math.hypot(kept[3 * point]!, kept[3 * point + 1]!, kept[3 * point + 2]!)),
    intensity: bright ? spanOf(count, (point) => bright[point]!) : [0, 1],
  };
}

const finite = (value: number) => (Number.isFinite(value) ? value : 0);

/** Where most values are, by a sample of them. */
function spanOf(count: number, value: (point: number) => number): Span {
  const every = Math.max(1, Math.floor(count / SAMPLED));
  const sample: number[] = [];
  for (let point = 0; point < count; point += every) sample.push(value(point));
  if (sample.length === 0) return [0, 1];
  sample.sort((a, b) => a - b);
  const low = sample[Math.floor(sample.length * OUTSIDE)]!;
  const high = sample[Math.ceil(sample.length * (1 - OUTSIDE)) - 1]!;
  return high > low ? [low, high] : [low, low + 1];
}
