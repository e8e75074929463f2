/**
 * A stand-in for the server of `cnerf studio`: it speaks the contract, with pictures of its own. Where the program is
 * there, the same tests run against that (CNERF_STUDIO_URL).
 */

import { randomBytes } from "node:crypto";
import { createServer } from "node:http";
import { existsSync, readFileSync, statSync } from "node:fs";
import { extname, join } from "node:path";
import { deflateSync } from "node:zlib";

const types = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };

function chunk(kind, bytes) {
  const body = Buffer.concat([Buffer.from(kind, "latin1"), bytes]);
  const out = Buffer.alloc(body.length + 8);
  out.writeUInt32BE(bytes.length, 0);
  body.copy(out, 4);
  out.writeUInt32BE(crc(body), body.length + 4);
  return out;
}
const table = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; ++k) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n >>> 0;
});
function crc(bytes) {
  let c = ~0;
  for (let i = 0; i < bytes.length; ++i) c = table[(c ^ bytes[i]) & 255] ^ (c >>> 8);
  return ~c >>> 0;
}

/** @param data  `channels` bytes a pixel, 3 or 4 */
export function png(width, height, channels, data) {
  const rows = Buffer.alloc((width * channels + 1) * height);
  for (let y = 0; y < height; ++y) Buffer.from(data.buffer, data.byteOffset + y * width * channels, width * channels).copy(rows, y * (width * channels + 1) + 1);
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, channels === 4 ? 6 : 2, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]), chunk("IHDR", head), chunk("IDAT", deflateSync(rows, { level: 1 })), chunk("IEND", Buffer.alloc(0))]);
}

/** A ball before a wall, a little further along in every view. */
function ballPicture(index, width = 252, height = 189) {
  const rgb = Buffer.alloc(3 * width * height);
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) {
      const [u, v] = [(x / width - 0.5 - 0.02 * (index - 3)) * (width / height), y / height - 0.52];
      const d = Math.hypot(u, v) / 0.3;
      const light = d < 1 ? 70 + 150 * Math.sqrt(1 - d * d) * (0.7 - 0.5 * v) : 46 + 40 * (y / height) + 8 * Math.sin(30 * u);
      const color = d < 1 ? [1.25, 0.85, 0.6] : [0.8, 1, 1.2];
      color.forEach((c, k) => (rgb[3 * (y * width + x) + k] = Math.min(255, light * c)));
    }
  }
  return { width, height, rgb };
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((v) => v / Math.hypot(...a));
function camera(index, count, { width, height }) {
  const angle = 0.9 * ((index + 0.5) / count - 0.5);
  const position = [3 * Math.sin(angle), 0.4, 3 * Math.cos(angle)];
  const forward = unit(position.map((v) => -v));
  const right = unit(cross(forward, [0, 1, 0]));
  const down = cross(forward, right);
  const rotation = [0, 1, 2].map((i) => [right[i], down[i], forward[i]]);
  return { position, rotation, lens: { width, height, fx: 1.1 * width, fy: 1.1 * width, cx: width / 2, cy: height / 2 } };
}
const luma = (rgb, p) => Math.round(0.2126 * rgb[p] + 0.7152 * rgb[p + 1] + 0.0722 * rgb[p + 2]);
/** Number of the pixel of `count` that a place lies in, or that is nearest to it. */
const within = (place, count) => Math.min(count - 1, Math.max(0, Math.floor(place)));

/** A stroke as the program writes it: without what is 0, false or empty. */
const written = (stroke) => Object.fromEntries(Object.entries(stroke).filter(([, value]) => value && value.length !== 0));

const wantedKinds = /\.(jpe?g|png|tiff?|webp|mp4|mov|mkv|avi|webm|m4v|json|bin|txt|npy|npz|xml|csv|xmp|exr|ply)$/i;

