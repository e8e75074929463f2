/** The studio in a real browser. CNERF_STUDIO_URL names a running server; without it a stand-in answers. */

import assert from "node:assert/strict";
import { after, before, describe, it } from "node:test";
import { builtPage, launch, open, patience } from "./support.mjs";
import { png, StudioMock } from "./studio_mock.mjs";

const real = process.env.CNERF_STUDIO_URL;
const noReal = real ? "only where the server can be ended" : false;
let browser, context, mock, url, page;

before(async () => {
  browser = await launch();
  context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
  if (!real) mock = await new StudioMock(builtPage, { steps: 40 }).start();
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
/** What the server has. */
const strokesOf = async (shown) => (await shown.evaluate(async () => (await fetch("./studio/strokes", { cache: "no-store" })).json())).strokes;
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
const brush = (shown, settings) => shown.evaluate((s) => window.cnerf.session.brush.set(s), settings);
async function clear(shown) {
  await shown.evaluate(() => window.cnerf.session.strokes.change([]));
  await saved(shown);
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
    assert.deepEqual(JSON.parse((await request).postData()).sides, ["grey", "now"]);
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
    await paintOn(page, 1);
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
});

describe("colour", () => {
  const take = (name) => page.locator(`#takes [data-take="${name}"]`);
  const answer = async (text) => {
    if (text) await page.fill("dialog[open] input", text);
    await page.click("dialog[open] .primary");
  };
  it("runs, can be stopped, and changes what is shown", async () => {
    const { colors } = await page.evaluate(() => window.cnerf.session.state);
    await page.click("#colour");
    await until(page, () => document.getElementById("colour").textContent === "Stop");
    await until(page, (from) => window.cnerf.session.state.colors > from, colors);
    await page.click("#colour");
    await until(page, () => window.cnerf.session.state.task === "");
    await page.click("#leave");
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
    assert.deepEqual(await page.evaluate(() => [window.cnerf.studio.field.left, window.cnerf.studio.field.right]), ["grey", "now"], "a side that is gone is not asked for");
  });
  it("says why the server refuses", async () => {
    await page.evaluate(() => window.cnerf.session.order({ order: "begin", take: "nothing" }));
    await until(page, () => /nothing/.test(document.getElementById("toast")?.textContent ?? ""));
  });
  it("begins from a photograph that is dropped, whose colours can be picked too", async () => {
    const bytes = [...png(8, 6, 3, Buffer.alloc(8 * 6 * 3, Buffer.from([40, 120, 200])))];
    const sent = page.waitForRequest((r) => r.url().includes("/studio/pictures?kind=reference&name=sea.png"), { timeout: patience });
    await page.evaluate((list) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([new Uint8Array(list)], "sea.png", { type: "image/png" }));
      for (const type of ["dragover", "drop"]) document.getElementById("field").dispatchEvent(new DragEvent(type, { dataTransfer: transfer, bubbles: true, cancelable: true }));
    }, bytes);
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
