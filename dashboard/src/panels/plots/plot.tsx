/** uPlot in a card: loaded when first needed, coloured by the theme, its header shows the newest or hovered value. */

import { useSignalEffect, type Signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type uPlot from "uplot";
import { clockTime, fixed, short } from "../../ui/format";
import type { Span } from "../../api/history_types";
import { hatched } from "../../ui/hatch";
import { inNextFrame, onBeat, useWork } from "../../ui/paint";
import { palette, type Palette } from "../../ui/theme";
import type { Frame } from "./frame";
import { everywhere, type Overlay } from "./overlay";
import type { drawCursor } from "./plot_cursor";
import type { Timeline } from "./timeline";

const UNSEEN_MS = 1000;

export interface PlotProps {
  timelines: Timeline[];
  labels: string[];
  unit: string;
  digits: number;
  bounds?: uPlot.Scale.Range;
  windowS: number;
  /** Changes whenever the timelines did. */
  version: Signal<number>;
  height?: number;
  /** The past; without it the window ends now. */
  frame?: Signal<Frame | null>;
  /** Draws the instant of the frame: a live page goes without its code. */
  cursor?: typeof drawCursor;
  /** Where data of the live window is known to be lost. */
  holes?: Signal<Span[]>;
  /** What is drawn beside the lines, in the place of what every plot of the robot has. */
  overlay?: Signal<Overlay | null>;
}

function options(props: PlotProps, colours: Palette, width: number, hovered: (index: number | null) => void): uPlot.Options {
  const axis = { stroke: colours.muted, grid: { stroke: colours.grid, width: 1 }, ticks: { show: false }, font: "11px system-ui" };
  const strokes = [colours.accent, colours["accent-2"]];
  const overlay = props.overlay ?? everywhere;
  return {
    width,
    height: props.height ?? 132,
    legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false }, points: { size: 7 }, sync: { key: "time" } },
    padding: [8, props.windowS < 60 ? 26 : props.frame ? 18 : 10, 0, 0], // half a label with seconds, or it is cut at the end
    scales: {
      x: { time: true, range: (_, first, last) => frameRange(props) ?? timeRange(first, last, props.windowS) },
      y: { range: props.bounds ?? ((_, low, high) => padded(low, high)) },
    },
    axes: [
      { ...axis, size: 24, space: 70, values: (_, splits, __, ___, stepS) => splits.map((split) => clockTime(split * 1000).slice(0, stepS < 60 ? 8 : 5)) },
      { ...axis, size: 46, space: 28, values: (_, splits) => splits.map(short) },
    ],
    series: [
      {},
      ...props.labels.map((label, i) => ({
        label,
        stroke: strokes[i % 2]!,
        width: 1.75,
        points: { show: false },
        ...(props.labels.length === 1 && !props.overlay && { fill: fade(colours.accent) }),
      })),
    ],
    hooks: {
      setCursor: [(plot) => hovered(plot.cursor.idx ?? null)],
      drawClear: [
        (plot) => {
          drawHoles(plot, props.frame?.peek()?.holes ?? props.holes?.peek() ?? [], colours);
          overlay.peek()?.under(plot, colours);
        },
      ],
      draw: [
        (plot) => {
          if (props.frame?.peek()) props.cursor!(plot, props.frame.peek()!, colours);
          overlay.peek()?.over(plot, colours);
        },
      ],
    },
  };
}

function frameRange({ frame }: PlotProps): [number, number] | null {
  const shown = frame?.peek();
  return shown ? [shown.startMs / 1000, shown.endMs / 1000] : null;
}

function drawHoles(plot: uPlot, holes: Span[], colours: Palette): void {
  const { left, top, width, height } = plot.bbox;
  for (const { from_ms, to_ms } of holes) {
    const from = Math.max(left, plot.valToPos(from_ms / 1000, "x", true));
    const to = Math.min(left + width, plot.valToPos(to_ms / 1000, "x", true));
    if (to > left && from < left + width) hatched(plot.ctx, from, top, Math.max(2, to - from), height, colours.warn);
  }
}