/**
 * @param pictures  [{ width, height, rgb }]: what the views show, in colour; left out, a ball
 * @param stage     what there is at first: "photographs", "training" or "field"
 * @param source    photographs that the studio was started with, "" = none
 * @param slow      steps of work wait for advance() instead of a clock
 */
export class StudioMock {
  constructor(page, { pictures, count = 8, title = "ball", steps = 6, stage = "field", source = "", slow = false } = {}) {
    this.page = page;
    this.steps = steps;
    this.slow = slow;
    this.pictures = pictures ?? Array.from({ length: count }, (_, i) => ballPicture(i));
    /** Their bytes by what they are shown with. */
    this.grades = new Map();
    this.scene = {
      title, run: "/runs/ball", up: "+y", centre: [0, 0, 0], radius: 1.6, home: 1,
      views: this.pictures.map((picture, i) => ({ name: `images/${String(i).padStart(4, "0")}.png`, held_out: i === this.pictures.length - 1, width: picture.width, height: picture.height, ...camera(i, this.pictures.length, picture) })),
    };
    this.state = {
      version: 1, stage, scene: 1, notes: [], arrived: { files: 0, bytes: 0, source }, finish: { saturation: 1, hue: 0, exposure: 0 }, colors: 1, task: "", fraction: 0, figures: {}, message: "", failed: false, ready: stage === "field", writer: "", strokes: 0, take: "",
      unkept: false, takes: [], commands: [], downloads: [], blender: "", cards: [], key_views: [],
    };
    this.strokes = [];
    this.viewpoints = [];
    this.painted = new Map();
    /** Files that were sent: name -> bytes. */
    this.arrived = new Map();
    /** Names -> what a piece of such a file is answered with: { status, sentence, times }. */
    this.refusals = new Map();
    this.prepareFails = "";
    this.amount = 0;
    this.amounts = {};
    this.streams = new Map();
    this.requests = [];
    this.timer = null;
  }
  async start(port = 0) {
    this.server = createServer((request, response) => this.answer(request, response).catch((problem) => response.headersSent || response.writeHead(500).end(String(problem))));
    await new Promise((resolve) => this.server.listen(port, "127.0.0.1", resolve));
    this.port = this.server.address().port;
    this.url = `http://127.0.0.1:${this.port}/`;
    return this;
  }
  async close() {
    clearInterval(this.timer);
    this.streams.clear();
    await new Promise((done) => (this.server.closeAllConnections(), this.server.close(done)));
  }
  change(partial) {
    Object.assign(this.state, partial, { version: this.state.version + 1 });
    const line = `data: ${JSON.stringify(this.state)}\n\n`;
    for (const stream of this.streams.keys()) stream.write(line);
  }

