/** Example events for a test call, in the shape in which rules hand them to a function. */

import type { FunctionDetail } from "../api/functions";

interface Template {
  word: string;
  event: (robot: string, now: Date) => unknown;
}

const NONE_ACCOUNT = "000000000000";
const seconds = (now: Date) => now.toISOString().replace(/\.\d+Z$/, "Z");

/** EventBridge's shape, as gateway/domain/automation/shapes.py has it. */
const event = (id: string, type: string, source: string, robot: string, now: Date, detail: object) => ({
  version: "0",
  id,
  "detail-type": type,
  source,
  account: NONE_ACCOUNT,
  time: seconds(now),
  region: "local",
  resources: robot ? [`arn:metaros:robot:${robot}`] : [],
  detail: robot ? { robot, ...detail } : detail,
});

const ALERT = { cause: "heat", severity: "error", state: "open", title: "Too hot", reason: "Motor temperature is 96.4 °C; a motor overheats above 95 °C.", times: 1, quiet: false, what: "opened", by: "", revision: 1 };
const BATTERY = { percentage: 0.14, voltage: 22.1, current: -3.2 };

export const TEMPLATES: Record<string, Template> = {
  alert: {
    word: "An alert",
    event: (robot, now) => event("e-4711", "metaros.alert.opened", "metaros", robot, now, { alert: "01JDZ5N0C7WQ3Y8K2M4R6T9VXA", ...ALERT }),
  },
  battery: {
    word: "Battery low",
    event: (robot, now) =>
      event(`${robot}/battery_low/${now.getTime()}000000`, "metaros.metric.threshold", "metaros.metric", robot, now, {
        series: "battery_state.percentage",
        value: 0.14,
        stamp_ns: now.getTime() * 1e6,
        above: null,
        below: 0.2,
        rule: "battery_low",
      }),
  },
  topic: {
    word: "A message on a topic",
    event: (robot, now) =>
      event(`${robot}/7/1/4711`, "metaros.topic.message", "metaros.topic", robot, now, {
        topic: `/${robot}/battery_state`,
        type: "sensor_msgs/msg/BatteryState",
        stamp_ns: now.getTime() * 1e6,
        seq: 4711,
        message: BATTERY,
      }),
  },
  recording: {
    word: "A recording is complete",
    event: (robot, now) => event("e-4712", "metaros.recording.stored", "metaros", robot, now, { recording: "01JDZ5N0C7WQ3Y8K2M4R6T9VXB", size_bytes: 41_203_992 }),
  },
  schedule: {
    word: "A schedule",
    event: (_, now) => event(`every_hour/${seconds(now)}`, "metaros.schedule", "metaros.schedule", "", now, { rule: "every_hour", expression: "rate(1 hour)", late_s: 0.02 }),
  },
  empty: { word: "An empty object", event: () => ({}) },
};

export const templateText = (name: string, robot: string, now: Date) => JSON.stringify(TEMPLATES[name]!.event(robot, now), null, 2);

/** The one that is most like what calls the function. */
export function likely({ triggers }: Pick<FunctionDetail, "triggers">): string {
  const kinds = triggers.filter(({ enabled }) => enabled).map(({ kind }) => kind);
  return kinds.includes("schedule") ? "schedule" : kinds.includes("mapping") ? "topic" : "alert";
}
