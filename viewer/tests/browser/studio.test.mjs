/** The studio in a real browser. CNERF_STUDIO_URL names a running server; without it a stand-in answers. */

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { builtPage, launch, open, patience } from "./support.mjs";
import { png, StudioMock } from "./studio_mock.mjs";

const real = process.env.CNERF_STUDIO_URL;
const standIn = real ? "only against the stand-in" : false;
const noReal = real ? "only where the server can be ended" : false;
let browser, context, mock, url, page;

before(async () => {
  browser = await launch();
  context = await browser.newContext({ viewport: { width: 1280, height: 720 }, reducedMotion: "reduce" });
  if (!real) mock = await new StudioMock(builtPage, { steps: 8 }).start();
  url = real ?? mock.url;
  page = await open(context, `${url}?still`);
  await page.waitForFunction(() => window.cnerf?.session.state.ready);
});
after(async () => {
  await browser?.close();
  await mock?.close();
});

const until = (shown, what, argument) => shown.waitForFunction(what, argument, { timeout: patience });
const saved = (shown) => until(shown, () => window.cnerf.session.strokes.isSaved);
/** What the server has; it leaves out what is 0, false or empty. */
const strokesOf = async (shown) => (await shown.evaluate(async () => (await fetch("./studio/strokes", { cache: "no-store" })).json())).strokes.map((stroke) => ({ softness: 0, hidden: false, points: [], ...stroke }));
const shownStrokes = (shown) => shown.evaluate(() => window.cnerf.session.strokes.list);
async function paintOn(shown, view) {
  await shown.evaluate((i) => window.cnerf.studio.paint(i), view);
  await shown.waitForSelector(`[data-photo="${view}"]`);
}
/** A place of the photograph, as shares of it, on the screen. */
const place = (shown, u, v) =>
  shown.evaluate(([x, y]) => {
    const { easel } = window.cnerf.studio;
    const box = easel.canvas.getBoundingClientRect();
    return { x: box.left + easel.corner.x + x * easel.photo.width * easel.scale, y: box.top + easel.corner.y + y * easel.photo.height * easel.scale };
  }, [u, v]);
async function draw(shown, points) {
  const places = [];
  for (const [u, v] of points) places.push(await place(shown, u, v));
  await shown.mouse.move(places[0].x, places[0].y);
  await shown.mouse.down();
  for (const { x, y } of places) await shown.mouse.move(x, y, { steps: 6 });
  await shown.mouse.up();
}
/** sRGB that is seen at a place of the photograph, and the grey below it. */
const seen = (shown, u, v) =>
  shown.evaluate(([x, y]) => {
    const { layer } = window.cnerf.studio.easel;
    const [px, py] = [Math.floor(x * layer.width), Math.floor(y * layer.height)];
    return { color: layer.colorAt(px, py), grey: layer.grey[py * layer.width + px] };
  }, [u, v]);
const tint = (shown, kind) => shown.evaluate((k) => window.cnerf.studio.easel.setTint(k), kind);
const brush = (shown, settings) => shown.evaluate((s) => window.cnerf.session.brush.set(s), settings);
async function clear(shown) {
  await shown.evaluate(() => window.cnerf.session.strokes.change([]));
  await saved(shown);
}
/** Drops a file on what a selector finds. */
const drop = (shown, selector, name, bytes, type = "image/png") =>
  shown.evaluate(([at, file, list, kind]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([new Uint8Array(list)], file, { type: kind }));
    for (const what of ["dragover", "drop"]) document.querySelector(at).dispatchEvent(new DragEvent(what, { dataTransfer: transfer, bubbles: true, cancelable: true }));
  }, [selector, name, [...bytes], type]);
