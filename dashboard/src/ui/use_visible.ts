/** Whether the page is looked at: a hidden tab needs no video. */

import { useSignal, type ReadonlySignal } from "@preact/signals";
import { useEffect } from "preact/hooks";

export function useVisible(): ReadonlySignal<boolean> {
  const visible = useSignal(!document.hidden);
  useEffect(() => {
    const look = () => void (visible.value = !document.hidden);
    document.addEventListener("visibilitychange", look);
    return () => document.removeEventListener("visibilitychange", look);
  }, []);
  return visible;
}
