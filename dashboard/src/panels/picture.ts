/** A camera's canvas: draws a picture, says its size, rate, age and bandwidth, and announces it to who measures. */

import type { RefObject } from "preact";
import { useMemo, useRef } from "preact/hooks";
import { fixed } from "../ui/format";

/** What "drawn" events tell: the picture that is on the canvas now. `stampMs`, `drawnMs`: ms since 1970. */
export interface Drawn {
  topic: string;
  codec: "image" | "h264";
  stampMs: number;
  drawnMs: number;
  width: number;
  height: number;
}

/** Over so long rate and bandwidth are counted. */
const WINDOW_MS = 2000;
/** Clocks that differ by more than this say nothing about a latency. */
const LATENCY_LIMIT_MS = 10_000;

/** Arrivals of the last seconds. */
export class Meter {
  #arrivals: { atMs: number; sizeBytes: number }[] = [];

  add(atMs: number, sizeBytes: number): void {
    this.#arrivals.push({ atMs, sizeBytes });
    while (this.#arrivals[0]!.atMs < atMs - WINDOW_MS) this.#arrivals.shift();
  }

  clear(): void {
    this.#arrivals = [];
  }

  /** "30 Hz · 1.8 Mbit/s"; "" of too few. */
  get words(): string {
    const [first, last] = [this.#arrivals[0], this.#arrivals.at(-1)];
    const spanMs = first && last ? last.atMs - first.atMs : 0;
    if (spanMs <= 0) return "";
    const sum = this.#arrivals.reduce((total, { sizeBytes }) => total + sizeBytes, -first!.sizeBytes);
    return `${fixed(((this.#arrivals.length - 1) * 1000) / spanMs, 0)} Hz · ${bits((sum * 8) / spanMs)}`;
  }
}

const bits = (kilobits: number) => (kilobits < 999.5 ? fixed(kilobits, 0, "kbit/s") : fixed(kilobits / 1000, 1, "Mbit/s"));

interface Picture {
  canvas: RefObject<HTMLCanvasElement | null>;
  note: RefObject<HTMLSpanElement | null>;
  meter: Meter;
  /** Put it on the canvas. `live`: how late it is makes sense. */
  draw: (source: ImageBitmap | VideoFrame, width: number, height: number, stampMs: number, live: boolean) => void;
}

export function usePicture(topic: string, codec: Drawn["codec"]): Picture {
  const canvas = useRef<HTMLCanvasElement>(null);
  const note = useRef<HTMLSpanElement>(null);
  const meter = useMemo(() => new Meter(), [topic]);
  const draw: Picture["draw"] = (source, width, height, stampMs, live) => {
    const target = canvas.current;
    if (!target) return;
    if (target.width !== width || target.height !== height) {
      target.width = width;
      target.height = height;
    }
    target.getContext("2d")!.drawImage(source, 0, 0, width, height);
    target.dataset.frames = String(Number(target.dataset.frames ?? 0) + 1);
    const drawnMs = performance.timeOrigin + performance.now();
    const lateMs = drawnMs - stampMs;
    const late = live && lateMs >= 0 && lateMs < LATENCY_LIMIT_MS ? fixed(lateMs, 0, "ms") : "";
    if (note.current) note.current.textContent = [`${width}×${height}`, live && meter.words, late].filter(Boolean).join(" · ");
    const detail: Drawn = { topic, codec, stampMs, drawnMs, width, height };
    target.dispatchEvent(new CustomEvent("drawn", { bubbles: true, detail }));
  };
  return { canvas, note, meter, draw };
}
