/**
 * What a bundle costs to look at, in the browser of the tests:
 *
 *   node viewer/tests/browser/measure.mjs BUNDLE [WIDTH HEIGHT]
 *   node viewer/tests/browser/measure.mjs BUNDLE --against RENDERS [--save FOLDER] [--rays 16]
 *
 * Prints the bytes until the poster and until the volume is seen, and the milliseconds of a frame while moving; or dB
 * between the page's pictures and those of `cnerf render RUN --path held-out --format png`, named as they are, which
 * --save keeps; with fewer rays per pixel than the page takes at rest it is quicker. Those pictures have the lens of
 * their camera, the page's have none: they are compared where the lens shows what the page does. The page is
 * CNERF_BUILT_PAGE, or viewer/dist.
 */

import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { builtPage, decoded, encoded, launch, open, picture, serve } from "./support.mjs";

const argument = (name) => (process.argv.includes(name) ? process.argv.splice(process.argv.indexOf(name), 2)[1] : null);
const [against, save, rays] = [argument("--against"), argument("--save"), Number(argument("--rays") ?? 16)];
const [bundle, width = "1280", height = "720"] = process.argv.slice(2);
const sizes = new Map();
const server = await serve([builtPage, bundle], (path, content) => {
  if (!path.startsWith("/photos/")) sizes.set(path, content.length);
  return content;
});
const browser = await launch();
// What is compared are pictures of a size of their own; the canvas, which draws all the while, need not be large.
const viewport = against ? { width: 64, height: 48 } : { width: Number(width), height: Number(height) };
const context = await browser.newContext({ viewport });
const page = await open(context, `${server.url}?still`);
// Bundles of earlier versions have one level, and their pages do not say when all is there.
const began = Date.now();
await page.waitForFunction(() => document.body.dataset.complete || !window.cnerf?.levels);
if (against) {
  await compare();
  await browser.close();
  await server.close();
  process.exit(0);
}
const sum = (match) => [...sizes].filter(([path]) => match(path)).reduce((total, [, size]) => total + size, 0);
const bytes = sum(() => true);
const volume = sum((path) => path.endsWith(".bin"));
console.log(`bytes to the poster:  ${bytes - volume} (uncompressed by the server)`);
const coarsest = sum((path) => path.endsWith(".bin") && !path.includes("_fine"));
console.log(`bytes to the volume:  ${bytes - volume + coarsest}, of these ${coarsest} of bricks`);
console.log(`finer levels:         ${volume - coarsest} bytes, ${Date.now() - began} ms after the first picture`);
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

/** Where a camera's lens shows a place of the picture without one, pixels. */
function throughLens({ model, fx, fy, cx, cy, distortion: k }, px, py) {
  const [x, y] = [(px - cx) / fx, (py - cy) / fy];
  const r2 = x * x + y * y;
  if (model === "opencv_fisheye") {
    const [r, a] = [Math.sqrt(r2), Math.atan(Math.sqrt(r2))];
    const bent = a * (1 + a ** 2 * (k[0] + a ** 2 * (k[1] + a ** 2 * (k[2] + a ** 2 * k[3]))));
    const scale = r > 0 ? bent / r : 1;
    return [fx * scale * x + cx, fy * scale * y + cy];
  }
  const radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return [
    fx * (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x)) + cx,
    fy * (y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y) + cy,
  ];
}

/** The picture without the lens; its alpha is 0 where the camera saw nothing. */
function withoutLens(camera, { width, height, data }) {
  const straight = Buffer.alloc(4 * width * height);
  for (let p = 0; p < width * height; ++p) {
    const [u, v] = throughLens(camera, (p % width) + 0.5, Math.floor(p / width) + 0.5).map((place) => place - 0.5);
    const [x, y] = [Math.floor(u), Math.floor(v)];
    if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height) continue;
    const at = (i, j, c) => data[4 * ((y + j) * width + x + i) + c];
    for (let c = 0; c < 3; ++c) {
      const row = (j) => at(0, j, c) + (u - x) * (at(1, j, c) - at(0, j, c));
      straight[4 * p + c] = Math.round(row(0) + (v - y) * (row(1) - row(0)));
    }
    straight[4 * p + 3] = 255;
  }
  return { width, height, data: straight };
}

/** dB between two pictures where `weight` is not 0. */
function decibel(a, b, weight = () => 1) {
  let [total, pixels] = [0, 0];
  for (let p = 0; p < a.width * a.height; ++p) {
    if (!weight(p)) continue;
    pixels += 1;
    for (let c = 0; c < 3; ++c) total += ((a.data[4 * p + c] - b.data[4 * p + c]) / 255) ** 2;
  }
  return { value: -10 * Math.log10(total / (3 * pixels)), share: pixels / (a.width * a.height) };
}

/**
 * Every camera that was rendered; also the pixels that the finest level alone decides: opaque with a clip box around
 * it, and the same with everything else.
 */
async function compare() {
  if (save) mkdirSync(save, { recursive: true });
  const { cameras, levels = [] } = JSON.parse(readFileSync(join(bundle, "bundle.json"), "utf8"));
  const means = { all: [], finest: [] };
  for (const [i, camera] of cameras.entries()) {
    const name = camera.name.replaceAll("/", "_").replace(/\.[^.]*$/, ".png");
    if (!existsSync(join(against, name))) continue;
    const rendered = await decoded(page, readFileSync(join(against, name)));
    const reference = camera.model === "pinhole" ? rendered : withoutLens(camera, rendered);
    const isSeen = (p) => reference.data[4 * p + 3] > 0;
    await page.evaluate((c) => window.cnerf.app.goToCamera(c), i);
    const shown = await picture(page, reference.width, reference.height, "#000000", rays);
    const all = decibel(shown, reference, isSeen);
    means.all.push(all.value);
    let line = `${camera.name}: ${all.value.toFixed(2)} dB`;
    if (levels.length > 1) {
      const { min: low, max: high } = levels.at(-1).cover;
      await page.evaluate((clip) => window.cnerf.app.set({ clip }), { low, high });
      const alone = await picture(page, reference.width, reference.height, "none", rays);
      await page.evaluate(() => window.cnerf.app.set({ clip: null }));
      const isFinest = (p) => isSeen(p) && alone.data[4 * p + 3] >= 250 && [0, 1, 2].every((c) => Math.abs(alone.data[4 * p + c] - shown.data[4 * p + c]) <= 8);
      const finest = decibel(shown, reference, isFinest);
      means.finest.push(finest.value);
      line += `; in the finest grid ${finest.value.toFixed(2)} dB of ${(100 * finest.share).toFixed(0)} % of the pixels`;
    }
    console.log(line);
    if (save) writeFileSync(join(save, name), await encoded(page, shown));
  }
  for (const [what, values] of Object.entries(means)) {
    if (values.length > 0) console.log(`mean, ${what}: ${(values.reduce((a, b) => a + b) / values.length).toFixed(2)} dB of ${values.length} cameras`);
  }
}
