import { expect, test } from "vitest";
import type { ApiKey, AuditProof, AuditRow, EnrolmentToken, RobotIdentity } from "../api/admin";
import { agoText, keyLife, patternsOf, robotsWords, rolesUpTo, userNameProblem, waysIn } from "./accounts";
import { ACTS } from "./audit_acts";
import { actWords, outcomeOf, proofWords, whoWords, withNewer } from "./audit_words";
import { alarmed, certificateWords, commandFor, countdown, currentCertificate, GRACE_MS, inOrder, tokenStanding } from "./certificates";

const DAY_MS = 86_400_000;
const NOW = Date.parse("2026-11-21T12:00:00Z");
const at = (days: number) => new Date(NOW + days * DAY_MS).toISOString();

/** An identity whose certificate lives three days from `issuedDays` on. */
function identity(issuedDays: number, changes: Partial<RobotIdentity> = {}): RobotIdentity {
  const certificate = { serial: "a1", how: "token" as const, issued: at(issuedDays), not_after: at(issuedDays + 3), revoked: null };
  return { robot: "arm_1", state: "active", enrolled: at(issuedDays), revoked: null, reason: "", alarm: "", alarm_at: null, certificates: [certificate], ...changes };
}

test.each([
  [0, "good", "valid", "renews in 2\u202fd, ends in 3\u202fd"],
  [-1.9, "good", "valid", "renews in 2.4\u202fh, ends in 26.4\u202fh"],
  [-2.5, "due", "renewal is due", "ends in 12\u202fh unless the robot comes"],
  [-4, "grace", "expired, in grace", "the robot renews it by itself if it comes back within 29\u202fd"],
  [-40, "over", "expired", "37\u202fd ago: enrol it again"],
])("a certificate of three days, issued %s d from now, is %s", (issued, status, word, note) => {
  expect(certificateWords(identity(issued), NOW)).toEqual({ status, word, note });
});

test("the moments between the states belong to the later one", () => {
  const one = identity(0);
  const end = Date.parse(at(3));
  const status = (ms: number) => certificateWords(one, ms).status;
  expect([status(NOW + 2 * DAY_MS - 1), status(NOW + 2 * DAY_MS)]).toEqual(["good", "due"]);
  expect([status(end - 1), status(end)]).toEqual(["due", "grace"]);
  expect([status(end + GRACE_MS - 1), status(end + GRACE_MS)]).toEqual(["grace", "over"]);
});

test("a revoked identity says when and why, whatever its certificate says", () => {
  const gone = identity(0, { state: "revoked", revoked: at(-0.125), reason: "lost on the way" });
  expect(certificateWords(gone, NOW)).toEqual({ status: "revoked", word: "revoked", note: "3\u202fh ago: lost on the way" });
});

test("the certificate that counts ends last and is not revoked", () => {
  const [one] = identity(0).certificates;
  const later = { ...one!, serial: "b2", not_after: at(9) };
  const taken = { ...one!, serial: "c3", not_after: at(99), revoked: at(0) };
  expect(currentCertificate(identity(0, { certificates: [one!, later, taken] }))?.serial).toBe("b2");
  expect(certificateWords(identity(0, { certificates: [taken] }), NOW).word).toBe("no certificate");
});

test("what needs somebody stands first; what is revoked raises no alarm", () => {
  const list = [
    identity(0, { robot: "arm_10" }),
    identity(0, { robot: "arm_9" }),
    identity(-40, { robot: "old" }),
    identity(0, { robot: "twin", alarm: "two agents" }),
    identity(0, { robot: "gone", state: "revoked", alarm: "two agents" }),
  ];
  expect(inOrder(list, NOW).map(({ robot }) => robot)).toEqual(["twin", "old", "arm_9", "arm_10", "gone"]);
  expect(alarmed(list).map(({ robot }) => robot)).toEqual(["twin"]);
});

test("tokens and their countdown", () => {
  const token = { id: "t", robot: "", made: at(0), made_by: "ada", expires: at(1), used: null, used_by: "" } satisfies EnrolmentToken;
  expect([tokenStanding(token, NOW), tokenStanding(token, NOW + DAY_MS), tokenStanding({ ...token, used: at(0) }, NOW + DAY_MS)]).toEqual(["open", "expired", "used"]);
  expect([countdown(3_600_000), countdown(3_599_000), countdown(9_999), countdown(-1)]).toEqual(["1:00:00", "59:59", "0:09", "0:00"]);
});

