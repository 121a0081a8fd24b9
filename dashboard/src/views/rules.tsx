/** The Rules page: every rule, one of them or a new one, schedules, and hooks. */

import { can, session } from "../api/session";
import { Link, MayNot } from "../ui/parts";
import { place } from "../ui/url";
import { lazy } from "./lazy";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/alerts.css";
import "../styles/functions.css";
import "../styles/rules.css";

const RulePage = lazy(async () => (await import("../rules/detail")).RulePage);
const NewRule = lazy(async () => (await import("../rules/detail")).NewRule);
const RulesPart = lazy(async () => (await import("../rules/list")).RulesPart);
const SchedulesPart = lazy(async () => (await import("../rules/lazy_views")).SchedulesPart);
const HooksPart = lazy(async () => (await import("../rules/lazy_views")).HooksPart);

/** Not by path: a rule may have any name. */
const PARTS = [
  { show: "", word: "Rules", View: RulesPart },
  { show: "schedules", word: "Schedules", View: SchedulesPart },
  { show: "hooks", word: "Hooks", View: HooksPart },
] as const;

export function RulesPage() {
  const name = /^\/rules\/([\w.-]+)\/?$/.exec(place.value.path)?.[1];
  const show = place.value.params.get("show") ?? "";
  const part = PARTS.find((one) => one.show === show) ?? PARTS[0];
  if (session.value !== null && !can("rules.read")) return <section class="empty"><h1>Rules</h1><MayNot what="see rules" /></section>;
  if (name) return <div class="admin alerts-page fn-pages rules-page"><RulePage key={name} name={name} /></div>;
  if (show === "new") return <div class="admin alerts-page fn-pages rules-page"><NewRule /></div>;
  return (
    <div class="admin alerts-page fn-pages rules-page">
      <div class="page-head"><h1>Rules</h1></div>
      <nav class="tabs" aria-label="Rules">
        {PARTS.map((item) => <Link key={item.show} href={item.show ? `/rules?show=${item.show}` : "/rules"} current={item === part}>{item.word}</Link>)}
      </nav>
      <part.View key={part.show} />
    </div>
  );
}
