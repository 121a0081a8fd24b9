/** Typed calls for the Admin page: robots' identities, users, keys, and the audit log. */

import { request, robotPath, send } from "./client";

export type RoleWord = "viewer" | "operator" | "admin";

export interface EnrolmentToken {
  id: string;
  /** "" for any robot that has no identity. */
  robot: string;
  made: string;
  made_by: string;
  expires: string;
  used: string | null;
  used_by: string;
}

export interface NewEnrolmentToken extends EnrolmentToken {
  token: string;
  command: string;
}

export interface RobotCertificate {
  serial: string;
  how: "token" | "renewal" | "grace";
  issued: string;
  not_after: string;
  revoked: string | null;
}

export interface RobotIdentity {
  robot: string;
  state: "active" | "revoked";
  enrolled: string;
  revoked: string | null;
  reason: string;
  alarm: string;
  alarm_at: string | null;
  certificates: RobotCertificate[];
}

export interface User {
  id: string;
  name: string;
  role: RoleWord;
  robots: string[];
  disabled: boolean;
  has_password: boolean;
  external: boolean;
  created: string;
  signed_in: string | null;
}

export interface UserChange {
  role?: RoleWord;
  robots?: string[];
  disabled?: boolean;
  password?: string;
}

export interface SignInLink {
  user: string;
  url: string;
  token: string;
  expires: string;
}

export interface ApiKey {
  id: string;
  name: string;
  /** "" for a key of nobody's, made on the gateway's machine. */
  user: string;
  role: RoleWord;
  robots: string[];
  scopes: string[];
  created: string;
  expires: string | null;
  used: string | null;
}

export interface NewApiKey extends ApiKey {
  secret: string;
  /** What goes behind "Authorization: Bearer". */
  key: string;
}

export interface KeyOrder {
  name: string;
  role: RoleWord;
  robots: string[];
  scopes: string[];
  expires_s: number | null;
}

export interface AuditRow {
  number: number;
  at: string;
  gateway: string;
  kind: string;
  actor: string;
  name: string;
  role: string;
  address: string;
  action: string;
  method: string;
  target: string;
  status: number;
  code: string;
  detail: string;
  hash: string;
}

export interface AuditPage {
  rows: AuditRow[];
  next: number | null;
}

export interface AuditProof {
  ok: boolean;
  rows: number;
  hash: string;
  faults: { number: number; fault: "hash" | "missing" | "head" | "export"; detail: string }[];
  heads: number;
  heads_sealed: number;
  heads_error: string;
}

export interface AuditQuery {
  before?: number;
  action: string;
  name: string;
}

const userPath = (name: string) => `/users/${encodeURIComponent(name)}`;

export const adminApi = {
  tokens: async () => (await request<{ tokens: EnrolmentToken[] }>("/enrolment-tokens")).tokens,
  makeToken: (robot: string, ttlS: number) => send<NewEnrolmentToken>("POST", "/enrolment-tokens", { robot, ttl_s: ttlS }),
  dropToken: (id: string) => send("DELETE", `/enrolment-tokens/${encodeURIComponent(id)}`),
  identities: async () => (await request<{ identities: RobotIdentity[] }>("/identities")).identities,
  revokeRobot: (robot: string, reason: string) => send("POST", `${robotPath(robot)}/revoke`, { reason }),

  users: async () => (await request<{ users: User[] }>("/users")).users,
  addUser: (user: { name: string; role: RoleWord; robots: string[]; password: string }) => send<User>("POST", "/users", user),
  changeUser: (name: string, change: UserChange) => send<User>("PATCH", userPath(name), change),
  deleteUser: (name: string) => send("DELETE", userPath(name)),
  makeLink: (name: string) => send<SignInLink>("POST", "/auth/links", { name }),

  keys: async () => (await request<{ keys: ApiKey[] }>("/keys")).keys,
  makeKey: (order: KeyOrder) => send<NewApiKey>("POST", "/keys", order),
  revokeKey: (id: string) => send("DELETE", `/keys/${encodeURIComponent(id)}`),

  audit: ({ before, action, name }: AuditQuery, limit = 100) => {
    const query = new URLSearchParams({ limit: String(limit) });
    if (before !== undefined) query.set("before", String(before));
    if (action) query.set("action", action);
    if (name) query.set("name", name);
    return request<AuditPage>(`/audit?${query}`);
  },
  verifyAudit: () => request<AuditProof>("/audit/verify"),
};
