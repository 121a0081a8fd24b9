import { afterEach, beforeEach, expect, test } from "vitest";
import { become, NOBODY, session, type Account } from "../api/session";
import { robots } from "./fleet";
import { followSession } from "./rights";

const VIEWER: Account = { ...NOBODY, role: "viewer", robots: ["*"] };
const ADA: Account = { ...VIEWER, kind: "user", id: "1", name: "ada", role: "operator" };
let did: string[];
let end: () => void;

beforeEach(() => {
  session.value = null;
  did = [];
  end = followSession({ start: () => void did.push("start"), stop: () => void did.push("stop") });
});
afterEach(() => end());

test("the first answer is about the connection that there is", () => {
  become(VIEWER);
  become({ ...VIEWER });
  expect(did).toEqual([]);
});

test("another person, another role and other robots are another connection", () => {
  become(VIEWER);
  for (const next of [ADA, { ...ADA, csrf: "new" }, { ...ADA, role: "viewer" as const }, { ...ADA, robots: ["a"] }]) {
    did = [];
    become(next);
    expect(did).toEqual(next.csrf === "new" ? [] : ["stop", "start"]);
  }
});

test("who is nobody sees nothing, and is connected again after signing in", () => {
  robots.value = [];
  become(NOBODY);
  expect([did, robots.value]).toEqual([["stop"], null]);
  become(ADA);
  expect(did).toEqual(["stop", "stop", "start"]);
});
