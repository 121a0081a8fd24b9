/** The stream follows who uses the page: another person, or another role, is another connection with those rights. */

import { effect, untracked } from "@preact/signals";
import { session } from "../api/session";
import { robots } from "./fleet";
import type { Stream } from "./stream";

/** Returns what ends the following. */
export function followSession(stream: Pick<Stream, "start" | "stop">): () => void {
  let person: string | null = null; // null: the first answer is about the connection that there is already
  return effect(() => {
    const who = session.value;
    if (who === null) return;
    const next = who.role === "none" ? "" : [who.kind, who.id, who.role, ...who.robots].join(" ");
    if (next === person) return;
    const first = person === null;
    person = next;
    untracked(() => {
      if (next !== "" && first) return;
      stream.stop();
      if (next === "") robots.value = null;
      else stream.start();
    });
  });
}
