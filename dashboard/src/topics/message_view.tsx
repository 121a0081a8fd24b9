/** The newest message of a topic as a tree that stays where it is while its values change. */

import { useSignal } from "@preact/signals";
import { useMemo, useRef } from "preact/hooks";
import type { Robot, Topic } from "../api/types";
import type { Decoded } from "../live/media/decoder";
import { clockTime, integer } from "../ui/format";
import { Freshness } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import { asJson, messageRows } from "./message_rows";

const RATE_HZ = 5;

export function MessageView({ robot, topic }: { robot: Robot; topic: Topic }) {
  const shown = useSignal<Decoded | null>(null);
  const seenMs = useSignal<number | null>(null);
  const paused = useSignal(false);
  const turned = useSignal<ReadonlySet<string>>(new Set());
  const error = useSignal("");
  useTopic({ robot: robot.id, topic: topic.topic, maxRateHz: RATE_HZ, enabled: !paused.value }, (decoded, at) => {
    if (paused.peek()) return;
    error.value = decoded.message ? "" : (decoded.error ?? "");
    if (decoded.message) shown.value = decoded;
    seenMs.value = at;
  });
  const message = shown.value?.message;
  const rows = useMemo(() => (message ? messageRows(message, turned.value) : []), [message, turned.value]);
  const turn = (path: string) => {
    const next = new Set(turned.peek());
    if (!next.delete(path)) next.add(path);
    turned.value = next;
  };
  return (
    <div class="message" data-message={topic.topic} data-paused={paused.value}>
      <div class="message-head">
        <span class="num hint">{shown.value ? `${clockTime(shown.value.stampMs)} · no. ${integer(shown.value.seq)}` : ""}</span>
        {!paused.value && <Freshness receivedMs={seenMs.value} />}
        {message && <CopyJson message={message} />}
        <button type="button" class="button" aria-pressed={paused.value} onClick={() => (paused.value = !paused.value)}>{paused.value ? "Go on" : "Pause"}</button>
      </div>
      {error.value && <p class="problem">{error.value}</p>}
      {!message && !error.value && <p class="hint message-none">{waitingWords(robot, topic)}</p>}
      {rows.length > 0 && (
        <ul class="message-tree mono" role="tree" aria-label={`Newest message of ${topic.topic}`}>
          {rows.map(({ path, depth, name, value, open }) => (
            <li key={path} role="treeitem" aria-level={depth + 1} aria-expanded={open ?? undefined} data-path={path} style={{ "--depth": depth }}>
              {open === null ? <span class="message-name">{name}</span> : <button type="button" class="message-name" onClick={() => turn(path)}>{name}</button>}
              <span class="message-value" title={value.length > 60 ? value : undefined}>{value}</span>
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}

function waitingWords(robot: Robot, topic: Topic): string {
  if (robot.state !== "online") return "The robot is offline: nothing comes.";
  if (!topic.forward) return "The robot keeps this topic to itself: its twin says so.";
  return topic.publishers === 0 ? "Nobody publishes it." : "Waiting for a message…";
}

const SAID_MS = 2000;

function CopyJson({ message }: { message: object }) {
  const done = useSignal(false);
  const timer = useRef<ReturnType<typeof setTimeout>>(undefined);
  const copy = async () => {
    await navigator.clipboard.writeText(asJson(message));
    done.value = true;
    clearTimeout(timer.current);
    timer.current = setTimeout(() => (done.value = false), SAID_MS);
  };
  if (!navigator.clipboard) return null; // a page over plain http may not copy
  return <button type="button" class="button" onClick={() => void copy()}>{done.value ? "Copied ✓" : "Copy JSON"}</button>;
}
