/** Keys of the whole page. */

import { useLayoutEffect, useRef } from "preact/hooks";

/** Hear the window's keys as long as the component is there, from before it is first painted: what one sees can be used. */
export function useWindowKey(onKey: (event: KeyboardEvent) => void): void {
  const newest = useRef(onKey);
  newest.current = onKey;
  useLayoutEffect(() => {
    const hear = (event: KeyboardEvent) => newest.current(event);
    addEventListener("keydown", hear);
    return () => removeEventListener("keydown", hear);
  }, []);
}
