/** The page in a real browser, drawing with SwiftShader: `ctest -L viewer`. */

import assert from "node:assert/strict";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, it } from "node:test";
import { brightness, builtPage, chroma, decoded, fixture, get, launch, meanAlpha, open, picture, psnr, psnrOfPictures, serve, set } from "./support.mjs";

const folders = [builtPage, join(fixture, "r8")];
const expected = JSON.parse(readFileSync(join(fixture, "expected.json"), "utf8"));
let browser, context, server, page;

before(async () => {
  browser = await launch();
  // A quarter of the pixels across: software draws them, and what is compared are pictures of a size of their own.
  context = await browser.newContext({ viewport: { width: 640, height: 420 }, deviceScaleFactor: 0.25, acceptDownloads: true });
  server = await serve(folders);
  page = await open(context, `${server.url}?still`);
});
after(async () => {
  await browser?.close();
  await server?.close();
});
const reset = () => page.evaluate(() => window.cnerf.app.reset());
const click = (id) => page.evaluate((name) => document.getElementById(name).click(), id);
/** Until the page has drawn what was set. */
const drawn = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
const slide = (id, value) =>
  page.evaluate(([name, v]) => {
    const input = document.getElementById(name);
    input.value = String(v);
    input.dispatchEvent(new Event("input", { bubbles: true }));
  }, [id, value]);

describe("picture", () => {
  it("is that of the program's integrator at three poses", async () => {
    for (let camera = 0; camera < 3; ++camera) {
      await page.evaluate((i) => window.cnerf.app.goToCamera(i), camera);
      const reference = expected.images[camera];
      const image = await picture(page, reference.width, reference.height);
      const decibel = psnr(image, reference.rgb);
      console.log(`# pose ${camera}: ${decibel.toFixed(2)} dB`);
      assert.ok(decibel >= 32, `${decibel} dB`);
      assert.ok(psnr(image, reference.rgb.map((v) => 0.6 * v)) < 32, "a darker picture would not pass");
    }
  });
  it("refines by itself once nothing moves, to what a saved picture shows", async () => {
    await reset();
    await page.evaluate(() => window.cnerf.settled());
    const statistics = await page.evaluate(() => window.cnerf.renderer.statistics());
    assert.equal(statistics.refined, statistics.passes);
  });
});

