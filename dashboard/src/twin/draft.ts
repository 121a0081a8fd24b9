/** What a person makes of the robot's own document before anything is stored: a form's document, or a text. */

import { same, isObject, readJson, writeJson, type JsonObject } from "../values/json";

export interface Draft {
  /** The own document that it was begun from. */
  base: JsonObject;
  revision: number;
  edition: number;
  document: JsonObject;
  /** The JSON as it is typed; null while the form is shown. */
  text: string | null;
  /** Fields that hold what is no value. */
  invalid: ReadonlySet<string>;
}

export const begun = ({ own, revision, edition }: { own: JsonObject; revision: number; edition: number }): Draft => ({
  base: own,
  revision,
  edition,
  document: own,
  text: null,
  invalid: new Set(),
});

/** The document of a text, or why it is none. */
export function documentOf(text: string): { document: JsonObject } | { problem: string } {
  try {
    const found = readJson(text.trim() === "" ? "{}" : text);
    return isObject(found) ? { document: found } : { problem: "The document is an object: it begins with {." };
  } catch (error) {
    return { problem: error instanceof Error ? error.message : String(error) };
  }
}

export const textOfDocument = (document: JsonObject) => writeJson(document, 2);

/** Why the draft cannot be tried, or "". */
export function draftProblem({ text, invalid }: Draft): string {
  if (text === null) return invalid.size > 0 ? `Not a value yet: ${[...invalid].join(", ")}` : "";
  const found = documentOf(text);
  return "problem" in found ? found.problem : "";
}

/** The document that the draft stands for; its base where its text is none. */
export function drafted({ text, document }: Draft): JsonObject {
  if (text === null) return document;
  const found = documentOf(text);
  return "document" in found ? found.document : document;
}

export const untouched = (draft: Draft) => same(draft.base, drafted(draft));
