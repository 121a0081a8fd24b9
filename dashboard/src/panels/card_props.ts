/** What a card is given that shows all topics of its kind. */

import type { Robot, Topic } from "../api/types";

export interface CardProps {
  robot: Robot;
  topics: Topic[];
}
