/** The frame of every page: the bar on top, the state of the connection, the help dialog, the keys. */

import { useSignal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { can, refresh, session, shutOut } from "../api/session";
import { moment } from "../history/moment";
import type { StreamState } from "../live/stream";
import { useLive } from "../ui/context";
import { Link } from "../ui/parts";
import { place, robotOf } from "../ui/url";
import { AccountMenu } from "./account_menu";
import { lazy } from "./lazy";

const FleetPage = lazy(async () => (await import("./fleet")).FleetPage);
const RobotPage = lazy(async () => (await import("./robot")).RobotPage);
const GraphsPage = lazy(async () => (await import("./graph")).GraphsPage);
const RecordingsPage = lazy(async () => (await import("./recordings")).RecordingsPage);
const RolloutsPage = lazy(async () => (await import("./rollouts")).RolloutsPage);
const AdminPage = lazy(async () => (await import("./admin")).AdminPage);
const HelpDialog = lazy(async () => (await import("./help")).HelpDialog, null);
const SignInPage = lazy(async () => (await import("./sign_in")).SignInPage);

/** The pages that are not a robot's: their paths, and what the window is called meanwhile. */
const PAGES: Record<string, [string, ComponentType]> = {
  "/": ["Fleet", FleetPage],
  "/graph": ["Graph", GraphsPage],
  "/recordings": ["Recordings", RecordingsPage],
  "/rollouts": ["Rollouts", RolloutsPage],
  "/admin": ["Admin", AdminPage],
  "/signin": ["Sign in", SignInPage],
};

const CONNECTION: Record<StreamState, string> = { connecting: "Connecting…", open: "Live", lost: "Reconnecting…" };

export function App() {
  const { stream } = useLive();
  const help = useSignal(false);
  const state = stream.state.value;
  const path = place.value.path;
  const out = shutOut.value;
  const robot = out ? null : robotOf(path);
  const [title, Page] = PAGES[out ? "/signin" : path.replace(/^\/(admin|rollouts)\/.*/, "/$1")] ?? ["No such page", NotFound];
  useEffect(() => {
    document.title = `${robot ?? title} · Meta-ROS`;
  }, [robot, title]);
  useEffect(() => {
    if (state === "open" && session.peek() === null) void refresh(); // it did not answer when the page began
  }, [state]);
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      const typing = event.target instanceof Element && event.target.matches("input, textarea, select");
      if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "?") help.value = true;
      const search = document.querySelector<HTMLInputElement>("input[type=search]");
      if (event.key !== "/" || !search) return;
      event.preventDefault();
      search.focus();
    };
    addEventListener("keydown", onKey);
    return () => removeEventListener("keydown", onKey);
  }, []);
  return (
    <>
      <a class="skip" href="#main">Skip to content</a>
      <header class="bar">
        <Link href="/" class="brand">
          <svg viewBox="0 0 24 24" aria-hidden="true"><path d="M3 20V6l9 8 9-8v14" /><circle cx="12" cy="5" r="2.4" /></svg>
          Meta-ROS
        </Link>
        {!out && (
          <nav aria-label="Main">
            <Link href="/" current={path === "/"}>Fleet</Link>
            <Link href="/graph" current={path === "/graph"}>Graph</Link>
            <Link href="/recordings" current={path === "/recordings"}>Recordings</Link>
            {can("updates.read") && <Link href="/rollouts" current={/^\/rollouts(\/|$)/.test(path)}>Rollouts</Link>}
            {can("users.manage") && <Link href="/admin" current={/^\/admin(\/|$)/.test(path)}>Admin</Link>}
          </nav>
        )}
        {!out && <span class={`link link-${state}`} role="status" data-stream={state}>{state === "open" && moment.value !== null ? "Connected" : CONNECTION[state]}</span>}
        <AccountMenu />
        <button type="button" class="help" aria-label="Help" onClick={() => (help.value = true)}>?</button>
      </header>
      <main id="main" class={state === "open" ? undefined : "is-lost"}>
        {robot !== null ? <RobotPage key={robot} id={robot} /> : <Page key={title} />}
      </main>
      {help.value && <HelpDialog onClose={() => (help.value = false)} />}
    </>
  );
}

function NotFound() {
  return (
    <section class="empty">
      <h1>There is no such page</h1>
      <p><Link href="/">To the fleet</Link></p>
    </section>
  );
}
