/** Cards whose code is fetched when a robot has a topic for them; each is given all of its topics. */

import type { ComponentType } from "preact";
import type { Topic } from "../api/types";
import type { CardProps } from "../panels/card_props";
import { isPublished } from "../panels/registry";
import { lazy } from "./lazy";

export interface LazyCard {
  kind: string;
  /** Beside the map, under the cameras; or below them, as wide as it likes. */
  place: "side" | "wide";
  /** Whether a topic is one of this card's. */
  takes: (topic: Topic) => boolean;
  Part: ComponentType<CardProps>;
}

const CLOUDS = ["sensor_msgs/msg/PointCloud2", "metaros_msgs/msg/QuantizedCloud"];

const AUDIO = ["foxglove_msgs/msg/RawAudio", "metaros_msgs/msg/AudioPacket"];

export const LAZY_CARDS: LazyCard[] = [
  {
    kind: "audio",
    place: "side",
    takes: (topic) => AUDIO.includes(topic.type) && (topic.topic.endsWith("/speaker/talk") || (isPublished(topic) && !topic.topic.includes("/speaker/"))),
    Part: lazy(async () => (await import("../panels/audio")).AudioCard, null),
  },
  {
    kind: "cloud",
    place: "wide",
    takes: (topic) => isPublished(topic) && CLOUDS.includes(topic.type),
    Part: lazy(async () => (await import("../panels/cloud/cloud")).CloudCards, null),
  },
  {
    kind: "devices",
    place: "wide",
    takes: (topic) => isPublished(topic) && topic.type === "diagnostic_msgs/msg/DiagnosticArray" && topic.topic.endsWith("/diagnostics"),
    Part: lazy(async () => (await import("../panels/devices")).DevicesCard, null),
  },
];
