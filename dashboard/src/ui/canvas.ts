/** A canvas that follows its box and the screen's pixel density, and draws at most once a frame. */

import { useEffect, useRef } from "preact/hooks";
import type { RefObject } from "preact";
import { forget, inNextFrame, onBeat } from "./paint";

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
  const drawing = useRef(draw);
  drawing.current = draw;
  const work = useRef(() => {
    const canvas = ref.current;
    const context = canvas?.getContext("2d");
    if (!canvas || !context) return;
    const density = devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (canvas.width !== Math.round(width * density) || canvas.height !== Math.round(height * density)) {
      canvas.width = Math.round(width * density);
      canvas.height = Math.round(height * density);
    }
    context.setTransform(density, 0, 0, density, 0, 0);
    context.clearRect(0, 0, width, height);
    drawing.current({ context, width, height });
  });
  const redraw = useRef(() => inNextFrame(work.current)).current;
  const redrawOnBeat = useRef(() => onBeat(work.current)).current;
  useEffect(() => {
    const observer = new ResizeObserver(redraw);
    observer.observe(ref.current!);
    redraw();
    return () => {
      observer.disconnect();
      forget(work.current);
    };
  }, []);
  return { ref, redraw, redrawOnBeat };
}
