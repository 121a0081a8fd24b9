/** One line over the list: whether functions run here, how well they are shut in, how many workers there are. */

import { Badge } from "../admin/badge";
import { useAsked } from "../admin/use_list";
import { functionsApi, type Runtime } from "../api/functions";
import { bytes } from "../ui/format";
import { Link } from "../ui/parts";
import { LEVEL_WORDS } from "./levels";

const EVERY_MS = 10_000;

export function RuntimeStrip() {
  const runtime = useAsked(functionsApi.runtime, EVERY_MS).value.value;
  return (
    <p class="fn-strip" data-runtime={runtime ? runtime.level || "none" : ""}>
      {runtime ? <Facts runtime={runtime} /> : <span>…</span>}
    </p>
  );
}

function Facts({ runtime }: { runtime: Runtime }) {
  if (!runtime.on) return <><Badge tone="off">functions are off</Badge> <span>This gateway was started with <code>--no-functions</code>; it keeps what there is.</span></>;
  if (runtime.trouble) return <><Badge tone="bad">no function runs</Badge> <span>{runtime.trouble}</span> <More /></>;
  if (!runtime.started) return <><Badge tone="off">ready</Badge> <span>The sandbox is found out at the first call.</span> <More /></>;
  const [short, tone] = LEVEL_WORDS[runtime.level] ?? [runtime.level, "off" as const];
  return (
    <>
      <Badge tone={tone}>Sandbox {runtime.level}</Badge>
      <span>{short}</span>
      <span class="num">{runtime.workers} of {runtime.most_workers} workers{runtime.memory_mb > 0 && `, ${bytes(runtime.memory_mb * 1e6)}`}</span>
      <span>{runtime.interpreter}</span>
      <More />
    </>
  );
}

const More = () => <Link href="/functions?show=runtime" class="text-link">Runtime</Link>;
