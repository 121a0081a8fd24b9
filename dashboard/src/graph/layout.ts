/**
 * Places the vertices of a directed graph in columns, so that arrows lead to the right wherever they can.
 *
 * Circles are broken at the edges that close them; a vertex stands one column behind the last that leads to it; long edges get a place
 * in every column that they cross; columns are sorted by the middle of their neighbours, a few times there and back.
 */

export interface Sized {
  id: string;
  width: number;
  height: number;
}

export interface Arrow {
  from: string;
  to: string;
}

export interface Placed {
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface Layout {
  /** By id: the middle of each vertex. */
  at: Map<string, Placed>;
  /** Of each arrow, in their order: the points that its line goes through. */
  lines: [number, number][][];
  width: number;
  height: number;
}

const COLUMN_GAP = 64;
const ROW_GAP = 14;
const SWEEPS = 12;

interface Cell extends Sized {
  rank: number;
  y: number;
  before: Cell[];
  after: Cell[];
}

/** Sweeps take milliseconds for hundreds of vertices; the same graph is always placed the same way. */
export function layout(vertices: readonly Sized[], arrows: readonly Arrow[]): Layout {
  const cells = new Map(vertices.map((one): [string, Cell] => [one.id, { ...one, rank: 0, y: 0, before: [], after: [] }]));
  const turned = backward(vertices, arrows);
  for (const [i, { from, to }] of arrows.entries()) link(cells, turned.has(i) ? to : from, turned.has(i) ? from : to);
  rank([...cells.values()]);
  const chains = arrows.map(({ from, to }, i) => chain(cells.get(turned.has(i) ? to : from)!, cells.get(turned.has(i) ? from : to)!));
  const columns = columnsOf(new Set([...cells.values(), ...chains.flat()]));
  order(columns);
  const middles = place(columns);
  const bottom = Math.max(0, ...columns.flat().map(({ y, height }) => y + height / 2));
  const at = new Map([...cells.values()].map((cell): [string, Placed] => [cell.id, { x: middles[cell.rank]!, y: cell.y, width: cell.width, height: cell.height }]));
  const lines = chains.map((cellsOf, i) => {
    const points = ends(cellsOf, middles);
    return turned.has(i) ? points.reverse() : points;
  });
  const last = columns.at(-1);
  return { at, lines, width: last ? middles.at(-1)! + widest(last) / 2 : 0, height: bottom };
}

const widest = (column: readonly Cell[]) => Math.max(0, ...column.map(({ width }) => width));

function link(cells: Map<string, Cell>, from: string, to: string): void {
  const [a, b] = [cells.get(from)!, cells.get(to)!];
  if (a.after.includes(b)) return;
  a.after.push(b);
  b.before.push(a);
}

/** Which arrows close a circle, when one walks from where nothing leads to first. */
function backward(vertices: readonly Sized[], arrows: readonly Arrow[]): Set<number> {
  const out = new Map<string, [number, string][]>();
  const entered = new Set(arrows.map(({ to }) => to));
  for (const [i, { from, to }] of arrows.entries()) out.set(from, [...(out.get(from) ?? []), [i, to]]);
  const found = new Set<number>();
  const state = new Map<string, "open" | "done">();
  const visit = (start: string) => {
    const stack: [string, number][] = [[start, 0]];
    state.set(start, "open");
    while (stack.length > 0) {
      const top = stack.at(-1)!;
      const next = out.get(top[0])?.[top[1]++];
      if (!next) {
        state.set(top[0], "done");
        stack.pop();
      } else if (state.get(next[1]) === "open") found.add(next[0]);
      else if (!state.has(next[1])) {
        state.set(next[1], "open");
        stack.push([next[1], 0]);
      }
    }
  };
  const sources = [...vertices].sort((a, b) => Number(entered.has(a.id)) - Number(entered.has(b.id)));
  for (const { id } of sources) if (!state.has(id)) visit(id);
  return found;
}

function rank(cells: readonly Cell[]): void {
  const waits = new Map(cells.map((cell) => [cell, cell.before.length]));
  const ready = cells.filter(({ before }) => before.length === 0);
  for (const cell of ready) {
    for (const next of cell.after) {
      next.rank = Math.max(next.rank, cell.rank + 1);
      const left = waits.get(next)! - 1;
      waits.set(next, left);
      if (left === 0) ready.push(next);
    }
  }
  for (const cell of ready.reverse()) { // what nothing leads to stands close to what it leads to
    if (cell.before.length === 0 && cell.after.length > 0) cell.rank = Math.min(...cell.after.map((next) => next.rank)) - 1;
  }
}

/** The cells that an arrow goes through, its ends included: one in each column. */
function chain(from: Cell, to: Cell): Cell[] {
  const found = [from];
  for (let column = from.rank + 1; column < to.rank; column += 1) found.push({ id: "", width: 0, height: 6, rank: column, y: 0, before: [], after: [] });
  found.push(to);
  if (found.length === 2) return found;
  from.after = from.after.filter((cell) => cell !== to);
  to.before = to.before.filter((cell) => cell !== from);
  found.slice(1).forEach((cell, i) => {
    found[i]!.after.push(cell);
    cell.before.push(found[i]!);
  });
  return found;
}

function columnsOf(cells: ReadonlySet<Cell>): Cell[][] {
  const columns: Cell[][] = [];
  for (const cell of cells) (columns[cell.rank] ??= []).push(cell);
  return Array.from(columns, (column) => column ?? []);
}

function order(columns: Cell[][]): void {
  const spot = new Map<Cell, number>();
  const number = (column: Cell[]) => column.forEach((cell, i) => spot.set(cell, i));
  columns.forEach(number);
  const sort = (column: Cell[], side: "before" | "after") => {
    const middle = new Map(column.map((cell) => [cell, cell[side].length > 0 ? mean(cell[side].map((one) => spot.get(one)!)) : spot.get(cell)!]));
    column.sort((a, b) => middle.get(a)! - middle.get(b)!);
    number(column);
  };
  for (let sweep = 0; sweep < SWEEPS; sweep += 1) {
    if (sweep % 2 === 0) columns.slice(1).forEach((column) => sort(column, "before"));
    else columns.slice(0, -1).reverse().forEach((column) => sort(column, "after"));
  }
}

/** Gives every cell its height, and returns where the columns stand. */
function place(columns: Cell[][]): number[] {
  for (const column of columns) stack(column, column.map(() => 0));
  for (let sweep = 0; sweep < SWEEPS; sweep += 1) {
    const inOrder = sweep % 2 === 0 ? columns : [...columns].reverse();
    for (const column of inOrder) stack(column, column.map((cell) => (cell.before.length + cell.after.length > 0 ? mean([...cell.before, ...cell.after].map(({ y }) => y)) : cell.y)));
  }
  const top = Math.min(...columns.flat().map(({ y, height }) => y - height / 2));
  for (const cell of columns.flat()) cell.y -= top;
  let left = 0;
  return columns.map((column) => {
    const middle = left + widest(column) / 2;
    left = middle + widest(column) / 2 + COLUMN_GAP;
    return middle;
  });
}

/** As near to where they want to be as their order and size let them. */
function stack(column: Cell[], wanted: number[]): void {
  let bottom = -Infinity;
  column.forEach((cell, i) => {
    cell.y = Math.max(wanted[i]!, bottom + ROW_GAP + cell.height / 2);
    bottom = cell.y + cell.height / 2;
  });
  const off = mean(column.map((cell, i) => wanted[i]! - cell.y));
  for (const cell of column) cell.y += off;
}

function ends(cells: readonly Cell[], middles: readonly number[]): [number, number][] {
  return cells.flatMap(({ rank: column, width, y }, i): [number, number][] => {
    const x = middles[column]!;
    if (i === 0) return [[x + width / 2, y]];
    return i === cells.length - 1 ? [[x - width / 2, y]] : [[x, y]];
  });
}

const mean = (values: readonly number[]) => (values.length > 0 ? values.reduce((sum, one) => sum + one, 0) / values.length : 0);

/** A line through points that leaves and enters level. */
export function curve(points: readonly [number, number][]): string {
  return points.map(([x, y], i) => {
    if (i === 0) return `M${x.toFixed(1)} ${y.toFixed(1)}`;
    const [fromX, fromY] = points[i - 1]!;
    const middle = (fromX + x) / 2;
    return `C${middle.toFixed(1)} ${fromY.toFixed(1)} ${middle.toFixed(1)} ${y.toFixed(1)} ${x.toFixed(1)} ${y.toFixed(1)}`;
  }).join("");
}
