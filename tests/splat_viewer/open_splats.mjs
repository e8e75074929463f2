// node open_splats.mjs NODE_MODULES CHROMIUM FOLDER
// Opens FOLDER/splats.ply and FOLDER/splats.spz by Spark in a browser that draws in software, from FOLDER/camera.json,
// and writes what was read to FOLDER/NAME.json (a row per splat: centre, deviations, w x y z, opacity, colour) and what
// was drawn to FOLDER/NAME.rgb (rows from the top).
import { createServer } from "node:http";
import { existsSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, extname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const [modules, executablePath, folder] = process.argv.slice(2).map((path) => resolve(path));
const { chromium } = createRequire(join(modules, "/"))("playwright-core");
const patience = 600_000;  // software rendering on a busy machine takes its time
const types = { ".html": "text/html", ".js": "text/javascript" };

const folders = [dirname(fileURLToPath(import.meta.url)), modules, folder];
const server = createServer((request, response) => {
  const path = decodeURIComponent(request.url.split("?")[0]);
  const file = folders.map((root) => join(root, path)).find((name) => existsSync(name) && statSync(name).isFile());
  if (!file) return response.writeHead(404).end();
  response.writeHead(200, { "Content-Type": types[extname(file)] ?? "application/octet-stream" });
  response.end(readFileSync(file));
});
await new Promise((done) => server.listen(0, "127.0.0.1", done));

const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader-webgl", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
  timeout: patience,
});
const camera = JSON.parse(readFileSync(join(folder, "camera.json"), "utf8"));
async function open(name) {
  const page = await browser.newPage();
  page.setDefaultTimeout(patience);
  page.on("pageerror", (error) => {
    console.log(`page: ${error.message}`);
    process.exit(1);
  });
  page.on("console", (message) => message.type() === "error" && console.log(`console: ${message.text()}`));
  await page.goto(`http://127.0.0.1:${server.address().port}/page.html`, { timeout: patience });
  await page.waitForFunction(() => window.ready);
  const { read, pixels } = await page.evaluate(([file, view]) => window.show(file, view), [`/${name}`, camera]);
  const rgb = Buffer.alloc(3 * camera.width * camera.height);
  for (let y = 0; y < camera.height; ++y) {
    for (let x = 0; x < camera.width; ++x) {
      for (let c = 0; c < 3; ++c) {
        rgb[3 * (y * camera.width + x) + c] = pixels[4 * ((camera.height - 1 - y) * camera.width + x) + c];
      }
    }
  }
  writeFileSync(join(folder, `${name}.json`), JSON.stringify(read));
  writeFileSync(join(folder, `${name}.rgb`), rgb);
  await page.close();
}
await Promise.all(["splats.ply", "splats.spz"].map(open));
await browser.close();
server.close();
