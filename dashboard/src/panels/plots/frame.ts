/** What a plot of the past shows: a span, the instant in it, and where data is known to be lost. */

import type { Span } from "../../api/history_types";

export interface Frame {
  startMs: number;
  endMs: number;
  cursorMs: number;
  holes: Span[];
}
