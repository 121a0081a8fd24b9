/** Values of series in the units in which plots show them, and what was expected of them. */

import { PAST_PLOTS, type PlotSpec } from "../panels/plots/plot_table";
import { short } from "../ui/format";

export interface Unit {
  title: string;
  unit: string;
  factor: number;
  digits: number;
  bounds?: [number, number];
}

/** How a series is shown elsewhere: its title, unit and factor; by its own name where no plot has it. */
export function unitOf(series: string, table: readonly PlotSpec[] = PAST_PLOTS): Unit {
  for (const spec of table) {
    const line = spec.lines.find((one) => one.series === series);
    if (line) return { title: spec.title, unit: spec.unit, factor: line.factor ?? 1, digits: spec.digits, bounds: spec.bounds };
  }
  return { title: series, unit: "", factor: 1, digits: 2 };
}

const measured = (value: number, { factor, unit }: Pick<Unit, "factor" | "unit">) => short(value * factor) + (unit && `\u202f${unit}`);

/** "38 °C to 44 °C", "at most 75 °C", or "" where nothing is expected. */
export function expectedText(low: number | null, high: number | null, unit: Pick<Unit, "factor" | "unit">): string {
  if (low !== null && high !== null) return low === high ? measured(low, unit) : `${short(low * unit.factor)} to ${measured(high, unit)}`;
  if (high !== null) return `at most ${measured(high, unit)}`;
  return low === null ? "" : `at least ${measured(low, unit)}`;
}

export const valueText = (value: number | null, unit: Pick<Unit, "factor" | "unit">) => (value === null ? "" : measured(value, unit));
