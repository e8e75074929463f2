/** A browser, a static server, the program, and pictures to compare. */

import { spawn } from "node:child_process";
import { createServer } from "node:http";
import { existsSync, readFileSync, statSync } from "node:fs";
import { extname, join } from "node:path";

export const fixture = process.env.CNERF_FIXTURE;
export const builtPage = process.env.CNERF_BUILT_PAGE ?? new URL("../../dist", import.meta.url).pathname;
export const program = process.env.CNERF_PROGRAM ?? "";
/** Software rendering on a busy machine takes its time. */
export const patience = 600_000;

const types = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json", ".svg": "image/svg+xml", ".webp": "image/webp", ".jpg": "image/jpeg" };

export async function launch(extra = []) {
  const { chromium } = await import("playwright-core"); // not every measure needs a browser
  return chromium.launch({
    executablePath: process.env.CNERF_CHROMIUM ?? "/usr/bin/chromium",
    // SwiftShader for WebGL alone: it would draw every frame of a page, ten times as slowly as Chromium itself.
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", ...extra],
    timeout: patience,
  });
}

/** Any static server will do; `change(path, bytes)` may alter, delay (by a promise) or withhold (null) what is served. */
export async function serve(folders, change = (_, bytes) => bytes, port = 0) {
  const server = createServer(async (request, response) => {
    let path = decodeURIComponent(request.url.split("?")[0]);
    if (path === "/") path = "/index.html";
    const found = folders.map((folder) => join(folder, path)).find((file) => existsSync(file) && statSync(file).isFile());
    const bytes = found ? await change(path, readFileSync(found)) : null;
    if (bytes === null) {
      response.statusCode = 404;
      return response.end();
    }
    response.setHeader("Content-Type", types[extname(path)] ?? "application/octet-stream");
    response.setHeader("Connection", "close");
    response.end(bytes);
  });
  await new Promise((resolve) => server.listen(port, "127.0.0.1", resolve));
  return { port: server.address().port, url: `http://127.0.0.1:${server.address().port}/`, close: () => new Promise((done) => (server.closeAllConnections(), server.close(done))) };
}

/** Runs the program to its end. */
export function run(args) {
  return new Promise((resolve) => {
    const child = spawn(program, args);
    let out = "";
    child.stdout.on("data", (text) => (out += text));
    child.stderr.on("data", (text) => (out += text));
    child.on("close", (code) => resolve({ code, out }));
  });
}

/** Starts the program and waits for the address it prints. */
export async function startServing(args) {
  const child = spawn(program, [...args, "--no-browser", "--progress", "plain"]);
  let out = "";
  const ended = new Promise((resolve) => child.on("close", resolve));
  const url = await new Promise((resolve, reject) => {
    const hear = (text) => {
      out += text;
      const found = /view: (http\S+)/.exec(out);
      if (found) resolve(found[1]);
    };
    child.stdout.on("data", hear);
    child.stderr.on("data", hear);
    child.on("close", (code) => reject(new Error(`ended with ${code}: ${out}`)));
  });
  return { url, child, ended, output: () => out };
}

/** Opens the page and waits until the volume, or a message, is there. */
export async function open(context, url, script) {
  const page = await context.newPage();
  page.setDefaultTimeout(patience);
  page.problems = [];
  page.on("pageerror", (error) => page.problems.push(error.message));
  if (script) await page.addInitScript(script);
  await page.goto(url, { timeout: patience });
  await page.waitForSelector("body[data-ready], #message:not([hidden]), .live-page", { state: "attached" });
  return page;
}

/** The page's picture of what it shows: { width, height, data: RGBA bytes }. Software draws each of the rays per pixel. */
export async function picture(page, width = 160, height = 120, background = "#000000", rays = 4) {
  const list = await page.evaluate(
    async ([w, h, b, r]) => {
      const image = await window.cnerf.renderer.picture(w, h, b, r);
      let text = "";
      for (const byte of image.data) text += String.fromCharCode(byte);
      return btoa(text);
    },
    [width, height, background, rays],
  );
  return { width, height, data: Buffer.from(list, "base64") };
}

