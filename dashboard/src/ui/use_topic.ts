/** Follow a topic of a robot for as long as the component is on the page. */

import { useEffect, useRef } from "preact/hooks";
import type { Decoded } from "../live/decoder";
import { useLive } from "./context";

export interface TopicOptions {
  robot: string;
  topic: string;
  maxRateHz?: number;
  /** How many messages may wait for the decoder: 1 shows only the newest, more keeps what arrives in bursts. */
  depth?: number;
  image?: boolean;
  enabled?: boolean;
}

export function useTopic(options: TopicOptions, onDecoded: (decoded: Decoded) => void): void {
  const { robot, topic, maxRateHz, depth = 1, image = false, enabled = true } = options;
  const { stream, decoder } = useLive();
  const handler = useRef(onDecoded);
  handler.current = onDecoded;
  useEffect(() => {
    if (!enabled) return;
    const feed = decoder.feed({ depth, image }, (decoded) => handler.current(decoded));
    const stop = stream.topic(
      { robots: robot, topics: topic, max_rate_hz: maxRateHz, mode: depth > 1 ? "queue" : "latest" },
      (channel, record) => feed.push(channel, record),
    );
    return () => {
      stop();
      feed.close();
    };
  }, [robot, topic, maxRateHz, depth, image, enabled]);
}
