/** docs/tutorial-colour.md in a real browser, on the sample capture. CNERF_PICTURES names a folder for its pictures. */

import assert from "node:assert/strict";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { drawStroke, launch, open, patience, program, run, startServing } from "./support.mjs";

const folder = mkdtempSync(join(tmpdir(), "cnerf-tutorial-"));
const [capture, trained] = [join(folder, "capture"), join(folder, "run")];
const long = process.env.CNERF_PICTURES ? [] : ["--set", "stage1.steps=250", "--set", "stage1.samples_per_step=16384", "--set", "stage1.steps_per_box=64", "--set", "stage2.grid.levels=4", "--set", "stage2.grid.log2_rows=12", "--set", "stage2.grid.finest_resolution=64", "--set", "render.steps_per_box=128", "--set", "bake.resolution=48"];
const size = process.env.CNERF_PICTURES ? ["--views", "24"] : ["--views", "10", "--width", "120", "--height", "90", "--samples-per-pixel", "1"];
let browser, page, serving;

async function ok(args) {
  const { code, out } = await run(args);
  assert.equal(code, 0, `cnerf ${args.join(" ")}\n${out}`);
}
const until = (what, argument) => page.waitForFunction(what, argument, { timeout: patience });
const idle = () => until(() => window.cnerf.session.state.task === "");
const state = () => page.evaluate(() => window.cnerf.session.state);
async function shot(name) {
  if (process.env.CNERF_PICTURES) await page.screenshot({ path: join(process.env.CNERF_PICTURES, `${name}.png`) });
}
const settled = () => until(() => window.cnerf.studio.field.settled && [...document.querySelectorAll(".thumbnail img")].every((i) => i.complete));

/** Mean difference of the channels of the frame that is shown. */
const colorfulness = () =>
  page.evaluate(async () => {
    const { session } = window.cnerf;
    const scene = await (await fetch("./studio/scene")).json();
    const { position, rotation, lens } = scene.views[scene.home];
    const answer = await fetch("./studio/frame", { method: "POST", headers: { "X-Cnerf": "1", "X-Cnerf-Client": `${session.api?.client ?? "tutorial"}x9` }, body: JSON.stringify({ position, rotation, lens, sides: ["now"] }) });
    const picture = await createImageBitmap(await answer.blob());
    const canvas = new OffscreenCanvas(picture.width, picture.height);
    const context = canvas.getContext("2d");
    context.drawImage(picture, 0, 0);
    const { data } = context.getImageData(0, 0, picture.width, picture.height);
    let sum = 0;
    for (let i = 0; i < data.length; i += 4) sum += Math.max(data[i], data[i + 1], data[i + 2]) - Math.min(data[i], data[i + 1], data[i + 2]);
    return sum / (data.length / 4);
  });

const draw = (points) => drawStroke(page, points);

