/** Typed calls for signing in and out and one's own password. */

import { call } from "./call";
import { BASE_PATH } from "./client";
import { become, refresh, session, type Account } from "./session";

const entered = (account: Account): Account => {
  become(account);
  return account;
};

export const accountApi = {
  login: async (name: string, password: string) => entered(await call("POST /auth/login", { body: { name, password } })),
  /** By what stands behind the # of a one-time link. */
  link: async (token: string) => entered(await call("POST /auth/link", { body: { token } })),
  provider: () => call("GET /auth/oidc"),
  /** `old` is "" for who has no password yet. */
  password: async (old: string, fresh: string) => {
    await call("POST /auth/password", { body: { old, new: fresh } });
    await refresh();
  },
  /** Drop a cookie that is not good any more; then who may look without one, or null when nobody may. */
  forget: async (): Promise<Account | null> => {
    await call("POST /auth/forget", { body: {} });
    const answer = await fetch(`${BASE_PATH}/auth/me`, { cache: "no-store" });
    return answer.ok ? ((await answer.json()) as Account) : null;
  },
  logout: async () => {
    await call("POST /auth/logout", { body: {} });
    session.value = null; // left, not shut out: nothing has ended against anybody's will
    await refresh();
  },
};
