/** The views of the Rules page beside its list, in one lazily loaded chunk. */

export { HooksPart } from "./hooks";
export { SchedulesPart } from "./schedules";
