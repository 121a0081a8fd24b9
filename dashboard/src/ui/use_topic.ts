/** Follow a topic of a robot for as long as the component is on the page: live, or at the instant that is shown. */

import { useEffect, useRef } from "preact/hooks";
import type { Missing } from "../api/history_types";
import type { Decoded } from "../live/media/decoder";
import { useLive } from "./context";

/** Messages of an instant come all at once. */
const AHEAD = 32;
/** Of a video: the worker is not to wait for a page that draws. */
const CHAINED_AHEAD = 4;

export interface TopicOptions {
  robot: string;
  topic: string;
  maxRateHz?: number;
  /** How many messages may wait for the decoder: 1 shows only the newest, more keeps what arrives in bursts. */
  depth?: number;
  /** Messages build on each other: where one does not fit, none that waits does. */
  chained?: boolean;
  image?: boolean;
  cloud?: boolean;
  enabled?: boolean;
  /** Another number asks anew: the robot is notified that somebody joined. */
  asks?: number;
  /** In the past: also the messages this long before and after the instant. */
  backS?: number;
  aheadS?: number;
  /** In the past: a new instant begins; forget the old one. `missing`: nothing is stored there, though older may follow. */
  onInstant?: (tMs: number, missing: Missing | null) => void;
}

/** `seenMs` is what the message's age counts from: its arrival, or in the past its stamp. */
export function useTopic(options: TopicOptions, onDecoded: (decoded: Decoded, seenMs: number) => void): void {
  const { robot, topic, maxRateHz, depth = 1, chained = false, image = false, cloud = false, enabled = true, asks = 0, backS = 0, aheadS = 0 } = options;
  const { stream, decoder, past } = useLive();
  const handler = useRef(onDecoded);
  handler.current = onDecoded;
  const instant = useRef(options.onInstant);
  instant.current = options.onInstant;
  useEffect(() => {
    if (!enabled) return;
    const ahead = past && !image && !cloud ? AHEAD : chained ? CHAINED_AHEAD : 1;
    const newFeed = () => decoder.feed({ depth, chained, image, cloud, ahead }, (decoded) => handler.current(decoded, past ? decoded.stampMs : Date.now()));
    let feed = newFeed();
    const stop = past
      ? past.watch({
          topic,
          backS,
          aheadS,
          onInstant: (tMs, missing) => {
            feed.close(); // what is still being decoded belongs to another instant
            feed = newFeed();
            instant.current?.(tMs, missing);
          },
          onRecord: (channel, record) => feed.push(channel, record),
        })
      : stream.topic({ robots: robot, topics: topic, max_rate_hz: maxRateHz, mode: depth > 1 ? "queue" : "latest" }, (channel, record) =>
          feed.push(channel, record),
        );
    return () => {
      stop();
      feed.close();
    };
  }, [robot, topic, maxRateHz, depth, chained, image, cloud, enabled, asks, past, backS, aheadS]);
}
