/** The lock of a sealed topic, and the way to open it: a keyring file, which never leaves this page. */

import { signal } from "@preact/signals";
import { useLive } from "../ui/context";

const said = signal("");
const bad = signal(false);

/** Beside a sealed topic's name. */
export function LockMark() {
  return (
    <span role="img" aria-label="sealed" title="Sealed on the robot: the gateway cannot read it" data-sealed>
      {" \u{1F512}"}
    </span>
  );
}

/** Choose a keyring file; what it opens is shown like any other topic until the page is closed. */
export function Unlock() {
  const { decoder } = useLive();
  const choose = async (input: HTMLInputElement) => {
    const file = input.files?.[0];
    input.value = "";
    if (!file) return;
    try {
      const ids = await decoder.unlock(await file.text());
      bad.value = false;
      said.value = `opens with ${ids.length === 1 ? "key" : "keys"} ${ids.join(", ")}`;
    } catch (error) {
      bad.value = true;
      said.value = error instanceof Error ? error.message : String(error);
    }
  };
  return (
    <div class="unlock" data-unlock>
      <p>
        <span aria-hidden="true">{"\u{1F512}"}</span> Some topics are sealed on the robot: the gateway cannot read them. Choose their keyring to read
        them here; it stays in this page until you close it.
      </p>
      <label class="button button-main">
        {said.value && !bad.value ? "Choose another keyring…" : "Choose the keyring…"}
        <input type="file" class="visually-hidden" onChange={(event) => void choose(event.currentTarget)} />
      </label>
      <span role="status" class={bad.value ? "bad" : "unlock-said"}>
        {said.value}
      </span>
    </div>
  );
}
