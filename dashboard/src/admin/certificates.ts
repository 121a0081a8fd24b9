/** What a robot's identity and an enrolment token mean to a person, at a moment. */

import type { EnrolmentToken, RobotCertificate, RobotIdentity } from "../api/admin";
import { duration } from "../ui/format";

/** How long after its end a robot can still renew its certificate; the gateway's limit `renewal_grace_s`. */
export const GRACE_MS = 30 * 86_400_000;
/** An agent renews when this part of the certificate's life is over. */
const RENEWS_AT = 2 / 3;

export type CertificateStatus = "good" | "due" | "grace" | "over" | "revoked";

export interface CertificateWords {
  status: CertificateStatus;
  /** In a word or three. */
  word: string;
  /** What happens next, and when. */
  note: string;
}

const span = (ms: number) => duration(Math.max(0, ms) / 1000);

/** The certificate that counts: of those not revoked the one that ends last. */
export function currentCertificate(identity: RobotIdentity): RobotCertificate | null {
  const valid = identity.certificates.filter(({ revoked }) => !revoked);
  return valid.reduce<RobotCertificate | null>((last, one) => (!last || Date.parse(one.not_after) > Date.parse(last.not_after) ? one : last), null);
}

/** How an identity stands at `nowMs`. */
export function certificateWords(identity: RobotIdentity, nowMs: number): CertificateWords {
  if (identity.state === "revoked") {
    const ago = identity.revoked ? `${span(nowMs - Date.parse(identity.revoked))} ago` : "";
    return { status: "revoked", word: "revoked", note: [ago, identity.reason].filter(Boolean).join(": ") };
  }
  const certificate = currentCertificate(identity);
  if (!certificate) return { status: "over", word: "no certificate", note: "enrol it again" };
  const [issuedMs, endMs] = [Date.parse(certificate.issued), Date.parse(certificate.not_after)];
  const renewsMs = issuedMs + (endMs - issuedMs) * RENEWS_AT;
  if (nowMs < renewsMs) return { status: "good", word: "valid", note: `renews in ${span(renewsMs - nowMs)}, ends in ${span(endMs - nowMs)}` };
  if (nowMs < endMs) return { status: "due", word: "renewal is due", note: `ends in ${span(endMs - nowMs)} unless the robot comes` };
  const graceMs = endMs + GRACE_MS;
  if (nowMs < graceMs) return { status: "grace", word: "expired, in grace", note: `the robot renews it by itself if it comes back within ${span(graceMs - nowMs)}` };
  return { status: "over", word: "expired", note: `${span(nowMs - endMs)} ago: enrol it again` };
}

export type TokenStanding = "open" | "used" | "expired";

export function tokenStanding(token: EnrolmentToken, nowMs: number): TokenStanding {
  if (token.used) return "used";
  return Date.parse(token.expires) <= nowMs ? "expired" : "open";
}

/** "59:58", or "23:59:58": how long a token is still good. */
export function countdown(leftMs: number): string {
  const seconds = Math.max(0, Math.floor(leftMs / 1000));
  const two = (value: number) => String(value).padStart(2, "0");
  const [hours, minutes] = [Math.floor(seconds / 3600), Math.floor((seconds % 3600) / 60)];
  return hours > 0 ? `${hours}:${two(minutes)}:${two(seconds % 60)}` : `${minutes}:${two(seconds % 60)}`;
}

/**
 * The command with the address by which this browser reaches the gateway: behind a proxy the gateway knows another. On the gateway's own
 * machine that address leads no robot anywhere, so there the gateway's word counts.
 */
export const commandFor = (command: string, origin: string) =>
  /^https?:\/\/(localhost|127\.|\[::1\])/.test(origin) ? command : command.replace(/--gateway \S+/, `--gateway ${origin}`);

/** What an alarm suggests, beside the gateway's own words. */
export const ALARM_ADVICE =
  "Somebody may have a copy of this robot's disk. Revoke the identity, then enrol the real robot again: that ends the alarm.";

/** Alarms of identities that still count, the newest first. */
export const alarmed = (identities: RobotIdentity[]) =>
  identities
    .filter(({ alarm, state }) => alarm && state === "active")
    .sort((a, b) => (b.alarm_at ?? "").localeCompare(a.alarm_at ?? ""));

/** What needs somebody first: alarms, then what has run out, then by name; revoked ones last. */
export function inOrder(identities: RobotIdentity[], nowMs: number): RobotIdentity[] {
  const RANK: Record<CertificateStatus, number> = { over: 1, grace: 2, due: 3, good: 4, revoked: 5 };
  const rank = (one: RobotIdentity) => (one.alarm && one.state === "active" ? 0 : RANK[certificateWords(one, nowMs).status]);
  return [...identities].sort((a, b) => rank(a) - rank(b) || a.robot.localeCompare(b.robot, "en", { numeric: true }));
}
