/** A page whose code is fetched when somebody first opens it. */

import type { ComponentType } from "preact";
import { useEffect, useState } from "preact/hooks";

export function lazy(load: () => Promise<ComponentType>): ComponentType {
  let found: ComponentType | null = null;
  return function Lazy() {
    const [Page, setPage] = useState<ComponentType | null>(() => found);
    useEffect(() => {
      if (!found) void load().then((page) => setPage(() => (found = page)));
    }, []);
    return Page ? <Page /> : <p class="quiet">Loading…</p>;
  };
}
