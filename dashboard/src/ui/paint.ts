/**
 * When a live page paints: what messages change waits for a beat that all cards share.
 *
 * A frame costs the browser about the same whether one card changed or all did, and a robot's topics come at odd times:
 * a frame for each of them is thirty a second. What must not wait, a picture or what somebody does, is painted in the
 * next frame, and a beat that is due is painted with it.
 */

import { useRef } from "preact/hooks";

type Work = () => void;

/** A beat takes part in a frame that is painted anyway: a camera of 10 Hz sets it. */
const EARLIEST_MS = 75;
/** Then it has a frame of its own. */
const LATEST_MS = 125;

const forFrame = new Set<Work>();
const forBeat = new Set<Work>();
let frame = 0;
let timer: ReturnType<typeof setTimeout> | undefined;
let beatMs = -Infinity;

/** Do it in the next frame, once however often it is asked for. */
export function inNextFrame(work: Work): void {
  forFrame.add(work);
  frame ||= requestAnimationFrame(paint);
}

/** Do it on the next beat: at once if nothing was painted of late. */
export function onBeat(work: Work): void {
  forBeat.add(work);
  timer ??= setTimeout(() => (frame ||= requestAnimationFrame(paint)), Math.max(0, beatMs + LATEST_MS - performance.now()));
}

/** A component's work, as of its newest rendering; it may be done once more when the component is gone. */
export function useWork(work: Work): Work {
  const newest = useRef(work);
  newest.current = work;
  return useRef(() => newest.current()).current;
}

function paint(): void {
  frame = 0;
  const due = new Set(forFrame);
  forFrame.clear();
  const now = performance.now();
  if (timer && now - beatMs >= EARLIEST_MS) {
    for (const work of forBeat) due.add(work);
    forBeat.clear();
    clearTimeout(timer);
    timer = undefined;
    beatMs = now;
  }
  for (const work of due) {
    try {
      work();
    } catch (error) {
      reportError(error); // the other cards are painted all the same
    }
  }
}
