/** What the Alerts page has beside alerts: these come together, when one of them is first shown. */

export { ChecksPart } from "./checks";
export { LearningPart } from "./learning";
export { SilencesPart } from "./silences";
