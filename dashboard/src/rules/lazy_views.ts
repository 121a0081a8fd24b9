/** What the Rules page shows beside its list, in one piece of code. */

export { HooksPart } from "./hooks";
export { SchedulesPart } from "./schedules";