  async answer(request, response) {
    const url = new URL(request.url, "http://localhost");
    const path = decodeURIComponent(url.pathname);
    const parts = [];
    for await (const part of request) parts.push(part);
    const body = Buffer.concat(parts);
    if (!path.startsWith("/studio/")) return this.file(path, response);
    const what = path.slice(8);
    this.requests.push(`${request.method} ${what}`);
    const client = request.headers["x-cnerf-client"] ?? "";
    if (request.method !== "GET" && (request.headers["x-cnerf"] !== "1" || !/^[a-z0-9]{8,32}$/i.test(client))) return this.refuse(response, 403, "The header X-Cnerf is missing.");
    const [kind, index] = what.split("/");
    const number = Number(index ?? -1);
    const isOfView = ["photos", "thumbnails", "reach"].includes(kind);
    if (request.method === "GET" && isOfView && index !== undefined && !this.pictures[number] && !this.viewpoints[number - this.pictures.length]) return this.refuse(response, 404, "There is no such view.");
    const handlers = {
      "GET scene": () => this.json(response, 200, this.state.stage === "photographs" ? { title: "", run: "/runs/ball", up: "+y", centre: [0, 0, 0], radius: 1, views: [], home: 0 } : this.scene),
      "GET state": () => this.json(response, 200, this.state),
      "GET events": () => this.events(url.searchParams.get("client") ?? "", response),
      "GET strokes": () => this.json(response, 200, { revision: this.state.strokes, strokes: this.strokes.map(written), viewpoints: this.viewpoints, ...(this.everywhere ? { everywhere: true } : {}) }),
      "GET painted": () => {
        const bytes = this.painted.get(url.searchParams.get("picture"));
        return bytes ? response.writeHead(200, { "Content-Type": "image/png" }).end(bytes) : this.refuse(response, 404, "There is no such picture.");
      },
      "PUT arrivals": () => this.isWriter(client, response) && this.arrive(response, url.searchParams.get("name"), Number(url.searchParams.get("offset")), body),
      "GET photos": () => this.picture(response, this.sampled(number, Number(url.searchParams.get("side") ?? 0), 0)),
      "GET thumbnails": () => (this.state.ready ? this.picture(response, this.sampled(number, 160, this.amount)) : this.refuse(response, 503, "Views are traced.")),
      "GET reach": () => this.reach(response, number, this.strokes),
      "POST reach": () => {
        const wish = JSON.parse(body);
        return this.reach(response, wish.view, [...this.strokes, ...wish.strokes]);
      },
      "POST frame": () => this.frame(response, JSON.parse(body)),
      "PUT strokes": () => this.isWriter(client, response) && this.put(response, Number(request.headers["x-cnerf-revision"]), JSON.parse(body)),
      "POST orders": () => this.isWriter(client, response) && this.order(response, JSON.parse(body)),
      "POST pictures": () => this.isWriter(client, response) && this.taken(response, url.searchParams, body),
    };
    const handler = handlers[`${request.method} ${kind}`];
    if (!handler) return this.refuse(response, 404, "There is no such address.");
    handler();
  }
  file(path, response) {
    const file = join(this.page, path === "/" ? "index.html" : path);
    if (path === "/bundle.json" || !existsSync(file) || !statSync(file).isFile()) return this.refuse(response, 404, "not found");
    response.writeHead(200, { "Content-Type": types[extname(file)] ?? "application/octet-stream" }).end(readFileSync(file));
  }
  json(response, status, value) {
    response.writeHead(status, { "Content-Type": "application/json", "Cache-Control": "no-cache" }).end(JSON.stringify(value));
  }
  refuse(response, status, sentence) {
    response.writeHead(status, { "Content-Type": "text/plain" }).end(sentence);
    return false;
  }
  events(client, response) {
    response.writeHead(200, { "Content-Type": "text/event-stream", "Cache-Control": "no-cache" });
    response.write(`retry: 200\ndata: ${JSON.stringify(this.state)}\n\n`);
    this.streams.set(response, client);
    response.on("close", () => {
      if (!this.streams.delete(response)) return;
      if (this.state.writer === client && ![...this.streams.values()].includes(client)) this.change({ writer: "" });
    });
  }
  isWriter(client, response) {
    if (this.state.writer === "") this.change({ writer: client });
    return this.state.writer === client || this.refuse(response, 423, "Another tab paints here.");
  }

  // Pictures.

