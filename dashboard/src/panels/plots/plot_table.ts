/** Which numeric series make which plot, in the order of the page. A plot is shown when the robot has its series. */

export interface PlotLine {
  /** Series name, relative to the robot: topic with dots, then the field path. */
  series: string;
  label: string;
  /** What the stored value is multiplied by to be shown in `unit`. */
  factor?: number;
}

export interface PlotSpec {
  title: string;
  unit: string;
  digits: number;
  lines: PlotLine[];
  /** Fixed bounds of the axis, where the quantity has them. */
  bounds?: [number, number];
}

export const PLOTS: PlotSpec[] = [
  { title: "Battery", unit: "%", digits: 1, bounds: [0, 100], lines: [{ series: "battery_state.percentage", label: "charge", factor: 100 }] },
  { title: "Battery voltage", unit: "V", digits: 2, lines: [{ series: "battery_state.voltage", label: "voltage" }] },
  {
    title: "Speed",
    unit: "m/s",
    digits: 2,
    lines: [{ series: "odom.twist.twist.linear.x", label: "forward" }],
  },
  { title: "Turn rate", unit: "rad/s", digits: 2, lines: [{ series: "odom.twist.twist.angular.z", label: "left" }] },
  { title: "Motor temperature", unit: "°C", digits: 1, lines: [{ series: "motor_temperature.temperature", label: "motor" }] },
  { title: "CPU", unit: "%", digits: 0, bounds: [0, 100], lines: [{ series: "host.cpu.percent", label: "all cores" }] },
  { title: "Memory", unit: "%", digits: 0, bounds: [0, 100], lines: [{ series: "host.memory.percent", label: "used" }] },
  { title: "Host temperature", unit: "°C", digits: 1, lines: [{ series: "host.temperature.celsius", label: "hottest" }] },
  {
    title: "Network",
    unit: "kB/s",
    digits: 1,
    lines: [
      { series: "host.network.rx_bytes_per_s", label: "in", factor: 1e-3 },
      { series: "host.network.tx_bytes_per_s", label: "out", factor: 1e-3 },
    ],
  },
  { title: "Disk", unit: "%", digits: 0, bounds: [0, 100], lines: [{ series: "host.disk.percent", label: "used" }] },
];

/** In the past the inertial sensor is a plot of its series too: its messages at full rate are not stored. */
export const PAST_PLOTS: PlotSpec[] = [
  ...PLOTS,
  {
    title: "IMU",
    unit: "",
    digits: 2,
    lines: [
      { series: "imu.angular_velocity.z", label: "turn rad/s" },
      { series: "imu.linear_acceleration.x", label: "acceleration m/s²" },
    ],
  },
];

/** The plots of a robot that has these series. */
export const plotsOf = (names: Set<string>, table = PLOTS) => table.filter((plot) => plot.lines.some((line) => names.has(line.series)));