describe("settings", () => {
  it("wipe shows luminance on the left, colour on the right", async () => {
    await reset();
    const before = await picture(page);
    await slide("wipe", 0.5);
    const image = await picture(page);
    assert.equal(chroma(image, 0, 0.5), 0);
    assert.ok(Math.abs(chroma(image, 0.5, 1) - chroma(before, 0.5, 1)) < 0.01);
    assert.ok(chroma(before, 0, 0.5) > 1);
    await drawn();
    const handle = await page.locator("#wipe-handle").boundingBox();
    assert.ok(Math.abs(handle.x + handle.width / 2 - 320) < 3);
  });
  it("the wipe's handle follows the pointer", async () => {
    await reset();
    await slide("wipe", 0.5);
    await page.evaluate(() => document.body.classList.remove("panel-open"));
    await drawn();
    const box = await page.locator("#wipe-handle").boundingBox();
    await page.mouse.move(box.x + box.width / 2, 160);
    await page.mouse.down();
    await page.mouse.move(160, 160, { steps: 4 });
    await page.mouse.up();
    assert.ok(Math.abs((await get(page, "wipe")) - 0.25) < 0.02);
    await page.mouse.down({ button: "right" });
    await page.mouse.move(400, 160, { steps: 4 });
    await page.mouse.up({ button: "right" });
    assert.ok(Math.abs((await get(page, "wipe")) - 0.25) < 0.02, "the right button has a menu of its own");
  });
  it("saturation 0 is grey at the same luminance, 2 more colourful", async () => {
    await reset();
    const normal = await picture(page);
    await slide("saturation", 0);
    const grey = await picture(page);
    assert.ok(chroma(grey) <= 0.5, "within rounding");
    await slide("wipe", 1);
    assert.ok(psnrOfPictures(grey, await picture(page)) > 48);
    await slide("wipe", 0);
    await slide("saturation", 1.6);
    assert.ok(chroma(await picture(page)) > 1.15 * chroma(normal));
  });
  it("hue turns colours and keeps their luminance", async () => {
    await reset();
    const normal = await picture(page);
    await slide("hue", 120);
    const turned = await picture(page);
    assert.ok(psnrOfPictures(normal, turned) < 30);
    await slide("hue", 0);
    assert.ok(psnrOfPictures(normal, await picture(page)) > 60);
  });
  it("exposure brightens by stops", async () => {
    await reset();
    await slide("exposure", -2);
    const image = await picture(page);
    const decibel = psnr(image, expected.images[0].rgb.map((v) => v / 4));
    assert.ok(decibel > 32, `${decibel}`);
  });
  it("background is put behind, or left out", async () => {
    await reset();
    await page.evaluate(() => document.querySelector('[data-background="#ffffff"]').click());
    const white = await picture(page, 160, 120, await get(page, "background"));
    assert.deepEqual([...white.data.subarray(0, 4)], [255, 255, 255, 255]);
    const clear = await picture(page, 160, 120, "none");
    assert.equal(clear.data[3], 0);
    assert.ok(meanAlpha(clear) > 20 && meanAlpha(clear) < 235);
  });
  it("gain thins and thickens, the threshold takes away", async () => {
    await reset();
    const normal = meanAlpha(await picture(page, 160, 120, "none"));
    await slide("gain", -2);
    const thin = meanAlpha(await picture(page, 160, 120, "none"));
    assert.ok(thin < 0.7 * normal, `${thin} of ${normal}`);
    await slide("gain", 0);
    await slide("threshold", 2.5);
    const partly = meanAlpha(await picture(page, 160, 120, "none"));
    assert.ok(partly < 0.999 * normal && partly > 0.2 * normal, `the fog is gone, the ball is not: ${partly} of ${normal}`);
    await slide("threshold", 10);
    assert.equal(meanAlpha(await picture(page, 160, 120, "none")), 0);
  });
});

describe("clip box", () => {
  it("cuts what is outside and prints the box", async () => {
    await reset();
    const whole = meanAlpha(await picture(page, 160, 120, "none"));
    await click("clip");
    const full = await page.locator("#aabb").textContent();
    assert.match(full, /^--aabb=(-?[\d.]+,){5}-?[\d.]+$/);
    assert.ok(Math.abs(meanAlpha(await picture(page, 160, 120, "none")) - whole) < 0.5);
    await slide("clip-z-high", 3.8);
    const half = meanAlpha(await picture(page, 160, 120, "none"));
    assert.ok(half < 0.8 * whole && half > 0.1 * whole, `${half} of ${whole}`);
    const top = Number((await page.locator("#aabb").textContent()).split(",").pop());
    assert.ok(Math.abs(top - 3.8) < 0.01, `${top}: the slider has steps`);
  });
  it("has handles that move a side along its axis", async () => {
    await reset();
    await page.evaluate(() => document.body.classList.remove("panel-open"));
    await click("clip");
    await page.evaluate(() => window.cnerf.app.frame());
    await drawn();
    const before = await get(page, "clip");
    const handle = page.locator('[data-handle="5"]'); // z, high
    const box = await handle.boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2 + 40, { steps: 5 });
    await page.mouse.up();
    const after = await get(page, "clip");
    assert.ok(after.high[2] < before.high[2] - 0.05);
    assert.deepEqual(after.low, before.low);
    assert.equal(after.high[0], before.high[0]);
  });
});