/** A PNG with a red field in its upper left. */
function redPaint({ width, height }) {
  const paint = Buffer.alloc(4 * width * height);
  for (let y = 20; y < 80; ++y) for (let x = 20; x < 100; ++x) paint.set([200, 40, 30, 255], 4 * (y * width + x));
  return png(width, height, 4, paint);
}
const luminance = ([r, g, b]) => {
  const [x, y, z] = [r, g, b].map((v) => (v <= 10.31475 ? v / 3294.6 : ((v / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * x + 0.7152 * y + 0.0722 * z;
};

describe("the scene", () => {
  it("is drawn, with a photograph of each view below it", async () => {
    await until(page, () => window.cnerf.studio.field.settled);
    const counts = await page.evaluate(() => [document.querySelectorAll("#strip .thumbnail").length, window.cnerf.session.scene.views.length]);
    assert.equal(counts[0], counts[1]);
    const varied = await page.evaluate(() => {
      const canvas = document.getElementById("field");
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      return new Set(data.filter((_, i) => i % 4 === 0)).size;
    });
    assert.ok(varied > 20, `${varied} different codes of red`);
    await until(page, () => document.querySelector("#strip .thumbnail img").naturalWidth > 0);
  });
  it("turns with a drag, coarse first, and is sharp at rest", async () => {
    const before = await page.evaluate(() => window.cnerf.studio.field.view.position);
    const widths = [];
    const listen = (request) => request.url().endsWith("/studio/frame") && widths.push(JSON.parse(request.postData()).lens.width);
    page.on("request", listen);
    await page.mouse.move(400, 300);
    await page.mouse.down();
    await page.mouse.move(520, 320, { steps: 8 });
    await page.mouse.up();
    await until(page, () => window.cnerf.studio.field.settled);
    page.off("request", listen);
    assert.notDeepEqual(await page.evaluate(() => window.cnerf.studio.field.view.position), before);
    const full = await page.evaluate(() => document.getElementById("field").width);
    assert.equal(widths.at(-1), full);
    assert.ok(widths[0] <= full);
  });
  it("has a wipe that follows pointer and keys and asks for both sides", async () => {
    const request = page.waitForRequest((r) => r.url().endsWith("/studio/frame") && JSON.parse(r.postData()).sides.length === 2, { timeout: patience });
    await page.focus("#wipe-handle");
    await page.keyboard.press("ArrowRight");
    const handle = await page.locator("#wipe-handle").boundingBox();
    await page.mouse.move(handle.x + handle.width / 2, handle.y + handle.height / 2);
    await page.mouse.down();
    await page.mouse.move(474, 300, { steps: 4 });
    await page.mouse.up();
    assert.ok(Math.abs((await page.evaluate(() => window.cnerf.studio.field.wipe)) - 0.5) < 0.02);
    assert.deepEqual(JSON.parse((await request).postData()).sides, ["", "now"]);
    await page.evaluate(() => window.cnerf.studio.field.setWipe(0));
  });
});

describe("painting", () => {
  it("colours the photograph at once, keeps its light, and is saved", async () => {
    await clear(page);
    await paintOn(page, 1);
    await brush(page, { tool: "brush", color: "#c03020", size: 0.08, softness: 0, exact: false });
    const asked = page.waitForRequest((r) => r.method() === "POST" && r.url().endsWith("/studio/reach"), { timeout: patience });
    await draw(page, [[0.4, 0.5], [0.5, 0.55], [0.6, 0.5]]);
    const { color, grey } = await seen(page, 0.5, 0.55);
    assert.ok(color && color[0] > color[2] + 8, `red is seen: ${color}`);
    assert.ok(Math.abs(luminance(color) - luminance([grey, grey, grey])) < 0.006, `${color} on ${grey}`);
    await asked;
    await saved(page);
    const [stroke] = await strokesOf(page);
    assert.equal(stroke.kind, "paint");
    assert.equal(stroke.color, "#c03020");
    assert.ok(stroke.points.length >= 3);
    assert.ok(Math.abs(stroke.points[0][0] - 0.4) < 0.01 && Math.abs(stroke.points.at(-1)[1] - 0.5) < 0.01);
  });
  it("colours everything from grey, unless the user says otherwise", async () => {
    const everywhere = async () => (await page.evaluate(async () => (await fetch("./studio/strokes", { cache: "no-store" })).json())).everywhere ?? false;
    const box = page.locator("#everywhere");
    assert.deepEqual([await box.isChecked(), await everywhere()], [true, true]);
    const asked = page.waitForRequest((r) => r.method() === "PUT" && r.url().endsWith("/studio/strokes"), { timeout: patience });
    await box.click();
    assert.equal(JSON.parse((await asked).postData()).everywhere, false);
    await saved(page);
    assert.deepEqual([await box.isChecked(), await everywhere()], [false, false]);
    await page.keyboard.press("Control+z");
    await saved(page);
    assert.deepEqual([await box.isChecked(), await everywhere(), (await shownStrokes(page)).length], [true, true, 1], "undone, and no stroke with it");
  });
  it("shows what strokes will reach in the thumbnails", () =>
    until(page, () => [...document.querySelectorAll("#strip .reach")].some((image) => image.naturalWidth > 0)));
  it("is undone and redone by keys and buttons", async () => {
    await page.keyboard.press("k");
    await draw(page, [[0.2, 0.3], [0.25, 0.35]]);
    assert.deepEqual((await shownStrokes(page)).map((s) => s.kind), ["paint", "grey"]);
    await page.keyboard.press("Control+z");
    await page.keyboard.press("Control+z");
    assert.equal((await shownStrokes(page)).length, 0);
    // The reach that was shown goes once the server knows.
    await until(page, () => {
      const { layer } = window.cnerf.studio.easel;
      return layer.colorAt(Math.floor(0.5 * layer.width), Math.floor(0.55 * layer.height)) === null;
    });
    await page.keyboard.press("Control+y");
    await page.keyboard.press("Control+Shift+z");
    assert.equal((await shownStrokes(page)).length, 2);
    await page.click("#undo");
    await saved(page);
    assert.deepEqual((await strokesOf(page)).map((s) => s.kind), ["paint"]);
  });
  it("has lines, fills and an eraser on their keys", async () => {
    await clear(page);
    await page.focus("#easel");
    await page.keyboard.press("l");
    await draw(page, [[0.2, 0.7], [0.3, 0.9], [0.6, 0.7]]);
    await page.keyboard.press("g");
    await draw(page, [[0.5, 0.5], [0.55, 0.5]]);
    await page.keyboard.press("e");
    await draw(page, [[0.4, 0.7], [0.41, 0.7]]);
    await saved(page);
    const strokes = await strokesOf(page);
    assert.deepEqual(strokes.map((s) => [s.kind, s.points.length > 1]), [["paint", true], ["paint", false], ["erase", true]]);
    assert.equal(strokes[0].points.length, 2, "a line has two ends");
    assert.equal((await seen(page, 0.4, 0.7)).color, null, "erased");
  });
  it("picks the colour of a stroke", async () => {
    await brush(page, { color: "#204080" });
    await page.keyboard.press("i");
    const { x, y } = await place(page, 0.22, 0.7);
    await page.mouse.click(x, y);
    assert.equal(await page.evaluate(() => window.cnerf.session.brush.settings.color), "#c03020");
    await page.keyboard.press("b");
  });
  it("has a list that hides, recolours and deletes", async () => {
    const rows = page.locator("#strokes li");
    await until(page, () => document.querySelectorAll("#strokes li").length === 3);
    await brush(page, { color: "#204080" });
    await rows.last().getByRole("button", { name: "Give it the brush's colour" }).click();
    await rows.last().getByRole("button", { name: "Hide" }).click();
    await rows.first().getByRole("button", { name: "Delete" }).click();
    await saved(page);
    assert.deepEqual((await strokesOf(page)).map((s) => [s.color, s.hidden]), [["#204080", true], ["#c03020", false]]);
  });
  it("loses no stroke of another photograph to the Delete key", async () => {
    const selected = await page.evaluate(() => window.cnerf.session.selected = window.cnerf.session.strokes.list[0].id);
    const before = (await shownStrokes(page)).length;
    await paintOn(page, 3);
    await page.keyboard.press("Delete");
    assert.equal((await shownStrokes(page)).length, before);
    await paintOn(page, 1);
    await page.keyboard.press("Delete");
    assert.ok((await shownStrokes(page)).every((stroke) => stroke.id !== selected));
    assert.equal((await shownStrokes(page)).length, before - 1);
  });
  it("works by keyboard alone", async () => {
    await clear(page);
    await page.keyboard.press("Escape");
    await page.evaluate(() => window.cnerf.studio.field.goToCamera(2));
    await page.focus("#field");
    await page.keyboard.press("Enter");
    await page.waitForSelector('[data-photo="2"]');
    await page.keyboard.press("b");
    for (let i = 0; i < 3; ++i) await page.keyboard.press("ArrowRight");
    await page.keyboard.press("Enter");
    await saved(page);
    const strokes = await strokesOf(page);
    assert.equal(strokes.length, 1);
    assert.equal(strokes[0].points.length, 1);
    const size = await page.evaluate(() => window.cnerf.session.brush.settings.size);
    await page.keyboard.press("]");
    assert.ok((await page.evaluate(() => window.cnerf.session.brush.settings.size)) > size);
  });
  it("zooms to single pixels and back", async () => {
    const zoom = () => page.evaluate(() => window.cnerf.studio.easel.zoom);
    const fitting = await zoom();
    const { x, y } = await place(page, 0.5, 0.5);
    await page.mouse.move(x, y);
    for (let i = 0; i < 20; ++i) await page.mouse.wheel(0, -120);
    await until(page, () => window.cnerf.studio.easel.zoom > 8);
    const centre = await place(page, 0.5, 0.5);
    assert.ok(Math.hypot(centre.x - x, centre.y - y) < 1, "the place under the pointer stays");
    await page.keyboard.press("0");
    assert.ok(Math.abs((await zoom()) - fitting) < 1e-6);
  });
  it("leaves out a stroke that Escape ends", async () => {
    const before = (await shownStrokes(page)).length;
    const { x, y } = await place(page, 0.3, 0.3);
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 30, y, { steps: 3 });
    await page.keyboard.press("Escape");
    await page.mouse.up();
    assert.equal((await shownStrokes(page)).length, before);
    assert.equal(await page.evaluate(() => window.cnerf.session.photo), 2);
  });
  it("takes away what is undone while a stroke is under way", async () => {
    await clear(page);
    await tint(page, "none");
    await draw(page, [[0.2, 0.2], [0.3, 0.2]]);
    assert.ok((await seen(page, 0.25, 0.2)).color);
    const { x, y } = await place(page, 0.6, 0.6);
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.evaluate(() => window.cnerf.session.strokes.undo());
    await page.mouse.move(x + 30, y, { steps: 3 });
    await page.mouse.up();
    assert.equal((await seen(page, 0.25, 0.2)).color, null);
    assert.ok((await seen(page, 0.6, 0.6)).color);
    await tint(page, "reach");
  });
});

describe("what to paint", () => {
  it("is marked on the photographs below, in reach of the keyboard", async () => {
    await clear(page);
    await page.keyboard.press("Escape");
    await page.focus("#which-view");
    await page.keyboard.press("Enter");
    await until(page, () => window.cnerf.session.state.key_views.length > 0 && window.cnerf.session.state.task === "");
    const views = await page.evaluate(() => window.cnerf.session.state.key_views.map((one) => one.view));
    const marked = await page.evaluate(() => [...document.querySelectorAll("#strip .rank:not([hidden])")].map((node) => [node.parentElement.dataset.view, node.textContent]).sort((a, b) => a[1] - b[1]));
    assert.deepEqual(marked, views.map((view, i) => [String(view), String(i + 1)]));
    const first = page.locator(`#strip .thumbnail[data-view="${views[0]}"]`);
    assert.match(await first.getAttribute("aria-label"), /suggestion 1, tells of \d+ % of the scene/);
    assert.equal(await page.evaluate(() => document.activeElement.dataset.view), String(views[0]), "the keyboard is there");
    await page.keyboard.press("Enter");
    await page.waitForSelector(`[data-photo="${views[0]}"]`);
  });
  it("leaves out what is painted", async () => {
    const { photo } = await page.evaluate(() => ({ photo: window.cnerf.session.photo }));
    await page.keyboard.press("b");
    await draw(page, [[0.4, 0.5], [0.5, 0.55]]);
    await saved(page);
    const version = await page.evaluate(() => window.cnerf.session.state.version);
    await page.click("#which-view");
    await until(page, (before) => window.cnerf.session.state.version > before + 1 && window.cnerf.session.state.task === "", version);
    await until(page, (painted) => !window.cnerf.session.state.key_views.some((one) => one.view === painted), photo);
  });
});

describe("a stroke's word", () => {
  const answer = async (text) => {
    await page.fill("dialog[open] input", text);
    await page.click("dialog[open] .primary");
    await page.waitForSelector("dialog form", { state: "detached" });  // its answer is taken then
  };
  const row = (index) => page.locator("#strokes li").nth(index);
  const naming = (index) => row(index).getByRole("button", { name: "Say what it is" });
  it("is said in the list, and kept with the stroke whatever is done to it", async () => {
    await clear(page);
    await paintOn(page, 1);
    await brush(page, { tool: "brush", color: "#c03020", size: 0.05, softness: 0, exact: false });
    for (const y of [0.3, 0.5, 0.7]) await draw(page, [[0.3, y], [0.4, y]]);
    for (const index of [0, 2]) {
      await naming(index).click();
      await answer("jacket");
    }
    await row(2).getByRole("button", { name: "Hide" }).click();
    await saved(page);
    assert.deepEqual((await strokesOf(page)).map((s) => [s.word, s.hidden]), [["jacket", true], [undefined, false], ["jacket", false]]);
    assert.match(await row(0).textContent(), /jacket/);
    await page.reload({ timeout: patience });
    await page.waitForSelector("body[data-ready]", { timeout: patience });
    await until(page, () => window.cnerf.session.strokes.list.length === 3);
    assert.deepEqual((await shownStrokes(page)).map((s) => s.word), ["jacket", undefined, "jacket"]);
  });
  it("gives all of that word the brush's colour at once, and can be taken back", async () => {
    await paintOn(page, 1);
    await brush(page, { color: "#2040a0" });
    await row(0).getByRole("button", { name: "Give it the brush's colour" }).click();
    await saved(page);
    assert.deepEqual((await strokesOf(page)).map((s) => s.color), ["#2040a0", "#c03020", "#2040a0"]);
    await naming(0).click();
    await answer("a, b");
    assert.equal((await shownStrokes(page))[2].word, "jacket", "no word has a comma");
    await naming(0).click();
    await answer("ж".repeat(33));
    assert.equal((await shownStrokes(page))[2].word, "jacket", "nor 66 bytes");
    await naming(0).click();
    await answer("");
    await saved(page);
    assert.deepEqual((await strokesOf(page)).map((s) => s.word), ["jacket", undefined, undefined]);
  });
});

describe("work", () => {
  it("is there after a reload, and the page may still paint", async () => {
    await saved(page);
    const before = await strokesOf(page);
    assert.ok(before.length > 0);
    await page.reload({ timeout: patience });
    await page.waitForSelector("body[data-ready]", { timeout: patience });
    await until(page, () => window.cnerf.session.strokes.list.length > 0);
    assert.deepEqual(await shownStrokes(page), before);
    await tint(page, "none");
    await paintOn(page, 1);
    assert.ok((await seen(page, 0.35, 0.5)).color, "a stroke without softness is drawn too");
    await tint(page, "reach");
    await draw(page, [[0.3, 0.3], [0.35, 0.3]]);
    await saved(page);
    assert.equal((await strokesOf(page)).length, before.length + 1);
  });
  it("of two who were equally fast comes together", async () => {
    await clear(page);
    await page.evaluate(() => {
      const { session } = window.cnerf;
      const view = session.scene.views[1].name;
      const other = { ...session.brush.stroke(view, [[0.1, 0.1, 1]]), id: "other" };
      // The server gets another list first, of which this page knows nothing: 409.
      void session.api.putStrokes([other], session.strokes.revision);
      session.strokes.add({ ...session.brush.stroke(view, [[0.9, 0.9, 1]]), id: "mine" });
    });
    await saved(page);
    assert.deepEqual((await strokesOf(page)).map((s) => s.id).sort(), ["mine", "other"]);
    assert.deepEqual((await shownStrokes(page)).map((s) => s.id).sort(), ["mine", "other"]);
  });
  it("is followed by a second tab, which is told that it only reads", async () => {
    const second = await open(context, `${url}?still`);
    await second.waitForSelector("#notice:not([hidden])", { timeout: patience });
    assert.match(await second.locator("#notice").textContent(), /read only/);
    assert.equal(await second.locator("#colour").isDisabled(), true);
    await until(second, () => window.cnerf.session.strokes.list.length === 2);
    await paintOn(second, 1);
    await draw(second, [[0.5, 0.5], [0.6, 0.5]]);
    assert.equal((await shownStrokes(second)).length, 2, "it cannot paint");
    assert.notEqual(await second.evaluate(() => (document.getElementById("saturation").focus(), document.activeElement.id)), "saturation", "nor change the finish by keyboard");
    await draw(page, [[0.5, 0.5], [0.6, 0.5]]);
    await until(second, () => window.cnerf.session.strokes.list.length === 3);
    await second.waitForFunction(() => {
      const { layer } = window.cnerf.studio.easel;
      return layer.colorAt(Math.floor(0.55 * layer.width), Math.floor(0.5 * layer.height)) !== null;
    });
    assert.deepEqual(second.problems, []);
    await second.close();
  });
  it("survives a server that is away for a while", { skip: noReal }, async () => {
    const { port } = mock;
    const held = await strokesOf(page);
    await mock.close();
    await page.waitForSelector("#notice:not([hidden])", { timeout: patience });
    assert.match(await page.locator("#notice").textContent(), /does not answer/);
    await draw(page, [[0.7, 0.7], [0.75, 0.7]]);
    assert.equal(await page.evaluate(() => window.cnerf.session.strokes.isSaved), false);
    await mock.start(port);
    await page.waitForSelector("#notice[hidden]", { state: "attached", timeout: patience });
    await saved(page);
    assert.equal((await strokesOf(page)).length, held.length + 1);
  });
  it("goes on after one request that failed, though nothing else happens", async () => {
    const held = await strokesOf(page);
    const noticed = page.waitForSelector("#notice:not([hidden])", { timeout: patience });
    await page.route("**/studio/reach", (route) => route.abort(), { times: 1 });
    await draw(page, [[0.2, 0.8], [0.25, 0.8]]);
    await noticed;
    await page.waitForSelector("#notice[hidden]", { state: "attached", timeout: patience });
    await saved(page);
    assert.equal((await strokesOf(page)).length, held.length + 1);
  });
});

describe("colour", () => {
  const take = (name) => page.locator(`#takes [data-take="${name}"]`);
  const answer = async (text) => {
    if (text) await page.fill("dialog[open] input", text);
    await page.click("dialog[open] .primary");
  };
  it("runs, can be stopped, and changes what is shown", async () => {
    const { colors } = await page.evaluate(() => window.cnerf.session.state);
    const steps = mock?.steps;
    if (mock) mock.steps = 400;  // time enough to press Stop on any machine
    await page.click("#colour");
    await until(page, () => document.getElementById("colour").textContent === "Stop");
    await until(page, (from) => window.cnerf.session.state.colors > from, colors);
    await page.click("#colour");
    await until(page, () => window.cnerf.session.state.task === "");
    await page.click("#leave");
    if (mock) mock.steps = steps;
    await until(page, () => window.cnerf.studio.field.settled && window.cnerf.studio.field.colors >= window.cnerf.session.state.colors);
    await page.click("#colour");
    await until(page, () => window.cnerf.session.state.task === "" && window.cnerf.session.state.unkept);
  });
  it("is kept as a take, renamed, copied, compared, begun from and deleted", async () => {
    await page.click("#keep");
    await answer("evening");
    await take("evening").waitFor({ timeout: patience });
    await take("evening").getByRole("button", { name: "Rename" }).click();
    await answer("dusk");
    await take("dusk").waitFor({ timeout: patience });
    await take("dusk").getByRole("button", { name: "Duplicate" }).click();
    await answer("dawn");
    await take("dawn").waitFor({ timeout: patience });
    const both = page.waitForRequest((r) => r.url().endsWith("/studio/frame") && JSON.parse(r.postData()).sides.join() === "dawn,now", { timeout: patience });
    await take("dawn").getByRole("button", { name: "Compare" }).click();
    await both;
    await take("dawn").getByRole("button", { name: "dawn" }).click();
    await until(page, () => window.cnerf.session.state.take === "dawn");
    await take("dusk").getByRole("button", { name: "Delete" }).click();
    await answer();
    await until(page, () => !window.cnerf.session.state.takes.some((t) => t.name === "dusk"));
    await take("dawn").getByRole("button", { name: "Delete" }).click();
    await answer();
    await until(page, () => !window.cnerf.session.state.takes.some((t) => t.name === "dawn"));
    assert.deepEqual(await page.evaluate(() => [window.cnerf.studio.field.left, window.cnerf.studio.field.right]), ["", "now"], "a side that is gone is not asked for");
  });
  it("says why the server refuses", async () => {
    await page.evaluate(() => window.cnerf.session.order({ order: "begin", take: "nothing" }));
    await until(page, () => /nothing/.test(document.getElementById("toast")?.textContent ?? ""));
  });
  it("begins from a photograph that is dropped, whose colours can be picked too", async () => {
    const sent = page.waitForRequest((r) => r.url().includes("/studio/pictures?kind=reference&name=sea.png"), { timeout: patience });
    await drop(page, "#field", "sea.png", png(8, 6, 3, Buffer.alloc(8 * 6 * 3, Buffer.from([40, 120, 200]))));
    assert.equal((await (await sent).response()).status() < 300, true);
    await until(page, () => window.cnerf.session.state.task === "");
    await paintOn(page, 1);
    await page.locator(".picker-picture").click();
    assert.equal(await page.evaluate(() => window.cnerf.session.brush.settings.color), "#2878c8");
  });
  it("had no errors", () => assert.deepEqual(page.problems, []));
});

describe("other screens", () => {
  it("a phone has everything within reach, and paints with a finger", async () => {
    await page.close();
    const small = await browser.newContext({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, deviceScaleFactor: 1 });
    const phone = await open(small, `${url}?still`);
    await until(phone, () => window.cnerf?.session.state.writer === "" || window.cnerf?.session.isReadOnly === false);
    assert.equal(await phone.evaluate(() => document.documentElement.scrollWidth), 390);
    const tooSmall = () =>
      phone.evaluate(() => [...document.querySelectorAll("button, select, .wheel, summary")]
        .filter((node) => node.checkVisibility() && node.getClientRects().length > 0)
        .map((node) => [node.getAttribute("aria-label") || node.textContent, node.getBoundingClientRect()])
        .filter(([, box]) => box.height < 39.5 || box.width < 39.5).map(([name, box]) => `${name} ${box.width}x${box.height}`));
    assert.deepEqual(await tooSmall(), []);
    await paintOn(phone, 1);
    const outside = await phone.evaluate(() => [...document.querySelectorAll(".toolbar button, .camera-bar button, .tools button")].filter((node) => node.checkVisibility()).map((node) => node.getBoundingClientRect()).filter((box) => box.left < 0 || box.right > 390).length);
    assert.equal(outside, 0);
    const before = (await shownStrokes(phone)).length;
    const { x, y } = await place(phone, 0.5, 0.5);
    await phone.touchscreen.tap(x, y);
    await until(phone, (count) => window.cnerf.session.strokes.list.length === count + 1, before);
    await saved(phone);
    await phone.tap("#settings");
    await phone.waitForSelector(".panel-open .panel .disc");
    assert.deepEqual(await tooSmall(), []);
    assert.deepEqual(phone.problems, []);
    await small.close();
  });
  it("a browser without WebGL shows all the same", async () => {
    const shown = await open(context, `${url}?still`, () => {
      const own = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return String(kind).startsWith("webgl") ? null : own.call(this, kind, ...rest);
      };
    });
    await until(shown, () => window.cnerf?.studio.field.settled);
    assert.deepEqual(shown.problems, []);
    await shown.close();
  });
});

/** A stand-in of its own, whose work goes on when it is told to. */
async function opened(options, size = { width: 1280, height: 720 }) {
  const server = await new StudioMock(builtPage, { slow: true, ...options }).start();
  const own = await browser.newContext({ viewport: size, reducedMotion: "reduce" });
  const shown = await open(own, `${server.url}?still`);
  return { server, own, shown, close: async () => (await own.close(), server.close()) };
}
/** The page has heard everything. */
const heard = (shown, server) => until(shown, (version) => window.cnerf.session.state.version >= version, server.state.version);
const text = (shown, selector) => shown.locator(selector).textContent();
const jpeg = (bytes) => Buffer.concat([png(4, 3, 3, Buffer.alloc(36, 99)), Buffer.alloc(bytes)]);

describe("a studio without photographs", { skip: standIn }, () => {
  let server, own, shown, close, folder, second;
  before(async () => {
    folder = mkdtempSync(join(tmpdir(), "cnerf-photographs-"));
    mkdirSync(join(folder, "house/images/.cache"), { recursive: true });
    for (const name of ["images/a.jpg", "images/b.jpg", "images/c.png", "images/bad.jpg", "Thumbs.db", "x.heic", "images/.cache/d.jpg", ".hidden.jpg"]) writeFileSync(join(folder, "house", name), jpeg(1000));
    ({ server, own, shown, close } = await opened({ stage: "photographs", steps: 5 }));
  });
  after(async () => {
    await close?.();
    rmSync(folder, { recursive: true, force: true });
  });

  it("asks for them", async () => {
    await shown.waitForSelector("#drop-zone:not([hidden])");
    assert.equal(await shown.locator("#build").isDisabled(), true);
    assert.equal(await shown.locator("#strip").count(), 0);
    assert.equal(await shown.evaluate(() => document.getElementById("folder").webkitdirectory), true);
  });
  it("takes a folder, tells by name what is refused, and leaves out what it has no use for", async () => {
    server.refusals.set("house/images/bad.jpg", { status: 400, sentence: "house/images/bad.jpg: it is no picture.", times: 9 });
    await shown.setInputFiles("#folder", join(folder, "house"));
    await until(shown, () => !document.getElementById("build").disabled);
    assert.deepEqual([...server.arrived.keys()].sort(), ["house/images/a.jpg", "house/images/b.jpg", "house/images/c.png"]);
    assert.match(await text(shown, "#refused"), /house\/images\/bad\.jpg.*it is no picture/);
    assert.match(await text(shown, "#left-out"), /2 files of other kinds.*\.heic.*HEIC/);
    assert.match(await text(shown, "#arrived"), /3 files are here/);
  });
  it("sends a clip in pieces, anew where the server lost it", async () => {
    const clip = jpeg(5 * 2 ** 20);
    const offsets = [];
    const listen = (request) => /arrivals\?name=clip.mp4/.test(request.url()) && offsets.push(Number(new URL(request.url()).searchParams.get("offset")) / 2 ** 20);
    shown.on("request", listen);
    const answer = server.arrive;
    let isLost = false;
    server.arrive = function (response, name, offset, body) {
      if (name === "clip.mp4" && offset > 0 && !isLost) isLost = this.arrived.delete(name);
      return answer.call(this, response, name, offset, body);
    };
    const sending = shown.waitForSelector(".arrivals .progress:not([hidden])", { timeout: patience });
    await shown.setInputFiles("#files", { name: "clip.mp4", mimeType: "video/mp4", buffer: clip });
    await sending;
    await until(shown, () => !window.cnerf.reception.isSending);
    shown.off("request", listen);
    assert.deepEqual(offsets, [0, 2, 0, 2, 4]);
    assert.ok(server.arrived.get("clip.mp4").equals(clip));
  });
  it("takes what is dropped anywhere on the page", async () => {
    await shown.evaluate(() => {
      const transfer = new DataTransfer();
      for (const name of ["dropped 1.jpg", "dropped 2.jpg"]) transfer.items.add(new File([new Uint8Array(500)], name, { type: "image/jpeg" }));
      for (const type of ["dragover", "drop"]) document.querySelector("#reception header").dispatchEvent(new DragEvent(type, { dataTransfer: transfer, bubbles: true, cancelable: true }));
    });
    await until(shown, () => window.cnerf.session.state.arrived.files === 6);
    assert.ok(server.arrived.has("dropped 2.jpg"));
  });
  it("is followed by a second tab, which cannot send", async () => {
    second = await open(own, `${server.url}?still`);
    await second.waitForSelector("#notice:not([hidden])", { timeout: patience });
    assert.match(await text(second, "#arrived"), /6 files are here/);
    assert.equal(await second.locator("#build").isDisabled(), true);
    assert.equal(await second.evaluate(() => document.getElementById("drop-zone").inert), true);
  });
  it("builds, says how it goes, and can be stopped", async () => {
    await shown.click("#build");
    await shown.waitForSelector("#work:not([hidden])");
    server.advance(2);
    await until(shown, () => document.querySelectorAll("#notes li").length === 2);
    assert.match(await text(shown, "#work"), /Finding the cameras.*40 %/);
    assert.match(await text(shown, "#notes"), /6 photographs were read\./);
    await until(second, () => document.querySelectorAll("#notes li").length === 2);
    await shown.click("#stop");
    await shown.waitForSelector("#work[hidden]", { state: "attached" });
    assert.equal(await shown.locator("#build").isDisabled(), false);
  });
  it("says why it failed, and takes more", async () => {
    server.prepareFails = "2 of 6 photographs could be placed.";
    await shown.click("#build");
    await shown.waitForSelector("#work:not([hidden])");
    server.advance(5);
    await shown.waitForSelector("#failure:not([hidden])", { timeout: patience });
    assert.match(await text(shown, "#failure"), /2 of 6 photographs could be placed/);
    await shown.setInputFiles("#files", { name: "more.jpg", mimeType: "image/jpeg", buffer: jpeg(10) });
    await until(shown, () => window.cnerf.session.state.arrived.files === 7 && !document.getElementById("build").disabled);
  });
  it("becomes the studio without a reload, in both tabs", async () => {
    server.prepareFails = "";
    await Promise.all([shown, second].map((tab) => tab.evaluate(() => (window.isSame = true))));
    await shown.click("#build");
    await shown.waitForSelector("#work:not([hidden])");
    server.advance(5);
    for (const tab of [shown, second]) {
      await until(tab, () => window.cnerf.studio?.field.settled);
      assert.deepEqual(await tab.evaluate(() => [window.isSame, document.querySelectorAll("#reception").length, document.querySelectorAll(".thumbnail").length]), [true, 0, 8]);
    }
    assert.equal(await second.locator("#colour").isDisabled(), true, "it still follows only");
    assert.equal(await shown.locator("#colour").isDisabled(), false, "it may still paint");
    assert.deepEqual([shown.problems, second.problems], [[], []]);
  });
  it("goes on with photographs that it was started with, and says which are taken", async () => {
    const named = await opened({ stage: "photographs", source: "/photos/house", steps: 5 });
    const started = named.shown;
    await started.waitForSelector("#drop-zone:not([hidden])");
    assert.match(await text(started, "#arrived"), /\/photos\/house/);
    const buildAndStop = async () => {
      await started.click("#build");
      await started.waitForSelector("#work:not([hidden])");
      named.server.advance(1);
      await until(started, () => /were read/.test(document.querySelector("#notes li:last-child")?.textContent ?? ""));
      await started.click("#stop");
      await started.waitForSelector("#work[hidden]", { state: "attached" });
    };
    await buildAndStop();
    assert.equal(await started.locator("#build").isDisabled(), false);
    await started.setInputFiles("#files", { name: "more.jpg", mimeType: "image/jpeg", buffer: jpeg(10) });
    await until(started, () => window.cnerf.session.state.arrived.files === 1 && !document.getElementById("build").disabled);
    assert.match(await text(started, "#notes"), /instead of \/photos\/house/);
    assert.equal(await started.locator("#notes").isVisible(), true, "also where nothing is being built");
    await buildAndStop();
    assert.match(await text(started, "#notes"), /instead of \/photos\/house/);
    assert.deepEqual(started.problems, []);
    await named.close();
  });
  it("is within reach on a phone", async () => {
    const phone = await opened({ stage: "photographs" }, { width: 390, height: 844 });
    const box = await phone.shown.evaluate(() => ({
      wide: document.querySelector(".reception-box").scrollWidth,
      low: [...document.querySelectorAll("button")].filter((b) => b.checkVisibility()).map((b) => b.getBoundingClientRect().height).filter((h) => h < 39.5),
    }));
    assert.deepEqual(box, { wide: 390, low: [] });
    await phone.shown.focus("#choose-folder");
    await phone.close();
  });
});

describe("training", { skip: standIn }, () => {
  let server, shown, close;
  before(async () => {
    ({ server, shown, close } = await opened({ stage: "training", steps: 12 }));
    server.train();
    await until(shown, () => window.cnerf?.studio?.field.settled);
  });
  after(() => close?.());

  it("is seen while it goes on, in frames of half the size", async () => {
    const widths = [];
    const listen = (request) => request.url().endsWith("/studio/frame") && widths.push(JSON.parse(request.postData()).lens.width);
    shown.on("request", listen);
    for (let i = 0; i < 2; ++i) {
      server.advance();
      await until(shown, (colors) => window.cnerf.studio.field.colors >= colors && window.cnerf.studio.field.settled, server.state.colors);
    }
    shown.off("request", listen);
    assert.ok(widths.length >= 2);
    assert.ok(Math.max(...widths) <= (await shown.evaluate(() => document.getElementById("field").width)) / 2 + 1);
    assert.match(await text(shown, "#status"), /^Training · 17 % · 24\.0 dB$/);
    assert.match(await shown.locator("#curve path").getAttribute("d"), /^M.*L/);
    assert.equal(await shown.locator("#curve").isVisible(), true);
    assert.equal(await shown.locator("#takes").isVisible(), false);
    assert.equal(await shown.locator("#suggest").isVisible(), false);
    assert.equal(await shown.locator("#wipe-handle").isVisible(), false);
  });
  it("lets photographs be painted on already, and gives the cameras their new places", async () => {
    await paintOn(shown, 2);
    await draw(shown, [[0.4, 0.5], [0.6, 0.5]]);
    await saved(shown);
    const before = await shown.evaluate(() => [window.cnerf.session.scene.views[2].position, window.cnerf.session.state.scene]);
    server.advance(2);
    await until(shown, ([position]) => window.cnerf.session.scene.views[2].position[2] !== position[2], before);
    assert.deepEqual(await shown.evaluate(() => [window.cnerf.session.photo, window.cnerf.session.strokes.list.length]), [2, 1]);
    assert.equal(server.strokes.length, 1);
    await shown.click("#leave");
    assert.deepEqual(await shown.evaluate(() => window.cnerf.studio.field.view.position), server.scene.views[2].position);
    // The camera that is looked through moves along.
    server.advance(3);
    await until(shown, (position) => window.cnerf.studio.field.view.position[2] === position[2], server.scene.views[2].position);
  });
  it("leaves lists alone while it tells how far it is: a button that is pressed meanwhile does its work", async () => {
    await paintOn(shown, 2);
    const hide = shown.locator("#strokes li").getByRole("button", { name: "Hide" });
    await hide.hover();
    await shown.mouse.down();
    const { version } = server.state;
    server.advance();
    await until(shown, (before) => window.cnerf.session.state.version > before, version);
    await shown.mouse.up();
    await until(shown, () => window.cnerf.session.strokes.list[0].hidden);
    const show = shown.locator("#strokes li").getByRole("button", { name: "Show" });
    await show.focus();
    server.advance();
    await until(shown, (before) => window.cnerf.session.state.version > before, version + 1);
    assert.equal(await shown.evaluate(() => document.activeElement.getAttribute("aria-label")), "Show");
    await show.click();
    await saved(shown);
    await shown.click("#leave");
  });
  it("stops, goes on, and ends with a field that can be coloured", async () => {
    await shown.click("#colour");
    await until(shown, () => document.getElementById("colour").textContent === "Train");
    await until(shown, () => window.cnerf.studio.field.settled);
    const orders = server.requests.length;
    await shown.focus("#field");
    await shown.keyboard.press("c");
    await until(shown, () => document.getElementById("colour").textContent === "Stop");
    assert.ok(server.requests.slice(orders).includes("POST orders"));
    assert.equal(server.state.task, "train");
    server.advance(12);
    await until(shown, () => document.getElementById("colour").textContent === "Colour");
    assert.equal(await shown.locator("#takes").isVisible(), true);
    const full = shown.waitForRequest((r) => r.url().endsWith("/studio/frame") && JSON.parse(r.postData()).lens.width > 800, { timeout: patience });
    await shown.evaluate(() => window.cnerf.studio.field.goToCamera(3));
    await full;
    assert.equal((await shownStrokes(shown)).length, 1);
    assert.deepEqual(shown.problems, []);
  });
});

describe("a window that moves to a screen of finer pixels", { skip: standIn }, () => {
  it("has its photograph drawn in those", async () => {
    const { own, shown, close } = await opened({});
    await paintOn(shown, 1);
    const cdp = await own.newCDPSession(shown);
    await cdp.send("Emulation.setDeviceMetricsOverride", { width: 1280, height: 720, deviceScaleFactor: 2, mobile: false });
    await shown.mouse.move(640, 300); // a page hears nothing of emulated pixels; a pointer is drawn anew
    await until(shown, () => {
      const { canvas, node } = window.cnerf.studio.easel;
      return devicePixelRatio === 2 && canvas.width === 2 * node.clientWidth && canvas.height === 2 * node.clientHeight;
    });
    await close();
  });
});

describe("a port that another run's server takes over", { skip: standIn }, () => {
  it("gets none of the strokes that were painted before", async () => {
    const { server, own, shown, close } = await opened({});
    const { port } = server;
    await paintOn(shown, 1);
    await server.close();
    await shown.waitForSelector("#notice:not([hidden])", { timeout: patience });
    await draw(shown, [[0.4, 0.5], [0.6, 0.5]]);
    const other = new StudioMock(builtPage, {});
    other.scene.run = "/runs/other";
    await other.start(port);
    await until(shown, () => window.cnerf?.session.scene.run === "/runs/other" && window.cnerf.session.state.ready);
    assert.deepEqual([await shownStrokes(shown), other.strokes], [[], []]);
    assert.ok(!other.requests.includes("PUT strokes"));
    const kept = await shown.evaluate(() => Object.keys(localStorage).filter((key) => key.startsWith("cnerf-studio-strokes")));
    assert.deepEqual(kept, ["cnerf-studio-strokes /runs/ball"]);
    await close();
    await other.close();
  });
});

describe("ideas and finish", { skip: standIn }, () => {
  let server, shown, close;
  before(async () => {
    ({ server, shown, close } = await opened({ steps: 3 }));
    await until(shown, () => window.cnerf?.studio.field.settled);
  });
  after(() => close?.());

  it("colours with the built-in colorizer, as a take", async () => {
    await shown.click("#builtin");
    await until(shown, () => document.getElementById("builtin").disabled && document.getElementById("suggest").disabled);
    server.advance(3);
    await shown.locator('#takes [data-take="builtin"]').waitFor({ timeout: patience });
    assert.deepEqual([server.state.take, server.state.unkept], ["builtin", false]);
  });
  it("suggests, and colours by the cards that are liked", async () => {
    await shown.click("#suggest");
    await until(shown, () => window.cnerf.session.isBusy);
    server.advance(3);
    await shown.locator("#cards .idea").nth(1).click();
    await shown.locator("#cards .idea").nth(0).click();
    await shown.locator("#cards .idea").nth(0).click();
    assert.deepEqual(await shown.locator("#cards .idea").evaluateAll((cards) => cards.map((card) => card.getAttribute("aria-pressed"))), ["false", "true"]);
    const sent = shown.waitForRequest((r) => r.url().endsWith("/studio/orders"), { timeout: patience });
    await shown.click("#builtin");
    assert.deepEqual((await sent).postDataJSON(), { order: "builtin", bases: [1] });
    await heard(shown, server);
    server.advance(3);
    await until(shown, () => !window.cnerf.session.isBusy);
    await shown.evaluate(() => window.cnerf.session.order({ order: "begin", take: "builtin" }));
  });
  it("shows new suggestions without a mark", async () => {
    await shown.locator("#cards .idea").nth(0).click();
    await shown.click("#suggest");
    await until(shown, () => window.cnerf.session.isBusy);
    server.advance(3);
    await until(shown, () => !window.cnerf.session.isBusy);
    assert.deepEqual(await shown.locator("#cards .idea").evaluateAll((cards) => cards.map((card) => card.getAttribute("aria-pressed"))), ["false", "false"]);
  });
  it("follows the sliders with a few orders a second, also beside work, and keeps the take kept", async () => {
    await shown.evaluate(() => void window.cnerf.session.order({ order: "bake", formats: ["vdb"] }));
    await until(shown, () => window.cnerf.session.state.task === "bake");
    const { colors } = server.state;
    const orders = [];
    const listen = (request) => request.url().endsWith("/studio/orders") && orders.push(JSON.parse(request.postData()));
    shown.on("request", listen);
    await shown.evaluate(() => {
      const input = document.getElementById("saturation");
      for (let value = 100; value >= 20; value -= 1) {
        input.value = String(value / 100);
        input.dispatchEvent(new Event("input", { bubbles: true }));
      }
    });
    await until(shown, () => window.cnerf.session.state.finish.saturation === 0.2);
    shown.off("request", listen);
    assert.equal(orders.length, 2, "the first one at once, then the last one");
    assert.deepEqual(orders.at(-1), { order: "finish", saturation: 0.2, hue: 0, exposure: 0 });
    assert.ok(server.state.colors > colors);
    await until(shown, (wanted) => window.cnerf.studio.field.colors === wanted, server.state.colors);
    assert.deepEqual([server.state.unkept, server.state.task], [false, "bake"]);
    // Somebody else's finish is shown.
    await until(shown, () => !document.querySelector("#exposure:active"));
    server.change({ finish: { saturation: 1, hue: 0, exposure: 1 } });
    await until(shown, () => (window.cnerf.session.tell(), document.getElementById("exposure").value === "1"));
    server.advance(3);
    assert.deepEqual(shown.problems, []);
  });
});

describe("a painted PNG", { skip: standIn }, () => {
  it("becomes a stroke of its photograph, that is drawn, hidden and deleted", async () => {
    const { server, shown, close } = await opened({});
    await until(shown, () => window.cnerf?.studio.field.settled);
    await paintOn(shown, 1);
    const { width, height } = server.pictures[1];
    const sent = shown.waitForRequest((r) => /pictures\?kind=stroke&view=1&name=roof\.png/.test(r.url()), { timeout: patience });
    await drop(shown, "#easel", "roof.png", redPaint(server.pictures[1]));
    await sent;
    const spot = [60 / width, 50 / height];
    const isRed = ([u, v]) => {
      const { layer } = window.cnerf.studio.easel;
      const color = layer.colorAt(Math.floor(u * layer.width), Math.floor(v * layer.height));
      return color !== null && color[0] > color[2] + 10;
    };
    await until(shown, isRed, spot);
    assert.equal((await seen(shown, 0.9, 0.9)).color, null);
    await until(shown, () => document.querySelector("#strokes img.picture")?.naturalWidth > 0);
    const row = shown.locator("#strokes li");
    assert.match(await row.textContent(), /Painted picture/);
    await row.getByRole("button", { name: "Hide" }).click();
    assert.equal((await seen(shown, ...spot)).color, null);
    await saved(shown);
    assert.deepEqual([server.strokes[0].hidden, server.strokes[0].kind, server.painted.has(server.strokes[0].picture), server.strokes[0].points], [true, "picture", true, []]);
    await row.getByRole("button", { name: "Show" }).click();
    await until(shown, isRed, spot);
    await row.getByRole("button", { name: "Delete" }).click();
    await saved(shown);
    assert.equal(server.strokes.length, 0);
    assert.deepEqual(shown.problems, []);
    await close();
  });
  it("is undone and redone by itself, not the stroke before it", async () => {
    const { server, shown, close } = await opened({});
    await until(shown, () => window.cnerf?.studio.field.settled);
    await paintOn(shown, 1);
    await draw(shown, [[0.7, 0.7], [0.8, 0.7]]);
    await saved(shown);
    await drop(shown, "#easel", "roof.png", redPaint(server.pictures[1]));
    await until(shown, () => window.cnerf.session.strokes.done.length === 2);
    const kinds = () => server.strokes.map((stroke) => stroke.kind);
    assert.deepEqual(kinds(), ["paint", "picture"]);
    await shown.keyboard.press("Control+z");
    await saved(shown);
    assert.deepEqual(kinds(), ["paint"]);
    await shown.keyboard.press("Control+Shift+z");
    await saved(shown);
    assert.deepEqual(kinds(), ["paint", "picture"]);
    await draw(shown, [[0.7, 0.8], [0.8, 0.8]]);
    await saved(shown);
    assert.deepEqual(kinds(), ["paint", "picture", "paint"], "painting goes on");
    assert.deepEqual(shown.problems, []);
    await close();
  });
});

describe("colours that no take has", { skip: standIn }, () => {
  let server, shown, close;
  const sent = () => server.requests.filter((request) => request === "POST pictures").length;
  const sea = png(8, 6, 3, Buffer.alloc(8 * 6 * 3, Buffer.from([40, 120, 200])));
  before(async () => {
    ({ server, shown, close } = await opened({ steps: 2 }));
    await until(shown, () => window.cnerf?.studio.field.settled);
    await shown.click("#colour");
    await until(shown, () => window.cnerf.session.isBusy);
    server.advance(2);
    await until(shown, () => window.cnerf.session.state.unkept && !window.cnerf.session.isBusy);
  });
  after(() => close?.());

  it("are left for those of a photograph only where the user says so", async () => {
    await drop(shown, "#field", "sea.png", sea);
    await shown.locator("dialog[open]").getByRole("button", { name: "Cancel" }).click();
    await shown.waitForSelector("dialog form", { state: "detached" });
    assert.deepEqual([sent(), server.state.unkept, server.state.task], [0, true, ""]);
    await drop(shown, "#field", "sea.png", sea);
    await shown.click("dialog[open] .primary");
    await until(shown, () => window.cnerf.session.state.task === "colour");
    assert.equal(sent(), 1);
    server.advance(2);
    await until(shown, () => !window.cnerf.session.isBusy);
  });
  it("are not left for a picture that is dropped on a photograph and is no painted PNG", async () => {
    await paintOn(shown, 1);
    await drop(shown, "#easel", "roof.tif", sea, "image/tiff");
    await until(shown, () => /Only a painted PNG/.test(document.getElementById("toast")?.textContent ?? ""));
    assert.equal(await shown.locator("dialog[open]").count(), 0);
    assert.equal(sent(), 1);
    assert.deepEqual(shown.problems, []);
  });
});

describe("a take called grey", { skip: standIn }, () => {
  it("is begun from, and compared with the scene without colours, like any other", async () => {
    const { server, shown, close } = await opened({});
    server.amounts.grey = 0.8;
    server.change({ takes: [{ name: "grey", colorizer: "strokes", seconds: 2 }] });
    const row = (name) => shown.locator(`#takes [data-take="${name}"]`);
    await row("grey").waitFor({ timeout: patience });
    assert.deepEqual(await shown.locator("#side-left option").allTextContents(), ["grey", "now", "take grey"]);
    await row("grey").locator(".name-button").click();
    await until(shown, () => window.cnerf.session.state.take === "grey");
    assert.equal(server.amount, 0.8);
    const both = shown.waitForRequest((r) => r.url().endsWith("/studio/frame") && JSON.parse(r.postData()).sides.length === 2, { timeout: patience });
    await shown.selectOption("#side-left", { value: "" });
    await shown.selectOption("#side-right", { value: "grey" });
    await until(shown, () => window.cnerf.studio.field.right === "grey");
    await both;
    const compared = shown.waitForRequest((r) => r.url().endsWith("/studio/frame") && JSON.parse(r.postData()).sides.join() === ",grey", { timeout: patience });
    await shown.evaluate(() => window.cnerf.studio.field.goToCamera(3));
    await compared;
    await row("").locator(".name-button").click();
    await until(shown, () => window.cnerf.session.state.take === "");
    assert.equal(server.amount, 0);
    assert.deepEqual(shown.problems, []);
    await close();
  });
});

describe("the keyboard", { skip: standIn }, () => {
  let server, shown, close;
  before(async () => {
    ({ server, shown, close } = await opened({}));
    await until(shown, () => window.cnerf?.studio.field.settled);
    await paintOn(shown, 1);
  });
  after(() => close?.());
  const press = async (key, times) => {
    for (let i = 0; i < times; ++i) await shown.keyboard.press(key);
  };
  const easel = () => shown.evaluate(() => {
    const { cursor, corner, margin, node, photo, scale } = window.cnerf.studio.easel;
    const inSight = cursor !== null && cursor.x >= margin.left && cursor.x <= node.clientWidth - margin.right && cursor.y >= margin.top && cursor.y <= node.clientHeight - margin.bottom;
    return { corner, inSight, at: cursor && [(cursor.x - corner.x) / scale / photo.width, (cursor.y - corner.y) / scale / photo.height] };
  });

  it("reaches all of a photograph that is larger than the window, with the brush in sight", async () => {
    await press("+", 5);
    const before = await easel();
    await press("Shift+ArrowRight", 80);
    await press("Shift+ArrowDown", 50);
    const { corner, inSight, at } = await easel();
    assert.ok(inSight);
    assert.ok(corner.x < before.corner.x && corner.y < before.corner.y, "the photograph moves");
    assert.ok(at.every((share) => share > 0.99 && share < 1), `the brush is in its corner: ${at}`);
    await press("Enter", 1);
    await saved(shown);
    const [[x, y]] = server.strokes[0].points;
    assert.ok(Math.abs(x - at[0]) < 0.001 && Math.abs(y - at[1]) < 0.001, `painted at ${x}, ${y}`);
  });
  it("moves the photograph with the hand", async () => {
    await press("h", 1);
    const before = await easel();
    await press("ArrowRight", 2);
    await press("ArrowUp", 1);
    const { corner } = await easel();
    assert.ok(Math.abs(corner.x - before.corner.x - 80) < 1e-6 && Math.abs(corner.y - before.corner.y + 40) < 1e-6);
    await press("b", 1);
    await press("0", 1);
  });
  it("resets a slider, and deletes no stroke with it", async () => {
    const strokes = (await shownStrokes(shown)).length;
    for (const key of ["Delete", "Backspace"]) {
      await brush(shown, { softness: 0.9 });
      await shown.focus("#softness");
      await press(key, 1);
      assert.equal(await shown.evaluate(() => window.cnerf.session.brush.settings.softness), 0.25);
    }
    assert.equal((await shownStrokes(shown)).length, strokes);
    assert.equal(await shown.locator(".slider").first().getAttribute("title"), "Double click, or Delete, resets");
  });
  it("leaves out a slider that is switched off, and hears what the disc has", async () => {
    const focused = (id) => shown.evaluate((name) => (document.activeElement.blur(), document.getElementById(name).focus(), document.activeElement.id === name), id);
    assert.equal(await focused("reach"), true);
    await brush(shown, { exact: true });
    assert.equal(await focused("reach"), false);
    await brush(shown, { exact: false });
    assert.match(await shown.locator(".disc").getAttribute("aria-valuenow"), /^\d+$/);
  });
  it("picks the colours of a picture", async () => {
    // Blue on the left, red on the right.
    const halves = Buffer.alloc(64 * 48 * 3);
    for (let p = 0; p < 64 * 48; ++p) halves.set(p % 64 < 32 ? [40, 120, 200] : [200, 40, 30], 3 * p);
    await drop(shown, "[data-drop=picker]", "halves.png", png(64, 48, 3, halves));
    await shown.waitForSelector(".picker-picture:not([hidden])");
    await shown.focus("#choose-picture");
    await press("Shift+Tab", 1);
    assert.ok(await shown.evaluate(() => document.activeElement.classList.contains("picker-picture")), "it is a stop of the Tab key");
    const picked = () => shown.evaluate(() => window.cnerf.session.brush.settings.color);
    await press("ArrowLeft", 3);
    await press("Enter", 1);
    assert.equal(await picked(), "#2878c8");
    await press("Shift+ArrowRight", 1);
    assert.equal(await picked(), "#2878c8", "moving picks nothing");
    await press("Enter", 1);
    assert.equal(await picked(), "#c8281e");
    assert.equal(await shown.evaluate(() => window.cnerf.session.photo), 1, "the photograph is still open");
    assert.deepEqual(shown.problems, []);
  });
});

describe("a pen", { skip: standIn }, () => {
  it("goes on drawing where the hand comes to rest", async () => {
    const { shown, close } = await opened({});
    await until(shown, () => window.cnerf?.studio.field.settled);
    await paintOn(shown, 1);
    const [from, to] = [await place(shown, 0.4, 0.5), await place(shown, 0.6, 0.5)];
    await shown.evaluate(([first, last]) => {
      const { canvas } = window.cnerf.studio.easel;
      // Pointers that only events tell of cannot be captured.
      canvas.setPointerCapture = () => {};
      const at = (type, pointerType, pointerId, { x, y }) => canvas.dispatchEvent(new PointerEvent(type, { pointerType, pointerId, pressure: 0.5, clientX: x, clientY: y, bubbles: true }));
      at("pointerdown", "pen", 21, first);
      at("pointerdown", "touch", 22, { x: last.x + 40, y: last.y + 60 });
      at("pointermove", "touch", 22, { x: last.x + 45, y: last.y + 60 });
      at("pointermove", "pen", 21, last);
      at("pointerup", "touch", 22, { x: last.x + 45, y: last.y + 60 });
      at("pointermove", "pen", 21, { x: last.x, y: last.y + 20 });
      at("pointerup", "pen", 21, { x: last.x, y: last.y + 20 });
    }, [from, to]);
    assert.deepEqual((await shownStrokes(shown)).map((stroke) => stroke.points.length), [3]);
    assert.deepEqual(shown.problems, []);
    await close();
  });
});

describe("free viewpoints", { skip: standIn }, () => {
  let server, shown, close, place1;
  before(async () => {
    ({ server, shown, close } = await opened({}));
    await until(shown, () => window.cnerf?.studio.field.settled);
  });
  after(() => close?.());
  const nearer = (factor) => shown.evaluate((f) => {
    const { field } = window.cnerf.studio;
    field.setView({ ...field.view, position: field.view.position.map((v) => v * f) });
    return field.view.position;
  }, factor);
  const thumbnails = () => shown.evaluate(() => [...document.querySelectorAll("#strip .caption")].map((n) => n.textContent));

  it("are painted on wherever the camera stands, by keyboard too", async () => {
    place1 = await nearer(0.8);
    const canvas = await shown.evaluate(() => document.getElementById("field").width / document.getElementById("field").height);
    assert.equal(await text(shown, "#camera-name"), "free view");
    assert.equal(await shown.locator("#paint-here").isVisible(), true);
    await shown.focus("#field");
    await shown.keyboard.press("Enter");
    await shown.waitForSelector('[data-photo="8"]', { timeout: patience });
    assert.equal(await text(shown, "#camera-name"), "Viewpoint 1");
    assert.deepEqual(await thumbnails(), ["Viewpoint 1"]);
    const [viewpoint] = server.viewpoints;
    assert.deepEqual(viewpoint.position, place1);
    const { width, height } = viewpoint.lens;
    assert.ok(Math.max(width, height) <= 1024 && width > 500, `${width} x ${height}`);
    assert.ok(Math.abs(width / height - canvas) < 0.01, "it shows what was seen");
    await draw(shown, [[0.4, 0.5], [0.5, 0.5]]);
    await saved(shown);
    assert.equal(server.strokes[0].view, "viewpoint-1");
    assert.match(await text(shown, "#strip"), /1/);
  });
  it("stay with their strokes, and leaving returns to the camera", async () => {
    await shown.keyboard.press("Escape");
    await until(shown, () => window.cnerf.studio.field.settled);
    assert.deepEqual(await shown.evaluate(() => window.cnerf.studio.field.view.position), place1);
    assert.equal(await text(shown, "#camera-name"), "Viewpoint 1");
    assert.equal(server.viewpoints.length, 1);
  });
  it("go again where nothing was painted", async () => {
    const there = await nearer(0.9);
    await shown.click("#paint-here");
    await shown.waitForSelector('[data-photo="9"]', { timeout: patience });
    assert.equal(server.viewpoints.length, 2);
    await shown.click("#leave");
    await until(shown, () => window.cnerf.session.strokes.savedViewpoints.length === 1);
    assert.deepEqual(server.viewpoints.map((v) => v.name), ["viewpoint-1"]);
    assert.deepEqual(await thumbnails(), ["Viewpoint 1"]);
    assert.deepEqual(await shown.evaluate(() => window.cnerf.studio.field.view.position), there);
    assert.equal(await text(shown, "#camera-name"), "free view");
  });
  it("keep their strokes where another one before them goes", async () => {
    await shown.click("#paint-here");
    await shown.waitForSelector('[data-photo="9"]', { timeout: patience });
    await draw(shown, [[0.3, 0.4], [0.35, 0.4]]);
    await saved(shown);
    // The first one's stroke is deleted while the second one is open: it is number 8 now.
    await shown.evaluate(() => window.cnerf.session.strokes.remove(window.cnerf.session.strokes.list[0].id));
    await saved(shown);
    assert.equal(await shown.evaluate(() => window.cnerf.session.photo), 8);
    const asked = shown.waitForRequest((r) => r.method() === "POST" && r.url().endsWith("/studio/reach") && JSON.parse(r.postData()).view === 8, { timeout: patience });
    await draw(shown, [[0.5, 0.6], [0.55, 0.6]]);
    await asked;
    await saved(shown);
    assert.equal(new Set(server.strokes.map((s) => s.view)).size, 1);
    assert.equal(server.strokes.length, 2);
    const [{ name }] = server.viewpoints;
    // Undo brings the first one back, camera and all.
    for (let i = 0; i < 2; ++i) await shown.keyboard.press("Control+z");
    await saved(shown);
    assert.deepEqual(server.viewpoints.map((v) => v.name), ["viewpoint-1", name]);
    assert.deepEqual(server.viewpoints[0].position, place1);
    await until(shown, () => document.querySelectorAll("#strip .caption").length === 2);
  });
  it("are there after a reload, and open from the strip", async () => {
    await saved(shown);
    await shown.reload({ timeout: patience });
    await until(shown, () => window.cnerf?.studio && document.querySelectorAll("#strip .caption").length === 2);
    await shown.locator('#strip [data-view="8"]').click();
    await shown.waitForSelector('[data-photo="8"]', { timeout: patience });
    assert.equal(await text(shown, "#camera-name"), "Viewpoint 1");
    assert.equal(await shown.locator("#strokes li").count(), 1);
    assert.deepEqual(shown.problems, []);
  });
});
