import { createHash } from "node:crypto";
import { gzipSync } from "node:zlib";
import { afterEach, describe, expect, it, vi } from "vitest";
import { BundleError, bundleSchema, loadLevel, parseBundle } from "../../src/bundle";
import { expected, manifestText } from "./fixture";

/** One level, as the present schema has it. */
const parts: Record<string, Uint8Array> = { "occupancy.bin": new Uint8Array([0]), "density.bin": new Uint8Array(512).fill(9), "color.bin": new Uint8Array(1536) };
const packedParts = Object.fromEntries(Object.entries(parts).map(([name, raw]) => [name, new Uint8Array(gzipSync(raw))]));

function level(suffix = "", voxelSize = 0.1): any {
  return {
    origin: [0, 0, 0], voxel_size: voxelSize, brick_side: 8, bricks: [1, 1, 1], stored_bricks: 1, voxels: 1,
    cover: { min: [0, 0, 0], max: [8 * voxelSize, 8 * voxelSize, 8 * voxelSize] },
    occupancy: { file: `occupancy${suffix}.bin` }, density: { file: `density${suffix}.bin`, encoding: "r8", scale: 10, max: 10 }, color: { file: `color${suffix}.bin` },
  };
}
/** With a second level, half as large. */
function twoLevels(): any {
  const json = manifest();
  json.levels.push(level("_fine1", 0.05));
  json.files.push(...json.files.map((file: any) => ({ ...file, name: file.name.replace(".bin", "_fine1.bin") })));
  return json;
}
function manifest(): any {
  return {
    schema: 2, program_version: "0", title: "t", units: "m", up_axis: "z", poster: null, cameras: [],
    color: { inferred: true, colorizer: "c", take: "t" },
    levels: [level()],
    files: Object.entries(packedParts).map(([name, bytes]) => ({ name, bytes: bytes.length, raw_bytes: parts[name].length, sha256: createHash("sha256").update(bytes).digest("hex") })),
  };
}
const one = () => parseBundle(JSON.stringify(manifest()));
const parsed = (change: (json: any) => void) => {
  const json = manifest();
  change(json);
  return () => parseBundle(JSON.stringify(json));
};
const serve = (files: Record<string, Uint8Array>) =>
  vi.stubGlobal("fetch", async (url: string, init?: RequestInit) => {
    const name = url.split("/").pop()!;
    // A browser answers from what it kept of an earlier bundle, unless it is to ask.
    if (init?.cache !== "no-cache") return new Response("of an earlier bundle");
    return files[name] ? new Response(files[name] as BodyInit) : new Response("", { status: 404, statusText: "Not Found" });
  });
afterEach(() => vi.unstubAllGlobals());

