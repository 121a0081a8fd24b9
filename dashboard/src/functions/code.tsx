/** The code that runs: its files, and the text of one. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { Refusal } from "../admin/modal";
import { saidOf } from "../api/client";
import { functionsApi, type CodeFile, type CodeText, type FunctionDetail } from "../api/functions";
import { bytes } from "../ui/format";
import { place, setParam } from "../ui/url";
import { highlighted } from "./highlight";
import { LATEST } from "./words";

export function CodePart({ one }: { one: FunctionDetail }) {
  const params = place.value.params;
  const version = params.get("version") || LATEST;
  const files = useSignal<CodeFile[] | null>(null);
  const cut = useSignal(false);
  const text = useSignal<CodeText | null>(null);
  const problem = useSignal("");
  const asked = params.get("file") ?? "";
  const path = files.value?.some((file) => file.path === asked) ? asked : mainFile(files.value ?? [], one.handler);
  const reading = (work: Promise<void>) => void work.then(() => (problem.value = ""), (error: unknown) => (problem.value = saidOf(error)));
  useEffect(() => {
    let gone = false;
    files.value = text.value = null;
    reading(
      functionsApi.code(one.name, version).then((found) => {
        if (gone) return;
        files.value = found.files;
        cut.value = found.truncated;
      }),
    );
    return () => void (gone = true);
  }, [one.name, version]);
  useEffect(() => {
    let gone = false;
    if (path) reading(functionsApi.text(one.name, version, path).then((found) => void (gone || (text.value = found))));
    return () => void (gone = true);
  }, [path, version]);
  return (
    <>
      <div class="alert-filters">
        <select aria-label="Version" value={version} onChange={(event) => setParam("version", event.currentTarget.value, LATEST)}>
          <option value={LATEST}>{LATEST}</option>
          {[...one.published].reverse().map((row) => <option key={row.version} value={row.version}>version {row.version}</option>)}
        </select>
        <span class="hint">{bytes(one.code_bytes)} zipped</span>
      </div>
      <Refusal text={problem.value} />
      {files.value === null ? !problem.value && <p class="quiet">Asking the gateway…</p> : (
        <div class="fn-code card">
          <nav aria-label="Files">
            {files.value.map((file) => (
              <button key={file.path} type="button" aria-current={file.path === path ? "true" : undefined} onClick={() => setParam("file", file.path)}>
                <span>{file.path}</span><small class="num">{bytes(file.size_bytes)}</small>
              </button>
            ))}
            {cut.value && <p class="hint pad-in">There are more files than are listed.</p>}
          </nav>
          {text.value && text.value.path === path ? <Text text={text.value} /> : <p class="hint pad-in">{path ? "…" : "Choose a file."}</p>}
        </div>
      )}
    </>
  );
}

/** The handler's own file: "handler.handler" is in handler.py. */
function mainFile(files: CodeFile[], handler: string): string {
  const wanted = `${handler.split(".").slice(0, -1).join("/")}.py`;
  return (files.find(({ path }) => path === wanted) ?? files.find(({ path }) => path.endsWith(".py")) ?? files[0])?.path ?? "";
}

function Text({ text }: { text: CodeText }) {
  const pieces = useMemo(() => highlighted(text.path, text.text), [text]);
  return (
    <div class="fn-source" tabIndex={0} role="region" aria-label={text.path}>
      <pre data-file={text.path}>{pieces.map(([token, said], i) => (token ? <span key={i} class={`code-${token}`}>{said}</span> : said))}</pre>
      {text.truncated && <p class="hint pad-in">This is its beginning; the file goes on.</p>}
    </div>
  );
}
