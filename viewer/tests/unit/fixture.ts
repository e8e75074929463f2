/** What the C++ side wrote: `web_fixture FOLDER`, its folder in CNERF_FIXTURE. */

import { existsSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { gunzipSync } from "node:zlib";
import { parseBundle, type Packed } from "../../src/bundle";

export const folder = process.env.CNERF_FIXTURE ?? "";
const there = folder !== "" && existsSync(join(folder, "expected.json"));
if (!there) console.warn("CNERF_FIXTURE names no fixture: tests against C++ are skipped; ctest -L viewer makes it");

interface Expected {
  projections: { camera: number; point: [number, number, number]; pixel: [number, number] }[];
  voxels: { centre: [number, number, number]; sigma: number; lightness: number; a: number; b: number }[];
  images: { width: number; height: number; rgb: number[]; opacity: number[] }[];
}

export const manifestText = (name = "r8") => readFileSync(join(folder, name, "bundle.json"), "utf8");
export const bundle = there ? parseBundle(manifestText()) : null;
export const expected = there ? (JSON.parse(readFileSync(join(folder, "expected.json"), "utf8")) as Expected) : null;

/** A level's parts. @param name  "r8", or "nested" of several levels. */
export function packed(name = "r8", level = 0): Packed {
  const { parts } = parseBundle(manifestText(name)).levels[level];
  const read = (part: string) => new Uint8Array(gunzipSync(readFileSync(join(folder, name, part))));
  return { occupancy: read(parts.occupancy), density: read(parts.density), color: read(parts.color) };
}