describe("manifest", () => {
  it("is read", () => expect(parsed(() => {})().volume.density.scale).toBe(10));
  it.skipIf(!expected)("is read as C++ writes it", () => {
    const bundle = parseBundle(manifestText());
    expect(bundle.cameras).toHaveLength(3);
    expect(bundle.cameras[1].photo).toBe("photos/001.jpg");
    expect(bundle.upAxis).toBe("z");
    expect(bundle.volume.density.scale).toBeGreaterThan(0);
    expect(bundle.colorizer).toBe("reference:a.png");
  });
  it("of several levels is read, coarsest first", () => {
    const bundle = parseBundle(JSON.stringify(twoLevels()));
    expect(bundle.levels.map((l) => l.voxelSize)).toEqual([0.1, 0.05]);
    expect(bundle.volume).toBe(bundle.levels[0]);
    expect(bundle.levels[1].parts.color).toBe("color_fine1.bin");
  });
  it("of the first schema is read as one level that covers itself", () => {
    const json = manifest();
    const { cover, ...volume } = json.levels[0];
    Object.assign(json, { schema: 1, volume, levels: undefined });
    const bundle = parseBundle(JSON.stringify(json));
    expect(bundle.levels).toHaveLength(1);
    expect(bundle.volume.cover.low).toEqual([0, 0, 0]);
    expect(bundle.volume.cover.high[0]).toBeCloseTo(cover.max[0]);
    expect(bundle.volume.parts).toEqual({ occupancy: "occupancy.bin", density: "density.bin", color: "color.bin" });
  });
  const wrongLevels: [string, (json: any) => void, RegExp][] = [
    ["levels in another order", (j) => j.levels.reverse(), /levels\[1\]\.voxel_size.*finer/],
    ["no level", (j) => (j.levels = []), /levels: expected 1 to/],
    ["too many levels", (j) => (j.levels = Array.from({ length: 9 }, (_, i) => level("", 0.1 / (i + 1)))), /levels: expected 1 to 8/],
    ["a cover beyond the bricks", (j) => (j.levels[1].cover.max[0] = 0.7), /levels\[1\]\.cover.*within/],
    ["a cover that is none", (j) => delete j.levels[1].cover, /cover.*object/],
    ["a part of a level elsewhere", (j) => (j.levels[1].density.file = "../density.bin"), /levels\[1\]\.density\.file.*leaves/],
    ["a missing part of a level", (j) => j.files.pop(), /color_fine1\.bin is not listed/],
  ];
  for (const [what, change, message] of wrongLevels) {
    it(`refuses ${what}, by name`, () => {
      const json = twoLevels();
      change(json);
      expect(() => parseBundle(JSON.stringify(json))).toThrow(message);
    });
  }
  const wrong: [string, (json: any) => void, RegExp][] = [
    ["a newer schema", (j) => (j.schema = bundleSchema + 1), /schema.*newer/],
    ["a missing number", (j) => delete j.levels[0].voxel_size, /voxel_size/],
    ["a number that is none", (j) => (j.levels[0].voxel_size = "x"), /voxel_size.*"x"/],
    ["a size of 0", (j) => (j.levels[0].voxel_size = 0), /voxel_size.*positive/],
    ["another encoding", (j) => (j.levels[0].density.encoding = "r16f"), /encoding.*r16f/],
    ["a file outside", (j) => j.files.push({ name: "../x", bytes: 1, sha256: "" }), /leaves the bundle/],
    ["a missing part", (j) => j.files.pop(), /color\.bin/],
    ["parts that do not fit the bricks", (j) => (j.levels[0].stored_bricks = 2), /density\.bin: expected 1024 bytes unpacked/],
    ["bricks beyond all memory", (j) => (j.levels[0].bricks = [4096, 4096, 4096]), /levels\[0\]\.bricks/],
    ["a bomb", (j) => (j.files[1].raw_bytes = 2 ** 40), /density\.bin: expected 512 bytes/],
    ["a file entry that is none", (j) => (j.files[0] = null), /files\[0\].*object/],
    ["a poster elsewhere", (j) => (j.poster = { file: "https://evil.example/x" }), /poster\.file.*leaves/],
    ["a camera without a place", (j) => j.cameras.push({ name: "a", width: 1, height: 1, fx: 1, fy: 1, cx: 0, cy: 0, world_from_camera: [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }), /cameras\[0\].*three numbers/],
    ["a camera without a pose", (j) => j.cameras.push({ name: "a", width: 1, height: 1, fx: 1, fy: 1, cx: 0, cy: 0 }), /cameras\[0\]/],
  ];
  for (const [what, change, message] of wrong) it(`refuses ${what}, by name`, () => expect(parsed(change)).toThrow(message));
  it("refuses or reads every mutant, and throws nothing else", () => {
    let state = 7;
    const random = (n: number) => (state = (state * 1103515245 + 12345) % 2 ** 31) % n;  // as in the C standard
    const values = [null, -1, 0, 1e308, 2 ** 53, "x".repeat(1e3), [], {}, true, [[]], "../x", NaN];
    const source = JSON.stringify({ ...manifest(), cameras: [{ name: "a", width: 4, height: 3, fx: 2, fy: 2, cx: 1, cy: 1, world_from_camera: [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]] }] });
    const places = (json: any): [any, string][] => (json && typeof json === "object" ? Object.keys(json).flatMap((key) => [[json, key] as [any, string], ...places(json[key])]) : []);
    for (let i = 0; i < 1000; ++i) {
      const json = JSON.parse(source), all = places(json);
      for (let n = 0; n <= random(3); ++n) {
        const [at, key] = all[random(all.length)];
        if (random(4) === 0) delete at[key];
        else at[key] = values[random(values.length)];
      }
      try {
        const bundle = parseBundle(JSON.stringify(json));
        expect(bundle.volume.storedBricks).toBe(1);
        for (const camera of bundle.cameras) expect(camera.position.every(Number.isFinite)).toBe(true);
      } catch (problem) {
        expect(problem).toBeInstanceOf(BundleError);
      }
    }
  });
  it("refuses half a file", () => expect(() => parseBundle(JSON.stringify(manifest()).slice(0, 100))).toThrow(BundleError));
});

describe("parts", () => {
  it("are loaded, checked and unpacked", async () => {
    serve(packedParts);
    let share = 0;
    const volume = await loadLevel("http://a/", one(), one().volume, (s) => (share = s));
    expect(Array.from(volume.density.subarray(0, 3))).toEqual([9, 9, 9]);
    expect(share).toBe(1);
  });
  const damages: [string, (bytes: Uint8Array) => Uint8Array, RegExp][] = [
    ["a changed byte", (b) => b.map((v, i) => (i === 20 ? v ^ 1 : v)), /density\.bin.*SHA-256/],
    ["a cut end", (b) => b.subarray(0, b.length - 3), /density\.bin.*more or less than its/],
    ["another file", () => new Uint8Array(gzipSync(new Uint8Array(5))), /density\.bin.*damaged/],
  ];
  for (const [what, damage, message] of damages) {
    it(`with ${what} are refused, by name`, async () => {
      serve({ ...packedParts, "density.bin": damage(packedParts["density.bin"]) });
      await expect(loadLevel("http://a/", one(), one().volume, () => {})).rejects.toThrow(message);
    });
  }
  it("with a changed byte are refused without SHA-256 too", async () => {
    vi.stubGlobal("crypto", {});
    const bytes = packedParts["density.bin"].map((v, i) => (i === packedParts["density.bin"].length - 6 ? v ^ 1 : v));
    serve({ ...packedParts, "density.bin": bytes });
    await expect(loadLevel("http://a/", one(), one().volume, () => {})).rejects.toThrow(/density\.bin.*damaged/);
  });
  it("that are missing are named with what the server says", async () => {
    serve({});
    await expect(loadLevel("http://a/", one(), one().volume, () => {})).rejects.toThrow(/404/);
  });
});
