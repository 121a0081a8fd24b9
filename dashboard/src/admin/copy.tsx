/** Text to copy: shown whole, copied by one press. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";

const SAID_MS = 4000;

type Said = "" | "copied" | "by hand";

/** Without the clipboard's interface (a page over plain http has none) the text is selected and copied as by hand. */
async function copied(text: string, shown: HTMLElement): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    getSelection()?.selectAllChildren(shown);
    return document.execCommand("copy");
  }
}

export function CopyField({ text, label, name }: { text: string; label: string; name: string }) {
  const shown = useRef<HTMLElement>(null);
  const said = useSignal<Said>("");
  useEffect(() => {
    if (said.value !== "copied") return;
    const timer = setTimeout(() => (said.value = ""), SAID_MS);
    return () => clearTimeout(timer);
  }, [said.value]);
  const copy = async () => {
    said.value = (await copied(text, shown.current!)) ? "copied" : "by hand";
  };
  return (
    <div class="copy" data-copy={name}>
      <code ref={shown} tabIndex={0} role="textbox" aria-readonly="true" aria-label={label} onFocus={(event) => getSelection()?.selectAllChildren(event.currentTarget)}>
        {text}
      </code>
      <button type="button" class="button button-main" onClick={() => void copy()}>
        {said.value === "copied" ? "Copied ✓" : "Copy"}
      </button>
      <span class={said.value === "by hand" ? "hint" : "visually-hidden"} role="status">
        {said.value === "copied" ? `${label}: copied` : said.value === "by hand" ? "The browser does not let this page copy. It is selected: press Ctrl+C." : ""}
      </span>
    </div>
  );
}
