/** What every part of a twin's form is given. */

import type { JsonObject } from "../values/json";
import type { Path } from "./document";

export interface FormProps {
  /** The robot's own document, as it is being edited. */
  draft: JsonObject;
  /** What templates say, as far as the own document leaves it to them. */
  given: JsonObject;
  onChange: (draft: JsonObject) => void;
  /** A field holds what is no value, or does so no more. */
  onInvalid: (path: Path, invalid: boolean) => void;
}
