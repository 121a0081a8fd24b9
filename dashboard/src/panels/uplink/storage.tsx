/** How much the store holds, of what, and for how long it will do; and what of it is damaged. */

import type { StoreView } from "../../api/history_types";
import { recordingsApi } from "../../api/recordings";
import { usePolled } from "../../history/density";
import { ageText, now } from "../../live/age";
import { bytes, duration, integer, NONE } from "../../ui/format";
import { Card } from "../../ui/parts";

const EVERY_MS = 15_000;
const DAY_S = 86_400;
/** Fewer days than this are worth a warning. */
const FEW_DAYS = 14;
const WORDS: Record<string, string> = {
  event: "faults, logs, results",
  metric: "series of numbers",
  bulk: "messages",
  live: "messages while watched",
  recording: "clips from black boxes",
};

export function StorageCard() {
  const store = usePolled(recordingsApi.store, "store", EVERY_MS).value;
  if (!store) return null;
  const most = Math.max(1, ...store.classes.map((one) => one.bytes));
  return (
    <>
      <div class="section-head"><h2>Storage</h2></div>
      <Card title="What is kept" kind="storage" note={store.disk_free_bytes === null ? "" : `${bytes(store.disk_free_bytes)} of disk free`}>
        <div class="storage">
          <div class="storage-total">
            <p class="big">{bytes(store.total_bytes)} <span class="uplink-state">{store.keep_bytes === null ? "stored" : `of at most ${bytes(store.keep_bytes)}`}</span></p>
            <Forecast store={store} />
          </div>
          <dl class="queues">
            {store.classes.map((one) => (
              <div key={one.class} data-class={one.class}>
                <dt><b>{one.class}</b> <small>{WORDS[one.class] ?? ""}</small></dt>
                <dd>
                  <span class="queue-bar"><i class="fresh" style={{ inlineSize: `${one.bytes > 0 ? Math.max(0.8, (100 * one.bytes) / most) : 0}%` }} /></span>
                  <span class="queue-facts num">
                    <span><b>{one.bytes > 0 ? bytes(one.bytes) : NONE}</b></span>
                    <span>{one.oldest ? `back to ${ageText(now.value - Date.parse(one.oldest))} ago` : ""}</span>
                    <span>{keeps(one.keep_days, one.keep_bytes)}</span>
                  </span>
                </dd>
              </div>
            ))}
          </dl>
        </div>
        {store.damaged.length > 0 && <Damage damaged={store.damaged} />}
      </Card>
    </>
  );
}

function keeps(days: number | null, limit: number | null): string {
  const parts = [days === null ? "" : `${integer(days)} d`, limit === null ? "" : bytes(limit)].filter(Boolean);
  return parts.length > 0 ? `kept ${parts.join(" or ")}` : "kept for ever";
}

function Forecast({ store: { growth_bytes_per_day: growth, days_until_full: days, days_until_bound: bound } }: { store: StoreView }) {
  const grows = growth !== null && growth > 0 ? `Grows by ${bytes(growth)} a day.` : "";
  const soon = days !== null && days < FEW_DAYS;
  return (
    <p class="hint">
      {grows} {days !== null && <b class={soon ? "bad" : undefined}>The disk is full in {duration(days * DAY_S)}.</b>}
      {bound !== null && (days === null || bound < days) && ` The bound is reached in ${duration(bound * DAY_S)}; then the oldest goes.`}
      {days === null && bound === null && (grows ? "" : "How fast it grows is not known yet.")}
    </p>
  );
}

function Damage({ damaged }: { damaged: StoreView["damaged"] }) {
  return (
    <div class="damage" role="alert">
      <p class="bad"><b>{integer(damaged.length)} damaged</b> · the rest is served</p>
      <ul>
        {damaged.slice(0, 5).map((one) => (
          <li key={`${one.object} ${one.topic}`}><span class="mono">{one.object}</span> {[one.robot, one.topic].filter(Boolean).join(" ")}</li>
        ))}
      </ul>
    </div>
  );
}
