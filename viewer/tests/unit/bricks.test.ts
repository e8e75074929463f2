import { describe, expect, it } from "vitest";
import { brickTexels, chosenBricks, fromDifferences, halfBits, leftOut, makeTexels, planAtlas, type AtlasPlan, type LevelTexels, type SlabTexels } from "../../src/bricks";
import { BundleError, parseBundle, type Bundle, type BundleLevel, type Packed } from "../../src/bundle";
import type { Vec3 } from "../../src/math";
import { expected, manifestText, packed } from "./fixture";

const plenty = 2 ** 29;

function halfValue(bits: number): number {
  const exponent = (bits >> 10) & 31;
  const mantissa = bits & 1023;
  return exponent === 0 ? (mantissa / 1024) * 2 ** -14 : (1 + mantissa / 1024) * 2 ** (exponent - 15);
}

/** The textures of a level as they are on the graphics card. */
interface Atlas {
  counts: Vec3;
  index: Uint8Array;
  density: Uint16Array;
  lab: Uint8Array;
}
function atlasOf(level: BundleLevel, parts: Packed, plan: AtlasPlan, of = 0): Atlas & { texels: LevelTexels } {
  const texels = makeTexels(level, parts, plan, plan.levels[of], []);
  const [ax, ay, az] = plan.counts;
  const size = ax * ay * brickTexels ** 3;
  const atlas = { counts: plan.counts, index: texels.index, density: new Uint16Array(size * az), lab: new Uint8Array(4 * size * az) };
  for (let slab = 0; slab < texels.slabs; ++slab) {
    const made: SlabTexels = texels.slab(slab);
    atlas.density.set(made.density, (plan.levels[of].first + slab) * size);
    atlas.lab.set(made.lab, 4 * (plan.levels[of].first + slab) * size);
  }
  return { ...atlas, texels };
}
function onlyLevel(): { bundle: Bundle; atlas: Atlas } {
  const bundle = parseBundle(manifestText());
  return { bundle, atlas: atlasOf(bundle.volume, packed(), planAtlas(bundle, 2048, plenty)) };
}

/** What the shader's texture look-up would find at the centre of a voxel: [density, L*, a, b]. */
function texel(level: BundleLevel, atlas: Atlas, point: Vec3): number[] | null {
  const p = point.map((v, i) => (v - level.origin[i]) / level.voxelSize);
  const cell = p.map((v) => Math.floor(v / 8));
  const [nx, ny] = level.bricks;
  const at = 4 * ((cell[2] * ny + cell[1]) * nx + cell[0]);
  if (atlas.index[at + 3] !== 0) return null;
  const t = p.map((v, i) => atlas.index[at + i] * brickTexels + 1 + Math.floor(v - 8 * cell[i]));
  const index = (t[2] * atlas.counts[1] * brickTexels + t[1]) * atlas.counts[0] * brickTexels + t[0];
  return [halfValue(atlas.density[index]) / level.voxelSize, (atlas.lab[4 * index] * 100) / 255, atlas.lab[4 * index + 1] - 128, atlas.lab[4 * index + 2] - 128];
}