/** The window up to now; while there is less history than that, only from its beginning, but never under a minute of it. */
function timeRange(first: number | null, last: number | null, windowS: number): [number, number] {
  const end = Math.max(last ?? 0, Date.now() / 1000 - 5);
  return [Math.max(end - windowS, Math.min(first ?? 0, end - Math.min(60, windowS))), end];
}

/** Some room around the values; a flat line still gets an axis. */
function padded(low: number | null, high: number | null): [number, number] {
  if (low == null || high == null) return [0, 1];
  const room = Math.max((high - low) * 0.12, Math.abs(high) * 0.02, 0.05);
  return [low >= 0 && low - room < 0 ? 0 : low - room, high + room];
}

const fade = (colour: string) => colour.replace(/^(\w+)a?\(([^/)]*).*$/, (_, kind: string, body: string) =>
  kind === "rgb" ? `rgba(${body}, 0.1)` : `${kind}(${body} / 0.1)`);

export function Plot(props: PlotProps) {
  const box = useRef<HTMLDivElement>(null);
  const values = useRef<HTMLParagraphElement>(null);
  const plot = useRef<uPlot>(null);
  const library = useRef<typeof uPlot>(null);
  const hovered = useRef<number | null>(null);
  const inView = useRef(true);
  const late = useRef<ReturnType<typeof setTimeout>>(undefined);

  const data = (): uPlot.AlignedData => {
    const tables = props.timelines.map(({ times, values: numbers }) => [times, numbers] as uPlot.AlignedData);
    return tables.length > 1 && library.current ? library.current.join(tables) : tables[0]!;
  };
  const caption = () => {
    const { current } = plot;
    props.timelines.forEach((timeline, i) => {
      const at = hovered.current;
      const shown = props.frame?.peek();
      const newest = shown ? timeline.valueAt(shown.cursorMs / 1000) : timeline.values.at(-1);
      const value = at !== null && current ? current.data[i + 1]?.[at] : newest;
      const cell = values.current?.children[i]?.lastElementChild;
      if (cell) cell.textContent = fixed(value, props.digits, props.unit);
    });
  };
  const paint = () => {
    clearTimeout(late.current);
    late.current = undefined;
    plot.current?.setData(data());
  };
  /** Painting is what costs: a plot that nobody sees is painted once a second. */
  const work = useWork(() => {
    if (inView.current) paint();
    else late.current ??= setTimeout(paint, UNSEEN_MS);
    caption();
  });
  const update = () => (props.frame ? inNextFrame : onBeat)(work);
  const rebuild = () => {
    plot.current?.destroy();
    if (!library.current || !box.current) return;
    const settings = options(props, palette.peek(), box.current.clientWidth, (index) => {
      hovered.current = index;
      caption();
    });
    plot.current = new library.current(settings, data(), box.current);
    caption();
  };
  useEffect(() => {
    let gone = false;
    void import("uplot").then((module) => {
      if (gone) return;
      library.current = module.default;
      rebuild();
    });
    const observer = new ResizeObserver(() => {
      const width = box.current?.clientWidth;
      if (width) plot.current?.setSize({ width, height: props.height ?? 132 });
    });
    observer.observe(box.current!);
    const watcher = new IntersectionObserver((looks) => {
      inView.current = looks.at(-1)!.isIntersecting; // a busy page is told of several at once
      if (inView.current) update();
    });
    watcher.observe(box.current!);
    return () => {
      gone = true;
      observer.disconnect();
      watcher.disconnect();
      clearTimeout(late.current);
      late.current = undefined;
      plot.current?.destroy();
      plot.current = null;
    };
  }, [props.windowS, props.timelines]);
  useSignalEffect(() => {
    if (palette.value) rebuild();
  });
  useSignalEffect(() => {
    void props.version.value;
    void props.frame?.value;
    void (props.overlay ?? everywhere).value;
    update();
  });
  return (
    <>
      <p class="readings num" ref={values}>
        {props.labels.map((label) => (
          <span key={label}>
            <i>{label}</i> <b>–</b>
          </span>
        ))}
      </p>
      <div class="plot" ref={box} />
    </>
  );
}
