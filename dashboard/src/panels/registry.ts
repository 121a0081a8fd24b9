/** Which card shows which message type. What is not here is a tree of names and values. */

import type { Topic } from "../api/types";
import { SEALED_CDR } from "../seal/encoding";

export type CardKind = "camera" | "video" | "map" | "imu" | "tree";

const KINDS: Record<string, CardKind> = {
  "sensor_msgs/msg/CompressedImage": "camera",
  "sensor_msgs/msg/Image": "camera",
  "foxglove_msgs/msg/CompressedVideo": "video",
  "sensor_msgs/msg/Imu": "imu",
  "nav_msgs/msg/Odometry": "map",
};
const SCAN = "sensor_msgs/msg/LaserScan";

/** A camera's topics: single pictures, video, or both of the same. */
export interface Camera {
  name: string;
  picture: string | null;
  video: string | null;
}

export interface Layout {
  cameras: Camera[];
  maps: { odom: string; scan: string | null }[];
  imus: Topic[];
  trees: Topic[];
  drivable: boolean;
}

/** The folder of a topic, to pair a scan with the odometry beside it. */
const folder = (topic: string) => topic.slice(0, topic.lastIndexOf("/") + 1);
const lastWord = (topic: string) => topic.slice(topic.lastIndexOf("/") + 1);
const kindOf = ({ type }: Topic) => KINDS[type] ?? "tree";

/** Whether somebody says something on it, or did. */
export const isPublished = ({ publishers, messages, received }: Topic) => publishers > 0 || messages > 0 || received > 0;

/** What the page can read. */
export const readable = (topics: Topic[]) =>
  topics.filter(({ encoding }) => encoding === "cdr" || encoding === SEALED_CDR).sort((a, b) => a.topic.localeCompare(b.topic));

/** Sort a robot's topics into cards: a map for each odometry, with the scan nearest to it; one camera for both of its topics. */
export function layoutOf(topics: Topic[]): Layout {
  const sorted = readable(topics);
  const published = sorted.filter(isPublished);
  const of = (kind: CardKind) => published.filter((topic) => kindOf(topic) === kind);
  const scans = published.filter(({ type }) => type === SCAN).map(({ topic }) => topic);
  return {
    cameras: camerasOf(of("camera"), of("video")),
    maps: of("map").map(({ topic }) => ({
      odom: topic,
      scan: scans.find((scan) => folder(scan) === folder(topic)) ?? scans[0] ?? null,
    })),
    imus: of("imu"),
    trees: published.filter((topic) => !["camera", "video"].includes(kindOf(topic))),
    drivable: sorted.some(({ topic }) => lastWord(topic) === "cmd_vel"),
  };
}

/** "/r/camera/image/compressed" and "/r/camera/video" are both the camera "/r/camera". */
const cameraName = (topic: string) => topic.split("/").filter((word) => !/^(image|image_raw|compressed|video|h264)$/.test(word)).join("/");

/** What nobody publishes any more yields to what the same camera publishes now. */
function camerasOf(pictures: Topic[], videos: Topic[]): Camera[] {
  const alive = new Set([...pictures, ...videos].filter(({ publishers }) => publishers).map(({ topic }) => cameraName(topic)));
  const now = ({ topic, publishers }: Topic) => publishers > 0 || !alive.has(cameraName(topic));
  const cameras: Camera[] = pictures.filter(now).map(({ topic }) => ({ name: cameraName(topic), picture: topic, video: null }));
  for (const { topic } of videos.filter(now)) {
    const name = cameraName(topic);
    const same = cameras.filter((camera) => camera.name === name && camera.video === null);
    const camera = same.find(({ picture }) => picture?.endsWith("/compressed")) ?? same[0];
    if (camera) camera.video = topic;
    else cameras.push({ name, picture: null, video: topic });
  }
  return cameras;
}
