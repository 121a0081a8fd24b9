/** A camera's H.264, decoded by the browser itself; or its single pictures where it cannot, or somebody chooses them. */

import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useMemo } from "preact/hooks";
import type { Missing } from "../api/history_types";
import { VideoPlayer } from "../live/media/video_player";
import { useLive } from "../ui/context";
import { Card } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import { useVisible } from "../ui/use_visible";
import "../styles/video.css";
import { CameraCard } from "./camera";
import { usePicture } from "./picture";

/** In the past: more than a group of pictures. */
const DEPTH = 128;
/** Live: a second, as a link that stalls gives it at once; a page that is further behind goes on with the next key frame. */
const LIVE_DEPTH = 30;
/** In the past: so far back the key frame of a group is looked for. */
const BACK_S = 2.5;

interface VideoCardProps {
  robot: string;
  topic: string;
  /** The same camera's single pictures. */
  picture: string | null;
  title: string;
}

/** Why this page cannot decode video; "" where it can. */
function whyNoVideo(): string {
  if (typeof VideoDecoder !== "undefined") return "";
  if (!isSecureContext) return "Browsers decode video on pages that came by https (or from localhost), and this page came by http.";
  return "This browser has no WebCodecs, which decode video.";
}

export function VideoCard({ robot, topic, picture, title }: VideoCardProps) {
  const chosen = useSignal<"video" | "picture" | null>(null);
  const why = whyNoVideo();
  const both = picture !== null && !why;
  const shows = picture === null || (!why && chosen.value !== "picture") ? "video" : "picture";
  const choice = both && (
    <span class="segments video-choice" role="group" aria-label={`${title}: shown as`}>
      <button type="button" aria-pressed={shows === "video"} onClick={() => (chosen.value = "video")}>H.264</button>
      <button type="button" aria-pressed={shows === "picture"} onClick={() => (chosen.value = "picture")}>JPEG</button>
    </span>
  );
  if (shows === "picture") {
    const remark = why && <p class="video-why">Shown as single pictures, which take more of the link than its video. {why}</p>;
    return <CameraCard key={picture!} robot={robot} topic={picture!} title={title} choice={choice} remark={remark} />;
  }
  if (why) {
    return (
      <Card title={title} kind="camera" topic={topic}>
        <p class="video-why" role="status">This camera sends H.264 video, which cannot be shown here. {why}</p>
      </Card>
    );
  }
  return <Video key={topic} robot={robot} topic={topic} title={title} choice={choice} />;
}

interface CompressedVideo {
  timestamp: { sec: number; nanosec: number };
  data: Uint8Array<ArrayBuffer>;
  format: string;
}

function Video({ robot, topic, title, choice }: { robot: string; topic: string; title: string; choice: ComponentChildren }) {
  const past = useLive().past !== null;
  const { canvas, note, meter, draw } = usePicture(topic, "h264");
  const received = useSignal<number | null>(null);
  const missing = useSignal<Missing | null>(null);
  const problem = useSignal("");
  const keyless = useSignal(false);
  const asks = useSignal(0);
  const visible = useVisible();

  const player = useMemo(() => {
    const events = {
      onFrame: (frame: VideoFrame, takenMs: number) => {
        draw(frame, frame.displayWidth, frame.displayHeight, takenMs, !past);
        frame.close();
      },
      onAsk: () => void (asks.value += 1),
      onProblem: (words: string) => void (problem.value = words),
    };
    return new VideoPlayer(events, undefined, undefined, past ? DEPTH : undefined);
  }, [topic, past]);
  useEffect(() => () => player.close(), [player]);
  const begin = (_: number, absent: Missing | null) => {
    missing.value = absent;
    received.value = null;
    keyless.value = false;
    player.restart();
  };
  const options = { robot, topic, depth: past ? DEPTH : LIVE_DEPTH, chained: !past, enabled: visible.value || past, asks: asks.value, backS: BACK_S, onInstant: begin };
  useTopic(options, ({ message, stampMs, seq, sizeBytes, error }, seenMs) => {
    if (Math.abs(seenMs - (received.peek() ?? 0)) > 1000) received.value = seenMs;
    if (!message) return void (problem.value = error ?? "no picture");
    const { timestamp, data, format } = message as unknown as CompressedVideo;
    if (format !== "h264") return void (problem.value = `Video in ${format.slice(0, 20) || "an unnamed format"} is not shown, only h264.`);
    meter.add(performance.now(), sizeBytes);
    player.push({ data, takenMs: timestamp.sec * 1000 + timestamp.nanosec / 1e6 || stampMs, seq });
    keyless.value = past && player.waits;
  });
  return (
    <Card title={title} kind="camera" topic={topic} note={<span ref={note} class="num" />} stampMs={received.value} missing={missing.value}>
      <div class="camera" data-codec="h264" data-asks={asks.value}>
        <canvas ref={canvas} width={640} height={360} role="img" aria-label={`Video of ${topic}`} />
        {choice}
        {problem.value && <p class="problem">{problem.value}</p>}
      </div>
      {keyless.value && <p class="video-why">Not shown here: the key frame that this part of the video builds on is not stored.</p>}
    </Card>
  );
}