test("the command leads to where the browser reached the gateway", () => {
  const command = "metaros agent enrol mr1.a.b.c --gateway http://10.0.0.7:8080 --name arm_1";
  expect(commandFor(command, "https://fleet.example")).toBe("metaros agent enrol mr1.a.b.c --gateway https://fleet.example --name arm_1");
  for (const here of ["http://localhost:8080", "https://127.0.0.1:8080", "http://[::1]:8080"]) expect(commandFor(command, here)).toBe(command);
});

test("patterns of robots, typed and read", () => {
  expect([patternsOf(" arm_1, sim_*\tarm_1 "), patternsOf("  ")]).toEqual([["arm_1", "sim_*"], ["*"]]);
  expect([robotsWords(["*"]), robotsWords(["arm_1", "sim_*"]), robotsWords([])]).toEqual(["every robot", "arm_1, sim_*", "no robot"]);
});

test("nobody gives away more than they are", () => {
  expect([rolesUpTo("viewer"), rolesUpTo("operator"), rolesUpTo("admin").length, rolesUpTo("none")]).toEqual([["viewer"], ["viewer", "operator"], 3, []]);
});

test("names of users, and how they get in", () => {
  expect(["ada", "a.b@c+d-e_1", "0x"].map(userNameProblem)).toEqual(["", "", ""]);
  for (const name of ["", "Ada", "-a", "a b", "a/b", "a".repeat(65)]) expect(userNameProblem(name)).not.toBe("");
  const user = { id: "u", name: "ada", role: "viewer" as const, robots: ["*"], disabled: false, has_password: true, external: false, created: at(0), signed_in: null };
  expect([waysIn(user), waysIn({ ...user, has_password: false }), waysIn({ ...user, external: true })]).toEqual(["password", "sign-in link", "single sign-on"]);
  expect([agoText(null, NOW), agoText(at(-1), NOW)]).toEqual(["never", "1 d ago"]);
});

test("the life of a key", () => {
  const key = (expires: string | null) => keyLife({ expires } as ApiKey, NOW);
  expect(key(null)).toEqual({ over: false, soon: false, text: "never" });
  expect(key(at(30))).toEqual({ over: false, soon: false, text: "in 30\u202fd" });
  expect(key(at(6))).toEqual({ over: false, soon: true, text: "in 6\u202fd" });
  expect(key(at(-3))).toEqual({ over: true, soon: false, text: "expired 3\u202fd ago" });
});

const row = (changes: Partial<AuditRow>): AuditRow => ({
  number: 1, at: at(0), gateway: "g", kind: "user", actor: "1", name: "ada", role: "admin", address: "127.0.0.1",
  action: "users.manage", method: "POST", target: "/api/v1/users", status: 201, code: "", detail: "", hash: "00", ...changes,
});

test.each([
  ["POST", "/api/v1/auth/link", "signed in by a link"],
  ["PATCH", "/api/v1/users/bob%20b", "changed user bob b"],
  ["POST", "/api/v1/robots/arm_1/revoke", "revoked the identity of arm_1"],
  ["SOCKET", "/api/v1/robots/arm_1/teleop", "took the controls of arm_1"],
  ["POST", "/api/v1/enrol/challenge", "began to renew a certificate"],
  ["POST", "/api/v1/auth/tickets", "made a ticket for a viewer"],
  ["POST", "/api/v1/robots/arm_1/services/call", "called a service of arm_1"],
  ["POST", "/api/v1/robots/arm_1/actions//arm_1/dock", "began action /arm_1/dock of arm_1"],
  ["POST", "/api/v1/robots/arm_1/nodes/lidar/restart", "told node lidar of arm_1 to restart"],
  ["DELETE", "/lambda/2015-03-31/functions/f", "called the Lambda API"],
  ["GRPC", "/metaros.v1.FleetService/SendCommand arm_1", "sent a command by gRPC, on arm_1"],
  ["GRPC", "/metaros.v1.AlertService/EndSilence", "ended a silence by gRPC"],
  ["SOCKET", "/rosbridge/arm_1", "opened a connection by rosbridge to arm_1"],
  ["CLI", "ada", "changed users: ada"],
  ["DELETE", "/api/v1/users/%E0%A4%A", "deleted user %E0%A4%A"],
  ["POST", "/api/v1/something/new", "POST /api/v1/something/new"],
  ["", "", "users.manage"],
])("%s %s is: %s", (method, target, words) => {
  expect(actWords(row({ method, target }))).toBe(words);
});

