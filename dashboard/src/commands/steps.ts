/** How far a command is: issued, delivered, running, and one end, with the time that each took. */

import type { Command, CommandState } from "../api/commands";
import { duration } from "../ui/format";

/**
 * `there`: it came, at a known time. `untold`: it came, nobody noted when. `next`: it is awaited.
 * `ahead`: later. `missed`: the command ended without it.
 */
export type StepStatus = "there" | "untold" | "next" | "ahead" | "missed";

export interface Step {
  word: string;
  status: StepStatus;
  stamp: string | null;
  /** Since the step before it: "4 ms"; "" where that is not known. */
  took: string;
  /** How it ended, on the last step of a command that is over. */
  end: "good" | "bad" | "off" | null;
}

const ENDS: Partial<Record<CommandState, "good" | "bad" | "off">> = { done: "good", failed: "bad", expired: "bad", cancelled: "off" };

export const isOver = (state: CommandState) => state in ENDS;
export const endOf = (state: CommandState) => ENDS[state] ?? null;

export function stepsOf(command: Command): Step[] {
  const over = isOver(command.state);
  const stamps = [command.issued, command.delivered, command.running, command.ended];
  const words = ["issued", "delivered", "running", over ? command.state : "done"];
  const reached = stamps.map((stamp, i) => stamp !== null && !(i === 3 && !over));
  const last = reached.lastIndexOf(true, 2);
  let awaited = true;
  return words.map((word, i) => {
    let status: StepStatus;
    if (reached[i]) status = "there";
    else if (over) status = passed(command, i, last) ? "untold" : "missed";
    else {
      status = i < last ? "untold" : awaited ? "next" : "ahead";
      if (i > last) awaited = false;
    }
    return { word, status, stamp: stamps[i] ?? null, took: tookAt(stamps, i), end: i === 3 ? endOf(command.state) : null };
  });
}

/** Whether a command that is over went through a step that has no time. */
function passed({ state, durable, delivered }: Command, i: number, last: number): boolean {
  if (i < last || state === "done") return true;
  return i === 2 && delivered !== null && !durable; // one that is answered at once does not say when it began
}

function tookAt(stamps: (string | null)[], i: number): string {
  const before = stamps.slice(0, i).findLast((stamp) => stamp !== null);
  const stamp = stamps[i];
  return before && stamp ? tookText(Date.parse(stamp) - Date.parse(before)) : "";
}

/** "4 ms", "1.2 s", "3 min". */
export function tookText(ms: number): string {
  if (ms < 1000) return `${Math.max(0, Math.round(ms))}\u202fms`;
  return duration(ms / 1000);
}
