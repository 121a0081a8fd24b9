/** A canvas that follows its box and the screen's pixel density, and draws at most once a frame. */

import { useEffect, useRef } from "preact/hooks";
import type { RefObject } from "preact";
import { inNextFrame, onBeat, useWork } from "./paint";

export interface Surface {
  context: CanvasRenderingContext2D;
  /** Size in CSS pixels; the context is scaled to them. */
  width: number;
  height: number;
}

interface Canvas {
  ref: RefObject<HTMLCanvasElement | null>;
  /** In the next frame: somebody did something. */
  redraw: () => void;
  /** With the other cards: a message came. */
  redrawOnBeat: () => void;
}

export function useCanvas(draw: (surface: Surface) => void): Canvas {
  const ref = useRef<HTMLCanvasElement>(null);
  const work = useWork(() => {
    const canvas = ref.current;
    const context = canvas?.getContext("2d");
    if (!canvas || !context) return;
    const density = devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    const [wide, high] = [Math.round(width * density), Math.round(height * density)];
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    context.setTransform(density, 0, 0, density, 0, 0);
    context.clearRect(0, 0, width, height);
    draw({ context, width, height });
  });
  const redraw = () => inNextFrame(work);
  useEffect(() => {
    const observer = new ResizeObserver(redraw);
    observer.observe(ref.current!);
    redraw();
    return () => observer.disconnect();
  }, []);
  return { ref, redraw, redrawOnBeat: () => onBeat(work) };
}
