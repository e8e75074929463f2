/** The page and the program together: bakes, servers, files that go to the command line, live training. */

import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { decoded, launch, open, picture, program, psnrOfPictures, run, startServing } from "./support.mjs";

const folder = mkdtempSync(join(tmpdir(), "cnerf-viewer-"));
const capture = join(folder, "capture");
const trained = join(folder, "run");
const bake = join(folder, "bake");
const quick = ["--preset", "quick", "--set", "stage1.steps=250", "--set", "stage2.patches=20", "--set", "stage2.distill_steps=40", "--set", "colorizer.reference_steps=20", "--set", "stage1.samples_per_step=16384", "--set", "stage1.steps_per_box=64", "--set", "stage2.patch_size=32", "--set", "stage2.rays_per_patch=256", "--set", "stage2.working_resolution=32", "--set", "stage2.purify.opinions=1"];
let browser, context;

async function ok(args) {
  const { code, out } = await run(args);
  assert.equal(code, 0, `cnerf ${args.join(" ")}\n${out}`);
  return out;
}

before(async () => {
  assert.ok(existsSync(program), "CNERF_PROGRAM names the program");
  await ok(["sample", "-o", capture, "--views", "12", "--width", "120", "--height", "90", "--samples-per-pixel", "1"]);
  await ok(["train", capture, "-o", trained, "--holdout", "6", ...quick]);
  await ok(["colorize", trained, "--take", "warm", ...quick]);
  const out = await ok(["bake", trained, "--format", "vdb,web", "-o", bake, "--resolution", "96", "--set", "bake.subsamples=1"]);
  assert.match(out, /web: .* bricks; .* of graphics memory/);
  browser = await launch();
  // A quarter of the pixels across, as in page.test.mjs.
  context = await browser.newContext({ viewport: { width: 480, height: 360 }, deviceScaleFactor: 0.25, acceptDownloads: true });
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

describe("cnerf view", () => {
  it("shows a bake as cnerf render does, at poses the page exported, and its box goes to cnerf bake", async () => {
    const serving = await startServing(["view", bake]);
    const page = await open(context, `${serving.url}?still`);
    await page.evaluate(() => {
      const { app, panel } = window.cnerf;
      for (const camera of [0, 4, 9]) {
        app.goToCamera(camera);
        panel.addKey();
      }
    });
    const path = join(folder, "three.json");
    const json = JSON.parse(await page.evaluate(() => window.cnerf.panel.pathJson()));
    writeFileSync(path, JSON.stringify({ ...json, frames: json.key_frames }));
    await ok(["render", bake, "--path", path, "--format", "png", "-o", join(folder, "renders")]);
    for (const [i, camera] of [0, 4, 9].entries()) {
      await page.evaluate((c) => window.cnerf.app.goToCamera(c), camera);
      const reference = await decoded(page, readFileSync(join(folder, "renders", "three", `frame_000${i}.png`)));
      const decibel = psnrOfPictures(await picture(page, reference.width, reference.height), reference);
      console.log(`# sample capture, camera ${camera}: ${decibel.toFixed(2)} dB`);
      assert.ok(decibel >= 32, `${decibel} dB`);
    }
    await page.evaluate(() => document.getElementById("clip").click());
    await page.evaluate(() => {
      const { app } = window.cnerf;
      const { low, high } = app.settings.clip;
      app.set({ clip: { low, high: [high[0], high[1], (low[2] + high[2]) / 2] } });
    });
    const box = await page.locator("#aabb").textContent();
    await ok(["bake", trained, box, "-o", join(folder, "clipped"), "--resolution", "48", "--set", "bake.subsamples=1"]);
    const clipped = JSON.parse(readFileSync(join(folder, "clipped", "manifest.json"), "utf8")).volume.bounds;
    const whole = JSON.parse(readFileSync(join(bake, "manifest.json"), "utf8")).volume;
    assert.ok(clipped.max[2] < whole.bounds.max[2] - 2 * whole.voxel_size);
    // A whole path goes to the run's renderer too.
    await ok(["render", trained, "--path", path, "--format", "png", "-o", join(folder, "of_run"), "--set", "render.steps_per_box=64"]);
    serving.child.kill("SIGINT");
    assert.equal(await serving.ended, 0);
    await page.close();
  });
  it("refuses what it cannot show, by name", async () => {
    for (const [args, code, text] of [
      [["view", join(folder, "nothing")], 66, /no such file/],
      [["view", capture], 66, /neither a web bundle .* nor a run/],
      [["view", bake, "--host", "0.0.0.0"], 64, /--token/],
      [["view", bake, "--port", "70000"], 64, /--port/],
      [["bake", trained, "--format", "webb"], 64, /'webb'/],
    ]) {
      const result = await run(args);
      assert.equal(result.code, code, result.out);
      assert.match(result.out, text);
    }
  });
});

describe("live", () => {
  it("training is followed, paused, resumed, and stopped with everything saved", async () => {
    const out = join(folder, "live");
    const serving = await startServing(["train", capture, "-o", out, "--view", "--holdout", "6", "--preset", "quick", "--set", "stage1.steps=100000", "--set", "stage1.samples_per_step=4096"]);
    const page = await open(context, serving.url);
    await page.waitForSelector('.chart[data-curve="stage 1: psnr"] path[d*="L"]', { state: "attached" });
    await page.waitForFunction(() => [...document.querySelectorAll(".previews img")].some((image) => image.naturalWidth > 0));
    const second = await open(context, serving.url);
    await page.click("#pause");
    await second.waitForFunction(() => /Paused/.test(document.getElementById("live-status").textContent));
    const progress = () => page.evaluate(async () => (await (await fetch("./live/state")).json()).fraction);
    await page.waitForTimeout(600);
    const paused = await progress();
    await page.waitForTimeout(1500);
    assert.equal(await progress(), paused);
    await second.click("#pause");
    await page.waitForFunction((from) => fetch("./live/state").then((a) => a.json()).then((s) => s.fraction > from), paused);
    await page.click("#stop");
    assert.equal(await serving.ended, 130, serving.output());
    assert.match(serving.output(), /--resume/);
    assert.ok(existsSync(join(out, "stage1.snapshot")));
    await page.waitForFunction(() => /Stopped and saved|lost/.test(document.getElementById("live-status").textContent));
  });
  it("colorizing is followed too", async () => {
    const serving = await startServing(["colorize", trained, "--take", "live", "--view", ...quick, "--set", "stage2.distill_steps=3000"]);
    const page = await open(context, serving.url);
    await page.waitForSelector('.chart[data-curve^="stage 2"]', { state: "attached" });
    await page.click("#stop");
    assert.ok([0, 130].includes(await serving.ended), serving.output());
  });
});
