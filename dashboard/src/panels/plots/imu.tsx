/** The inertial sensor over the last seconds, at message rate. */

import { useSignal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { Card } from "../../ui/parts";
import { useTopic } from "../../ui/use_topic";
import { Plot } from "./plot";
import { Timeline } from "./timeline";

const WINDOW_S = 20;
const RATE_HZ = 10;

interface Imu {
  angular_velocity: { z: number };
  linear_acceleration: { x: number };
}

export function ImuCard({ robot, topic }: { robot: string; topic: string }) {
  const timelines = useMemo(() => [new Timeline(WINDOW_S), new Timeline(WINDOW_S)], [robot, topic]);
  const version = useSignal(0);
  const received = useSignal<number | null>(null);
  const problem = useSignal("");
  useTopic({ robot, topic, maxRateHz: RATE_HZ }, ({ message, error }) => {
    problem.value = message ? "" : (error ?? "");
    if (!message) return;
    const imu = message as unknown as Imu;
    const at = Date.now();
    timelines[0]!.add(at, imu.angular_velocity.z);
    timelines[1]!.add(at, imu.linear_acceleration.x);
    version.value += 1;
    if (at - (received.peek() ?? 0) > 1000) received.value = at;
  });
  return (
    <Card title="IMU" kind="imu" topic={topic} note="last 20 s" stampMs={received.value}>
      {problem.value && <p class="problem">{problem.value}</p>}
      <Plot
        timelines={timelines}
        labels={["turn rad/s", "acceleration m/s²"]}
        unit=""
        digits={2}
        windowS={WINDOW_S}
        version={version}
      />
    </Card>
  );
}
