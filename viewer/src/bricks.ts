/** Packed bricks -> the texels of three textures. No WebGL here. */

import type { Bundle, BundleLevel, Packed } from "./bundle";
import { BundleError } from "./bundle";
import type { Vec3 } from "./math";

export const brickSide = 8;
/** With the layer of neighbours around it that hardware interpolation reads. */
export const brickTexels = brickSide + 2;
const voxelsOfBrick = brickSide ** 3;

/** Bytes of textures for a stored brick: half floats of density, four bytes of colour. */
const bytesOfBrick = brickTexels ** 3 * (2 + 4);
/** Of an index entry whose brick is stored in the bundle, but has no place: a coarser level shows it. */
export const leftOut = 255;

/** Where a level lies in the textures that all levels share. */
export interface LevelPlan {
  /** Slabs of the atlas, each one brick high, [first, first + slabs). */
  first: number;
  slabs: number;
  /** Bricks that have a place, at most, of those stored. */
  places: number;
  /** Where the level's cells begin in the index, along z. */
  base: number;
}

export interface AtlasPlan {
  /** Bricks along each axis of the atlas. */
  counts: Vec3;
  /** Cells along each axis of the index: the levels' grids one above the other. */
  index: Vec3;
  /** Of the levels that have any place, coarsest first. */
  levels: LevelPlan[];
  bytes: number;
}

/** A level's bricks as they go into the textures. */
export interface LevelTexels {
  /** [bricks, 4] where a stored brick lies in the atlas, and how far the nearest stored one is (0 = here). */
  index: Uint8Array;
  /** Bricks that rays can reach, and that have no place. */
  missing: number;
  /** Slabs that hold any. */
  slabs: number;
  /** The texels of a slab of the level; made when asked for. */
  slab: (number: number) => SlabTexels;
}

export interface SlabTexels {
  /** [z, y, x] half floats: optical depth of one voxel of the level. */
  density: Uint16Array;
  /** [z, y, x, 4] L* 255/100, a + 128, b + 128, 255. */
  lab: Uint8Array;
}

/** Undoes the differences within bricks, in place. */
export function fromDifferences(bricks: Uint8Array): void {
  for (let begin = 0; begin < bricks.length; begin += voxelsOfBrick) {
    for (let i = 1; i < voxelsOfBrick; ++i) {
      const step = i & 7 ? 1 : i & 63 ? 8 : 64;
      bricks[begin + i] += bricks[begin + i - step];
    }
  }
}

/** Bits of the half float nearest to a number >= 0; beyond 65504 the largest. */
export function halfBits(value: number): number {
  if (!(value > 0)) return 0;
  if (value >= 65504) return 0x7bff;
  const exponent = Math.max(-14, Math.floor(Math.log2(value)));
  let mantissa = Math.round((value / 2 ** exponent) * 1024);
  let e = exponent;
  if (mantissa === 2048) {
    mantissa = 1024;
    e += 1;
  }
  return mantissa < 1024 ? mantissa : ((e + 15) << 10) | (mantissa - 1024);
}

/** Optical depth of a voxel, as a half float, by code. */
export function opticalTable({ density, voxelSize }: BundleLevel): Uint16Array {
  return Uint16Array.from({ length: 256 }, (_, code) => halfBits(density.scale * (code / 255) ** 3 * voxelSize));
}

/**
 * Places for the bricks of all levels in one atlas: every level has slabs of its own. Coarser levels come first; once
 * the budget is spent, bricks of the next one go without, and finer levels altogether. The coarsest is always there.
 * @param maxTexture  texels along a side of a 3-D texture that the browser takes.
 * @param budget  bytes of textures.
 * @throws BundleError  when the volume does not fit.
 */
