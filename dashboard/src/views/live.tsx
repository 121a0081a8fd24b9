/** The live tab: a card for each thing the robot publishes, chosen by its type; now, or at the instant shown. */

import { can } from "../api/session";
import type { Robot, SeriesInfo, Topic } from "../api/types";
import { CameraCard } from "../panels/camera";
import { ImuCard } from "../panels/plots/imu";
import { MapCard } from "../panels/map/map";
import { MetricPlots, RANGES } from "../panels/plots/metric_plots";
import { PAST_PLOTS, PLOTS, plotsOf } from "../panels/plots/plot_table";
import { layoutOf, readable } from "../panels/registry";
import { lazy } from "./lazy";
import { LAZY_CARDS } from "./lazy_cards";
import { TreeCard } from "../panels/tree";
import { useLive } from "../ui/context";
import { Card, MayNot } from "../ui/parts";
import { relativeTopic } from "../ui/format";
import { place, setParam } from "../ui/url";

export { TimeBar } from "../panels/time_bar/time_bar"; // over these cards alone: it comes with them

const TeleopCard = lazy(async () => (await import("../panels/teleop")).TeleopCard);
const VideoCard = lazy(async () => (await import("../panels/video")).VideoCard, null);
const PastPlots = lazy(async () => (await import("../panels/plots/past_plots")).PastPlots);

export function LiveTab({ robot, topics, series }: { robot: Robot; topics: Topic[] | null; series: SeriesInfo[] }) {
  const past = useLive().past !== null;
  if (topics === null) return <p class="quiet">Reading the robot's topics…</p>;
  const layout = layoutOf(topics);
  const wanted = place.value.params.get("range") ?? "";
  const range = wanted in RANGES ? wanted : "5m";
  const name = (topic: string) => relativeTopic(topic, robot.namespace);
  const names = series.map((one) => one.name);
  const plotted = (!past && layout.imus.length > 0) || plotsOf(new Set(names), past ? PAST_PLOTS : PLOTS).length > 0;
  const drivable = layout.drivable && !past; // nobody drives by a picture of an hour ago
  const found = readable(topics);
  const more = LAZY_CARDS.map((card) => ({ ...card, topics: found.filter(card.takes) })).filter((card) => card.topics.length > 0);
  const cards = (where: "side" | "wide") =>
    more.filter(({ place }) => place === where).map(({ kind, Part, topics }) => <Part key={`${robot.id} ${kind}`} robot={robot} topics={topics} />);
  const [beside, below] = [cards("side"), cards("wide")];
  const side = layout.cameras.length > 0 || drivable || beside.length > 0;
  return (
    <>
      <div class={`stage ${past ? "stage-past" : ""} ${layout.maps.length > 0 && side ? "stage-split" : ""}`}>
        {layout.maps.slice(0, 1).map((map) => (
          <MapCard key={`${robot.id} ${map.odom}`} robot={robot.id} namespace={robot.namespace} odom={map.odom} scan={map.scan} />
        ))}
        {side && (
          <div class="stage-side">
            {layout.cameras.map(({ name: camera, picture, video }) =>
              video === null ? (
                <CameraCard key={`${robot.id} ${picture}`} robot={robot.id} topic={picture!} title={cameraTitle(name(`${camera}/`))} />
              ) : (
                <VideoCard key={`${robot.id} ${video}`} robot={robot.id} topic={video} picture={picture} title={cameraTitle(name(`${camera}/`))} />
              ),
            )}
            {drivable && !can("robots.drive") && (
              <Card title="Drive" kind="teleop"><div class="pad-in"><MayNot what="drive" /></div></Card>
            )}
            {drivable && can("robots.drive") && (
              <TeleopCard key={robot.id} robot={robot.id} namespace={robot.namespace} online={robot.state === "online"} lease={robot.lease?.holder ?? null} />
            )}
            {beside}
          </div>
        )}
      </div>
      {below.length > 0 && <div class="stage">{below}</div>}
      {plotted && <div class="section-head">
        <h2>Plots</h2>
        <div class="segments" role="group" aria-label="Time range">
          {Object.keys(RANGES).map((choice) => (
            <button key={choice} type="button" aria-pressed={choice === range} onClick={() => setParam("range", choice, "5m")}>
              {choice}
            </button>
          ))}
        </div>
      </div>}
      <div class="grid">
        {past ? (
          <PastPlots key={robot.id} robot={robot.id} names={names} windowS={RANGES[range]!} />
        ) : (
          <MetricPlots key={robot.id} robot={robot.id} names={names} range={range} />
        )}
        {!past && layout.imus.map(({ topic }) => (
          <ImuCard key={`${robot.id} ${topic}`} robot={robot.id} topic={topic} />
        ))}
      </div>
      {layout.trees.length > 0 && <div class="section-head"><h2>Messages</h2></div>}
      <div class="grid grid-trees">
        {layout.trees.map(({ topic, type, rate_hz }) => (
          <TreeCard key={`${robot.id} ${topic}`} robot={robot.id} topic={topic} title={name(topic)} type={type} rateHz={rate_hz} />
        ))}
      </div>
    </>
  );
}

/** "front/camera" is "front camera"; one without any name of its own is a camera still. */
const cameraTitle = (name: string) => name.split("/").filter(Boolean).join(" ") || "camera";
