/** Templates: what groups of robots are to be, in the order in which they are laid over each other. */

import { useSignal } from "@preact/signals";
import { Refusal } from "../admin/modal";
import { useAsked } from "../admin/use_list";
import { can } from "../api/session";
import { templatesApi, type Template } from "../api/templates";
import { ageText, now } from "../live/age";
import { textOfDocument } from "../twin/draft";
import { MayNot } from "../ui/parts";
import { isObject } from "../values/json";
import { TemplateDrop } from "./template_drop";
import { TemplateEditor } from "./template_editor";
import { TemplateHistory } from "./template_history";

const EVERY_MS = 5000;

export function TemplatesPart() {
  const asked = useAsked(templatesApi.list, EVERY_MS);
  /** Null: nothing is edited. A template without a name is a new one. */
  const edited = useSignal<Template | "new" | null>(null);
  const dropped = useSignal<Template | null>(null);
  const past = useSignal<Template | null>(null);
  const all = asked.value.value;
  const done = async () => {
    edited.value = null;
    await asked.refresh();
  };
  return (
    <>
      <div class="rollouts-head">
        <p class="hint">Laid over each other from the first to the last; a robot's own document lies on top of them.</p>
        {!can("templates.write") ? <MayNot what="change templates" least="Admins" /> : edited.value === null && (
          <button type="button" class="button button-solid" onClick={() => (edited.value = "new")}>New template…</button>
        )}
      </div>
      <Refusal text={asked.problem.value} />
      {edited.value !== null && (
        <TemplateEditor
          key={edited.value === "new" ? "" : edited.value.name}
          like={edited.value === "new" ? null : edited.value}
          taken={(all ?? []).map(({ name }) => name)}
          onCancel={() => (edited.value = null)}
          onDone={done}
        />
      )}
      {all === null ? <p class="quiet">Asking the gateway…</p> : all.length === 0 ? <Nothing /> : (
        <ol class="templates">
          {all.map((one) => (
            <TemplateCard key={one.name} one={one} onEdit={() => (edited.value = one)} onDrop={() => (dropped.value = one)} onPast={() => (past.value = one)} />
          ))}
        </ol>
      )}
      {past.value && <TemplateHistory one={past.value} onClose={() => (past.value = null)} onDone={asked.refresh} />}
      {dropped.value && <TemplateDrop one={dropped.value} onClose={() => (dropped.value = null)} onDone={asked.refresh} />}
    </>
  );
}

interface CardProps {
  one: Template;
  onEdit: () => void;
  onDrop: () => void;
  onPast: () => void;
}

function TemplateCard({ one, onEdit, onDrop, onPast }: CardProps) {
  return (
    <li class="rollout template" data-template={one.name}>
      <div class="rollout-head">
        <h3 class="wrap">{one.name}</h3>
        <code class="chip wrap">{one.selector || "every robot"}</code>
        <span class="rollout-facts">
          <span class="num">priority {one.priority}</span>
          <span class="num">revision {one.revision}</span>
          <span title={one.at}>{one.author}, {ageText(now.value - Date.parse(one.at))} ago</span>
        </span>
      </div>
      {one.reason && <p class="rollout-why">{one.reason}</p>}
      <details>
        <summary>{contentsOf(one)}</summary>
        <pre tabIndex={0}>{textOfDocument(one.document)}</pre>
      </details>
      <p class="template-acts">
        {can("templates.write") && <button type="button" class="button" aria-label={`Edit ${one.name}`} onClick={onEdit}>Edit…</button>}
        <button type="button" class="button" aria-label={`History of ${one.name}`} onClick={onPast}>History…</button>
        {can("templates.write") && <button type="button" class="button" aria-label={`Delete ${one.name}`} onClick={onDrop}>Delete…</button>}
      </p>
    </li>
  );
}

/** "topics 2, nodes 1": what it is about. */
export const contentsOf = ({ document }: Pick<Template, "document">) =>
  Object.entries(document).map(([section, rows]) => (isObject(rows) && section !== "budget" && section !== "agent" ? `${section} ${Object.keys(rows).length}` : section)).join(", ") || "nothing";

function Nothing() {
  return (
    <p class="nothing">
      No template yet. A template says once what a whole group of robots is to be: topics, nodes, parameters. Whatever robot has its labels, now
      or later, becomes so.
    </p>
  );
}