describe("slices", () => {
  it("show each quantity, where it is", async () => {
    await reset();
    await click("slice");
    const shown = {};
    for (const quantity of ["density", "L", "a", "b"]) {
      await page.evaluate((q) => document.querySelector(`#slice-quantity [data-value="${q}"]`).click(), quantity);
      shown[quantity] = await picture(page);
      assert.ok(brightness(shown[quantity]) > 2, quantity);
    }
    assert.equal(chroma(shown.L), 0, "L* is grey");
    for (const [a, b] of [["density", "L"], ["L", "a"], ["a", "b"]]) assert.ok(psnrOfPictures(shown[a], shown[b]) < 35, `${a} and ${b} look alike`);
    await slide("slice-at", 0.9);
    assert.ok(psnrOfPictures(shown.b, await picture(page)) < 40);
  });
});

describe("camera", () => {
  it("orbits by dragging, at the same distance", async () => {
    await reset();
    await page.evaluate(() => document.body.classList.remove("panel-open"));
    const distance = () => page.evaluate(() => Math.hypot(...window.cnerf.app.view.position.map((v, i) => v - window.cnerf.app.target[i])));
    const [before, far] = [await picture(page), await distance()];
    await page.mouse.move(300, 150);
    await page.mouse.down();
    await page.mouse.move(380, 170, { steps: 4 });
    await page.mouse.up();
    assert.ok(psnrOfPictures(before, await picture(page)) < 25);
    assert.ok(Math.abs((await distance()) - far) < 1e-6);
    await page.mouse.wheel(0, -300);
    await page.waitForFunction((d) => Math.hypot(...window.cnerf.app.view.position.map((v, i) => v - window.cnerf.app.target[i])) < 0.9 * d, far);
  });
  it("turns and comes nearer by touch", async () => {
    await reset();
    const moved = await page.evaluate(() => {
      const canvas = document.getElementById("view");
      const at = (type, id, x, y) => canvas.dispatchEvent(new PointerEvent(type, { pointerId: id, pointerType: "touch", clientX: x, clientY: y, bubbles: true, buttons: 1 }));
      canvas.setPointerCapture = () => {};
      const { app } = window.cnerf;
      const distance = () => Math.hypot(...app.view.position.map((v, i) => v - app.target[i]));
      const begin = { position: [...app.view.position], distance: distance() };
      at("pointerdown", 11, 200, 200);
      at("pointermove", 11, 240, 200);
      const turned = Math.hypot(...app.view.position.map((v, i) => v - begin.position[i]));
      at("pointerdown", 12, 300, 200);
      at("pointermove", 12, 360, 200);
      at("pointerup", 11, 0, 0);
      at("pointerup", 12, 0, 0);
      return { turned, nearer: distance() / begin.distance };
    });
    assert.ok(moved.turned > 0.05);
    assert.ok(moved.nearer > 0.3 && moved.nearer < 0.75, `${moved.nearer}`);
  });
  it("flies with the keys", async () => {
    await reset();
    await page.evaluate(() => document.querySelector('#mode [data-value="fly"]').click());
    const before = await page.evaluate(() => window.cnerf.app.view.position);
    await page.keyboard.down("w");
    await page.waitForFunction((from) => Math.hypot(...window.cnerf.app.view.position.map((v, i) => v - from[i])) > 0.02, before);
    await page.keyboard.up("w");
    const walked = await page.evaluate((from) => {
      const { view } = window.cnerf.app;
      return view.position.reduce((sum, v, i) => sum + (v - from[i]) * view.rotation[i][2], 0);
    }, before);
    assert.ok(walked > 0.019, `forwards: ${walked}`);
  });
  it("frames, and goes back to the start", async () => {
    await page.keyboard.press("f");
    await page.waitForTimeout(100);
    const framed = await picture(page, 160, 120, "none");
    assert.equal(framed.data[3], 0, "all of it is inside the picture");
    assert.ok(meanAlpha(framed) > 15);
    await page.keyboard.press("r");
    await page.waitForTimeout(100);
    assert.ok(psnr(await picture(page), expected.images[0].rgb) > 32);
  });
  it("jumps to the capture's cameras, with their photographs laid over", async () => {
    await reset();
    await page.keyboard.press("]");
    await page.waitForFunction(() => document.getElementById("camera-name").textContent === "b.png");
    await slide("photo", 0.5);
    await page.waitForFunction(() => document.querySelector("img.photo").naturalWidth > 0);
    await drawn();
    const photo = page.locator("img.photo");
    assert.equal(await photo.evaluate((node) => getComputedStyle(node).opacity), "0.5");
    const box = await photo.boundingBox();
    assert.ok(Math.abs(box.width / box.height - 160 / 120) < 0.01 && Math.abs(box.height - 420) < 1);
    // The photograph is the luminance of what lies under it.
    const grey = await photo.evaluate(async (node) => {
      await node.decode();
      const canvas = new OffscreenCanvas(160, 120);
      const c = canvas.getContext("2d");
      c.drawImage(node, 0, 0, 160, 120);
      return [...c.getImageData(0, 0, 160, 120).data];
    });
    await set(page, { wipe: 1 });
    const decibel = psnrOfPictures(await picture(page), { width: 160, height: 120, data: grey });
    assert.ok(decibel > 25, `${decibel}; the photograph is a JPEG`);
    await page.evaluate(() => document.querySelector('.thumbnail[data-camera="2"]').click());
    assert.equal(await page.evaluate(() => window.cnerf.app.captureCamera), 2);
  });
  it("plays key frames until they are removed", async () => {
    await reset();
    await click("add-key");
    await page.evaluate(() => window.cnerf.app.goToCamera(1));
    await click("add-key");
    await click("play-path");
    await page.evaluate(() => {
      for (let i = 0; i < 2; ++i) document.querySelector("#key-frames .remove").click();
    });
    await drawn();
    assert.equal(await page.evaluate(() => window.cnerf.panel.playing), 0);
    assert.deepEqual(page.problems, []);
  });
  it("is in the address, with the settings", async () => {
    await reset();
    await set(page, { saturation: 1.4, gain: 3 });
    await page.evaluate(() => window.cnerf.app.goToCamera(2));
    await page.waitForFunction(() => location.hash === window.cnerf.app.hash);
    const other = await open(context, page.url());
    assert.ok(psnrOfPictures(await picture(page), await picture(other)) > 60);
    assert.equal(await get(other, "gain"), 3);
    await other.close();
  });
});