  /** A view's picture with an amount of its colours, and the finish. */
  graded(index, amount) {
    const { saturation, exposure } = this.state.finish;
    const key = [index, amount, saturation, exposure].join();
    if (!this.grades.has(key)) {
      amount *= saturation;
      const light = 2 ** (exposure / 2.2);
      const { rgb } = this.pictures[index];
      const bytes = Buffer.alloc(rgb.length);
      for (let p = 0; p < rgb.length; p += 3) {
        const grey = luma(rgb, p);
        for (let k = p; k < p + 3; ++k) bytes[k] = Math.max(0, Math.min(255, (grey + (rgb[k] - grey) * amount) * light));
      }
      this.grades.set(key, bytes);
    }
    return this.grades.get(key);
  }
  /** @param across, down  a pixel's centre -> place in the view's picture */
  resampled(index, amount, width, height, across, down) {
    const own = this.pictures[index];
    const from = this.graded(index, amount);
    const columns = Int32Array.from({ length: width }, (_, x) => 3 * within(across(x + 0.5), own.width));
    const data = Buffer.alloc(3 * width * height);
    for (let y = 0, at = 0; y < height; ++y) {
      const row = 3 * own.width * within(down(y + 0.5), own.height);
      for (let x = 0; x < width; ++x, at += 3) {
        const p = row + columns[x];
        data[at] = from[p];
        data[at + 1] = from[p + 1];
        data[at + 2] = from[p + 2];
      }
    }
    return { width, height, channels: 3, data };
  }
  /** What stands at a viewpoint is what the nearest view shows. */
  sampled(index, side, amount) {
    const viewpoint = this.viewpoints[index - this.pictures.length];
    if (viewpoint) {
      const { width, height } = viewpoint.lens;
      const scale = side > 0 ? Math.min(1, side / Math.max(width, height)) : 1;
      return this.seen(viewpoint.position, this.scaled(viewpoint.lens, scale), amount);
    }
    const own = this.pictures[index];
    const scale = side > 0 ? Math.min(1, side / Math.max(own.width, own.height)) : 1;
    const [width, height] = [Math.round(own.width * scale), Math.round(own.height * scale)];
    return this.resampled(index, amount, width, height, (x) => x / scale, (y) => y / scale);
  }
  picture(response, { width, height, channels, data }, headers = {}) {
    response.writeHead(200, { "Content-Type": "image/png", ...headers }).end(png(width, height, channels, data));
  }
  scaled({ width, height, fx, fy, cx, cy }, scale) {
    return { width: Math.round(width * scale), height: Math.round(height * scale), fx: fx * scale, fy: fy * scale, cx: cx * scale, cy: cy * scale };
  }
  frame(response, { position, lens, sides }) {
    const { width, height } = lens;
    if (!(width > 0 && height > 0 && width <= 4096 && height <= 4096)) return this.refuse(response, 400, "lens: a picture has 1 to 4096 pixels a side.");
    const amounts = sides.map((side) => (side === "" ? 0 : side === "now" ? this.amount : (this.amounts[side] ?? 0)));
    const pictures = amounts.map((amount) => this.seen(position, lens, amount)).map(({ width: w, height: h, channels, data }) => png(w, h, channels, data));
    const sizes = pictures.map((one) => one.length).join();
    response.writeHead(200, { "Content-Type": "image/png", "X-Cnerf-Colors": String(this.state.colors), "X-Cnerf-Sizes": sizes, "X-Cnerf-Milliseconds": "20" });
    response.end(Buffer.concat(pictures));
  }
  seen(position, lens, amount) {
    const distance = ({ position: p }) => Math.hypot(...p.map((v, k) => v - position[k]));
    const index = this.scene.views.reduce((best, view, i, all) => (distance(view) < distance(all[best]) ? i : best), 0);
    const own = this.scene.views[index].lens;
    return this.resampled(index, amount, lens.width, lens.height, (x) => own.cx + ((x - lens.cx) / lens.fx) * own.fx, (y) => own.cy + ((y - lens.cy) / lens.fy) * own.fy);
  }
  /** Pixels of like light near a stroke, in every view at the same place. */
  reach(response, index, strokes) {
    if (!this.state.ready) return this.refuse(response, 503, "Views are traced.");
    // At a viewpoint: that of the first view, roughly.
    const { width, height, rgb } = this.pictures[index] ?? this.pictures[0];
    const data = Buffer.alloc(4 * width * height);
    for (const stroke of strokes) {
      if (stroke.hidden || stroke.kind !== "paint") continue;
      const color = [1, 3, 5].map((i) => parseInt(stroke.color.slice(i, i + 2), 16));
      const mean = color[0] * 0.2126 + color[1] * 0.7152 + color[2] * 0.0722 || 1;
      for (const [sx, sy] of stroke.points.filter((_, i) => i % 4 === 0)) {
        const seed = luma(rgb, 3 * (Math.min(height - 1, Math.floor(sy * height)) * width + Math.min(width - 1, Math.floor(sx * width))));
        const radius = 0.16 * stroke.reach * height;
        for (let y = Math.max(0, Math.floor(sy * height - radius)); y < Math.min(height, sy * height + radius); ++y) {
          for (let x = Math.max(0, Math.floor(sx * width - radius)); x < Math.min(width, sx * width + radius); ++x) {
            const grey = luma(rgb, 3 * (y * width + x));
            if (Math.abs(grey - seed) > 26 || Math.hypot(x - sx * width, y - sy * height) > radius) continue;
            color.forEach((c, k) => (data[4 * (y * width + x) + k] = Math.min(255, (c * grey) / mean)));
            data[4 * (y * width + x) + 3] = 210;
          }
        }
      }
    }
    this.picture(response, { width, height, channels: 4, data });
  }

