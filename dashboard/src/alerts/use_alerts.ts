/** What of the alerts is in view, asked again when the gateway says that one changed, and now and then in any case. */

import { useEffect, useRef } from "preact/hooks";
import { useAsked, type Asked } from "../admin/use_list";

const EVERY_MS = 15_000;
/** Many events at once are one question. */
const SETTLE_MS = 200;
const AGAIN_MS = 10_000;

/** Calls back a moment after alerts changed; a stream that was refused is tried again. */
export function useAlertEvents(onChange: () => void): void {
  const latest = useRef(onChange);
  latest.current = onChange;
  useEffect(() => {
    let source: EventSource | null = null;
    let settle: ReturnType<typeof setTimeout> | undefined;
    let again: ReturnType<typeof setTimeout> | undefined;
    const changed = () => {
      settle ??= setTimeout(() => {
        settle = undefined;
        latest.current();
      }, SETTLE_MS);
    };
    const follow = () => {
      source = new EventSource("/api/v1/events?kind=alert.*");
      source.onmessage = changed;
      source.onerror = () => {
        if (source?.readyState === EventSource.CLOSED) again = setTimeout(follow, AGAIN_MS);
      };
    };
    follow();
    return () => {
      source?.close();
      clearTimeout(settle);
      clearTimeout(again);
    };
  }, []);
}

export function useAlerts<T>(ask: () => Promise<T>, everyMs = EVERY_MS): Asked<T> {
  const asked = useAsked(ask, everyMs);
  useAlertEvents(() => void asked.refresh());
  return asked;
}
