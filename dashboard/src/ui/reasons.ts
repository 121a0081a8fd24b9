/** Why something is not there, in words. */

export const REASONS: Record<string, string> = {
  outbox_full: "outbox full: the oldest went",
  thinned: "outbox full: kept 1 of 10",
  disk_low: "disk nearly full",
  disk_full: "disk full",
  disk_slow: "disk too slow",
  disk_error: "disk error",
  disk_corrupt: "damaged on disk",
  not_sealed: "could not be sealed",
  too_large: "sample too large",
  not_held: "the robot no longer has it",
  damaged: "damaged in the store",
  purged: "deleted by retention",
};

export const reasonWords = (reason: string) => REASONS[reason] ?? reason;