describe("keyboard", () => {
  it("goes through the page with Tab, presses buttons, and has the settings on M", async () => {
    await reset();
    const isOpen = () => page.evaluate(() => document.body.classList.contains("panel-open"));
    const before = await isOpen();
    await page.keyboard.press("m");
    assert.equal(await isOpen(), !before);
    await page.keyboard.press("m");
    await page.focus("#settings");
    await page.keyboard.press("Shift+Tab");
    assert.equal(await page.evaluate(() => document.activeElement.id), "help");
    await page.keyboard.press("Space");
    assert.equal(await page.evaluate(() => document.querySelector(".veil").hidden), false);
    await page.keyboard.press("Escape");
    assert.equal(await isOpen(), before);
    const isLeft = await page.evaluate(() => document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", code: "ArrowLeft", altKey: true, bubbles: true, cancelable: true })));
    assert.equal(isLeft, true, "the browser goes back with it");
  });
});

describe("a running command", () => {
  it("is asked for again where its news were refused", async () => {
    const folder = mkdtempSync(join(tmpdir(), "cnerf-live-"));
    mkdirSync(join(folder, "live"));
    const state = { version: 1, title: "room", task: "stage 1", fraction: 0.25, seconds: 3, paused: false, stopping: false, finished: false, message: "", figures: {}, curves: {}, pictures: [] };
    writeFileSync(join(folder, "live/state"), JSON.stringify(state));
    writeFileSync(join(folder, "live/events"), "");
    let asked = 0;
    const own = await serve([builtPage, folder], (path, bytes) => (path === "/live/events" ? ((asked += 1), null) : bytes));
    const shown = await open(context, own.url);
    for (let i = 0; i < 600 && asked < 2; ++i) await shown.waitForTimeout(100);
    assert.ok(asked >= 2);
    assert.match(await shown.locator("#live-status").textContent(), /waiting for it/);
    assert.equal(await shown.locator("[role=progressbar]").getAttribute("aria-valuenow"), "25");
    assert.deepEqual(shown.problems, []);
    await shown.close();
    await own.close();
    rmSync(folder, { recursive: true });
  });
});

describe("nested grids", () => {
  const nested = JSON.parse(readFileSync(join(fixture, "nested.json"), "utf8"));
  const ofNested = [builtPage, join(fixture, "nested")];
  const levelsThere = (shown) => shown.evaluate(() => window.cnerf.levels.there);
  const complete = (shown) => shown.waitForSelector("body[data-complete]", { state: "attached" });
  it("are shown as the program's integrator does: inside the finest, across its border, and all", async () => {
    const own = await serve(ofNested);
    const shown = await open(context, `${own.url}?still`);
    await complete(shown);
    assert.equal(await levelsThere(shown), 3);
    for (const [camera, image] of nested.images.entries()) {
      await shown.evaluate((i) => window.cnerf.app.goToCamera(i), camera);
      const decibel = psnr(await picture(shown, image.width, image.height), image.rgb);
      console.log(`# camera ${camera}: ${decibel.toFixed(2)} dB`);
      assert.ok(decibel >= 32, `${decibel} dB`);
    }
    assert.equal(await shown.evaluate(() => document.getElementById("missing").hidden), true, "nothing is left out");
    await shown.close();
    await own.close();
  });
  it("are seen coarse at first, then finer, each level as it comes", async () => {
    let release;
    const held = new Promise((resolve) => (release = resolve));
    const own = await serve(ofNested, (path, bytes) => (path === "/color_fine1.bin" ? held.then(() => bytes) : bytes));
    const shown = await open(context, `${own.url}?still`);
    assert.equal(await levelsThere(shown), 1, "the coarsest is enough to begin with");
    const image = nested.images[0];
    const coarse = psnr(await picture(shown, image.width, image.height), image.rgb);
    release();
    await complete(shown);
    assert.equal(await levelsThere(shown), 3);
    const fine = psnr(await picture(shown, image.width, image.height), image.rgb);
    assert.ok(coarse < fine - 6, `${coarse} dB, then ${fine} dB`);
    await shown.close();
    await own.close();
  });
  it("leave the finest bricks out where memory is short, without holes, and say so", async () => {
    const own = await serve(ofNested);
    const image = nested.images[2];
    const seen = {};
    for (const budget of ["0.1", "1.2", "64"]) {
      const shown = await open(context, `${own.url}?still&budget=${budget}`);
      await complete(shown);
      await shown.evaluate(() => window.cnerf.app.goToCamera(2));
      const { textureBytes } = await shown.evaluate(() => window.cnerf.renderer.statistics());
      const drawnPicture = await picture(shown, image.width, image.height, "none");
      const note = await shown.locator("#missing").textContent();
      seen[budget] = { levels: await levelsThere(shown), alpha: meanAlpha(drawnPicture), bytes: textureBytes, note };
      await shown.close();
    }
    console.log(`# ${JSON.stringify(seen)}`);
    assert.equal(seen["0.1"].levels, 1);
    assert.match(seen["0.1"].note, /Left out: the 2 finest levels.*budget=/);
    assert.match(seen["1.2"].note, /Left out: [0-9,]+ bricks? of level 2/);
    assert.ok(seen["1.2"].bytes < 1.3 * 2 ** 20 && seen["1.2"].bytes > seen["0.1"].bytes);
    assert.equal(seen["64"].note, "");
    for (const budget of ["0.1", "1.2"]) assert.ok(Math.abs(seen[budget].alpha - seen["64"].alpha) < 0.04 * seen["64"].alpha, "what is left out is shown coarser");
    await own.close();
  });
  it("stay as they are where a finer level is damaged, with the reason", async () => {
    const own = await serve(ofNested, (path, bytes) => (path === "/density_fine1.bin" ? bytes.subarray(0, 500) : bytes));
    const shown = await open(context, `${own.url}?still`);
    await complete(shown);
    assert.equal(await levelsThere(shown), 1);
    assert.match(await shown.locator("#missing").textContent(), /coarser than it is: density_fine1\.bin.*damaged/);
    assert.equal(await shown.locator("#message").isVisible(), false);
    await shown.close();
    await own.close();
  });
  it("show slices of the finest level that is there", async () => {
    const own = await serve(ofNested);
    const shown = await open(context, `${own.url}?still`);
    await complete(shown);
    await shown.evaluate(() => window.cnerf.app.goToCamera(2));
    await set(shown, { slice: { axis: 2, at: 0, quantity: "L" } });
    const fine = await picture(shown);
    assert.ok(brightness(fine) > 2);
    await shown.evaluate(() => (window.cnerf.renderer.levels = 1));
    assert.ok(psnrOfPictures(fine, await picture(shown)) < 30, "the coarsest would look otherwise");
    await shown.close();
    await own.close();
  });
});

describe("what leaves the page", () => {
  it("a camera path in the manner of transforms.json", async () => {
    await reset();
    await click("add-key");
    await page.evaluate(() => window.cnerf.app.goToCamera(1));
    await page.keyboard.press("k");
    const [download] = await Promise.all([page.waitForEvent("download"), click("export-path")]);
    const json = JSON.parse(readFileSync(await download.path(), "utf8"));
    assert.equal(json.frames.length, 120);
    assert.equal(json.key_frames.length, 2);
    const manifest = JSON.parse(readFileSync(join(fixture, "r8", "bundle.json"), "utf8"));
    const pose = manifest.cameras[0].world_from_camera;
    json.frames[0].transform_matrix.slice(0, 3).forEach((row, i) => {
      [pose[i][0], -pose[i][1], -pose[i][2], pose[i][3]].forEach((v, j) => assert.ok(Math.abs(row[j] - v) < 1e-9));
    });
  });
  it("a picture with alpha", async () => {
    await reset();
    await set(page, { background: "none" });
    const [download] = await Promise.all([page.waitForEvent("download"), click("screenshot")]);
    const image = await decoded(page, readFileSync(await download.path()));
    assert.deepEqual([image.width, image.height], [160, 105]);
    assert.equal(image.data[3], 0);
    assert.ok(meanAlpha(image) > 10);
  });
  it("no errors", () => assert.deepEqual(page.problems, []));
});

describe("trouble", () => {
  const message = (shown) => shown.locator("#message").textContent();
  const flip = (name) => (path, bytes) => (path === `/${name}` ? Buffer.from(bytes.map((b, i) => (i === 60 ? b ^ 8 : b))) : bytes);
  for (const [what, change, say] of [
    ["a damaged part", flip("color.bin"), /color\.bin.*damaged/],
    ["a cut part", (path, bytes) => (path === "/density.bin" ? bytes.subarray(0, 500) : bytes), /density\.bin.*damaged/],
    ["a missing part", (path, bytes) => (path === "/occupancy.bin" ? null : bytes), /occupancy\.bin.*404/],
    ["a cut manifest", (path, bytes) => (path === "/bundle.json" ? bytes.subarray(0, 700) : bytes), /bundle\.json.*not JSON/],
    ["parts that others wrote", (path, bytes) => (path === "/bundle.json" ? Buffer.from(bytes.toString().replace(/("stored_bricks": *)[0-9]+/, "$11")) : bytes), /bundle\.json.*bytes unpacked/],
    ["deep JSON", (path, bytes) => (path === "/bundle.json" ? Buffer.from(`{"schema": ${"[".repeat(1e6)}`) : bytes), /bundle\.json.*not JSON/],
    ["a list for a manifest", (path, bytes) => (path === "/bundle.json" ? Buffer.from("[]") : bytes), /bundle\.json: schema/],
    ["no bundle at all", (path, bytes) => (path === "/bundle.json" ? null : bytes), /no bundle\.json/],
  ]) {
    it(`${what} is said to be`, async () => {
      const own = await serve(folders, change);
      const shown = await open(context, own.url);
      assert.match(await message(shown), say);
      await shown.close();
      await own.close();
    });
  }
  it("a browser without WebGL 2 is told so", async () => {
    const shown = await open(context, server.url, () => {
      const real = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind === "webgl2" ? null : real.call(this, kind, ...rest);
      };
    });
    assert.match(await message(shown), /does not offer WebGL 2/);
    await shown.close();
  });
  it("textures that are too small are told, with what to do", async () => {
    const shown = await open(context, server.url, () => {
      const real = WebGL2RenderingContext.prototype.getParameter;
      WebGL2RenderingContext.prototype.getParameter = function (name) {
        return name === this.MAX_3D_TEXTURE_SIZE ? 16 : real.call(this, name);
      };
    });
    assert.match(await message(shown), /16 texels.*--web-resolution/);
    await shown.close();
  });
  it("a bundle opened as a file says what to do", async () => {
    const shown = await open(context, `file://${builtPage}/index.html`);
    assert.match(await message(shown), /needs a web server[^]*cnerf view[^]*http\.server/);
    await shown.close();
  });
  it("two tabs do not mind each other", async () => {
    await reset();
    const other = await open(context, `${server.url}?still`);
    await other.evaluate(() => window.cnerf.app.goToCamera(1));
    const [first, second] = await Promise.all([picture(page), picture(other)]);
    assert.ok(psnr(first, expected.images[0].rgb) > 32);
    assert.ok(psnr(second, expected.images[1].rgb) > 32);
    await other.close();
  });
  it("a server that ended is said to have; the volume stays; and it comes back", async () => {
    const own = await serve(folders);
    const shown = await open(context, `${own.url}?still`);
    await own.close();
    assert.ok(psnr(await picture(shown), expected.images[0].rgb) > 32, "what is loaded can still be looked at");
    const again = await serve(folders, undefined, own.port);
    await shown.reload({ timeout: 600_000 });
    await shown.waitForSelector("body[data-ready]", { state: "attached" });
    await again.close();
    // A server that goes while the page loads.
    const late = await serve(folders, (path, bytes) => (path === "/bundle.json" ? (setTimeout(() => late.close(), 0), bytes) : bytes));
    const waiting = await open(context, late.url);
    assert.match(await message(waiting), /server does not answer|connection broke/);
    await waiting.close();
    await shown.close();
  });
});

describe("phone", () => {
  it("has everything within reach", async () => {
    const small = await browser.newContext({ viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true, deviceScaleFactor: 1 });
    const shown = await open(small, `${server.url}?still`);
    await shown.evaluate(() => (window.cnerf.renderer.frame = () => false)); // the volume was drawn; what follows is about what is around it
    assert.equal(await shown.evaluate(() => document.documentElement.scrollWidth), 390);
    assert.equal(await shown.evaluate(() => document.body.classList.contains("panel-open")), false, "the picture comes first");
    await shown.tap("#settings");
    await shown.waitForFunction(() => document.getElementById("panel").getBoundingClientRect().bottom <= innerHeight + 1);
    const panel = await shown.locator("#panel").boundingBox();
    assert.ok(panel.x >= 0 && panel.width <= 390 && panel.y > 250, JSON.stringify(panel));
    for (const button of await shown.locator(".tools button:visible").all()) {
      const box = await button.boundingBox();
      assert.ok(box.x >= 0 && box.x + box.width <= 390 && box.width >= 36);
    }
    await small.close();
  });
});
