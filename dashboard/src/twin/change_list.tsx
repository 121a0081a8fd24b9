/** Changes of a document, each as what goes and what comes: by colour, sign and word. */

import { shown } from "../values/value_text";
import { SECTIONS } from "./compare";
import { pathOf, unfolded, type Change } from "./document";

const SIGNS: Record<Change["verb"], [string, string]> = { add: ["+", "added"], remove: ["−", "removed"], change: ["~", "changed"] };

interface Group {
  title: string;
  name: string;
  changes: { change: Change; key: string }[];
}

/** Changes of one row of a section stand together. */
function grouped(changes: readonly Change[]): Group[] {
  const groups = new Map<string, Group>();
  for (const change of changes.flatMap(unfolded)) {
    const [section = "", ...rest] = pathOf(change.path);
    const single = section === "budget" || section === "agent";
    const name = single ? "" : (rest[0] ?? "");
    const id = `${section}/${name}`;
    const group = groups.get(id) ?? { title: SECTIONS[section] ?? section, name, changes: [] };
    groups.set(id, group);
    group.changes.push({ change, key: (single ? rest : rest.slice(1)).join(".") || (section === "lifecycle" ? "state" : "") });
  }
  return [...groups.values()];
}

export function ChangeList({ changes, more = 0, none = "Nothing changes." }: { changes: readonly Change[]; more?: number; none?: string }) {
  if (changes.length === 0) return <p class="hint" data-changes="0">{none}</p>;
  return (
    <div class="changes" data-changes={changes.length}>
      {grouped(changes).map(({ title, name, changes: rows }) => (
        <section key={`${title} ${name}`}>
          <h3>{title}{name && <> <span class="mono">{name}</span></>}</h3>
          <ul>
            {rows.map(({ change, key }) => <ChangeRow key={change.path} change={change} name={key} />)}
          </ul>
        </section>
      ))}
      {more > 0 && <p class="hint">and {more} more changes</p>}
    </div>
  );
}

function ChangeRow({ change, name }: { change: Change; name: string }) {
  const [sign, word] = SIGNS[change.verb];
  return (
    <li class={`change change-${change.verb}`} data-path={change.path}>
      <i aria-hidden="true">{sign}</i>
      <span class="visually-hidden">{word}</span>
      <span class="change-key mono">{name}</span>
      <span class="change-values mono">
        {change.verb !== "add" && <del>{shown(change.old)}</del>}
        {change.verb === "change" && <span class="arrow" aria-label="becomes">→</span>}
        {change.verb !== "remove" && <ins>{shown(change.new)}</ins>}
      </span>
    </li>
  );
}
