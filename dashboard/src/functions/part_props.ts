/** What every part of a function's page is given. */

import type { Asked } from "../admin/use_list";
import type { FunctionDetail } from "../api/functions";

export interface PartProps {
  one: FunctionDetail;
  asked: Asked<FunctionDetail>;
}
