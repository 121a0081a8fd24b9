/** The frame of every page: the bar on top, the state of the connection, the help dialog, the keys. */

import { useSignal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { can, refresh, session, shutOut } from "../api/session";
import { moment } from "../history/moment";
import { alertsOpen } from "../live/fleet";
import type { StreamState } from "../live/stream";
import { useLive } from "../ui/context";
import { Link } from "../ui/parts";
import { place, robotOf } from "../ui/url";
import { useWindowKey } from "../ui/use_window_key";
import { AccountMenu } from "./account_menu";
import { lazy } from "./lazy";

const FleetPage = lazy(async () => (await import("./fleet")).FleetPage);
const RobotPage = lazy(async () => (await import("./robot")).RobotPage);
const GraphsPage = lazy(async () => (await import("./graph")).GraphsPage);
const RecordingsPage = lazy(async () => (await import("./recordings")).RecordingsPage);
const AlertsPage = lazy(async () => (await import("./alerts")).AlertsPage);
const FunctionsPage = lazy(async () => (await import("./functions")).FunctionsPage);
const RulesPage = lazy(async () => (await import("./rules")).RulesPage);
const RolloutsPage = lazy(async () => (await import("./rollouts")).RolloutsPage);
const AdminPage = lazy(async () => (await import("./admin")).AdminPage);
const HelpDialog = lazy(async () => (await import("./help")).HelpDialog, null);
const SignInPage = lazy(async () => (await import("./sign_in")).SignInPage);

/** The pages that are not a robot's: their paths, and what the window is called meanwhile. */
const PAGES: Record<string, [string, ComponentType]> = {
  "/": ["Fleet", FleetPage],
  "/alerts": ["Alerts", AlertsPage],
  "/graph": ["Graph", GraphsPage],
  "/recordings": ["Recordings", RecordingsPage],
  "/functions": ["Functions", FunctionsPage],
  "/rules": ["Rules", RulesPage],
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
  const [title, Page] = PAGES[out ? "/signin" : path.replace(/^\/(admin|alerts|functions|rules|rollouts)\/.*/, "/$1")] ?? ["No such page", NotFound];
  useEffect(() => {
    document.title = `${robot ?? title} · Meta-ROS`;
  }, [robot, title]);
  useEffect(() => document.querySelector(".bar nav [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" }), [title, session.value?.id]); // a phone's bar holds a few
  useEffect(() => {
    if (state === "open" && session.peek() === null) void refresh(); // it did not answer when the page began
  }, [state]);
  useWindowKey((event) => {
    const typing = event.target instanceof Element && event.target.matches("input, textarea, select");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "?") help.value = true;
    const search = document.querySelector<HTMLInputElement>("input[type=search]");
    if (event.key !== "/" || !search) return;
    event.preventDefault();
    search.focus();
  });
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
            {can("alerts.read") && <AlertsLink current={/^\/alerts(\/|$)/.test(path)} />}
            <Link href="/graph" current={path === "/graph"}>Graph</Link>
            <Link href="/recordings" current={path === "/recordings"}>Recordings</Link>
            {can("functions.read") && <Link href="/functions" current={/^\/functions(\/|$)/.test(path)}>Functions</Link>}
            {can("rules.read") && <Link href="/rules" current={/^\/rules(\/|$)/.test(path)}>Rules</Link>}
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

/** With how many there are, which take no room of their own: the links beside it stay where they are. */
function AlertsLink({ current }: { current: boolean }) {
  const { open, error } = alertsOpen.value;
  return (
    <Link href="/alerts" class="nav-alerts" current={current}>
      Alerts{open > 0 && <b class={error ? "nav-count nav-error" : "nav-count"} data-open={open}>{open > 99 ? "99+" : open}<span class="visually-hidden"> open</span></b>}
    </Link>
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
