import { defineConfig } from "vite";

// Relative addresses: the page works in any folder of any static server.
export default defineConfig({
  base: "./",
  build: {
    outDir: process.env.CNERF_PAGE_OUT ?? "dist",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 4096,
    modulePreload: { polyfill: false },
    rollupOptions: { output: { entryFileNames: "assets/[name].js", assetFileNames: "assets/[name][extname]" } },
  },
  test: { include: ["tests/unit/**/*.test.ts"], setupFiles: ["tests/unit/setup.ts"] },
} as object);
