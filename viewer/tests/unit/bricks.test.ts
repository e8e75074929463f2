import { describe, expect, it } from "vitest";
import { atlasCounts, brickTexels, fromDifferences, halfBits, makeAtlas, type Atlas } from "../../src/bricks";
import { BundleError, parseBundle, type Bundle } from "../../src/bundle";
import type { Vec3 } from "../../src/math";
import { expected, manifestText, packed } from "./fixture";

function halfValue(bits: number): number {
  const exponent = (bits >> 10) & 31;
  const mantissa = bits & 1023;
  return exponent === 0 ? (mantissa / 1024) * 2 ** -14 : (1 + mantissa / 1024) * 2 ** (exponent - 15);
}

/** What the shader's texture look-up would find at the centre of a voxel: [density, L*, a, b]. */
function texel(bundle: Bundle, atlas: Atlas, point: Vec3): number[] | null {
  const p = point.map((v, i) => (v - bundle.volume.origin[i]) / bundle.volume.voxelSize);
  const cell = p.map((v) => Math.floor(v / 8));
  const [nx, ny] = bundle.volume.bricks;
  const at = 4 * ((cell[2] * ny + cell[1]) * nx + cell[0]);
  if (atlas.index[at + 3] !== 0) return null;
  const t = p.map((v, i) => atlas.index[at + i] * brickTexels + 1 + Math.floor(v - 8 * cell[i]));
  const index = (t[2] * atlas.counts[1] * brickTexels + t[1]) * atlas.counts[0] * brickTexels + t[0];
  return [halfValue(atlas.density[index]) / bundle.volume.voxelSize, (atlas.lab[4 * index] * 100) / 255, atlas.lab[4 * index + 1] - 128, atlas.lab[4 * index + 2] - 128];
}

describe.skipIf(!expected)("bricks that C++ wrote", () => {
  it("give back every voxel", () => {
    const bundle = parseBundle(manifestText());
    const atlas = makeAtlas(bundle, packed(), 2048);
    expect(expected!.voxels.length).toBeGreaterThan(10);
    for (const voxel of expected!.voxels) {
      if (voxel.sigma === 0) continue;
      const found = texel(bundle, atlas, voxel.centre);
      expect(found).not.toBeNull();
      const [sigma, lightness, a, b] = found!;
      // Codes are off by 1.5 at most, 4.5 where a voxel is opaque: 3 times that, relatively, on the cubic scale.
      const code = 255 * Math.cbrt(voxel.sigma / bundle.volume.density.scale);
      expect(Math.abs(sigma / voxel.sigma - 1)).toBeLessThan((3 * (voxel.sigma * bundle.volume.voxelSize > 6 ? 4.5 : 1.5) * 1.05) / code + 0.001);
      expect(Math.abs(lightness - voxel.lightness)).toBeLessThan(voxel.sigma * bundle.volume.voxelSize < 0.021 ? 1.8 : 0.6);
      const ofAb = voxel.sigma * bundle.volume.voxelSize < 0.021 ? 6.51 : 2.51;
      expect(Math.abs(a - voxel.a)).toBeLessThan(ofAb);
      expect(Math.abs(b - voxel.b)).toBeLessThan(ofAb);
    }
  });
  it("have the neighbours' voxels around each brick", () => {
    const bundle = parseBundle(manifestText());
    const atlas = makeAtlas(bundle, packed(), 2048);
    const [nx, ny, nz] = bundle.volume.bricks;
    const [rows, layers] = [atlas.counts[0] * brickTexels, atlas.counts[0] * brickTexels * atlas.counts[1] * brickTexels];
    const at = (cell: number, x: number, y: number, z: number) => {
      const [bx, by, bz] = atlas.index.subarray(4 * cell, 4 * cell + 3);
      return (bz * brickTexels + z) * layers + (by * brickTexels + y) * rows + bx * brickTexels + x;
    };
    let pairs = 0;
    for (let cell = 0; cell + 1 < nx * ny * nz; ++cell) {
      if (cell % nx === nx - 1 || atlas.index[4 * cell + 3] || atlas.index[4 * cell + 7]) continue;
      for (let i = 1; i < 9; ++i) {
        expect(atlas.density[at(cell, 9, i, i)]).toBe(atlas.density[at(cell + 1, 1, i, i)]);
        expect(atlas.density[at(cell + 1, 0, i, i)]).toBe(atlas.density[at(cell, 8, i, i)]);
        pairs += 1;
      }
    }
    expect(pairs).toBeGreaterThan(100);
  });
  it("are refused when they do not belong together, or are too many", () => {
    const bundle = parseBundle(manifestText());
    const good = packed();
    expect(() => makeAtlas(bundle, { ...good, density: good.density.subarray(512) }, 2048)).toThrow(BundleError);
    expect(() => makeAtlas(bundle, { ...good, occupancy: new Uint8Array(good.occupancy.length) }, 2048)).toThrow(/occupancy/);
    expect(() => makeAtlas(bundle, good, 20)).toThrow(/--web-resolution/);
  });
});

describe("packing", () => {
  it("undoes differences", () => {
    const bricks = new Uint8Array(1024);
    bricks[0] = 200;
    bricks[1] = 100; // 44 modulo 256
    bricks[8] = 255;
    fromDifferences(bricks);
    expect([bricks[0], bricks[1], bricks[7], bricks[8], bricks[15], bricks[64]]).toEqual([200, 44, 44, 199, 199, 200]);
    expect(bricks[512]).toBe(0);
  });
  it("rounds to the nearest half float", () => {
    for (const v of [0, 1e-7, 6e-5, 0.1, 0.33333, 1, 2.7182818, 999.5, 65504, 1e9]) {
      const back = halfValue(halfBits(v));
      expect(Math.abs(back - Math.min(v, 65504))).toBeLessThanOrEqual(Math.max(v * 2 ** -11, 2 ** -25));
    }
    expect(halfBits(2047.9)).toBe(halfBits(2048));
    expect(halfBits(-1)).toBe(0);
  });
  it("makes an atlas that holds all bricks, or none", () => {
    for (const n of [1, 7, 64, 1000, 15_000]) {
      const counts = atlasCounts(n, 25);
      expect(counts).not.toBeNull();
      expect(counts![0] * counts![1] * counts![2]).toBeGreaterThanOrEqual(n);
      expect(Math.max(...counts!)).toBeLessThanOrEqual(25);
    }
    expect(atlasCounts(15_626, 25)).toBeNull();
  });
});
