import { defineConfig } from "vitest/config";

// `npm run dev` serves the page from Vite and everything else from a running gateway.
const gateway = "http://127.0.0.1:8080";

// The modules of these paths, whatever a path's separator is here.
const modules = (...paths: string[]) => new RegExp(paths.join("|").replaceAll(".", "\\.").replaceAll("/", "[\\\\/]"));

// What every page has is one file: two that are packed apart take more.
const EVERYWHERE = modules(
  "node_modules/preact/",
  "node_modules/@preact/",
  "src/api/client.ts",
  "src/api/history.ts",
  "src/api/recordings.ts",
  "src/api/session.ts",
  "src/history/moment.ts",
  "src/history/span.ts",
  "src/live/age.ts",
  "src/live/backoff.ts",
  "src/live/fleet.ts",
  "src/live/link_history.ts",
  "src/live/media/decoder.ts",
  "src/live/records.ts",
  "src/live/rights.ts",
  "src/live/stream.ts",
  "src/panels/time_bar/save_button.tsx",
  "src/ui/context.ts",
  "src/ui/format.ts",
  "src/ui/parts.tsx",
  "src/ui/reasons.ts",
  "src/ui/theme.ts",
  "src/ui/url.ts",
  "src/ui/use_topic.ts",
  "src/views/account_menu.tsx",
  "src/views/app.tsx",
  "src/views/lazy.tsx",
);

// What more than one page draws plots with.
const PLOTS = modules(
  "src/history/density.ts",
  "src/history/latest.ts",
  "src/panels/plots/overlay.ts",
  "src/panels/plots/plot.tsx",
  "src/panels/plots/plot_table.ts",
  "src/panels/plots/timeline.ts",
  "src/ui/canvas.ts",
  "src/ui/hatch.ts",
  "src/ui/paint.ts",
);

export default defineConfig({
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    target: "es2022",
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
    rolldownOptions: {
      output: {
        chunkFileNames: "assets/[name]-[hash:7].js", // a page names dozens of them: a letter less in each
        codeSplitting: { groups: [{ name: "base", test: EVERYWHERE }, { name: "plot", test: PLOTS }] },
      },
    },
  },
  worker: { format: "es" },
  test: { isolate: false, setupFiles: ["src/fresh_modules.ts"] },
  server: { proxy: { "/api": { target: gateway, ws: true, changeOrigin: true } } },
});
