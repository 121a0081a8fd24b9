/** What main.tsx makes once and every view uses; a view of the past puts its own past into it. */

import type { ReadonlySignal } from "@preact/signals";
import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Past } from "../history/past";
import type { Decoder } from "../live/media/decoder";
import type { Stream } from "../live/stream";

export interface Live {
  stream: Stream;
  decoder: Decoder;
  /** What panels show instead of the live stream; null: LIVE. */
  past: Past | null;
  /** What ages are measured against: the wall clock, or the instant shown. */
  at: ReadonlySignal<number>;
}

export const LiveContext = createContext<Live | null>(null);

export function useLive(): Live {
  const live = useContext(LiveContext);
  if (!live) throw new Error("outside of LiveContext");
  return live;
}
