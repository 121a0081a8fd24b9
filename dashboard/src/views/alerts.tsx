/** The Alerts page: alerts in time and as a list, one of them, silences, the checks' table, and what is being learned. */

import { can, session } from "../api/session";
import { Link, MayNot } from "../ui/parts";
import { place } from "../ui/url";
import { lazy } from "./lazy";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/alerts.css";

const AlertPage = lazy(async () => (await import("../alerts/detail")).AlertPage);
const AlertsPart = lazy(async () => (await import("../alerts/list")).AlertsPart);
const SilencesPart = lazy(async () => (await import("../alerts/checks/settings")).SilencesPart);
const ChecksPart = lazy(async () => (await import("../alerts/checks/settings")).ChecksPart);
const LearningPart = lazy(async () => (await import("../alerts/checks/settings")).LearningPart);

const PARTS = [
  { path: "/alerts", word: "Alerts", View: AlertsPart },
  { path: "/alerts/silences", word: "Silences", View: SilencesPart },
  { path: "/alerts/checks", word: "Checks", View: ChecksPart },
  { path: "/alerts/learning", word: "Learning", View: LearningPart },
] as const;

export function AlertsPage() {
  const path = place.value.path.replace(/\/+$/, "");
  const part = PARTS.find((one) => one.path === path);
  const one = part ? undefined : /^\/alerts\/(\w+)$/.exec(path)?.[1];
  if (session.value !== null && !can("alerts.read")) return <section class="empty"><h1>Alerts</h1><MayNot what="see alerts" /></section>;
  if (one) return <div class="admin alerts-page"><AlertPage key={one} id={one} /></div>;
  return (
    <div class="admin alerts-page">
      <div class="page-head"><h1>Alerts</h1></div>
      <nav class="tabs" aria-label="Alerts">
        {PARTS.map((item) => <Link key={item.path} href={item.path} current={item === part}>{item.word}</Link>)}
      </nav>
      {part ? <part.View key={part.path} /> : <p class="nothing">There is no such part of the Alerts page.</p>}
    </div>
  );
}
