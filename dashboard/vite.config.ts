import { defineConfig } from "vitest/config";

// `npm run dev` serves the page from Vite and everything else from a running gateway.
const gateway = "http://127.0.0.1:8080";

// What every page has is one file: two that are packed apart take more.
const EVERYWHERE = new RegExp(
  [
    "node_modules.@?preact",
    "src.api.(client|session|history|recordings)\\.ts",
    "src.history.(moment|span)\\.ts",
    "src.live.(age|backoff|decoder|fleet|link_history|records|rights|stream)\\.ts",
    "src.panels.save_button",
    "src.ui.(context|format|parts|reasons|theme|url|use_topic)\\.tsx?",
    "src.views.(account_menu|app|lazy)\\.",
  ].join("|"),
);

// What more than one page draws plots with.
const PLOTS = /src.(panels.(overlay|plot|plot_table|timeline)|ui.(canvas|hatch|paint)|history.(density|latest))\.tsx?/;

export default defineConfig({
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    target: "es2022",
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
    rolldownOptions: { output: { codeSplitting: { groups: [{ name: "base", test: EVERYWHERE }, { name: "plot", test: PLOTS }] } } },
  },
  worker: { format: "es" },
  test: { isolate: false, setupFiles: ["src/fresh_modules.ts"] },
  server: { proxy: { "/api": { target: gateway, ws: true, changeOrigin: true } } },
});
