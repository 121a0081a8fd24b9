import { expect, test, vi } from "vitest";
import { ageText, isStale } from "../live/age";
import { bytes, fixed, percent, relativeTopic, short, typeWord } from "./format";
import { signInErrorText } from "./sign_in_errors";

vi.stubGlobal("location", { origin: "http://gw:8080", pathname: "/", search: "" }); // the module reads it as it begins
const { returnUrlFrom } = await import("./return_url");

test("a missing number is a dash, never a zero", () => {
  expect([fixed(null, 1), percent(undefined), bytes(NaN), short(Infinity)]).toEqual(["–", "–", "–", "–"]);
});

test("bytes", () => {
  expect([bytes(0), bytes(999), bytes(1500), bytes(2.5e6), bytes(999_999)]).toEqual(
    ["0\u202fB", "999\u202fB", "1.5\u202fkB", "2.5\u202fMB", "1.0\u202fMB"],
  );
});

test("what rounds to nothing has no sign", () => {
  expect([fixed(-0.004, 2), fixed(-0.006, 2), fixed(-0.4, 0), fixed(0, 1)]).toEqual(["0.00", "-0.01", "0", "0.0"]);
});

test("numbers", () => {
  expect([fixed(1.234, 2, "m"), percent(0.805), short(0.00012), short(12345678), short(3.14159)]).toEqual(
    ["1.23\u202fm", "81\u202f%", "1.20e-4", "1.23e+7", "3.142"],
  );
});

test("topics and types as the robot would say them", () => {
  expect(relativeTopic("/sim_1/scan", "/sim_1")).toBe("scan");
  expect(relativeTopic("/sim_10/scan", "/sim_1")).toBe("/sim_10/scan");
  expect(relativeTopic("/rosout", "/")).toBe("/rosout");
  expect(typeWord("sensor_msgs/msg/Imu")).toBe("Imu");
});

test("ages", () => {
  expect([ageText(900), ageText(61_000), ageText(7_200_000), ageText(-5)]).toEqual(["0 s", "1 min", "2 h", "0 s"]);
  expect([isStale(0, 5000), isStale(0, 5001)]).toEqual([false, true]);
});

test("signing in leads back to a page of ours, whatever the address says", () => {
  expect(returnUrlFrom("/robots/a?t=2026-11-21T06:00:00Z&span=1h")).toBe("/robots/a?t=2026-11-21T06:00:00Z&span=1h");
  for (const text of [null, "", "https://evil.example/", "//evil.example/x", "/\\evil.example", "javascript:alert(1)", "/signin?back=/x", "/api/v1/auth/oidc/start"]) {
    expect(returnUrlFrom(text)).toBe("/");
  }
});

test("a refused single sign-on is said in words, and nothing of what the address says", () => {
  expect(signInErrorText(null)).toBeNull();
  expect(signInErrorText("oidc_role")).toContain("none of your groups has a role here");
  for (const code of ["call 0123 now", "constructor", "__proto__"]) {
    expect(signInErrorText(code)).toBe("Single sign-on did not work: you were not let in. Try again, or ask an admin.");
  }
});
