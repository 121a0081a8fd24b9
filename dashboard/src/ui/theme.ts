/** The style sheet's colours for canvases, which cannot use CSS variables; they change with the colour scheme. */

import { signal } from "@preact/signals";

const NAMES = ["text", "muted", "line", "surface", "accent", "accent-2", "warn", "bad", "grid", "wall"] as const;
export type Palette = Record<(typeof NAMES)[number], string>;

function read(): Palette {
  const probe = document.body.appendChild(document.createElement("i"));
  const found = {} as Palette;
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    found[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  return found;
}

export const palette = signal<Palette>({} as Palette);

export function startTheme(): void {
  palette.value = read();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    palette.value = read();
  });
}
