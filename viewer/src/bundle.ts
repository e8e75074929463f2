/** Reads a web bundle: its manifest, strictly, and its files, with their checksums. */

import type { Lens } from "./camera";
import type { Mat3, Vec3 } from "./math";
import { mostLevels } from "./shaders";

/** Something is wrong with the bundle; the message says which file or field and what to do. */
export class BundleError extends Error {}

export interface CaptureCamera {
  name: string;
  lens: Lens;
  position: Vec3;
  rotation: Mat3;
  photo: string | null;
}

export interface BundleFile {
  name: string;
  bytes: number;
  sha256: string;
  rawBytes: number;
}

/** A grid of bricks. */
export interface BundleLevel {
  origin: Vec3;
  voxelSize: number;
  bricks: Vec3;
  storedBricks: number;
  voxels: number;
  density: { scale: number; max: number };
  /** World units; within the bricks. */
  cover: { low: Vec3; high: Vec3 };
  /** Names of files. */
  parts: { occupancy: string; density: string; color: string };
}

export interface Bundle {
  title: string;
  program: string;
  units: string;
  upAxis: string;
  inferred: boolean;
  colorizer: string;
  take: string;
  /** Coarsest first; each stands by itself, and a finer one answers for all of its `cover`. */
  levels: BundleLevel[];
  /** The coarsest, which covers everything. */
  volume: BundleLevel;
  poster: string | null;
  /** What is seen beyond the volume. */
  sky: string | null;
  files: Map<string, BundleFile>;
  cameras: CaptureCamera[];
}

/** Schema 1 had one level, in `volume`. */
export const bundleSchema = 2;

/** What a bundle may state, so that one that somebody else made takes no more of the browser than a large one of ours. */
const limits = { cells: 2 ** 26, storedBricks: 2 ** 18, cameras: 10_000, side: 100_000, levels: mostLevels };
const voxelsOfBrick = 512;

type Json = { [key: string]: unknown };

function fail(field: string, problem: string): never {
  throw new BundleError(`bundle.json: ${field}: ${problem}`);
}
function object(json: Json, field: string): Json {
  const value = json[field];
  if (typeof value !== "object" || value === null || Array.isArray(value)) fail(field, "expected an object");
  return value as Json;
}
/** The beginning of a value, for messages. */
const shown = (value: unknown) => String(JSON.stringify(value)).slice(0, 80);

function number(json: Json, field: string, positive = false): number {
  const value = json[field];
  if (typeof value !== "number" || !Number.isFinite(value)) fail(field, `expected a number, found ${shown(value)}`);
  if (positive && value <= 0) fail(field, `expected a positive number, found ${value}`);
  return value;
}
function count(json: Json, field: string, most: number): number {
  const value = number(json, field, true);
  if (!Number.isInteger(value) || value > most) fail(field, `expected a whole number up to ${most}, found ${value}`);
  return value;
}
function text(json: Json, field: string): string {
  const value = json[field];
  if (typeof value !== "string") fail(field, `expected text, found ${shown(value)}`);
  return value;
}
function vector(value: unknown, field: string): Vec3 {
  if (!Array.isArray(value) || value.length < 3 || !value.every((v) => typeof v === "number" && Number.isFinite(v))) {
    fail(field, "expected three numbers");
  }
  return [value[0], value[1], value[2]];
}
function list(json: Json, field: string): Json[] {
  const value = json[field];
  if (!Array.isArray(value)) fail(field, "expected a list");
  value.forEach((entry, i) => {
    if (typeof entry !== "object" || entry === null) fail(`${field}[${i}]`, "expected an object");
  });
  return value as Json[];
}
/** A file of the bundle. */
function inside(name: string, field: string): string {
  if (name.startsWith("/") || name.startsWith("\\") || name.includes("..") || name.includes(":")) fail(field, `${name} leaves the bundle`);
  return name;
}

/** The parts of a level, whose sizes follow from its bricks. */
function checkParts(files: Map<string, BundleFile>, { parts, bricks, storedBricks }: BundleLevel): void {
  const sizes = { occupancy: bricks[0] * bricks[1] * bricks[2], density: storedBricks * voxelsOfBrick, color: 3 * storedBricks * voxelsOfBrick };
  for (const part of ["occupancy", "density", "color"] as const) {
    const [name, size] = [parts[part], sizes[part]];
    const file = files.get(name);
    if (!file) fail("files", `${name} is not listed`);
    if (file.rawBytes !== size) fail("files", `${name}: expected ${size} bytes unpacked, found ${file.rawBytes}`);
    if (file.bytes > 1.1 * size + 1024) fail("files", `${name}: ${file.bytes} bytes are more than gzip makes of ${size}`);
  }
}