test("every operation that the log tells of has its own words, also when it is done", () => {
  const said = (operation: string, status: number) => {
    const [method, path] = operation.split(" ") as [string, string];
    const target = `${/^\/(lambda|foxglove|rosbridge|metaros)/.test(path) ? "" : "/api/v1"}${path}`; // a part stands for itself
    return actWords(row({ method, target, action: "", status }));
  };
  const wrong = Object.entries(ACTS).filter(([operation, words]) => said(operation, 500) !== `tried to ${words}`);
  expect(wrong).toEqual([]);
  const undone = Object.entries(ACTS).filter(([operation, words]) => said(operation, 200) === words && !/^(re)?set /.test(words));
  expect(undone).toEqual([]);
});

test("what somebody does over an open connection, and what the gateway does by itself", () => {
  const foxglove = { method: "SOCKET", target: "/foxglove/arm_1", status: 200 };
  expect(actWords(row({ ...foxglove, action: "robots.call" }))).toBe("called a service or an action by Foxglove");
  expect(actWords(row({ ...foxglove, action: "robots.drive", status: 403 }))).toBe("tried to drive by Foxglove");
  expect(actWords(row({ kind: "gateway", action: "refusals", method: "", target: "", status: 0 }))).toBe("dropped rows about refusals");
});

test("what was refused was tried", () => {
  expect(actWords(row({ method: "GET", target: "/api/v1/robots/arm_1/twin", status: 403 }))).toBe("tried to read robots/arm_1/twin");
  expect(actWords(row({ method: "GRPC", target: "/metaros.v1.FleetService/ListRobots", status: 401 }))).toBe("tried to read FleetService/ListRobots by gRPC");
  expect(actWords(row({ target: "/api/v1/auth/login", status: 401 }))).toBe("tried to sign in with a password");
  expect(actWords(row({ target: "/api/v1/robots/$&*/publish", status: 500 }))).toBe("tried to publish on $&*");
});

test("how it ended, and who it was", () => {
  const outcomes = [101, 200, 401, 403, 429, 404, 500].map((status) => outcomeOf(row({ status })));
  expect(outcomes).toEqual(["done", "done", "refused", "refused", "refused", "failed", "failed"]);
  expect([outcomeOf(row({ status: 0 })), outcomeOf(row({ status: 0, kind: "gateway" }))]).toEqual(["unknown", "done"]);
  const nobody = { name: "anonymous", kind: "anonymous" };
  expect([whoWords(row({})), whoWords(row(nobody)), whoWords(row({ ...nobody, action: "agent.enrol" })), whoWords(row({ name: "", kind: "gateway" }))]).toEqual(
    ["ada", "somebody unknown", "a robot", "the gateway"],
  );
});

const PROOF: AuditProof = { ok: true, rows: 1234, hash: "ab", faults: [], heads: 2, heads_sealed: 2, heads_error: "" };

test("a whole log says so, and what that rests on", () => {
  expect(proofWords(PROOF)).toEqual({
    head: "The log is whole: 1,234 rows, each follows from the one before.",
    lines: ["Compared with 2 exported heads, all sealed by this gateway."],
  });
  expect(proofWords({ ...PROOF, heads: 3, heads_sealed: 1 }).lines[0]).toBe("Compared with 3 exported heads, 1 of them sealed by this gateway.");
  expect(proofWords({ ...PROOF, heads: 0, heads_sealed: 0 }).lines[0]).toContain("No head");
});

test("a log with faults names their rows; one whose heads cannot be read is not called whole", () => {
  const fault = (number: number) => ({ number, fault: "hash" as const, detail: "" });
  expect(proofWords({ ...PROOF, ok: false, faults: [fault(7)] }).head).toBe("The log was changed after it was written: see row 7.");
  expect(proofWords({ ...PROOF, ok: false, faults: [1, 2, 2, 3, 4].map(fault) }).head).toBe("The log was changed after it was written: see rows 1, 2, 3, ….");
  const away = proofWords({ ...PROOF, ok: false, heads: 0, heads_error: "the bucket is away" });
  expect(away.head).toBe("The log could not be verified.");
  expect(away.lines[1]).toContain("the bucket is away");
});

test("newer rows go before those shown; after a gap the list begins anew", () => {
  const rows = (...numbers: number[]) => numbers.map((number) => row({ number }));
  const numbers = ({ rows: found, fresh }: { rows: AuditRow[]; fresh: boolean }) => [found.map(({ number }) => number), fresh];
  expect(numbers(withNewer([], rows(2, 1)))).toEqual([[2, 1], true]);
  expect(numbers(withNewer(rows(2, 1), rows(4, 3, 2)))).toEqual([[4, 3, 2, 1], false]);
  expect(numbers(withNewer(rows(2, 1), rows(2, 1)))).toEqual([[2, 1], false]);
  expect(numbers(withNewer(rows(2, 1), rows(9, 8, 7)))).toEqual([[9, 8, 7], true]);
});
