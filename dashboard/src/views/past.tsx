/** The live tab's cards at the instant that the time bar shows: a robot's past in the place of its live stream. */

import type { ComponentChildren } from "preact";
import { useSignalEffect } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { StoredTopic } from "../api/history_types";
import type { Robot, SeriesInfo, Topic } from "../api/types";
import { useStored } from "../history/density";
import { moment, moving, shownNow } from "../history/moment";
import { Past } from "../history/past";
import { LiveContext, useLive } from "../ui/context";
import { LiveTab } from "./live";

export function PastTab({ robot, series }: { robot: Robot; series: SeriesInfo[] }) {
  const stored = useStored(robot.id).value;
  const topics = useMemo(() => (stored ? topicsOfStore(stored.topics) : null), [stored?.topics.map(({ topic }) => topic).join("\n")]);
  if (stored && stored.topics.length === 0 && stored.series === 0) return <p class="quiet">There is nothing to show of the past.</p>;
  return (
    <PastProvider robot={robot.id}>
      <LiveTab robot={robot} topics={topics} series={series} />
    </PastProvider>
  );
}

function PastProvider({ robot, children }: { robot: string; children: ComponentChildren }) {
  const { stream, decoder } = useLive();
  const past = useMemo(() => new Past(robot), [robot]);
  const value = useMemo(() => ({ stream, decoder, past, at: shownNow }), [stream, decoder, past]);
  useSignalEffect(() => {
    if (moment.value !== null) past.seek(moment.value, { preview: moving.value });
  });
  useEffect(() => () => past.close(), [past]);
  return (
    <LiveContext.Provider value={value}>
      {past.problem.value && <p class="problem" role="status">{past.problem.value}</p>}
      {children}
    </LiveContext.Provider>
  );
}

/** Stored topics as the page's table of cards takes them: nobody can drive or watch them. */
function topicsOfStore(stored: StoredTopic[]): Topic[] {
  return stored.map(
    ({ topic, type, class: kind, samples }) =>
      ({ topic, type, class: kind, encoding: "cdr", publishers: 0, messages: samples, received: samples, rate_hz: 0 }) as Topic,
  );
}
