/** How far an alert's clip is, and the way to its file. */

import { useAsked } from "../admin/use_list";
import type { Recording } from "../api/history_types";
import { recordingsApi } from "../api/recordings";
import { RecordingStand } from "../panels/time_bar/recording_row";
import { bytes, duration } from "../ui/format";
import { Link } from "../ui/parts";

const EVERY_MS = 4000;

export function ClipState({ robot, id: wanted }: { robot: string; id: string }) {
  const asked = useAsked(() => recordingsApi.list(robot), EVERY_MS);
  const list = asked.value.value;
  const clip = list?.find(({ id }) => id === wanted);
  if (list === null) return <p class="hint">{asked.problem.value || "Asking the gateway…"}</p>;
  if (!clip) return <p class="hint">The clip is not kept any more.</p>;
  const lengthS = (Date.parse(clip.end) - Date.parse(clip.start)) / 1000;
  return (
    <>
      <p class="clip-state" data-clip-state={clip.state}><RecordingStand recording={clip} /></p>
      <p class="hint num">{duration(lengthS)}{clip.size_bytes ? `, ${bytes(clip.size_bytes)}` : ""}</p>
      <p class="act-row">
        {clip.state === "stored" && <a class="button" href={recordingsApi.fileHref(clip.id)} download={nameOf(clip)}>Download MCAP</a>}
        <Link href="/recordings" class="button">Recordings</Link>
      </p>
    </>
  );
}

const nameOf = ({ robot, start }: Recording) => `${robot}-${start}.mcap`;
