/** Reads a web bundle: its manifest, strictly, and its files, with their checksums. */

import type { Lens } from "./camera";
import type { Mat3, Vec3 } from "./math";

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

export interface Bundle {
  title: string;
  program: string;
  units: string;
  upAxis: string;
  inferred: boolean;
  colorizer: string;
  take: string;
  volume: {
    origin: Vec3;
    voxelSize: number;
    bricks: Vec3;
    storedBricks: number;
    voxels: number;
    density: { scale: number; max: number };
  };
  poster: string | null;
  files: Map<string, BundleFile>;
  cameras: CaptureCamera[];
}

export const bundleSchema = 1;

type Json = { [key: string]: unknown };

function fail(field: string, problem: string): never {
  throw new BundleError(`bundle.json: ${field}: ${problem}`);
}
function object(json: Json, field: string): Json {
  const value = json[field];
  if (typeof value !== "object" || value === null || Array.isArray(value)) fail(field, "expected an object");
  return value as Json;
}
function number(json: Json, field: string, positive = false): number {
  const value = json[field];
  if (typeof value !== "number" || !Number.isFinite(value)) fail(field, `expected a number, found ${JSON.stringify(value)}`);
  if (positive && value <= 0) fail(field, `expected a positive number, found ${value}`);
  return value;
}
function text(json: Json, field: string): string {
  const value = json[field];
  if (typeof value !== "string") fail(field, `expected text, found ${JSON.stringify(value)}`);
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
  return value as Json[];
}

function cameraOf(json: Json, index: number): CaptureCamera {
  const rows = json.world_from_camera;
  const field = `cameras[${index}].world_from_camera`;
  if (!Array.isArray(rows) || rows.length < 3) fail(field, "expected a 4x4 matrix");
  const rotation = [0, 1, 2].map((i) => vector(rows[i], field)) as Mat3;
  return {
    name: text(json, "name"),
    lens: {
      width: number(json, "width", true),
      height: number(json, "height", true),
      fx: number(json, "fx", true),
      fy: number(json, "fy", true),
      cx: number(json, "cx"),
      cy: number(json, "cy"),
    },
    rotation,
    position: [rows[0][3], rows[1][3], rows[2][3]],
    photo: typeof json.photo === "string" ? json.photo : null,
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
  const volume = object(json, "volume");
  const density = object(volume, "density");
  const encoding = text(density, "encoding");
  if (encoding !== "r8") fail("volume.density.encoding", `expected r8, found ${encoding}`);
  if (number(volume, "brick_side") !== 8) fail("volume.brick_side", "this page reads bricks of 8");
  const color = object(json, "color");
  const files = new Map<string, BundleFile>();
  for (const entry of list(json, "files")) {
    const file = { name: text(entry, "name"), bytes: number(entry, "bytes"), sha256: text(entry, "sha256"), rawBytes: Number(entry.raw_bytes ?? 0) };
    if (file.name.startsWith("/") || file.name.includes("..") || file.name.includes(":")) fail("files", `${file.name} leaves the bundle`);
    files.set(file.name, file);
  }
  for (const name of ["occupancy.bin", "density.bin", "color.bin"]) {
    if (!files.has(name)) fail("files", `${name} is not listed`);
  }
  const bricks = vector(volume.bricks, "volume.bricks");
  if (!bricks.every((n) => Number.isInteger(n) && n > 0 && n <= 4096)) fail("volume.bricks", "expected counts");
  const poster = json.poster as Json | null;
  return {
    title: text(json, "title"),
    program: `cnerf ${text(json, "program_version")}`,
    units: text(json, "units"),
    upAxis: text(json, "up_axis"),
    inferred: color.inferred === true,
    colorizer: text(color, "colorizer"),
    take: text(color, "take"),
    volume: {
      origin: vector(volume.origin, "volume.origin"),
      voxelSize: number(volume, "voxel_size", true),
      bricks,
      storedBricks: number(volume, "stored_bricks", true),
      voxels: number(volume, "voxels"),
      density: { scale: number(density, "scale", true), max: number(density, "max") },
    },
    poster: poster ? text(poster, "file") : null,
    files,
    cameras: list(json, "cameras").map(cameraOf),
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

async function fetched(url: string, name: string, onBytes: (count: number) => void): Promise<Uint8Array<ArrayBuffer>> {
  let response: Response;
  try {
    response = await fetch(url);
  } catch {
    throw new BundleError(`${name}: cannot be loaded: the server does not answer`);
  }
  if (!response.ok) throw new BundleError(`${name}: cannot be loaded: the server says ${response.status} ${response.statusText}`);
  if (!response.body) return new Uint8Array(await response.arrayBuffer());
  const parts: Uint8Array[] = [];
  let size = 0;
  const reader = response.body.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      parts.push(value);
      size += value.length;
      onBytes(value.length);
    }
  } catch {
    throw new BundleError(`${name}: the connection broke after ${size} bytes`);
  }
  const whole = new Uint8Array(size);
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

export async function gunzipped(bytes: Uint8Array<ArrayBuffer>, name: string): Promise<Uint8Array> {
  try {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  } catch {
    throw new BundleError(`${name}: is damaged: its compressed data cannot be read. Write the bundle again with cnerf bake --format web`);
  }
}

async function loadFile(base: string, file: BundleFile, onBytes: (count: number) => void): Promise<Uint8Array> {
  const bytes = await fetched(base + file.name, file.name, onBytes);
  const damaged = (what: string) =>
    new BundleError(`${file.name}: is damaged: ${what}. Copy the bundle again, or write it again with cnerf bake --format web`);
  if (bytes.length !== file.bytes) throw damaged(`${bytes.length} bytes instead of ${file.bytes}`);
  const digest = await sha256(bytes);
  if (digest !== null && digest !== file.sha256) throw damaged("its SHA-256 is not the one in bundle.json");
  const raw = await gunzipped(bytes, file.name);
  if (raw.length !== file.rawBytes) throw damaged(`${raw.length} unpacked bytes instead of ${file.rawBytes}`);
  return raw;
}

/** @param onProgress share of the bytes that came, in [0, 1]. @throws BundleError naming the file. */
export async function loadVolume(base: string, bundle: Bundle, onProgress: (share: number) => void): Promise<Packed> {
  const names = ["occupancy.bin", "density.bin", "color.bin"];
  const files = names.map((name) => bundle.files.get(name)!);
  const total = files.reduce((sum, file) => sum + file.bytes, 0);
  let come = 0;
  const [occupancy, density, color] = await Promise.all(
    files.map((file) => loadFile(base, file, (count) => onProgress(Math.min(1, (come += count) / total)))),
  );
  return { occupancy, density, color };
}
