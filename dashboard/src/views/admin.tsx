/** The Admin page: robots' identities, users, keys, the audit log; each part for who may, and a word for who may not. */

import type { ComponentType } from "preact";
import { AuditPart } from "../admin/audit";
import { KeysPart } from "../admin/keys";
import { RobotsPart } from "../admin/robots";
import { UsersPart } from "../admin/users";
import { can, session } from "../api/session";
import { Link } from "../ui/parts";
import { here, place } from "../ui/url";
import "../styles/admin.css";

interface Part {
  path: string;
  word: string;
  needs: string;
  View: ComponentType;
}

const PARTS: readonly Part[] = [
  { path: "/admin/robots", word: "Robots", needs: "robots.enrol", View: RobotsPart },
  { path: "/admin/users", word: "Users", needs: "users.manage", View: UsersPart },
  { path: "/admin/keys", word: "Keys", needs: "keys.own", View: KeysPart },
  { path: "/admin/audit", word: "Audit log", needs: "audit.read", View: AuditPart },
];

export function AdminPage() {
  const path = place.value.path.replace(/\/+$/, "");
  const part = PARTS.find((one) => one.path === path) ?? (path === "/admin" ? PARTS[0] : undefined);
  const open = PARTS.filter(({ needs }) => can(needs));
  const only = open.length === 1 && part === open[0];
  return (
    <div class="admin">
      <div class="page-head"><h1>{only && part?.word === "Keys" ? "My keys" : "Admin"}</h1></div>
      {open.length > 1 && (
        <nav class="tabs" aria-label="Admin">
          {open.map((one) => <Link key={one.path} href={one.path} current={one === part}>{one.word}</Link>)}
        </nav>
      )}
      {!part ? <p class="nothing">There is no such part of the Admin page.</p> : session.value === null ? <p class="quiet">Asking the gateway…</p> : can(part.needs) ? <part.View key={part.path} /> : <NotYours part={part} />}
    </div>
  );
}

/** Why somebody sees nothing here, and what to do about it. */
function NotYours({ part }: { part: Part }) {
  const account = session.value!;
  if (account.kind === "anonymous") {
    return (
      <section class="empty empty-near" data-refused="sign-in">
        <h1>Sign in first</h1>
        <p>You look at this gateway without an account. Robots' identities, users, keys and the audit log are for who has signed in.</p>
        <p><Link href={`/signin?back=${encodeURIComponent(here())}`} class="button button-solid">Sign in</Link></p>
      </section>
    );
  }
  return (
    <section class="empty empty-near" data-refused="role">
      <h1>This is for administrators</h1>
      <p>
        You are signed in as <b>{account.name}</b>, whose role is <b>{account.role}</b>. “{part.word}” needs the role admin; another admin can give it to
        you.
      </p>
      {can("keys.own") && <p>Your own keys are yours to look after: <Link href="/admin/keys">My keys</Link></p>}
    </section>
  );
}
