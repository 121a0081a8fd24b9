/** The Functions page: every function, one of them, what could not be delivered, and where they run. */

import { can, session } from "../api/session";
import { Link, MayNot } from "../ui/parts";
import { place } from "../ui/url";
import { lazy } from "./lazy";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/alerts.css";
import "../styles/functions.css";

const FunctionPage = lazy(async () => (await import("../functions/detail")).FunctionPage);
const FunctionsPart = lazy(async () => (await import("../functions/list")).FunctionsPart);
const DeadLettersPart = lazy(async () => (await import("../functions/dead_letters")).DeadLettersPart);
const RuntimePart = lazy(async () => (await import("../functions/runtime")).RuntimePart);

/** Not by path: a function may have any name. */
const PARTS = [
  { show: "", word: "Functions", View: FunctionsPart },
  { show: "dead-letters", word: "Dead letters", View: DeadLettersPart },
  { show: "runtime", word: "Runtime", View: RuntimePart },
] as const;

export function FunctionsPage() {
  const name = /^\/functions\/([\w-]+)\/?$/.exec(place.value.path)?.[1];
  const part = PARTS.find(({ show }) => show === (place.value.params.get("show") ?? "")) ?? PARTS[0];
  if (session.value !== null && !can("functions.read")) return <section class="empty"><h1>Functions</h1><MayNot what="see functions" /></section>;
  if (name) return <div class="admin alerts-page fn-pages"><FunctionPage key={name} name={name} /></div>;
  return (
    <div class="admin alerts-page fn-pages">
      <div class="page-head"><h1>Functions</h1></div>
      <nav class="tabs" aria-label="Functions">
        {PARTS.map((item) => <Link key={item.show} href={item.show ? `/functions?show=${item.show}` : "/functions"} current={item === part}>{item.word}</Link>)}
      </nav>
      <part.View key={part.show} />
    </div>
  );
}
