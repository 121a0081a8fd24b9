/** Dead-man driving: it moves only while a finger, a button or a key is held. */

import { useSignal } from "@preact/signals";
import { useLayoutEffect, useMemo, useRef } from "preact/hooks";
import { ApiError, openSocket, robotPath, send, teleopPath } from "../api/client";
import type { AnswerOf } from "../api/operation.js";
import { can, session } from "../api/session";
import { Teleop, type Aim, type TeleopState } from "../live/teleop";
import { fixed } from "../ui/format";
import { Card } from "../ui/parts";
import { speedOfKeys, speedOfPointer, isDriveKey } from "./teleop_input";

const WORDS: Record<TeleopState, string> = {
  idle: "Hold to drive",
  asking: "Asking for the lease…",
  holding: "Driving",
  armed: "Stopped, lease held",
  refused: "Refused",
  lost: "Link lost",
};

const SPEEDS = { slow: { linear: 0.25, angular: 0.6 }, normal: { linear: 0.5, angular: 1.0 }, fast: { linear: 1.0, angular: 1.6 } };

/** Who drives, as another operator will read it: their name, and which of their tabs. */
function holderName(): string {
  const who = session.peek();
  const kept = sessionStorage.getItem("metaros.holder");
  const tab = kept ?? `browser-${crypto.getRandomValues(new Uint16Array(1))[0]!.toString(16)}`;
  sessionStorage.setItem("metaros.holder", tab);
  return who?.kind === "user" ? `${who.name} (${tab})` : tab;
}

