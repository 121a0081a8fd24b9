/** What every part of a rule's form is given. */

import type { RuleFault } from "../api/rules";
import type { JsonObject } from "../values/json";

export interface FormProps {
  document: JsonObject;
  faults: readonly RuleFault[];
  onChange: (document: JsonObject) => void;
}