export function planAtlas(bundle: Bundle, maxTexture: number, budget: number): AtlasPlan {
  const tooLarge = () =>
    new BundleError(
      `This volume needs 3-D textures of more than ${maxTexture} texels a side, which is all this browser or graphics card has. ` +
        "Write a smaller bundle: cnerf bake --format web --web-resolution 192",
    );
  const limit = Math.min(255, Math.floor(maxTexture / brickTexels));
  const affordable = Math.max(bundle.volume.storedBricks, Math.floor(budget / bytesOfBrick));
  const wanted = Math.min(affordable, bundle.levels.reduce((sum, level) => sum + level.storedBricks, 0));
  // A cube has the smallest slabs, and so the least waste where a level ends; slabs are a row larger until all fit.
  for (let side = Math.ceil(Math.cbrt(wanted)); side <= limit; ++side) {
    const ofSlab = side * side;
    const levels: LevelPlan[] = [];
    let [first, base] = [0, 0];
    for (const level of bundle.levels) {
      const left = levels.length === 0 ? Infinity : Math.floor(affordable / ofSlab) - first;
      const slabs = Math.min(Math.ceil(level.storedBricks / ofSlab), left);
      if (slabs <= 0) break;
      levels.push({ first, slabs, places: Math.min(level.storedBricks, slabs * ofSlab), base });
      first += slabs;
      base += level.bricks[2];
      if (slabs * ofSlab < level.storedBricks) break;
    }
    const shown = bundle.levels.slice(0, levels.length);
    const index: Vec3 = [Math.max(...shown.map((l) => l.bricks[0])), Math.max(...shown.map((l) => l.bricks[1])), base];
    if (Math.max(...index) > maxTexture) throw tooLarge();
    if (first > limit) continue;
    return { counts: [side, side, first], index, levels, bytes: side * side * first * bytesOfBrick + 4 * index[0] * index[1] * index[2] };
  }
  throw tooLarge();
}

/** Stored bricks by number: the cell each lies in. @throws BundleError where that contradicts the manifest. */
function storedCells({ bricks, storedBricks, parts }: BundleLevel, packed: Packed): { cells: number[]; numbers: Int32Array } {
  const all = bricks[0] * bricks[1] * bricks[2];
  const cells: number[] = [];
  const numbers = new Int32Array(all).fill(-1);
  for (let b = 0; b < packed.occupancy.length; ++b) {
    if (packed.occupancy[b] === 0) numbers[b] = cells.push(b) - 1;
  }
  if (packed.occupancy.length !== all || cells.length !== storedBricks) {
    throw new BundleError(`${parts.occupancy}: does not fit bundle.json: it was written by another bake`);
  }
  const plane = storedBricks * voxelsOfBrick;
  if (packed.density.length !== plane || packed.color.length !== 3 * plane) {
    throw new BundleError(`${parts.density}, ${parts.color}: do not fit bundle.json: they were written by another bake`);
  }
  return { cells, numbers };
}

/**
 * Which stored bricks get a place: those that rays can reach, and where there are too few places, those nearest to the
 * eyes, since what is far away looks the same in larger voxels. @returns their numbers, in order, and how many went without.
 */
export function chosenBricks(level: BundleLevel, cells: number[], places: number, eyes: Vec3[]): { chosen: number[]; missing: number } {
  const [nx, ny] = level.bricks;
  const side = brickSide * level.voxelSize;
  const lowOf = (cell: number): Vec3 => [level.origin[0] + (cell % nx) * side, level.origin[1] + (Math.floor(cell / nx) % ny) * side, level.origin[2] + Math.floor(cell / (nx * ny)) * side];
  const reached: number[] = [];
  cells.forEach((cell, n) => {
    const low = lowOf(cell);
    // Bricks beside the cover only lend their voxels to those within.
    if (low.every((v, i) => v < level.cover.high[i] - 1e-6 * side && v + side > level.cover.low[i] + 1e-6 * side)) reached.push(n);
  });
  if (reached.length <= places) return { chosen: reached, missing: 0 };
  const around = eyes.length > 0 ? eyes : [level.cover.low.map((v, i) => (v + level.cover.high[i]) / 2) as Vec3];
  const distance = new Map<number, number>();
  for (const n of reached) {
    const low = lowOf(cells[n]);
    distance.set(n, Math.min(...around.map((eye) => Math.hypot(...low.map((v, i) => v + side / 2 - eye[i])))));
  }
  const nearest = [...reached].sort((a, b) => distance.get(a)! - distance.get(b)!).slice(0, places);
  return { chosen: nearest.sort((a, b) => a - b), missing: reached.length - places };
}

