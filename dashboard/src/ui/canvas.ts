/** A canvas that follows its box and the screen's pixel density, and draws at most once a frame. */

import { useEffect, useRef } from "preact/hooks";
import type { RefObject } from "preact";

export interface Surface {
  context: CanvasRenderingContext2D;
  /** Size in CSS pixels; the context is scaled to them. */
  width: number;
  height: number;
}

export function useCanvas(draw: (surface: Surface) => void): { ref: RefObject<HTMLCanvasElement | null>; redraw: () => void } {
  const ref = useRef<HTMLCanvasElement>(null);
  const drawing = useRef(draw);
  drawing.current = draw;
  const pending = useRef(0);
  const redraw = useRef(() => {
    if (pending.current) return;
    pending.current = requestAnimationFrame(() => {
      pending.current = 0;
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
  });
  useEffect(() => {
    const observer = new ResizeObserver(() => redraw.current());
    observer.observe(ref.current!);
    redraw.current();
    return () => {
      observer.disconnect();
      cancelAnimationFrame(pending.current);
      pending.current = 0;
    };
  }, []);
  return { ref, redraw: redraw.current };
}
