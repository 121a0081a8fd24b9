import { defineConfig } from "vite";

// `npm run dev` serves the page from Vite and everything else from a running gateway.
const gateway = "http://127.0.0.1:8080";

export default defineConfig({
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    target: "es2022",
    modulePreload: { polyfill: false },
    reportCompressedSize: true,
    // What every page has is one file: two that are packed apart take more.
    rolldownOptions: { output: { codeSplitting: { groups: [{ name: "preact", test: /node_modules.@?preact/ }] } } },
  },
  worker: { format: "es" },
  server: { proxy: { "/api": { target: gateway, ws: true, changeOrigin: true } } },
});
