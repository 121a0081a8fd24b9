/** What main.tsx makes once and every view uses. */

import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Decoder } from "../live/decoder";
import type { Stream } from "../live/stream";

export interface Live {
  stream: Stream;
  decoder: Decoder;
}

export const LiveContext = createContext<Live | null>(null);

export function useLive(): Live {
  const live = useContext(LiveContext);
  if (!live) throw new Error("outside of LiveContext");
  return live;
}
