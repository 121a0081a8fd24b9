/** The sync status of a twin, in words: whether the robot is in its desired state. */

import type { Tone } from "../admin/badge";
import type { Twin } from "../api/twin";

export type Step = "none" | "in_step" | "waiting" | "sending" | "applying" | "confirming" | "reverted" | "refused";

export interface SyncStatus {
  step: Step;
  tone: Tone;
  word: string;
  text: string;
}

const living = (applied: number) => (applied ? `It lives by revision ${applied}` : "It lives by its own settings");
/** The robot's own words end a sentence or not. */
const ended = (text: string) => (/[.!?]$/.test(text) ? text : `${text}.`);

export function syncStatusOf(twin: Twin, online: boolean): SyncStatus {
  const { revision, reported } = twin;
  const say = (step: Step, tone: Tone, word: string, text: string): SyncStatus => ({ step, tone, word, text });
  if (revision === 0) return say("none", "off", "nothing desired", "Nobody has said what this robot is to be: it lives by its own settings.");
  if (twin.in_step) return say("in_step", "good", "in step", `The robot lives by revision ${revision}.`);
  const before = reported ? living(reported.applied) : "It has not said yet by what it lives";
  if (!reported || reported.revision < revision) {
    if (!online) return say("waiting", "off", "waits for the robot", `The robot is offline and takes revision ${revision} when it is back. ${before}.`);
    if (!reported) return say("sending", "warn", "no report", "The robot has not reported: its agent may be too old for twins.");
    return say("sending", "warn", "on its way", `Revision ${revision} goes to the robot. ${before}.`);
  }
  const why = [reported.message, reported.code && `(${reported.code})`].filter(Boolean).join(" ");
  switch (reported.state) {
    case "reverted":
      return say("reverted", "bad", "went back by itself", `Revision ${revision} could not be confirmed in time: ${ended(why || "the link did not come back")} ${before} again.`);
    case "refused":
      return say("refused", "bad", "refused", `The robot did not take revision ${revision}: ${ended(why || "it gave no reason")} ${before}.`);
    case "confirming":
      return say("confirming", "warn", "on trial", `Revision ${revision} runs. Without a confirmation the robot goes back by itself.`);
    default:
      return say("applying", "warn", "applying", `The robot is changing to revision ${revision}. Unless it can confirm it goes back by itself.`);
  }
}

/** The trial of a revision, as this page has seen it: when it began at the latest, by the browser's clock. */
export interface Trial {
  revision: number;
  sinceMs: number;
}

/** The trial that goes on after another look; null where there is none. */
export function trialOf(before: Trial | null, twin: Twin, step: Step, nowMs: number, first: boolean): Trial | null {
  if (step !== "applying" && step !== "confirming") return null;
  if (before?.revision === twin.revision) return before;
  // On the first look it has begun already: nobody knows when, but not before it was asked for.
  const saidMs = first && twin.at ? Date.parse(twin.at) : nowMs;
  return { revision: twin.revision, sinceMs: Math.min(nowMs, Number.isNaN(saidMs) ? nowMs : saidMs) };
}

/** Seconds until the robot goes back by itself, and which part of the window that is. */
export function left(trial: Trial, windowS: number, nowMs: number): { s: number; part: number } {
  const s = Math.max(0, windowS - (nowMs - trial.sinceMs) / 1000);
  return { s, part: windowS > 0 ? Math.min(1, s / windowS) : 0 };
}