/** Draws on the photograph that is open, as a hand does: places are shares of its width and height. */
export async function drawStroke(page, points, steps = 6) {
  const places = [];
  for (const [u, v] of points) {
    places.push(await page.evaluate(([x, y]) => {
      const { easel } = window.cnerf.studio;
      const box = easel.canvas.getBoundingClientRect();
      return { x: box.left + easel.corner.x + x * easel.photo.width * easel.scale, y: box.top + easel.corner.y + y * easel.photo.height * easel.scale };
    }, [u, v]));
  }
  await page.mouse.move(places[0].x, places[0].y);
  await page.mouse.down();
  for (const { x, y } of places) await page.mouse.move(x, y, { steps });
  await page.mouse.up();
}

export const set = (page, settings) => page.evaluate((s) => window.cnerf.app.set(s), settings);
export const get = (page, name) => page.evaluate((n) => window.cnerf.app.settings[n], name);

export function srgb(linear) {
  const c = Math.min(1, Math.max(0, linear));
  return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
}

/** dB between RGB of a picture and linear RGB over black, both in sRGB. */
export function psnr(image, rgb) {
  let total = 0;
  for (let p = 0; p < image.width * image.height; ++p) {
    for (let c = 0; c < 3; ++c) total += (image.data[4 * p + c] / 255 - srgb(rgb[3 * p + c])) ** 2;
  }
  return -10 * Math.log10(total / (3 * image.width * image.height));
}

export function psnrOfPictures(a, b) {
  let total = 0;
  for (let p = 0; p < a.width * a.height; ++p) for (let c = 0; c < 3; ++c) total += ((a.data[4 * p + c] - b.data[4 * p + c]) / 255) ** 2;
  return -10 * Math.log10(Math.max(total, 1e-9) / (3 * a.width * a.height));
}

/** Mean of |max - min| of a pixel's channels: how colourful a part of a picture is. */
export function chroma(image, from = 0, to = 1) {
  let total = 0;
  let count = 0;
  for (let y = 0; y < image.height; ++y) {
    for (let x = Math.floor(from * image.width); x < Math.floor(to * image.width); ++x) {
      const [r, g, b] = image.data.subarray(4 * (y * image.width + x));
      total += Math.max(r, g, b) - Math.min(r, g, b);
      count += 1;
    }
  }
  return total / count;
}

/** Mean of the channels. */
export function brightness(image) {
  let total = 0;
  for (let p = 0; p < image.width * image.height; ++p) total += image.data[4 * p] + image.data[4 * p + 1] + image.data[4 * p + 2];
  return total / (3 * image.width * image.height);
}
export function meanAlpha(image) {
  let total = 0;
  for (let p = 0; p < image.width * image.height; ++p) total += image.data[4 * p + 3];
  return total / (image.width * image.height);
}

/** A PNG file's picture, decoded by the browser. */
export async function decoded(page, bytes) {
  const [width, height, data] = await page.evaluate(async (base64) => {
    const blob = new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], { type: "image/png" });
    const bitmap = await createImageBitmap(blob, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data: pixels } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let text = "";
    for (const byte of pixels) text += String.fromCharCode(byte);
    return [bitmap.width, bitmap.height, btoa(text)];
  }, bytes.toString("base64"));
  return { width, height, data: Buffer.from(data, "base64") };
}

/** A picture as a PNG file. */
export async function encoded(page, { width, height, data }) {
  const base64 = await page.evaluate(async ([w, h, bytes]) => {
    const canvas = new OffscreenCanvas(w, h);
    canvas.getContext("2d").putImageData(new ImageData(Uint8ClampedArray.from(atob(bytes), (c) => c.charCodeAt(0)), w, h), 0, 0);
    const file = new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
    return btoa(Array.from(file, (b) => String.fromCharCode(b)).join(""));
  }, [width, height, Buffer.from(data).toString("base64")]);
  return Buffer.from(base64, "base64");
}
