/** A part of the page whose code is fetched when it is first shown. */

import type { ComponentChildren, ComponentType } from "preact";
import { useEffect, useState } from "preact/hooks";

const LOADING = <p class="quiet">Loading…</p>;

/** `meanwhile` is shown until it is there: nothing in the place of a dialog. */
export function lazy<Props extends object>(load: () => Promise<ComponentType<Props>>, meanwhile: ComponentChildren = LOADING): ComponentType<Props> {
  let found: ComponentType<Props> | null = null;
  return function Lazy(props: Props) {
    const [Part, setPart] = useState<ComponentType<Props> | null>(() => found);
    const [failed, setFailed] = useState(false);
    useEffect(() => {
      if (found) return;
      load().then((part) => setPart(() => (found = part)), () => setFailed(true));
    }, []);
    if (Part) return <Part {...props} />;
    if (!failed) return <>{meanwhile}</>;
    return (
      <p class="quiet" role="alert">
        A part of this page did not come: the gateway is away, or newer than the page.{" "}
        <button type="button" class="button" onClick={() => location.reload()}>Reload</button>
      </p>
    );
  };
}
