import { expect, test } from "vitest";
import type { Robot } from "../api/types";
import { HISTORY_POINTS, linkHistory, noteLink } from "./link_history";

const robot = (id: string, rtt: number | null, late: number, state: "online" | "offline" = "online") =>
  ({ id, state, link: { rtt_ms: rtt, classes: [{ backfill_bytes: late }, { backfill_bytes: 1 }] } }) as unknown as Robot;

test("round trips and back-fill are noted once a second while online", () => {
  noteLink(robot("a", 5, 999), 0);
  noteLink(robot("a", 6, 999), 100);
  noteLink(robot("a", 7, 499), 1000);
  noteLink(robot("a", 8, 0, "offline"), 2000);
  noteLink(robot("a", null, 499), 3000);
  const { rtts, drained } = linkHistory("a");
  expect(rtts.value).toEqual([5, 7]);
  expect(drained.value).toMatchObject({ leftBytes: 500, peakBytes: 1000, progress: 0.5 });
});

test("the memory is bounded", () => {
  for (let i = 0; i < 500; i++) noteLink(robot("b", i, 0), i * 1000);
  expect(linkHistory("b").rtts.value).toHaveLength(HISTORY_POINTS);
  expect(linkHistory("b").rtts.value.at(-1)).toBe(499);
});
