/** The byte budgets that the slider offers, from a radio modem to none at all. */

export const STEPS: (number | null)[] = [
  5_000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000, 20_000_000,
  50_000_000, null,
];

/** The step nearest to a budget that somebody else may have set. */
export function stepOf(bytesPerS: number | null): number {
  if (bytesPerS === null) return STEPS.length - 1;
  let best = 0;
  STEPS.forEach((step, i) => {
    if (step !== null && Math.abs(Math.log(step / bytesPerS)) < Math.abs(Math.log(STEPS[best]! / bytesPerS))) best = i;
  });
  return best;
}
