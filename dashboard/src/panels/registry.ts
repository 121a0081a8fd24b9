/** Which card shows which message type. What is not here is a tree of names and values. */

import type { Topic } from "../api/types";
import { SEALED_CDR } from "../seal/encoding";

export type CardKind = "camera" | "map" | "imu" | "tree";

const KINDS: Record<string, CardKind> = {
  "sensor_msgs/msg/CompressedImage": "camera",
  "sensor_msgs/msg/Image": "camera",
  "sensor_msgs/msg/Imu": "imu",
  "nav_msgs/msg/Odometry": "map",
};
const SCAN = "sensor_msgs/msg/LaserScan";

export interface Layout {
  cameras: Topic[];
  maps: { odom: string; scan: string | null }[];
  imus: Topic[];
  trees: Topic[];
  drivable: boolean;
}

/** The folder of a topic, to pair a scan with the odometry beside it. */
const folder = (topic: string) => topic.slice(0, topic.lastIndexOf("/") + 1);
const lastWord = (topic: string) => topic.slice(topic.lastIndexOf("/") + 1);

/** Sort a robot's topics into cards: a map for each odometry, with the scan nearest to it. */
export function layoutOf(topics: Topic[]): Layout {
  const sorted = topics.filter(({ encoding }) => encoding === "cdr" || encoding === SEALED_CDR).sort((a, b) => a.topic.localeCompare(b.topic));
  const published = sorted.filter(({ publishers, messages, received }) => publishers > 0 || messages > 0 || received > 0);
  const of = (kind: CardKind) => published.filter(({ type }) => (KINDS[type] ?? "tree") === kind);
  const scans = published.filter(({ type }) => type === SCAN).map(({ topic }) => topic);
  return {
    cameras: of("camera"),
    maps: of("map").map(({ topic }) => ({
      odom: topic,
      scan: scans.find((scan) => folder(scan) === folder(topic)) ?? scans[0] ?? null,
    })),
    imus: of("imu"),
    trees: published.filter(({ type }) => type !== "sensor_msgs/msg/CompressedImage" && type !== "sensor_msgs/msg/Image"),
    drivable: sorted.some(({ topic }) => lastWord(topic) === "cmd_vel"),
  };
}
