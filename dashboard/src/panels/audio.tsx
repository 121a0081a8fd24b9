/** A robot's sound: listen to each of its microphones, and talk through its speaker. */

import { useSignal } from "@preact/signals";
import { useEffect, useLayoutEffect, useMemo } from "preact/hooks";
import { openSocket, robotPath } from "../api/client";
import { can, session } from "../api/session";
import type { Robot, Topic } from "../api/types";
import { bestCoding, openMicrophone } from "../live/media/microphone";
import { packetOf } from "../live/media/sound";
import { canOpus, SoundPlayer } from "../live/media/sound_player";
import { Talk, type TalkSocket, type TalkState } from "../live/media/talk";
import "../styles/audio.css";
import { useLive } from "../ui/context";
import { fixed, relativeTopic } from "../ui/format";
import { Card, MayNot } from "../ui/parts";
import { useTopic } from "../ui/use_topic";
import type { CardProps } from "./card_props";

/** A second of packets. */
const DEPTH = 50;
const TALK = "/speaker/talk";

const WORDS: Record<TalkState, string> = {
  idle: "Hold to talk",
  asking: "Asking…",
  talking: "You are talking",
  armed: "Hold to talk on",
  refused: "Refused",
  lost: "Silent",
};

export function AudioCard({ robot, topics }: CardProps) {
  if (useLive().past !== null) return null;
  const speaker = topics.some(({ topic }) => topic.endsWith(TALK));
  const heard = microphonesOf(topics);
  return (
    <Card title="Sound" kind="audio">
      <div class="audio">
        {heard.map((topic) => (
          <Listen key={topic} robot={robot.id} topic={topic} name={relativeTopic(topic, robot.namespace)} />
        ))}
        {speaker && (can("robots.talk") ? <TalkButton key={robot.id} robot={robot} /> : <MayNot what="talk" />)}
      </div>
    </Card>
  );
}

/** One topic of each microphone: its Opus, where it has one and the page can decode it. */
function microphonesOf(topics: Topic[]): string[] {
  const found = topics.map(({ topic }) => topic).filter((topic) => !topic.includes("/speaker/"));
  return found.filter((topic) => (topic.endsWith("/opus") ? canOpus() || !found.includes(topic.slice(0, -5)) : !canOpus() || !found.includes(`${topic}/opus`)));
}

function Listen({ robot, topic, name }: { robot: string; topic: string; name: string }) {
  const on = useSignal(false);
  const volume = useSignal(1);
  const player = useMemo(() => new SoundPlayer(), [topic]);
  useEffect(() => () => player.close(), [player]);
  useTopic({ robot, topic, depth: DEPTH, enabled: on.value }, ({ message, error }) => {
    const packet = message ? packetOf(message) : (error ?? "it cannot be read");
    if (typeof packet === "string") player.problem.value = packet;
    else player.push(packet);
  });
  const toggle = () => {
    on.value = !on.value;
    if (!on.value) player.close();
  };
  const why = !canOpus() && topic.endsWith("/opus") ? "This browser cannot decode Opus." : "";
  return (
    <div class="audio-row" data-listen={name} data-on={on.value} data-peak={player.peak.value.toFixed(3)}>
      <button type="button" class="button" aria-pressed={on.value} disabled={why !== ""} onClick={toggle}>
        {on.value ? "Stop listening" : "Listen"}
      </button>
      <span class="audio-name">{name}</span>
      <meter min={0} max={1} high={0.9} value={player.peak.value} aria-label={`Level of ${name}`} />
      <input
        type="range"
        min={0}
        max={1}
        step={0.05}
        value={volume.value}
        aria-label={`Volume of ${name}`}
        onInput={(event) => {
          volume.value = Number(event.currentTarget.value);
          player.volume(volume.value);
        }}
      />
      <span class="num audio-note" role="status">
        {why || player.problem.value || (on.value && player.latencyMs.value !== null ? fixed(player.latencyMs.value, 0, "ms") : "")}
      </span>
    </div>
  );
}

/** Who talks, as another operator will read it. */
const holderName = () => session.peek()?.name || "somebody";

function TalkButton({ robot }: { robot: Robot }) {
  const talk = useMemo(
    () => new Talk({ connect: () => openSocket(`${robotPath(robot.id)}/talk`) as TalkSocket, coding: bestCoding, open: openMicrophone }, holderName()),
    [robot.id],
  );
  const online = robot.state === "online";
  useLayoutEffect(() => { // before it is painted: what starts can be stopped
    const stop = () => talk.letGo();
    const hidden = () => document.hidden && stop();
    addEventListener("blur", stop);
    addEventListener("pagehide", stop);
    document.addEventListener("visibilitychange", hidden);
    return () => {
      removeEventListener("blur", stop);
      removeEventListener("pagehide", stop);
      document.removeEventListener("visibilitychange", hidden);
      talk.release();
    };
  }, [talk]);
  const press = (event: KeyboardEvent, down: boolean) => {
    if (event.code === "Escape") return talk.letGo();
    if (event.code !== "Space" && event.code !== "Enter") return;
    event.preventDefault();
    if (!down) talk.letGo();
    else if (!event.repeat) talk.hold();
  };
  return (
    <div class="audio-row" data-talk={talk.state.value} data-sent={talk.sent.value}>
      <button
        type="button"
        class="button audio-talk"
        disabled={!online}
        onPointerDown={(event) => {
          if (event.button !== 0) return;
          event.currentTarget.setPointerCapture(event.pointerId);
          talk.hold();
        }}
        onPointerUp={() => talk.letGo()}
        onPointerCancel={() => talk.letGo()}
        onLostPointerCapture={() => talk.letGo()}
        onContextMenu={(event) => event.preventDefault()}
        onKeyDown={(event) => press(event, true)}
        onKeyUp={(event) => press(event, false)}
        onBlur={() => talk.letGo()}
      >
        {WORDS[talk.state.value]}
      </button>
      <span class="audio-note" aria-live="polite">{online ? talk.detail.value : "Offline"}</span>
    </div>
  );
}
