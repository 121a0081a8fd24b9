/** The sandbox levels in words: what each keeps a function from. */

import type { Tone } from "../admin/badge";

export const LEVELS = ["L3", "L2", "L1", "L0"] as const;

/** The short word, how good that is, and what it means. */
export const LEVEL_WORDS: Record<string, readonly [string, Tone, string]> = {
  L3: ["own network, processes and mounts", "good", "A function sees its own files and processes alone, and has a network of its own, out of which only its egress list leads."],
  L2: ["own files, one port, few system calls", "good", "The kernel refuses other files, other ports and system calls that a function has no need of."],
  L1: ["bounded, never root", "warn", "Memory, processes and files are bounded; what the gateway's user may read a function may read too."],
  L0: ["a plain process", "bad", "A process with a deadline and no more: only for code that is trusted as much as the gateway itself."],
};