export function TeleopCard({ robot, namespace, online, lease }: { robot: string; namespace: string; online: boolean; lease: string | null }) {
  const teleop = useMemo(() => new Teleop(() => openSocket(teleopPath(robot)), holderName()), [robot]);
  const speed = useSignal<keyof typeof SPEEDS>("normal");
  const thumb = useSignal<{ x: number; y: number } | null>(null);
  const keys = useRef(new Set<string>());
  const pad = useRef<HTMLDivElement>(null);

  const stop = () => {
    keys.current.clear();
    thumb.value = null;
    teleop.letGo();
  };
  useLayoutEffect(() => { // before it is painted: what starts can be stopped
    const hidden = () => document.hidden && stop();
    const escape = (event: KeyboardEvent) => event.key === "Escape" && stop();
    addEventListener("blur", stop);
    addEventListener("pagehide", stop);
    addEventListener("keydown", escape);
    document.addEventListener("visibilitychange", hidden);
    return () => {
      removeEventListener("blur", stop);
      removeEventListener("pagehide", stop);
      removeEventListener("keydown", escape);
      document.removeEventListener("visibilitychange", hidden);
      teleop.release();
    };
  }, [teleop]);

  const point = (event: PointerEvent): Aim => {
    const box = pad.current!.getBoundingClientRect();
    const x = (event.clientX - box.left - box.width / 2) / (box.width / 2);
    const y = (event.clientY - box.top - box.height / 2) / (box.height / 2);
    const length = Math.max(1, Math.hypot(x, y));
    thumb.value = { x: x / length, y: y / length };
    return speedOfPointer(x / length, y / length, SPEEDS[speed.value]);
  };
  const press = (event: KeyboardEvent, down: boolean) => {
    if (!isDriveKey(event.code) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (down) keys.current.add(event.code);
    else keys.current.delete(event.code);
    if (keys.current.size === 0) return stop();
    const aim = speedOfKeys(keys.current, SPEEDS[speed.value]);
    thumb.value = { x: -aim.angular / SPEEDS[speed.value].angular || 0, y: -aim.linear / SPEEDS[speed.value].linear || 0 };
    if (!event.repeat || !down) teleop.hold(aim);
    teleop.aim(aim);
  };
  const state = teleop.state.value;
  return (
    <Card title="Drive" kind="teleop" note={teleop.rttMs.value === null ? "" : <span class="num">rtt {fixed(teleop.rttMs.value, 0, "ms")}</span>}>
      <div class="teleop" data-teleop={state} data-sent={teleop.sent.value}>
        <div
          ref={pad}
          class="pad"
          tabIndex={online ? 0 : -1}
          role="group"
          aria-disabled={!online}
          aria-label="Drive pad: hold and drag, or focus it and hold W A S D or the arrow keys. Escape stops."
          onPointerDown={(event) => {
            if (!online || event.button !== 0) return;
            pad.current!.setPointerCapture(event.pointerId);
            pad.current!.focus({ preventScroll: true });
            teleop.hold(point(event));
          }}
          onPointerMove={(event) => {
            if (pad.current!.hasPointerCapture(event.pointerId)) teleop.aim(point(event));
          }}
          onPointerUp={stop}
          onPointerCancel={stop}
          onLostPointerCapture={stop}
          onContextMenu={(event) => event.preventDefault()}
          onKeyDown={(event) => online && press(event, true)}
          onKeyUp={(event) => press(event, false)}
          onBlur={stop}
        >
          <svg viewBox="-50 -50 100 100" aria-hidden="true">
            <path d="M0-42 6-33H-6ZM0 42 6 33H-6ZM-42 0-33 6V-6ZM42 0 33 6V-6Z" />
          </svg>
          <i style={{ transform: `translate(${(thumb.value?.x ?? 0) * 46}px, ${(thumb.value?.y ?? 0) * 46}px)` }} />
        </div>
        <div class="teleop-side">
          <p class="teleop-state" aria-live="polite">
            <b>{online ? WORDS[state] : "Offline"}</b>
            <span>{teleop.detail.value || (lease && state === "idle" ? `${lease} holds the lease` : "")}</span>
          </p>
          <div class="segments" role="group" aria-label="Speed">
            {(Object.keys(SPEEDS) as (keyof typeof SPEEDS)[]).map((name) => (
              <button key={name} type="button" aria-pressed={speed.value === name} onClick={() => (speed.value = name)}>
                {name}
              </button>
            ))}
          </div>
          <p class="hint">
            <kbd>W</kbd><kbd>A</kbd><kbd>S</kbd><kbd>D</kbd> when the pad has focus · <kbd>Esc</kbd> stops
          </p>
          {can("robots.call") && <Resume robot={robot} namespace={namespace} online={online} before={() => teleop.release()} />}
        </div>
      </div>
    </Card>
  );
}

/** A base counts as driven until its watchdog has seen no command for 300 ms; asked sooner it refuses. */
const SETTLE_MS = 500;
const ATTEMPTS = 3;

async function resumeAutonomy(robot: string, namespace: string): Promise<string> {
  const service = `${namespace === "/" ? "" : namespace}/base/resume`;
  let said = "";
  for (let attempt = 0; attempt < ATTEMPTS; attempt++) {
    if (attempt > 0) await new Promise((done) => setTimeout(done, SETTLE_MS));
    const { response } = await send<AnswerOf<"POST /robots/{robot_id}/services/call">>("POST", `${robotPath(robot)}/services/call`, { service, type: "std_srvs/srv/Trigger", request: {}, timeout_s: 5 });
    if (response.success !== false) return "autonomy resumed";
    said = `refused: ${String(response.message)}`;
  }
  return said;
}

function Resume({ robot, namespace, online, before }: { robot: string; namespace: string; online: boolean; before: () => void }) {
  const said = useSignal("");
  const busy = useSignal(false);
  const resume = async () => {
    busy.value = true;
    before();
    try {
      said.value = await resumeAutonomy(robot, namespace);
    } catch (error) {
      said.value = error instanceof ApiError ? error.message : String(error);
    }
    busy.value = false;
  };
  return (
    <div class="resume">
      <button type="button" class="button" disabled={!online || busy.value} onClick={() => void resume()}>
        Resume autonomy
      </button>
      <span aria-live="polite">{said.value}</span>
    </div>
  );
}