describe.skipIf(!expected)("bricks that C++ wrote", () => {
  it("give back every voxel", () => {
    const { bundle, atlas } = onlyLevel();
    expect(expected!.voxels.length).toBeGreaterThan(10);
    for (const voxel of expected!.voxels) {
      if (voxel.sigma === 0) continue;
      const found = texel(bundle.volume, atlas, voxel.centre);
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
    const { bundle, atlas } = onlyLevel();
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
    const plan = planAtlas(bundle, 2048, plenty);
    const good = packed();
    const make = (parts: Packed) => () => makeTexels(bundle.volume, parts, plan, plan.levels[0], []);
    expect(make({ ...good, density: good.density.subarray(512) })).toThrow(BundleError);
    expect(make({ ...good, occupancy: new Uint8Array(good.occupancy.length) })).toThrow(/occupancy/);
    expect(() => planAtlas(bundle, 20, plenty)).toThrow(/--web-resolution/);
  });
  it("of nested grids all hold the same matter where they meet", () => {
    const bundle = parseBundle(manifestText("nested"));
    expect(bundle.levels.length).toBe(3);
    const plan = planAtlas(bundle, 2048, plenty);
    const atlases = bundle.levels.map((level, i) => atlasOf(level, packed("nested", i), plan, i));
    const finest = bundle.levels[2];
    const [low, high] = [finest.cover.low, finest.cover.high];
    let inside = 0;
    for (let i = 0; i < 4000; ++i) {
      const point = low.map((v, axis) => v + (high[axis] - v) * ((i * [0.7548, 0.5698, 0.3247][axis]) % 1)) as Vec3;
      const r = Math.hypot(...point);
      if (Math.abs(r - 0.95) < 0.25 || Math.abs(r - 1.25) < 0.25) continue;  // a coarse voxel holds both sides of these
      for (const [l, level] of bundle.levels.entries()) {
        const found = texel(level, atlases[l], point);
        const sigma = r < 0.95 ? 9 : r < 1.25 ? 0.5 : 0;
        expect(Math.abs((found?.[0] ?? 0) - sigma)).toBeLessThan(0.05 * sigma + 0.001);
      }
      inside += 1;
    }
    expect(inside).toBeGreaterThan(1000);
  });
});

/** Stored bricks in a row, half of which lie within the cover. */
function row(count: number, voxelSize: number, within = count): BundleLevel {
  return {
    origin: [0, 0, 0], voxelSize, bricks: [count, 1, 1], storedBricks: count, voxels: 1, density: { scale: 1, max: 1 },
    cover: { low: [0, 0, 0], high: [8 * within * voxelSize, 8 * voxelSize, 8 * voxelSize] }, parts: { occupancy: "o", density: "d", color: "c" },
  };
}
const bundleOf = (levels: BundleLevel[]) => ({ levels, volume: levels[0] }) as Bundle;
const cells = (count: number) => Array.from({ length: count }, (_, i) => i);
const emptyParts = (count: number): Packed => ({ occupancy: new Uint8Array(count), density: new Uint8Array(512 * count), color: new Uint8Array(1536 * count) });

describe("places", () => {
  it("are slabs of its own for each level, coarsest first", () => {
    const plan = planAtlas(bundleOf([row(30, 1), row(70, 0.5), row(11, 0.25)]), 2048, plenty);
    let [slab, base] = [0, 0];
    for (const [i, level] of plan.levels.entries()) {
      expect(level).toMatchObject({ first: slab, base, places: [30, 70, 11][i] });
      slab += level.slabs;
      base += 1;
    }
    expect(slab).toBe(plan.counts[2]);
    expect(plan.bytes).toBe(plan.counts[0] * plan.counts[1] * slab * 6000 + 4 * plan.index[0] * plan.index[1] * plan.index[2]);
  });
  it("are given to as many bricks as the budget holds; the coarsest level is always there", () => {
    const bundle = bundleOf([row(64, 1), row(500, 0.5), row(500, 0.25)]);
    for (const bricks of [100, 300, 700]) {
      const plan = planAtlas(bundle, 2048, 6000 * bricks);
      const places = plan.levels.reduce((sum, level) => sum + level.places, 0);
      expect(places).toBeLessThanOrEqual(bricks);
      expect(places).toBeGreaterThan(0.6 * bricks);
      expect(plan.counts[0] * plan.counts[1] * plan.counts[2]).toBeLessThanOrEqual(bricks);
    }
    expect(planAtlas(bundle, 2048, 1).levels).toEqual([expect.objectContaining({ places: 64 })]);
    expect(planAtlas(bundle, 2048, plenty).levels).toHaveLength(3);
  });
  it("go to bricks within the cover that are nearest to the eyes", () => {
    const level = row(10, 1, 6);
    expect(chosenBricks(level, cells(10), 10, [])).toEqual({ chosen: cells(6), missing: 0 });
    expect(chosenBricks(level, cells(10), 2, [[43, 4, 4], [3, 4, 4]])).toEqual({ chosen: [0, 5], missing: 4 });
    expect(chosenBricks(level, cells(10), 2, [])).toEqual({ chosen: [2, 3], missing: 4 });
  });
  it("of bricks that have none are marked, so that a coarser level shows them", () => {
    const level = row(10, 1);
    const plan: AtlasPlan = { counts: [1, 1, 4], index: [10, 1, 1], levels: [{ first: 0, slabs: 4, places: 4, base: 0 }], bytes: 0 };
    const { index, missing, slabs } = makeTexels(level, emptyParts(10), plan, plan.levels[0], [[0, 4, 4]]);
    expect(Array.from(cells(10), (i) => index[4 * i + 3])).toEqual([0, 0, 0, 0, ...Array(6).fill(leftOut)]);
    expect(Array.from(cells(4), (i) => index[4 * i + 2])).toEqual([0, 1, 2, 3]);
    expect([missing, slabs]).toEqual([6, 4]);
  });
  it("are no nearer than the mark even where everything is far away", () => {
    const level = { ...row(300, 1), storedBricks: 1 };
    const parts = { ...emptyParts(1), occupancy: Uint8Array.from(cells(300), (i) => Math.min(i, 255)) };
    const plan = planAtlas(bundleOf([level]), 2048, plenty);
    expect(makeTexels(level, parts, plan, plan.levels[0], []).index[4 * 299 + 3]).toBe(leftOut - 1);
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
      const { counts } = planAtlas(bundleOf([{ ...row(1, 1), storedBricks: n }]), 250, plenty);
      expect(counts[0] * counts[1] * counts[2]).toBeGreaterThanOrEqual(n);
      expect(Math.max(...counts)).toBeLessThanOrEqual(25);
    }
    expect(() => planAtlas(bundleOf([{ ...row(1, 1), storedBricks: 15_626 }]), 250, plenty)).toThrow(BundleError);
  });
});
