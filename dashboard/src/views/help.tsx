/** The help dialog: which keys do what. */

import { useEffect, useRef } from "preact/hooks";

const KEYS: [string, string][] = [
  ["/", "search robots"],
  ["?", "this help"],
  ["W A S D or arrows", "drive, while held and the pad has focus"],
  ["Esc", "stop driving"],
  ["l", "back to live"],
  ["← → Shift", "on the time bar: a second, ten seconds"],
  ["Space, Page ↑↓", "on the time bar: play, a tenth of its span"],
  ["j k Enter a", "in the list of alerts: next, previous, open, acknowledge"],
  ["Ctrl Enter", "in a test of a function: call it"],
  ["+ − f", "zoom and follow, when the map has focus"],
];

export function HelpDialog({ onClose }: { onClose: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog ref={dialog} aria-labelledby="help-title" onClose={onClose}>
      <h2 id="help-title">Keys</h2>
      <dl>
        {KEYS.map(([key, does]) => (
          <div key={key}><dt><kbd>{key}</kbd></dt><dd>{does}</dd></div>
        ))}
      </dl>
      <form method="dialog"><button class="button">Close</button></form>
    </dialog>
  );
}