/**
 * @param packed  is changed.
 * @param eyes  world positions that the volume is mostly looked at from.
 * @throws BundleError  when the parts contradict each other.
 */
export function makeTexels(level: BundleLevel, packed: Packed, atlas: AtlasPlan, plan: LevelPlan, eyes: Vec3[]): LevelTexels {
  const { cells, numbers } = storedCells(level, packed);
  fromDifferences(packed.density);
  fromDifferences(packed.color);
  const table = opticalTable(level);
  const { chosen, missing } = chosenBricks(level, cells, plan.places, eyes);
  const [ax, ay] = atlas.counts;
  const index = new Uint8Array(4 * numbers.length);
  for (let b = 0; b < numbers.length; ++b) index[4 * b + 3] = numbers[b] >= 0 ? leftOut : Math.min(packed.occupancy[b], leftOut - 1);
  chosen.forEach((n, place) => {
    index.set([place % ax, Math.floor(place / ax) % ay, plan.first + Math.floor(place / (ax * ay)), 0], 4 * cells[n]);
  });
  const slab = (number: number): SlabTexels => {
    const texels = { density: new Uint16Array(ax * ay * brickTexels ** 3), lab: new Uint8Array(4 * ax * ay * brickTexels ** 3) };
    for (let place = 0; place < ax * ay && number * ax * ay + place < chosen.length; ++place) {
      const n = chosen[number * ax * ay + place];
      const corner = (Math.floor(place / ax) * ax * brickTexels + (place % ax)) * brickTexels;
      fillBrick(n, neighboursOf(cells[n], level.bricks, numbers), packed, table, { texels, corner, row: ax * brickTexels, layer: ax * ay * brickTexels ** 2 });
    }
    return texels;
  };
  return { index, missing, slabs: Math.ceil(chosen.length / (ax * ay)), slab };
}

/** Numbers of the 27 bricks around a cell, -1 where none is stored. */
function neighboursOf(cell: number, [nx, ny, nz]: Vec3, numbers: Int32Array): Int32Array {
  const [bx, by, bz] = [cell % nx, Math.floor(cell / nx) % ny, Math.floor(cell / (nx * ny))];
  const around = new Int32Array(27).fill(-1);
  for (let i = 0; i < 27; ++i) {
    const x = bx + (i % 3) - 1;
    const y = by + (Math.floor(i / 3) % 3) - 1;
    const z = bz + Math.floor(i / 9) - 1;
    if (x >= 0 && y >= 0 && z >= 0 && x < nx && y < ny && z < nz) around[i] = numbers[(z * ny + y) * nx + x];
  }
  return around;
}

/** The texels of a brick, with the layer of its neighbours' voxels around it. */
function fillBrick(n: number, around: Int32Array, packed: Packed, table: Uint16Array, { texels, corner, row, layer }: { texels: SlabTexels; corner: number; row: number; layer: number }): void {
  const { density, color } = packed;
  const plane = density.length;
  const clampTo = (v: number) => (v < 0 ? 0 : v > 7 ? 7 : v);
  for (let z = -1; z <= brickSide; ++z) {
    const dz = z < 0 ? 0 : z === brickSide ? 18 : 9;
    for (let y = -1; y <= brickSide; ++y) {
      const dy = y < 0 ? 0 : y === brickSide ? 6 : 3;
      let to = corner + (z + 1) * layer + (y + 1) * row;
      for (let x = -1; x <= brickSide; ++x, ++to) {
        const dx = x < 0 ? 0 : x === brickSide ? 2 : 1;
        const from = around[dz + dy + dx];
        let at: number;
        if (from >= 0) {
          at = from * voxelsOfBrick + ((z & 7) << 6) + ((y & 7) << 3) + (x & 7);
          texels.density[to] = table[density[at]];
        } else {
          // Nothing is there: no density; the colour of the voxel beside it.
          at = n * voxelsOfBrick + (clampTo(z) << 6) + (clampTo(y) << 3) + clampTo(x);
        }
        const rgba = 4 * to;
        texels.lab[rgba] = color[at];
        texels.lab[rgba + 1] = color[plane + at];
        texels.lab[rgba + 2] = color[2 * plane + at];
        texels.lab[rgba + 3] = 255;
      }
    }
  }
}
