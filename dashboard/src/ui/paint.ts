/**
 * When a live page paints: what messages change waits for a beat that all cards share.
 *
 * A frame costs the browser about the same whether one card changed or all did, and a robot's topics come at odd times:
 * a frame for each of them is thirty a second. What must not wait, a picture or what somebody does, is painted in the
 * next frame, and a beat that is due is painted with it.
 */

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

/** It is not to be done any more. */
export function forget(work: Work): void {
  forFrame.delete(work);
  forBeat.delete(work);
}

function paint(): void {
  frame = 0;
  const due = [...forFrame];
  forFrame.clear();
  const now = performance.now();
  if (now - beatMs >= EARLIEST_MS && forBeat.size > 0) {
    due.push(...[...forBeat].filter((work) => !due.includes(work)));
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
