/** The drawing: nodes as boxes, topics as pills, a line's width by how much goes through; what is chosen shows its neighbours. */

import { useMemo } from "preact/hooks";
import type { Topic } from "../api/types";
import { curve, layout } from "./layout";
import type { Drawn } from "./model";

interface GraphProps {
  drawn: Drawn;
  /** By name: their rates make the lines. */
  topics: ReadonlyMap<string, Topic>;
  /** The id of a vertex, or "". */
  chosen: string;
  onChoose: (id: string) => void;
  label: string;
}

const MARGIN = 8;
const THIN = 1.4;
const THICK = 7;

/** From a few bytes a second to some megabytes. */
export function widthOf(bytesPerS: number): number {
  return bytesPerS <= 0 ? THIN : Math.min(THICK, THIN + Math.max(0, Math.log10(bytesPerS / 100)) * 1.2);
}

export function GraphSvg({ drawn, topics, chosen, onChoose, label }: GraphProps) {
  const { vertices, edges } = drawn;
  const placed = useMemo(() => layout(vertices, edges), [vertices, edges]);
  const near = useMemo(() => new Set(chosen ? [chosen, ...edges.filter(({ from, to }) => from === chosen || to === chosen).flatMap(({ from, to }) => [from, to])] : []), [edges, chosen]);
  const [width, height] = [placed.width + 2 * MARGIN, placed.height + 2 * MARGIN];
  return (
    <svg class={chosen ? "graph graph-chosen" : "graph"} width={width} height={height} viewBox={`${-MARGIN} ${-MARGIN} ${width} ${height}`} role="group" aria-label={label} onClick={() => onChoose("")}>
      <defs>
        <marker id="graph-arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" markerUnits="userSpaceOnUse" orient="auto-start-reverse"><path d="M0 .8 7.5 4 0 7.2Z" /></marker>
      </defs>
      {edges.map((edge, i) => {
        const told = topics.get(edge.topic);
        const still = told !== undefined && !((told.rate_hz ?? 0) > 0);
        const words = ["graph-edge", still && "graph-still", edge.broken && "graph-broken", near.size > 0 && (edge.from === chosen || edge.to === chosen) && "graph-near"];
        return (
          <path key={`${edge.from} ${edge.to}`} class={words.filter(Boolean).join(" ")} data-edge={`${edge.from} > ${edge.to}`} d={curve(placed.lines[i]!)} stroke-width={edge.broken ? THIN : widthOf(still ? 0 : (told?.bytes_per_s ?? 0))} marker-end="url(#graph-arrow)">
            {edge.broken && <title>{edge.broken}</title>}
          </path>
        );
      })}
      {vertices.map(({ id, kind, name, label: text }) => {
        const { x, y, width: wide, height: high } = placed.at.get(id)!;
        const words = ["graph-vertex", `graph-${kind}`, near.has(id) && "graph-near", id === chosen && "graph-one"];
        return (
          <g
            key={id} class={words.filter(Boolean).join(" ")} transform={`translate(${x.toFixed(1)} ${y.toFixed(1)})`} data-vertex={name} data-kind={kind}
            role="button" tabindex={0} aria-pressed={id === chosen} aria-label={`${kind} ${name}`}
            onClick={(event) => { event.stopPropagation(); onChoose(id === chosen ? "" : id); }}
            onKeyDown={(event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); onChoose(id === chosen ? "" : id); } }}
          >
            <title>{name}</title>
            <rect x={-wide / 2} y={-high / 2} width={wide} height={high} rx={kind === "node" ? 6 : high / 2} />
            <text dy="0.34em" text-anchor="middle">{text}</text>
          </g>
        );
      })}
    </svg>
  );
}