  // Changes.

  put(response, revision, body) {
    const list = Array.isArray(body) ? body : body.strokes;
    if (revision !== this.state.strokes) return this.refuse(response, 409, "Another tab was faster.");
    const viewpoints = body.viewpoints ?? [];
    if (viewpoints.length > 50) return this.refuse(response, 400, "viewpoints: there are more than 50.");
    for (const [i, v] of viewpoints.entries()) {
      const isGood = /^viewpoint-\d{1,6}$/.test(v.name) && v.position.length === 3 && v.rotation.length === 3 && Number.isInteger(v.lens.width) && Number.isInteger(v.lens.height) && Math.max(v.lens.width, v.lens.height) <= 1024;
      if (!isGood) return this.refuse(response, 400, `viewpoints[${i}]: something is wrong with it.`);
    }
    const training = new Set([...this.scene.views.filter((v) => !v.held_out), ...viewpoints].map((v) => v.name));
    for (const [i, s] of list.entries()) {
      const isGood = /^[a-z0-9]{1,32}$/i.test(s.id) && training.has(s.view) && ["paint", "exact", "grey", "erase", "picture"].includes(s.kind) && /^#[0-9a-f]{6}$/i.test(s.color) && s.size >= 0.0005 && s.size <= 0.5 && s.softness >= 0 && s.softness <= 1 && s.reach >= 0.1 && s.reach <= 4 && (s.kind === "picture" ? this.painted.has(s.picture) : s.points.length > 0) && s.points.every(([x, y, p]) => x >= -1 && x <= 2 && y >= -1 && y <= 2 && p >= 0 && p <= 1);
      if (!isGood) return this.refuse(response, 400, `strokes[${i}]: something is wrong with it.`);
    }
    this.strokes = list;
    if (typeof (body.everywhere ?? false) !== "boolean") return this.refuse(response, 400, "everywhere: expected true or false.");
    this.everywhere = body.everywhere ?? false;
    this.viewpoints = viewpoints;
    this.change({ strokes: revision + 1 });
    this.json(response, 200, { revision: revision + 1 });
  }
  /** What is said where something arrived beside what the studio was started with. */
  insteadOf() {
    const { source } = this.state.arrived;
    return source ? [`note: what has arrived is taken instead of ${source}`] : [];
  }
  arrive(response, name, offset, body) {
    const refusal = this.refusals.get(name);
    if (refusal && refusal.times-- > 0) return this.refuse(response, refusal.status, refusal.sentence);
    const parts = name.split("/");
    if (parts.length > 6 || name.length > 200 || parts.some((part) => !/^[\p{L}\p{N} _()+-][\p{L}\p{N} ._()+-]*$/u.test(part))) return this.refuse(response, 400, `${name}: that is no name for a file here.`);
    if (!wantedKinds.test(name)) return this.refuse(response, 400, `${name}: files of that kind are not taken.`);
    if (body.length > 8 * 2 ** 20) return this.refuse(response, 413, `${name}: a piece has 8 MiB at most.`);
    const before = offset === 0 ? Buffer.alloc(0) : (this.arrived.get(name) ?? Buffer.alloc(0));
    if (before.length !== offset) return this.refuse(response, 409, `${name}: ${before.length} bytes are here.`);
    const isFirst = this.arrived.size === 0;
    this.arrived.set(name, Buffer.concat([before, body]));
    this.change({ notes: [...this.state.notes, ...(isFirst ? this.insteadOf() : [])], arrived: { ...this.state.arrived, files: this.arrived.size, bytes: [...this.arrived.values()].reduce((sum, file) => sum + file.length, 0) } });
    this.json(response, 200, { bytes: offset + body.length });
  }
  train() {
    let step = 0;
    this.run("train", () => this.change({ stage: "field", ready: true, scene: this.state.scene + 1, message: "The field is trained." }), () => {
      step += 1;
      // The cameras are refined now and then.
      if (step % 3 === 0) {
        this.scene = { ...this.scene, views: this.scene.views.map((view) => ({ ...view, position: view.position.map((v) => v * 1.002) })) };
        this.state.scene += 1;
      }
      this.state.colors += 1;
      return { psnr: 30 - 12 / step, loss: 0.02 / step, "rays/s": 412_345, samples: 91_000 };
    });
  }
  /** One step of slow work, or some. */
  advance(steps = 1) {
    for (let i = 0; i < steps; ++i) this.step?.();
  }
  /** @param figures  called at each step */
  run(task, end, figures = () => ({})) {
    let step = 0;
    this.end = () => {
      clearInterval(this.timer);
      this.step = null;
      this.change({ task: "", fraction: 0, figures: {} });
    };
    this.change({ task, fraction: 0, message: "", failed: false });
    this.step = () => {
      step += 1;
      if (task === "colour") {
        this.amount = Math.min(1, step / 6);
        this.state.colors += 1;
      }
      this.change({ fraction: step / this.steps, figures: task === "colour" ? { loss: 1 / step } : figures() });
      if (step < this.steps) return;
      this.end();
      end();
    };
    if (!this.slow) this.timer = setInterval(() => this.step?.(), 40);
  }
  order(response, order) {
    const { state } = this;
    const take = state.takes.find((t) => t.name === order.take);
    const colored = (amount, change) => ((this.amount = amount), this.change({ colors: state.colors + 1, ...change }));
    const command = (line) => (state.commands = [...state.commands, line]);
    if (["colour", "bake", "suggest", "key-views", "photographs", "builtin", "prepare", "train"].includes(order.order) && state.task) return this.refuse(response, 409, "Something runs already.");
    if (["begin", "rename", "duplicate", "delete"].includes(order.order) && !take && order.take !== "") return this.refuse(response, 404, `There is no take ${order.take}.`);
    if (["keep", "rename", "duplicate"].includes(order.order) && state.takes.some((t) => t.name === order.name)) return this.refuse(response, 409, `There is a take ${order.name} already.`);
    const orders = {
      colour: () => this.run("colour", () => (command("cnerf colorize RUN --strokes RUN/strokes.json"), this.change({ unkept: true, message: "The scene is coloured." }))),
      prepare: () => {
        const { files, source } = state.arrived;
        if (files === 0 && !source) return;
        this.change({ notes: files > 0 ? this.insteadOf() : [] });
        const lines = [`${this.arrived.size} photographs were read.`, "COLMAP finds what the photographs have in common.", "5 640 points in common were found.", "Cameras are placed.", `${this.arrived.size} of ${this.arrived.size} photographs were placed.`];
        this.run("prepare", () => {
          if (this.prepareFails) return this.change({ failed: true, message: this.prepareFails });
          this.change({ stage: "training", scene: this.state.scene + 1 });
          this.train();
        }, () => ((this.state.notes = [...this.state.notes, ...lines.splice(0, 1)].slice(-12)), {}));
      },
      clear: () => (this.arrived.clear(), this.change({ arrived: { ...state.arrived, files: 0, bytes: 0 }, notes: [], failed: false, message: "" })),
      train: () => this.train(),
      builtin: () => this.run("colour", () => ((this.amounts.builtin = this.amount), this.change({ takes: [...state.takes, { name: "builtin", colorizer: "built-in", seconds: 2 }], take: "builtin", unkept: false }))),
      stop: () => this.end?.(),
      keep: () => ((this.amounts[order.name] = this.amount), this.change({ takes: [...state.takes, { name: order.name, colorizer: "strokes", seconds: 3 }], take: order.name, unkept: false })),
      begin: () => colored(this.amounts[order.take] ?? 0, { take: order.take, unkept: false }),
      rename: () => ((this.amounts[order.name] = this.amounts[order.take]), this.change({ take: state.take === order.take ? order.name : state.take, takes: state.takes.map((t) => (t === take ? { ...t, name: order.name } : t)) })),
      duplicate: () => ((this.amounts[order.name] = this.amounts[order.take]), this.change({ takes: [...state.takes, { ...take, name: order.name }] })),
      delete: () => this.change({ takes: state.takes.filter((t) => t !== take), take: state.take === order.take ? "" : state.take }),
      suggest: () => this.run("suggest", () => this.change({ cards: [0, 1].map((number) => ({ number, address: `./studio/photos/${number}?side=96` })) })),
      // The views that nobody painted on, from the middle outwards.
      "key-views": () => this.run("key-views", () => {
        const painted = new Set(this.strokes.map((s) => s.view));
        const left = this.scene.views.map((v, view) => ({ ...v, view })).filter((v) => !v.held_out && !painted.has(v.name));
        const middle = this.scene.views.length / 2;
        this.change({ key_views: left.sort((a, b) => Math.abs(a.view - middle) - Math.abs(b.view - middle)).slice(0, 3).map(({ view }, i) => ({ view, adds: 0.5 / (i + 1) })) });
      }),
      finish: () => colored(this.amount, { unkept: state.unkept, finish: { saturation: order.saturation, hue: order.hue, exposure: order.exposure } }),
      bake: () => this.run("bake", () => (command(`cnerf bake RUN --format ${order.formats.join(",")}`), this.change({ downloads: order.formats.map((f) => ({ name: `ball.${f}`, address: `./studio/files/ball.${f}`, bytes: 3e6 })), blender: "blender --python blender_setup.py" }))),
      photographs: () => this.run("photographs", () => this.change({ message: "Written." })),
    };
    if (!orders[order.order]) return this.refuse(response, 400, `order: there is no order '${order.order}'.`);
    orders[order.order]();
    this.json(response, 202, { state: this.state });
  }
  taken(response, query, body) {
    if (body.length === 0) return this.refuse(response, 400, "The picture is empty.");
    if (query.get("kind") === "stroke") {
      const index = Number(query.get("view"));
      const view = [...this.scene.views, ...this.viewpoints][index];
      if (!view) return this.refuse(response, 404, "There is no such view.");
      const picture = randomBytes(6).toString("hex");
      this.painted.set(picture, body);
      this.strokes = [...this.strokes, { id: picture, view: view.name, kind: "picture", picture, color: "#808080", size: 0.01, softness: 0, reach: 1, hidden: false, points: [] }];
      this.change({ strokes: this.state.strokes + 1 });
    }
    if (query.get("kind") === "reference") this.run("colour", () => this.change({ take: "", unkept: true, message: `Begun from ${query.get("name")}.` }));
    this.json(response, 202, { state: this.state });
  }
}
