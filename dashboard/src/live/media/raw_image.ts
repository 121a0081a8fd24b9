/** sensor_msgs/msg/Image to RGBA, for the encodings that cameras commonly use. */

export interface RawImage {
  width: number;
  height: number;
  step: number;
  encoding: string;
  data: Uint8Array;
}

/** Byte offsets of red, green and blue in a pixel, and the pixel's size. */
const LAYOUTS: Record<string, { red: number; green: number; blue: number; size: number }> = {
  rgb8: { red: 0, green: 1, blue: 2, size: 3 },
  bgr8: { red: 2, green: 1, blue: 0, size: 3 },
  rgba8: { red: 0, green: 1, blue: 2, size: 4 },
  bgra8: { red: 2, green: 1, blue: 0, size: 4 },
  mono8: { red: 0, green: 0, blue: 0, size: 1 },
  "8UC1": { red: 0, green: 0, blue: 0, size: 1 },
};

export function rawToRgba(image: RawImage): Uint8ClampedArray<ArrayBuffer> {
  const layout = LAYOUTS[image.encoding];
  if (!layout) throw new Error(`pictures in ${image.encoding} are not shown`);
  const { width, height, step, data } = image;
  if (data.length < step * height || step < width * layout.size) throw new Error("the picture is cut off");
  const rgba = new Uint8ClampedArray(width * height * 4);
  for (let y = 0, out = 0; y < height; y++) {
    for (let x = 0, at = y * step; x < width; x++, at += layout.size, out += 4) {
      rgba[out] = data[at + layout.red]!;
      rgba[out + 1] = data[at + layout.green]!;
      rgba[out + 2] = data[at + layout.blue]!;
      rgba[out + 3] = 255;
    }
  }
  return rgba;
}