function coverOf(json: Json, field: string, { origin, bricks, voxelSize }: BundleLevel): BundleLevel["cover"] {
  const cover = object(json, "cover");
  const low = vector(cover.min, `${field}.cover.min`);
  const high = vector(cover.max, `${field}.cover.max`);
  for (let axis = 0; axis < 3; ++axis) {
    const [begin, end] = [origin[axis], origin[axis] + 8 * bricks[axis] * voxelSize];
    const rounding = 1e-6 * (end - begin);
    if (low[axis] < begin - rounding || high[axis] > end + rounding || low[axis] >= high[axis]) fail(`${field}.cover`, "expected a box within the bricks");
  }
  return { low, high };
}

/** @param field  where it stands, for messages. */
function levelOf(json: Json, field: string, files: Map<string, BundleFile>): BundleLevel {
  const density = object(json, "density");
  const encoding = text(density, "encoding");
  if (encoding !== "r8") fail(`${field}.density.encoding`, `expected r8, found ${encoding}`);
  if (number(json, "brick_side") !== 8) fail(`${field}.brick_side`, "this page reads bricks of 8");
  const bricks = vector(json.bricks, `${field}.bricks`);
  const cells = bricks[0] * bricks[1] * bricks[2];
  if (!bricks.every((n) => Number.isInteger(n) && n > 0) || cells > limits.cells) fail(`${field}.bricks`, "expected counts of at most 2^26 bricks in all");
  const level: BundleLevel = {
    origin: vector(json.origin, `${field}.origin`),
    voxelSize: number(json, "voxel_size", true),
    bricks,
    storedBricks: count(json, "stored_bricks", limits.storedBricks),
    voxels: number(json, "voxels"),
    density: { scale: number(density, "scale", true), max: number(density, "max") },
    cover: { low: [0, 0, 0], high: [0, 0, 0] },
    parts: { occupancy: "occupancy.bin", density: "density.bin", color: "color.bin" },
  };
  if (field === "volume") {
    level.cover = { low: level.origin, high: level.origin.map((v, i) => v + 8 * bricks[i] * level.voxelSize) as Vec3 };
  } else {
    level.cover = coverOf(json, field, level);
    for (const part of ["occupancy", "density", "color"] as const) level.parts[part] = inside(text(object(json, part), "file"), `${field}.${part}.file`);
  }
  checkParts(files, level);
  return level;
}

function levelsOf(json: Json, schema: number, files: Map<string, BundleFile>): BundleLevel[] {
  if (schema === 1) return [levelOf(object(json, "volume"), "volume", files)];
  const entries = list(json, "levels");
  if (entries.length === 0 || entries.length > limits.levels) fail("levels", `expected 1 to ${limits.levels} of them, found ${entries.length}`);
  const levels = entries.map((entry, i) => levelOf(entry, `levels[${i}]`, files));
  levels.forEach((level, i) => {
    if (i > 0 && level.voxelSize >= levels[i - 1].voxelSize) fail(`levels[${i}].voxel_size`, "expected a finer level than the one before");
  });
  const sum = (of: (level: BundleLevel) => number) => levels.reduce((total, level) => total + of(level), 0);
  if (sum(({ bricks }) => bricks[0] * bricks[1] * bricks[2]) > limits.cells) fail("levels", "expected at most 2^26 bricks in all");
  if (sum(({ storedBricks }) => storedBricks) > limits.storedBricks) fail("levels", `expected at most ${limits.storedBricks} stored bricks in all`);
  return levels;
}

function cameraOf(json: Json, index: number): CaptureCamera {
  const rows = json.world_from_camera;
  const field = `cameras[${index}].world_from_camera`;
  if (!Array.isArray(rows) || rows.length < 3) fail(field, "expected a 4x4 matrix");
  const place = [0, 1, 2].map((i) => (Array.isArray(rows[i]) ? rows[i][3] : null));
  const rotation = [0, 1, 2].map((i) => vector(rows[i], field)) as Mat3;
  return {
    name: text(json, "name"),
    lens: {
      width: count(json, "width", limits.side),
      height: count(json, "height", limits.side),
      fx: number(json, "fx", true),
      fy: number(json, "fy", true),
      cx: number(json, "cx"),
      cy: number(json, "cy"),
    },
    rotation,
    position: vector(place, field),
    photo: typeof json.photo === "string" ? inside(json.photo, `cameras[${index}].photo`) : null,
  };
}

