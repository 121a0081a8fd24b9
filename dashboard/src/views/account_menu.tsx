/** The end of the bar: who uses the page, with the way in, or a small menu with the way out. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { session, shutOut, signedIn } from "../api/session";
import { Link } from "../ui/parts";
import { here, place } from "../ui/url";
import { lazy } from "./lazy";

const PasswordDialog = lazy(async () => (await import("./password")).PasswordDialog, null);

export function AccountMenu() {
  const who = session.value;
  if (who === null || shutOut.value) return null;
  return signedIn.value ? <Menu /> : <Viewer />;
}

function Viewer() {
  const path = place.value.path; // the way back is another one on every page
  if (path === "/signin") return null;
  return (
    <span class="account" data-account="anonymous">
      <span class="account-role">Viewer</span>
      <Link href={`/signin?back=${encodeURIComponent(here())}`} class="button button-main">Sign in</Link>
    </span>
  );
}

function Menu() {
  const { name, role, robots, has_password } = session.value!;
  const menu = useRef<HTMLDivElement>(null);
  const open = useSignal(false);
  const password = useSignal(false);
  const problem = useSignal("");
  const close = () => menu.current?.hidePopover();
  useEffect(close, [place.value.path]);
  const leave = async () => {
    problem.value = "";
    try {
      const { accountApi } = await import("../api/account");
      await accountApi.logout();
    } catch (error) {
      problem.value = error instanceof Error ? error.message : String(error);
    }
  };
  return (
    <span class="account" data-account={name} data-role={role}>
      <button type="button" class="who" popovertarget="account-menu" aria-expanded={open.value} aria-label={`Account: ${name}, ${role}`}>
        <span class="face" aria-hidden="true">{name.slice(0, 1).toUpperCase()}</span>
        <span class="who-name">{name}</span>
        <span class="who-role">{role}</span>
        <svg viewBox="0 0 10 6" aria-hidden="true"><path d="m1 1 4 4 4-4" /></svg>
      </button>
      <div ref={menu} id="account-menu" class="account-menu" popover="auto" onToggle={(event) => (open.value = event.newState === "open")}>
        <p><b>{name}</b><span>{role} · {robots.includes("*") ? "every robot" : robots.join(", ")}</span></p>
        <button
          type="button"
          onClick={() => {
            close();
            password.value = true;
          }}
        >
          {has_password ? "Change password…" : "Set a password…"}
        </button>
        <Link href="/admin/keys">API keys</Link>
        <button type="button" onClick={() => void leave()}>Sign out</button>
        {problem.value && <p class="bad" role="alert">{problem.value}</p>}
      </div>
      {password.value && <PasswordDialog onClose={() => (password.value = false)} />}
    </span>
  );
}