before(async () => {
  assert.ok(existsSync(program), "CNERF_PROGRAM names the program");
  await ok(["sample", "-o", capture, ...size]);
  browser = await launch();
  serving = await startServing(["studio", "-o", trained, "--preset", "quick", "--set", "capture.holdout=8", ...long]);
  // A quarter of the pixels across, where nobody looks at them: frames are drawn from the field.
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, deviceScaleFactor: process.env.CNERF_PICTURES ? 1 : 0.25, reducedMotion: "reduce", acceptDownloads: true });
  page = await open(context, `${serving.url}?still`);
});
after(async () => {
  serving?.child.kill("SIGINT");
  await serving?.ended;
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

describe("the tutorial", () => {
  let painted;
  it("begins with nothing: a folder is dropped, and refused by name what is not understood", async () => {
    await page.waitForSelector("#reception");
    await page.setInputFiles("#folder", capture);
    await until(() => !document.getElementById("build").disabled);
    await shot("studio-drop");
    const bad = await page.evaluate(async () => (await fetch("./studio/arrivals?name=..%2Fescape.png&offset=0", { method: "PUT", headers: { "X-Cnerf": "1" }, body: "x" })).status);
    assert.equal(bad, 400);
    assert.ok(!existsSync(join(folder, "escape.png")));
  });
  it("trains in front of it", async () => {
    await page.click("#build");
    await until(() => window.cnerf?.session?.state.stage === "training" && window.cnerf.session.state.figures.psnr > 0);
    await page.waitForFunction(() => document.body.dataset.ready === "yes", undefined, { timeout: patience });
    if (process.env.CNERF_PICTURES) await until(() => window.cnerf.session.state.fraction > 0.4 && window.cnerf.studio.field.settled);
    await shot("studio-training");
    await page.evaluate(() => window.cnerf.session.order({ order: "stop" }));
    await until(() => window.cnerf.session.state.stage === "field" || window.cnerf.session.state.task === "");
    if ((await state()).stage === "training") await page.evaluate(() => window.cnerf.session.order({ order: "train" }));
    await until(() => window.cnerf.session.state.ready);
    await idle();
  });
  it("shows the field in grey, and nobody else may work on the run", async () => {
    assert.ok((await colorfulness()) < 3);
    const second = await run(["studio", trained, "--no-browser"]);
    assert.equal(second.code, 75, second.out);
    assert.match(second.out, /strokes/);
    await settled();
    await shot("studio-grey");
  });
  it("paints a photograph, and shows what the strokes will colour", async () => {
    const view = await page.evaluate(async () => (await (await fetch("./studio/scene")).json()).home);
    await page.evaluate((i) => window.cnerf.studio.paint(i), view);
    await page.waitForSelector(`[data-photo="${view}"]`);
    for (const [color, points] of [["#4f7f3a", [[0.37, 0.24], [0.38, 0.36], [0.36, 0.46], [0.4, 0.5]]], ["#c03a2b", [[0.49, 0.46], [0.505, 0.53]]], ["#a8753c", [[0.24, 0.62], [0.36, 0.72], [0.5, 0.75], [0.7, 0.72], [0.78, 0.62]]]]) {
      await page.evaluate((c) => window.cnerf.session.brush.set({ color: c, size: 0.04, reach: 2, tool: "brush" }), color);
      await draw(points);
    }
    await until(() => window.cnerf.session.strokes.isSaved);
    painted = JSON.parse(readFileSync(join(trained, "strokes", "strokes.json"), "utf8"));
    assert.equal(painted.strokes.length, 3);
    const reached = await page.evaluate(async (i) => {
      const picture = await createImageBitmap(await (await fetch(`./studio/reach/${i}`)).blob());
      const context = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
      context.drawImage(picture, 0, 0);
      const { data } = context.getImageData(0, 0, picture.width, picture.height);
      return data.filter((_, i) => i % 4 === 3).reduce((n, alpha) => n + (alpha > 0), 0) / (data.length / 4);
    }, view);
    assert.ok(reached > 0.02, `${reached} of the view`);
    await shot("studio-paint");
  });
  it("paints where the camera stands, and takes a picture that was painted elsewhere", async () => {
    await page.keyboard.press("Escape");
    await page.evaluate(() => {
      const { field } = window.cnerf.studio;
      field.setView({ ...field.view, position: field.view.position.map((v) => v * 0.9) });
    });
    await page.focus("#field");
    await page.keyboard.press("Enter");
    const views = await page.evaluate(() => window.cnerf.session.scene.views.length);
    await page.waitForSelector(`[data-photo="${views}"]`, { timeout: patience });
    await page.evaluate(() => window.cnerf.session.brush.set({ color: "#3b5fa0", size: 0.05, reach: 1, tool: "brush" }));
    await draw([[0.62, 0.35], [0.66, 0.4]]);
    await until(() => window.cnerf.session.strokes.isSaved);
    const list = JSON.parse(readFileSync(join(trained, "strokes", "strokes.json"), "utf8"));
    assert.deepEqual([list.viewpoints.length, list.strokes.at(-1).view], [1, list.viewpoints[0].name]);
    await page.keyboard.press("Escape");

    const photo = await page.evaluate(() => window.cnerf.session.scene.home);
    await page.evaluate((i) => window.cnerf.studio.paint(i), photo);
    await page.waitForSelector(`[data-photo="${photo}"]`);
    await page.evaluate(async (i) => {
      const { width, height } = window.cnerf.session.scene.views[i];
      const canvas = new OffscreenCanvas(width, height);
      const context = canvas.getContext("2d");
      context.fillStyle = "#a04080";
      context.fillRect(0.1 * width, 0.75 * height, 0.05 * width, 0.05 * height);
      await window.cnerf.session.sendPainted(new File([await canvas.convertToBlob({ type: "image/png" })], "gimp.png", { type: "image/png" }));
    }, photo);
    await until(() => window.cnerf.session.strokes.list.some((stroke) => stroke.kind === "picture"));
    painted = JSON.parse(readFileSync(join(trained, "strokes", "strokes.json"), "utf8"));
    assert.equal(painted.strokes.length, 5);
    assert.ok(existsSync(join(trained, "strokes", "painted", `${painted.strokes.at(-1).picture}.png`)));
  });
  it("colours all views, and keeps a take", async () => {
    await page.keyboard.press("c");
    await until(() => window.cnerf.session.state.unkept);
    await idle();
    assert.ok((await colorfulness()) > 3, "the scene has colours");
    await page.keyboard.press("Escape");
    await page.evaluate(() => window.cnerf.session.order({ order: "keep", name: "evening" }));
    await until(() => window.cnerf.session.state.takes.some((take) => take.name === "evening"));
    await idle();
    await settled();
    await shot("studio-colour");
  });
  it("makes the take again without a browser, bit for bit", async () => {
    await ok(["colorize", trained, "--replay", "evening", "--take", "again"]);
    const [a, b] = ["evening", "again"].map((take) => readFileSync(join(trained, "takes", take, "take.snapshot")));
    assert.ok(a.equals(b));
  });
  it("finishes what is shown, without touching the take", async () => {
    const before = await colorfulness();
    await page.evaluate(() => window.cnerf.session.order({ order: "finish", saturation: 0.2, hue: 0, exposure: 0 }));
    assert.ok((await colorfulness()) < 0.6 * before);
    await page.evaluate(() => window.cnerf.session.order({ order: "finish", saturation: 1, hue: 0, exposure: 0 }));
    assert.equal((await state()).unkept, false);
  });
  it("writes the volume, and the photographs in colour", async () => {
    await page.evaluate(() => window.cnerf.session.order({ order: "photographs", format: "png" }));
    await until(() => window.cnerf.session.state.downloads.length > 0);
    await idle();
    const { downloads, failed, message } = await state();
    assert.equal(failed, false, message);
    assert.equal(downloads.length, size[1] === "24" ? 24 : 10);
    await page.evaluate(() => window.cnerf.session.order({ order: "bake", formats: ["vdb"] }));
    await until(() => window.cnerf.session.state.blender);
    await idle();
    assert.match((await state()).blender, /blender --python/);
    const [file] = (await state()).downloads;
    const bytes = await page.evaluate(async (address) => (await (await fetch(address)).arrayBuffer()).byteLength, file.address);
    assert.equal(bytes, file.bytes);
  });
  it("loses nothing when the program is killed while it colours", async () => {
    await page.evaluate(() => window.cnerf.session.order({ order: "colour" }));
    await until(() => window.cnerf.session.state.task === "colour");
    serving.child.kill("SIGKILL");
    await serving.ended;
    serving = await startServing(["studio", trained, "--take", "evening"]);
    const answer = await fetch(`${serving.url}studio/strokes`);
    assert.deepEqual((await answer.json()).strokes, painted.strokes);
    const { takes } = await (await fetch(`${serving.url}studio/state`)).json();
    assert.deepEqual(takes.map((take) => take.name).sort(), ["again", "evening"]);
  });
});