/** @throws BundleError naming the field. */
export function parseBundle(source: string): Bundle {
  let json: Json;
  try {
    json = JSON.parse(source) as Json;
  } catch (problem) {
    throw new BundleError(`bundle.json: is not JSON (${(problem as Error).message}); it was cut short or edited`);
  }
  const schema = number(json, "schema");
  if (schema > bundleSchema) fail("schema", `${schema} is newer than this page, which reads ${bundleSchema}; use the page of that cnerf`);
  const color = object(json, "color");
  const files = new Map<string, BundleFile>();
  for (const entry of list(json, "files")) {
    const file = { name: inside(text(entry, "name"), "files"), bytes: number(entry, "bytes"), sha256: text(entry, "sha256"), rawBytes: Number(entry.raw_bytes ?? 0) };
    files.set(file.name, file);
  }
  const levels = levelsOf(json, schema, files);
  const cameras = list(json, "cameras");
  if (cameras.length > limits.cameras) fail("cameras", `expected at most ${limits.cameras}, found ${cameras.length}`);
  const poster = json.poster == null ? null : object(json, "poster");
  const sky = json.sky == null ? null : object(json, "sky");
  return {
    title: text(json, "title"),
    program: `cnerf ${text(json, "program_version")}`,
    units: text(json, "units"),
    upAxis: text(json, "up_axis"),
    inferred: color.inferred === true,
    colorizer: text(color, "colorizer"),
    take: text(color, "take"),
    levels,
    volume: levels[0],
    poster: poster ? inside(text(poster, "file"), "poster.file") : null,
    sky: sky ? inside(text(sky, "file"), "sky.file") : null,
    files,
    cameras: cameras.map(cameraOf),
  };
}

export interface Packed {
  occupancy: Uint8Array;
  density: Uint8Array;
  color: Uint8Array;
}

async function sha256(bytes: Uint8Array<ArrayBuffer>): Promise<string | null> {
  // Only secure contexts have it; elsewhere gzip's own checksum has to do.
  if (!globalThis.crypto?.subtle) return null;
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return Array.from(digest, (b) => b.toString(16).padStart(2, "0")).join("");
}

/** The chunks of a stream as one array, of which nothing is kept beyond `size`. @returns null where there is more or less. */
async function filled(stream: ReadableStream<Uint8Array>, size: number, onBytes: (count: number) => void): Promise<Uint8Array<ArrayBuffer> | null> {
  const whole = new Uint8Array(size);
  let at = 0;
  const reader = stream.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return at === size ? whole : null;
    if (at + value.length > size) {
      await reader.cancel();
      return null;
    }
    whole.set(value, at);
    at += value.length;
    onBytes(value.length);
  }
}

async function fetched(url: string, { name, bytes }: BundleFile, onBytes: (count: number) => void): Promise<Uint8Array<ArrayBuffer> | null> {
  let response: Response;
  try {
    // A bundle that was written again has other content under the same names.
    response = await fetch(url, { cache: "no-cache" });
  } catch {
    throw new BundleError(`${name}: cannot be loaded: the server does not answer`);
  }
  if (!response.ok) throw new BundleError(`${name}: cannot be loaded: the server says ${response.status} ${response.statusText}`);
  if (!response.body) return null;
  let come = 0;
  try {
    return await filled(response.body, bytes, (count) => ((come += count), onBytes(count)));
  } catch {
    throw new BundleError(`${name}: the connection broke after ${come} bytes`);
  }
}

async function gunzipped(bytes: Uint8Array<ArrayBuffer>, { name, rawBytes }: BundleFile): Promise<Uint8Array | null> {
  try {
    return await filled(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")), rawBytes, () => {});
  } catch {
    throw new BundleError(`${name}: is damaged: its compressed data cannot be read. Write the bundle again with cnerf bake --format web`);
  }
}

async function loadFile(base: string, file: BundleFile, onBytes: (count: number) => void): Promise<Uint8Array> {
  const bytes = await fetched(base + file.name, file, onBytes);
  const damaged = (what: string) =>
    new BundleError(`${file.name}: is damaged: ${what}. Copy the bundle again, or write it again with cnerf bake --format web`);
  if (bytes === null) throw damaged(`more or less than its ${file.bytes} bytes`);
  const digest = await sha256(bytes);
  if (digest !== null && digest !== file.sha256) throw damaged("its SHA-256 is not the one in bundle.json");
  const raw = await gunzipped(bytes, file);
  if (raw === null) throw damaged(`more or less than ${file.rawBytes} bytes unpacked`);
  return raw;
}

/** @param onProgress share of the bytes that came, in [0, 1]. @throws BundleError naming the file. */
export async function loadLevel(base: string, bundle: Bundle, level: BundleLevel, onProgress: (share: number) => void): Promise<Packed> {
  const { parts } = level;
  const files = [parts.occupancy, parts.density, parts.color].map((name) => bundle.files.get(name)!);
  const total = files.reduce((sum, file) => sum + file.bytes, 0);
  let come = 0;
  const [occupancy, density, color] = await Promise.all(
    files.map((file) => loadFile(base, file, (count) => onProgress(Math.min(1, (come += count) / total)))),
  );
  return { occupancy, density, color };
}
