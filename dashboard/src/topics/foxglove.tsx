/** The way into Foxglove or Lichtblick: an address with a ticket that looks at this robot, for an hour. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { SegmentedControl } from "../admin/segmented_control";
import { CopyField } from "../admin/copy";
import { Modal, Refusal } from "../admin/modal";
import { call } from "../api/call";
import { saidOf } from "../api/client";
import { can } from "../api/session";
import { clockTime } from "../ui/format";

const TTL_S = 3600;
const FOXGLOVE = "https://app.foxglove.dev/";

/** Where viewers connect, on the address that served this page; `ticket` "": as whoever may look without. */
export function viewerUrl(robot: string, ticket: string, page: { protocol: string; host: string } = location): string {
  const token = ticket && `?token=${encodeURIComponent(ticket)}`;
  return `${page.protocol === "https:" ? "wss" : "ws"}://${page.host}/foxglove/${encodeURIComponent(robot)}${token}`;
}

export const foxgloveUrl = (address: string) => `${FOXGLOVE}?${new URLSearchParams({ ds: "foxglove-websocket", "ds.url": address })}`;

export function OpenInFoxglove({ robot }: { robot: string }) {
  const open = useSignal(false);
  return (
    <>
      <button type="button" class="button" onClick={() => (open.value = true)}>Open in Foxglove…</button>
      {open.value && <FoxgloveDialog robot={robot} onClose={() => (open.value = false)} />}
    </>
  );
}

const ROLES: readonly ["viewer" | "operator", string][] = [["viewer", "Look"], ["operator", "Look, publish and call"]];

function FoxgloveDialog({ robot, onClose }: { robot: string; onClose: () => void }) {
  const role = useSignal<"viewer" | "operator">("viewer");
  const made = useSignal<{ ticket: string; expires: string } | null>(null);
  const problem = useSignal("");
  const may = can("tickets.make");
  useEffect(() => {
    if (!may) return;
    let gone = false; // another choice was made: this ticket is not what is shown
    made.value = null;
    call("POST /auth/tickets", { body: { robots: [robot], role: role.value, ttl_s: TTL_S } }).then(
      (ticket) => !gone && (made.value = ticket),
      (error: unknown) => !gone && (problem.value = saidOf(error)),
    );
    return () => (gone = true);
  }, [role.value, may]);
  const address = made.value || !may ? viewerUrl(robot, made.value?.ticket ?? "") : "";
  return (
    <Modal title={`${robot} in Foxglove`} onClose={onClose}>
      {(close) => (
        <div class="foxglove">
          {can("robots.publish") && may && <SegmentedControl label="What it may do" choices={ROLES} chosen={role.value} onChoose={(word) => (role.value = word)} />}
          <Refusal text={problem.value} />
          {address && (
            <>
              <p class="hint">In Foxglove or Lichtblick: Open connection, Foxglove WebSocket, and this address.</p>
              <CopyField text={address} label="Address for viewers" name="viewer" />
              <p class="hint">
                {made.value ? `Whoever has it may do so until ${clockTime(Date.parse(made.value.expires))}; share it as you would a key.` : "Without a ticket: it works where this gateway lets people look without signing in."}
              </p>
            </>
          )}
          <div class="dialog-end">
            <span />
            <button type="button" class="button" onClick={close}>Close</button>
            {address && <a class="button button-solid" href={foxgloveUrl(address)} target="_blank" rel="noreferrer noopener">Open app.foxglove.dev</a>}
          </div>
        </div>
      )}
    </Modal>
  );
}
