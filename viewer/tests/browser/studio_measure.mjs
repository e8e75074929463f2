/**
 * What the studio is like to use, with the real program (CNERF_PROGRAM) and Chromium. The run is copied, not changed.
 *
 *   node viewer/tests/browser/studio_measure.mjs RUN [--take TAKE] [--rounds 3]
 *       milliseconds of a frame of 1280 x 720 and of a coarse one at an HTTP client, encoding included, before a browser
 *       runs; then, in the page, from a drag that turns the camera to the first new frame and to the last
 *   node viewer/tests/browser/studio_measure.mjs RUN --strokes FILE
 *       paints the strokes of a stroke file of one photograph by pointer events on a grey take, colours, keeps the take
 *       and prints the seconds until colours change and settle, and the held-out ab error
 *   --no-browser   what an HTTP client can tell alone: frames, and strokes that it sends
 */

import { cpSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { drawStroke, launch, open, patience, run, startServing } from "./support.mjs";

const argument = (name, usual) => (process.argv.includes(name) ? process.argv.splice(process.argv.indexOf(name), 2)[1] : usual);
const withBrowser = !process.argv.includes("--no-browser");
const [take, strokes, rounds] = [argument("--take", ""), argument("--strokes", ""), Number(argument("--rounds", "3"))];
const folder = mkdtempSync(join(tmpdir(), "cnerf-measure-"));
const copy = join(folder, "run");
cpSync(process.argv[2], copy, { recursive: true });
if (strokes) await ok(["colorize", copy, "--colorizer", "grey", "--take", "measured-grey"]);
const begins = strokes ? "measured-grey" : take;
const serving = await startServing(["studio", copy, ...(begins ? ["--take", begins] : [])]);
const get = async (path) => (await fetch(`${serving.url}studio/${path}`)).json();
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
const row = (what, value, unit) => console.log(`${what.padEnd(62)} ${value.toFixed(value < 100 ? 2 : 0).padStart(8)} ${unit}`);
let browser = null;

/** Runs the program, which must succeed. */
async function ok(args) {
  const { code, out } = await run(args);
  if (code !== 0) throw new Error(`${args.join(" ")}: ${out}`);
}

/** The page, once it shows the last frame of where it begins. */
async function openPage() {
  browser = await launch();
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
  const page = await open(context, serving.url);
  await page.waitForFunction(() => window.cnerf.studio?.field.settled, null, { timeout: patience });
  return page;
}

/** Milliseconds until a frame is there as a whole. */
async function frame(view, width, height, sides) {
  const f = (view.lens.fy * height) / view.height;
  const lens = { model: "PINHOLE", width, height, fx: f, fy: f, cx: width / 2, cy: height / 2 };
  const begin = performance.now();
  const answer = await fetch(`${serving.url}studio/frame`, {
    method: "POST",
    headers: { "X-Cnerf": "1", "X-Cnerf-Client": "measure1" },
    body: JSON.stringify({ position: view.position, rotation: view.rotation, lens, sides }),
  });
  if (!answer.ok) throw new Error(`a frame: ${answer.status} ${await answer.text()}`);
  await answer.arrayBuffer();
  return performance.now() - begin;
}

async function measureFrames() {
  const { views } = await get("scene");
  const seen = [0.5, 0.1, 0.8].map((place) => views[Math.floor(place * views.length)]);
  const both = ["", "now"];
  while (!(await get("state")).ready) await new Promise((soon) => setTimeout(soon, 50)); // it caches views first
  await frame(seen[0], 160, 90, both);
  for (const [width, height, sides] of [[160, 90, both], [1280, 720, ["now"]], [1280, 720, both]]) {
    for (const view of seen) {
      const times = [];
      for (let i = 0; i < rounds; ++i) times.push(await frame(view, width, height, sides));
      row(`HTTP, ${sides === both ? "grey and colour" : "colour"}, ${width} x ${height} as ${view.name}`, median(times), "ms");
    }
  }
}

async function measurePage() {
  const page = await openPage();
  const [first, last] = [[], []];
  for (let i = 0; i < rounds; ++i) {
    await page.mouse.move(640, 360);
    await page.mouse.down();
    await page.evaluate(() => {
      const { field } = window.cnerf.studio;
      const shown = (window.shown = { begin: 0, first: 0, last: 0 });
      const before = field.frameShown;
      field.canvas.addEventListener("pointermove", () => (shown.begin = performance.now()), { once: true, capture: true });
      const look = () => {
        const now = performance.now() - shown.begin;
        if (field.frameShown !== before) shown.first ||= now;
        if (shown.first > 0 && field.settled) shown.last = now;
        else requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    });
    await page.mouse.move(680 + 10 * i, 370);
    await page.mouse.up();
    await page.waitForFunction(() => window.shown.last > 0, null, { timeout: patience });
    const shown = await page.evaluate(() => window.shown);
    first.push(shown.first);
    last.push(shown.last);
  }
  row("Chromium, from a drag to the first new frame", median(first), "ms");
  row("Chromium, from a drag to the last frame", median(last), "ms");
}

/** Milliseconds from an order to colour until colours change, until they are settled, and to keep them: by pointer events. */
async function colourInPage(list) {
  const page = await openPage();
  const until = (what, value) => page.waitForFunction(what, value, { timeout: patience });
  const photo = await page.evaluate((name) => window.cnerf.session.views.findIndex((view) => view.name === name), list.strokes[0].view);
  await until(() => window.cnerf.session.state.ready);
  await page.evaluate((i) => window.cnerf.studio.paint(i), photo);
  await page.waitForSelector(`[data-photo="${photo}"]`, { timeout: patience });
  await page.evaluate((everywhere) => window.cnerf.session.strokes.setEverywhere(everywhere), list.everywhere ?? false);
  for (const { kind, color, size, softness = 0, reach = 1, points } of list.strokes) {
    await page.evaluate((brush) => window.cnerf.session.brush.set(brush), { tool: kind === "grey" ? "grey" : "brush", color, size, softness, reach, exact: kind === "exact" });
    await drawStroke(page, points, 1);
  }
  await until(() => window.cnerf.session.strokes.isSaved);
  const colors = await page.evaluate(() => window.cnerf.session.state.colors);
  const begin = performance.now();
  await page.keyboard.press("c");
  await until((before) => window.cnerf.session.state.colors !== before, colors);
  const changed = performance.now();
  await until(() => window.cnerf.session.state.unkept && window.cnerf.session.state.task === "");
  const settled = performance.now();
  await page.evaluate(() => window.cnerf.session.order({ order: "keep", name: "painted" }));
  await until(() => window.cnerf.session.state.takes.some((take) => take.name === "painted"));
  await until(() => window.cnerf.session.state.task === "");
  return [changed - begin, settled - begin];
}

/** The studio's news: what it said last, and waiting until it says something. */
async function follow(client) {
  const news = { state: await get("state"), hear: () => {} };
  news.until = async (what) => {
    while (!what(news.state)) await new Promise((heard) => (news.hear = heard));
    return performance.now();
  };
  const events = await fetch(`${serving.url}studio/events?client=${client}`);
  const listen = async () => {
    let text = "";
    for await (const part of events.body.pipeThrough(new TextDecoderStream())) {
      const messages = (text + part).split("\n\n");
      text = messages.pop();
      for (const message of messages.filter((one) => one.startsWith("data: "))) news.state = JSON.parse(message.slice("data: ".length));
      news.hear();
    }
  };
  listen().catch(() => {}); // the studio ends first
  return news;
}

/** The same by a client that sends the strokes. */
async function colourByClient({ strokes: painted, viewpoints = [], everywhere = false }) {
  const client = "measure1";
  const news = await follow(client);
  const send = async (method, path, body, revision = news.state.strokes) => {
    const headers = { "X-Cnerf": "1", "X-Cnerf-Client": client, "X-Cnerf-Revision": String(revision) };
    const answer = await fetch(`${serving.url}studio/${path}`, { method, headers, body: JSON.stringify(body) });
    if (!answer.ok) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
  };
  await news.until((state) => state.ready);
  await send("PUT", "strokes", { strokes: painted, viewpoints, everywhere });
  const { colors } = news.state;
  const begin = performance.now();
  await send("POST", "orders", { order: "colour" });
  const changed = await news.until((state) => state.colors !== colors);
  const settled = await news.until((state) => state.unkept && state.task === "");
  await send("POST", "orders", { order: "keep", name: "painted" });
  await news.until((state) => state.takes.some((one) => one.name === "painted") && state.task === "");
  return [changed - begin, settled - begin];
}

async function measureStrokes() {
  const list = JSON.parse(readFileSync(strokes, "utf8"));
  const [changed, settled] = await (withBrowser ? colourInPage : colourByClient)(list);
  serving.child.kill("SIGINT");
  await serving.ended;
  await ok(["eval", copy, "--take", "painted"]);
  const { mean } = JSON.parse(readFileSync(join(copy, "metrics.json"), "utf8"));
  row("colour: until colours change", changed / 1000, "s");
  row("colour: until they are settled", settled / 1000, "s");
  row("held-out ab error", mean.ab_error, "");
  row("  share of grey's", (100 * mean.ab_error) / mean.ab_error_grey, "%");
}

try {
  if (strokes) {
    await measureStrokes();
  } else {
    await measureFrames();
    if (withBrowser) await measurePage();
  }
} finally {
  await browser?.close();
  serving.child.kill("SIGINT");
  await serving.ended;
  rmSync(folder, { recursive: true });
}
