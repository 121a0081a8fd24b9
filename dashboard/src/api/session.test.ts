import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { ApiError, openSocket, request, send, waitWords } from "./client";
import { become, can, ended, NOBODY, refresh, session, shutOut, signedIn, stale, whyNot, type Account } from "./session";

const ADA: Account = { ...NOBODY, kind: "user", id: "1", name: "ada", role: "operator", csrf: "t1", permissions: ["robots.drive"] };
const VIEWER: Account = { ...NOBODY, role: "viewer", permissions: ["robots.read"] };

type Call = { path: string; token: string | undefined };
let calls: Call[];
let answers: Record<string, (() => Response | Promise<Response>)[]>;

const json = (status: number, body: object, headers: Record<string, string> = {}) => () => new Response(JSON.stringify(body), { status, headers });
const refused = (status: number, code: string, more: object = {}) => json(status, { code, detail: `no: ${code}`, ...more });

beforeEach(() => {
  become(VIEWER);
  session.value = null;
  calls = [];
  answers = {};
  vi.stubGlobal("fetch", async (path: string, init?: RequestInit) => {
    calls.push({ path, token: (init?.headers as Record<string, string> | undefined)?.["x-csrf-token"] });
    const next = answers[path]?.shift();
    if (!next) throw new TypeError("no network");
    return next();
  });
});
afterEach(() => vi.unstubAllGlobals());

test("the gateway says who looks, and what they may", async () => {
  answers["/api/v1/auth/me"] = [json(200, ADA)];
  expect([can("robots.drive"), shutOut.value, signedIn.value]).toEqual([false, false, false]);
  await refresh();
  expect([can("robots.drive"), can("users.manage"), shutOut.value, signedIn.value]).toEqual([true, false, false, true]);
});

test("a gateway that does not answer, or fails, changes nothing", async () => {
  become(ADA);
  await refresh();
  answers["/api/v1/auth/me"] = [refused(503, "store_unavailable")];
  await refresh();
  expect(session.value).toBe(ADA);
});

test("a session that ended shuts out, and says whose it was; signing in forgets that", async () => {
  become(ADA);
  answers["/api/v1/auth/me"] = [refused(401, "bad_credentials")];
  answers["/api/v1/robots/a/topics"] = [refused(401, "bad_credentials")];
  await expect(request("/robots/a/topics")).rejects.toThrow("no: bad_credentials");
  expect([shutOut.value, ended.value, stale.value]).toEqual([true, "ada", true]);
  become(ADA);
  expect([shutOut.value, ended.value, stale.value]).toEqual([false, "", false]);
  answers["/api/v1/auth/me"] = [refused(401, "sign_in")];
  await refresh();
  expect([shutOut.value, stale.value]).toEqual([true, false]); // nothing was sent that is not good
});

test("an answer about who it was before signing in does not count", async () => {
  let late = (_: Response) => {};
  answers["/api/v1/auth/me"] = [() => new Promise((done) => (late = done))];
  const asked = refresh();
  become(ADA);
  late(refused(401, "bad_credentials")());
  await asked;
  expect(session.value).toBe(ADA);
});

test("questions at the same time are one", async () => {
  answers["/api/v1/auth/me"] = [json(200, ADA)];
  await Promise.all([refresh(), refresh(), refresh()]);
  expect(calls).toHaveLength(1);
});

test("what changes something carries the token, what reads does not", async () => {
  become(ADA);
  answers["/api/v1/x"] = [json(200, {}), json(200, {})];
  await send("PATCH", "/x", {});
  await request("/x");
  expect(calls.map(({ token }) => token)).toEqual(["t1", undefined]);
});

test("with a token of another session it is tried once more with the present one, and not a third time", async () => {
  become(ADA);
  answers["/api/v1/x"] = [refused(403, "csrf"), json(200, { ok: true })];
  answers["/api/v1/auth/me"] = [json(200, { ...ADA, csrf: "t2" }), json(200, { ...ADA, csrf: "t3" })];
  expect(await send("POST", "/x", {})).toEqual({ ok: true });
  expect(calls.map(({ path, token }) => [path, token])).toEqual([
    ["/api/v1/x", "t1"],
    ["/api/v1/auth/me", undefined],
    ["/api/v1/x", "t2"],
  ]);
  answers["/api/v1/x"] = [refused(403, "csrf"), refused(403, "csrf"), json(200, {})];
  await expect(send("POST", "/x", {})).rejects.toMatchObject({ code: "csrf" });
});

test("a wrong password is about what was typed: nobody is asked who looks", async () => {
  become(VIEWER);
  answers["/api/v1/auth/login"] = [refused(401, "bad_credentials")];
  await expect(send("POST", "/auth/login", {})).rejects.toMatchObject({ status: 401 });
  expect(calls).toHaveLength(1);
});

test("too many requests: the wait is said in words and kept as a number", async () => {
  answers["/api/v1/x"] = [refused(429, "too_many_requests", { retry_after_s: 3.2 }), json(429, {}, { "retry-after": "240" })];
  const first = (await request("/x").catch((error) => error)) as ApiError;
  expect([first.retryAfterS, first.message]).toEqual([3.2, "no: too_many_requests; try again in 4 s"]);
  const second = (await request("/x").catch((error) => error)) as ApiError;
  expect([second.retryAfterS, second.message]).toEqual([240, "HTTP 429; try again in 4 min"]);
  expect([waitWords(0.2), waitWords(90), waitWords(91)]).toEqual(["1 s", "90 s", "2 min"]);
});

test("why something is not offered", () => {
  expect(whyNot("drive")).toBe("Operators may drive.");
  become({ ...ADA, role: "viewer", permissions: [] });
  expect(whyNot("drive")).toBe("Operators may drive; ada is a viewer.");
  become({ ...session.value!, role: "operator" });
  expect(whyNot("start rollouts", "Admins")).toBe("Admins may start rollouts; ada is an operator.");
});

test("a socket that is refused or shown out asks who looks; one that is only lost does not", async () => {
  const made: EventTarget[] = [];
  class Socket extends EventTarget {
    constructor(readonly url: string) {
      super();
      made.push(this);
    }
  }
  vi.stubGlobal("WebSocket", Socket);
  vi.stubGlobal("location", { protocol: "https:", host: "fleet.example" });
  const close = (index: number, code: number) => made[index]!.dispatchEvent(Object.assign(new Event("close"), { code }));
  for (const path of ["/stream", "/stream", "/stream"]) openSocket(path);
  made[0]!.dispatchEvent(new Event("open"));
  close(0, 1006);
  expect(calls).toHaveLength(0);
  answers["/api/v1/auth/me"] = [json(200, VIEWER), json(200, ADA)];
  made[1]!.dispatchEvent(new Event("open"));
  close(1, 4401);
  await vi.waitFor(() => expect(session.value?.role).toBe("viewer"));
  close(2, 1006);
  await vi.waitFor(() => expect(session.value?.role).toBe("operator"));
  expect(calls).toHaveLength(2);
});
