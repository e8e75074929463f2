/**
 * What a bundle costs to look at, in the browser of the tests:
 *
 *   node viewer/tests/browser/measure.mjs BUNDLE [WIDTH HEIGHT]
 *
 * Prints the bytes until the poster and until the volume is seen, and the milliseconds of a frame while moving. PAGE is
 * CNERF_BUILT_PAGE, or viewer/dist.
 */

import { builtPage, launch, open, serve } from "./support.mjs";

const [bundle, width = "1280", height = "720"] = process.argv.slice(2);
const sizes = new Map();
const server = await serve([builtPage, bundle], (path, content) => {
  if (!path.startsWith("/photos/")) sizes.set(path, content.length);
  return content;
});
const browser = await launch();
const context = await browser.newContext({ viewport: { width: Number(width), height: Number(height) } });
const page = await open(context, `${server.url}?still`);
const sum = (match) => [...sizes].filter(([path]) => match(path)).reduce((total, [, size]) => total + size, 0);
const bytes = sum(() => true);
const volume = sum((path) => path.endsWith(".bin"));
console.log(`bytes to the poster:  ${bytes - volume} (uncompressed by the server)`);
console.log(`bytes to the volume:  ${bytes}, of these ${volume} of bricks`);
/** In the page: milliseconds of one frame at full resolution, as while moving; the median of several. */
function measure([width, height]) {
  const { renderer } = window.cnerf;
  const { gl } = renderer;
  const target = renderer.target(null, width, height);
  const times = [];
  for (let i = 0; i <= 5; ++i) {
    const begin = performance.now();
    renderer.bindMarch(target, 1, [0.5, 0.5], 0.5, 1 / 128);
    renderer.draw();
    const bytes = renderer.target(null, 1, 1, true);
    gl.bindFramebuffer(gl.FRAMEBUFFER, bytes.framebuffer);
    renderer.displayTo(target, 1, 1, "#000000");
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits for all of it
    renderer.free(bytes);
    if (i > 0) times.push(performance.now() - begin); // the first compiles
  }
  renderer.free(target);
  return times.sort((a, b) => a - b)[2];
}
for (const share of [1, 0.5, 0.25]) {
  const [w, h] = [Math.round(share * width), Math.round(share * height)];
  const milliseconds = await page.evaluate(measure, [w, h]);
  console.log(`frame at ${w} x ${h}:  ${milliseconds.toFixed(1)} ms`);
}
const statistics = await page.evaluate(() => window.cnerf.renderer.statistics());
console.log(`graphics:             ${statistics.renderer}`);
await browser.close();
await server.close();
