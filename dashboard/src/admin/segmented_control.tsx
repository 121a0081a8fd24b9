/** A segmented control: one of a few choices, by buttons beside each other. */

interface SegmentedControlProps<T> {
  label: string;
  /** Values with their words. */
  choices: readonly (readonly [T, string])[];
  chosen: T;
  onChoose: (value: T) => void;
}

export function SegmentedControl<T extends string | number>({ label, choices, chosen, onChoose }: SegmentedControlProps<T>) {
  return (
    <div class="field" role="group" aria-label={label}>
      <span>{label}</span>
      <div class="segments">
        {choices.map(([value, word]) => (
          <button key={value} type="button" aria-pressed={value === chosen} onClick={() => onChoose(value)}>{word}</button>
        ))}
      </div>
    </div>
  );
}
