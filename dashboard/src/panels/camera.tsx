/** A camera: compressed or raw pictures, decoded off the main thread and drawn once a frame. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Missing } from "../api/history_types";
import { fixed } from "../ui/format";
import { Card } from "../ui/parts";
import { useTopic } from "../ui/use_topic";

export function CameraCard({ robot, topic, title }: { robot: string; topic: string; title: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const waiting = useRef<ImageBitmap>(null);
  const frame = useRef(0);
  const arrivals = useRef<number[]>([]);
  const note = useRef<HTMLSpanElement>(null);
  const received = useSignal<number | null>(null);
  const missing = useSignal<Missing | null>(null);
  const error = useSignal("");

  const draw = () => {
    frame.current = 0;
    const bitmap = waiting.current;
    const target = canvas.current;
    waiting.current = null;
    if (!bitmap || !target) return;
    if (target.width !== bitmap.width || target.height !== bitmap.height) {
      target.width = bitmap.width;
      target.height = bitmap.height;
    }
    target.getContext("2d")!.drawImage(bitmap, 0, 0);
    target.dataset.frames = String(Number(target.dataset.frames ?? 0) + 1);
    const hertz = rate(arrivals.current);
    if (note.current) note.current.textContent = `${bitmap.width}×${bitmap.height}${hertz === null ? "" : ` · ${fixed(hertz, 0)} Hz`}`;
    bitmap.close();
  };
  const begin = (_: number, absent: Missing | null) => {
    missing.value = absent;
    arrivals.current = [];
    received.value = null;
  };
  useTopic({ robot, topic, image: true, onInstant: begin }, (decoded, seenMs) => {
    if (!decoded.bitmap) {
      error.value = decoded.error ?? "no picture";
      return;
    }
    error.value = "";
    arrivals.current = [...arrivals.current.slice(-19), performance.now()];
    if (Math.abs(seenMs - (received.peek() ?? 0)) > 1000) received.value = seenMs;
    waiting.current?.close();
    waiting.current = decoded.bitmap;
    frame.current ||= requestAnimationFrame(draw);
  });
  useEffect(
    () => () => {
      cancelAnimationFrame(frame.current);
      waiting.current?.close();
    },
    [],
  );
  return (
    <Card title={title} kind="camera" topic={topic} note={<span ref={note} class="num" />} stampMs={received.value} missing={missing.value}>
      <div class="camera">
        <canvas ref={canvas} width={320} height={240} role="img" aria-label={`Picture of ${topic}`} />
        {error.value && <p class="problem">{error.value}</p>}
      </div>
    </Card>
  );
}

/** Pictures a second over the last twenty. */
function rate(stamps: number[]): number | null {
  const span = stamps.length > 1 ? stamps.at(-1)! - stamps[0]! : 0;
  return span > 0 ? ((stamps.length - 1) * 1000) / span : null;
}
