/** A camera: compressed or raw pictures, decoded off the main thread and drawn once a frame. */

import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Missing } from "../api/history_types";
import type { Decoded } from "../live/media/decoder";
import { useLive } from "../ui/context";
import { inNextFrame } from "../ui/paint";
import { Card } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import { usePicture } from "./picture";

interface CameraCardProps {
  robot: string;
  topic: string;
  title: string;
  /** On the picture, and below it. */
  choice?: ComponentChildren;
  remark?: ComponentChildren;
}

export function CameraCard({ robot, topic, title, choice, remark }: CameraCardProps) {
  const { past } = useLive();
  const { canvas, note, meter, draw } = usePicture(topic, "image");
  const waiting = useRef<Decoded>(null);
  const received = useSignal<number | null>(null);
  const missing = useSignal<Missing | null>(null);
  const error = useSignal("");

  const drawWaiting = () => {
    const { bitmap, takenMs, stampMs } = waiting.current ?? {};
    waiting.current = null;
    if (!bitmap) return;
    draw(bitmap, bitmap.width, bitmap.height, takenMs || stampMs!, past === null);
    bitmap.close();
  };
  const begin = (_: number, absent: Missing | null) => {
    missing.value = absent;
    meter.clear();
    received.value = null;
  };
  useTopic({ robot, topic, image: true, onInstant: begin }, (decoded, seenMs) => {
    if (!decoded.bitmap) {
      error.value = decoded.error ?? "no picture";
      return;
    }
    error.value = "";
    meter.add(performance.now(), decoded.sizeBytes);
    if (Math.abs(seenMs - (received.peek() ?? 0)) > 1000) received.value = seenMs;
    waiting.current?.bitmap?.close();
    waiting.current = decoded;
    inNextFrame(drawWaiting);
  });
  useEffect(() => () => waiting.current?.bitmap?.close(), []);
  return (
    <Card title={title} kind="camera" topic={topic} note={<span ref={note} class="num" />} stampMs={received.value} missing={missing.value}>
      <div class="camera">
        <canvas ref={canvas} width={320} height={240} role="img" aria-label={`Picture of ${topic}`} />
        {choice}
        {error.value && <p class="problem">{error.value}</p>}
      </div>
      {remark}
    </Card>
  );
}
