/** Typed calls for the Admin page: robots' identities, users, keys, and the audit log. */

import { call } from "./call";
import type { BodyOf } from "./operation.js";
import type { User } from "./schema.js";

export type { ApiKey, AuditPage, AuditProof, AuditRow, EnrolmentToken, NewApiKey, NewEnrolmentToken, RobotCertificate, RobotIdentity, SignInLink, User } from "./schema.js";
export type RoleWord = User["role"];
export type UserChange = BodyOf<"PATCH /users/{name}">;
export type KeyOrder = BodyOf<"POST /keys">;

export interface AuditQuery {
  before?: number;
  action: string;
  name: string;
}

const named = (name: string) => ({ path: { name } });

export const adminApi = {
  tokens: async () => (await call("GET /enrolment-tokens")).tokens,
  makeToken: (robot: string, ttlS: number) => call("POST /enrolment-tokens", { body: { robot, ttl_s: ttlS } }),
  dropToken: (id: string) => call("DELETE /enrolment-tokens/{token_id}", { path: { token_id: id } }),
  identities: async () => (await call("GET /identities")).identities,
  revokeRobot: (robot: string, reason: string) => call("POST /robots/{robot_id}/revoke", { path: { robot_id: robot }, body: { reason } }),

  users: async () => (await call("GET /users")).users,
  addUser: (body: BodyOf<"POST /users">) => call("POST /users", { body }),
  changeUser: (name: string, body: UserChange) => call("PATCH /users/{name}", { ...named(name), body }),
  deleteUser: (name: string) => call("DELETE /users/{name}", named(name)),
  makeLink: (name: string) => call("POST /auth/links", { body: { name } }),

  keys: async () => (await call("GET /keys")).keys,
  makeKey: (body: KeyOrder) => call("POST /keys", { body }),
  revokeKey: (id: string) => call("DELETE /keys/{key_id}", { path: { key_id: id } }),

  audit: ({ before, action, name }: AuditQuery, limit = 100) =>
    call("GET /audit", { query: { limit, before, action: action || undefined, name: name || undefined } }),
  verifyAudit: () => call("GET /audit/verify"),
};
