/** What was said and done about an alert, the oldest first, and the field that adds to it. */

import { useSignal } from "@preact/signals";
import { Refusal, useAttempt } from "../admin/modal";
import { alertsApi, type AlertDetail } from "../api/alerts";
import { can } from "../api/session";
import { clockTime, dayText } from "../ui/format";
import { historyOf, remarkWords } from "./words";

const MOST = 2000;

export function RemarksCard({ one, refresh }: { one: AlertDetail; refresh: () => Promise<void> }) {
  return (
    <section class="card" aria-label="History">
      <header><h2>History</h2></header>
      <ol class="remarks">
        {historyOf(one).map((remark) => (
          <li key={remark.number} data-remark={remark.kind}>
            <p class="remark-when num" title={remark.at}>{clockTime(Date.parse(remark.at))} <small>{dayText(Date.parse(remark.at))}</small></p>
            <div>
              <p class="remark-what">{remarkWords(remark)}</p>
              {remark.text && remark.kind !== "clip" && <p class="remark-text wrap">{remark.text}</p>}
            </div>
          </li>
        ))}
      </ol>
      {can("alerts.handle") && <CommentForm one={one} refresh={refresh} />}
    </section>
  );
}

function CommentForm({ one, refresh }: { one: AlertDetail; refresh: () => Promise<void> }) {
  const text = useSignal("");
  const { busy, problem, attempt } = useAttempt();
  const send = () =>
    attempt(async () => {
      await alertsApi.comment(one.id, text.value.trim());
      text.value = "";
      await refresh();
    });
  return (
    <form
      class="comment"
      onSubmit={(event) => {
        event.preventDefault();
        void send();
      }}
    >
      <label>
        <span class="visually-hidden">Comment</span>
        <textarea
          class="text"
          rows={2}
          maxLength={MOST}
          placeholder="Write what you found, for whoever comes next"
          value={text.value}
          onInput={(event) => (text.value = event.currentTarget.value)}
          onKeyDown={(event) => {
            if (event.key !== "Enter" || !(event.ctrlKey || event.metaKey) || !text.value.trim()) return;
            event.preventDefault();
            void send();
          }}
        />
      </label>
      <button class="button" disabled={busy.value || text.value.trim() === ""}>Comment</button>
      <Refusal text={problem.value} />
    </form>
  );
}
