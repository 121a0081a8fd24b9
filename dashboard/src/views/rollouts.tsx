/** The Rollouts page: rollouts, one of them, the versions that they can bring, and templates. */

import { RolloutPage } from "../rollouts/detail";
import { RolloutList } from "../rollouts/list";
import { VersionsPart } from "../rollouts/versions";
import { Link } from "../ui/parts";
import { place } from "../ui/url";
import { lazy } from "./lazy";
import "../styles/admin.css";
import "../styles/ops.css";
import "../styles/rollouts.css";

const TemplatesPart = lazy(async () => (await import("../rollouts/templates")).TemplatesPart);

const PARTS = [
  { path: "/rollouts", word: "Rollouts", View: RolloutList },
  { path: "/rollouts/versions", word: "Versions", View: VersionsPart },
  { path: "/rollouts/templates", word: "Templates", View: TemplatesPart },
] as const;

export function RolloutsPage() {
  const path = place.value.path.replace(/\/+$/, "");
  const part = PARTS.find((one) => one.path === path);
  const one = /^\/rollouts\/([a-z0-9]{26})$/.exec(path)?.[1];
  if (one) return <div class="admin rollouts-page"><RolloutPage key={one} id={one} /></div>;
  return (
    <div class="admin rollouts-page">
      <div class="page-head"><h1>Rollouts</h1></div>
      <nav class="tabs" aria-label="Rollouts">
        {PARTS.map((item) => <Link key={item.path} href={item.path} current={item === part}>{item.word}</Link>)}
      </nav>
      {part ? <part.View key={part.path} /> : <p class="nothing">There is no such rollout.</p>}
    </div>
  );
}
