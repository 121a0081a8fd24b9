/** What the plots and the time bar of a robot show of alerts. Who knows of some brings the code: a robot without goes without. */

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import type uPlot from "uplot";
import type { Alert } from "../../api/schema.js";
import type { Window } from "../../history/span";
import type { Palette } from "../../ui/theme";

export interface Overlay {
  /** Behind the lines. */
  under: (plot: uPlot, colours: Palette) => void;
  /** Over the lines. */
  over: (plot: uPlot, colours: Palette) => void;
}

/** On every plot of the robot that is shown, live and past. */
export const everywhere = signal<Overlay | null>(null);

export interface AlertMarks {
  alerts: Alert[];
  View: ComponentType<{ alerts: Alert[]; window: Window; hoverMs: number | null }>;
}

/** On its time bar. */
export const marks = signal<AlertMarks | null>(null);
