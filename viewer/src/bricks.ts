/** Packed bricks -> the texels of three textures. No WebGL here. */

import type { Bundle, Packed } from "./bundle";
import { BundleError } from "./bundle";
import type { Vec3 } from "./math";

export const brickSide = 8;
/** With the layer of neighbours around it that hardware interpolation reads. */
export const brickTexels = brickSide + 2;
const voxelsOfBrick = brickSide ** 3;

export interface Atlas {
  /** Bricks along each axis of the atlas. */
  counts: Vec3;
  /** [z, y, x] half floats: optical depth of one voxel. */
  density: Uint16Array;
  /** [z, y, x, 4] L* 255/100, a + 128, b + 128, 255. */
  lab: Uint8Array;
  /** [bricks, 4] where a stored brick lies in the atlas, and how far the nearest stored one is (0 = here). */
  index: Uint8Array;
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
export function opticalTable(bundle: Bundle): Uint16Array {
  const { density, voxelSize } = bundle.volume;
  return Uint16Array.from({ length: 256 }, (_, code) => halfBits(density.scale * (code / 255) ** 3 * voxelSize));
}

/** Bricks along each axis of a box that is as near to a cube as it gets. */
export function atlasCounts(bricks: number, limit: number): Vec3 | null {
  const x = Math.min(limit, Math.ceil(Math.cbrt(bricks)));
  const y = Math.min(limit, Math.ceil(Math.sqrt(bricks / x)));
  const z = Math.ceil(bricks / (x * y));
  return z <= limit ? [x, y, z] : null;
}

/**
 * @param maxTexture  texels along a side of a 3-D texture that the browser takes.
 * @throws BundleError  when the parts contradict each other, or the volume does not fit.
 */
export function makeAtlas(bundle: Bundle, packed: Packed, maxTexture: number): Atlas {
  const { bricks, storedBricks } = bundle.volume;
  const [nx, ny, nz] = bricks;
  const cells = nx * ny * nz;
  const plane = storedBricks * voxelsOfBrick;
  const stored: number[] = [];
  const numbers = new Int32Array(cells).fill(-1);
  for (let b = 0; b < packed.occupancy.length; ++b) {
    if (packed.occupancy[b] === 0) numbers[b] = stored.push(b) - 1;
  }
  if (packed.occupancy.length !== cells || stored.length !== storedBricks) {
    throw new BundleError("occupancy.bin: does not fit bundle.json: it was written by another bake");
  }
  if (packed.density.length !== plane || packed.color.length !== 3 * plane) {
    throw new BundleError("density.bin, color.bin: do not fit bundle.json: they were written by another bake");
  }
  const limit = Math.min(255, Math.floor(maxTexture / brickTexels));
  const counts = atlasCounts(storedBricks, limit);
  if (!counts || Math.max(...bricks) > maxTexture) {
    throw new BundleError(
      `This volume needs 3-D textures of more than ${maxTexture} texels a side, which is all this browser or graphics card has. ` +
        "Write a smaller bundle: cnerf bake --format web --web-resolution 192",
    );
  }
  const [ax, ay, az] = counts;
  const rowTexels = ax * brickTexels;
  const layerTexels = rowTexels * ay * brickTexels;
  const texels = layerTexels * az * brickTexels;
  const result: Atlas = {
    counts,
    density: new Uint16Array(texels),
    lab: new Uint8Array(4 * texels),
    index: new Uint8Array(4 * cells),
  };
  fromDifferences(packed.density);
  fromDifferences(packed.color);
  const table = opticalTable(bundle);
  const source = packed.density;
  const color = packed.color;

  for (let b = 0; b < cells; ++b) {
    result.index[4 * b + 3] = packed.occupancy[b];
    const n = numbers[b];
    if (n < 0) continue;
    result.index[4 * b] = n % ax;
    result.index[4 * b + 1] = Math.floor(n / ax) % ay;
    result.index[4 * b + 2] = Math.floor(n / (ax * ay));
  }
  for (let n = 0; n < stored.length; ++n) {
    const b = stored[n];
    const bx = b % nx;
    const by = Math.floor(b / nx) % ny;
    const bz = Math.floor(b / (nx * ny));
    const corner =
      Math.floor(n / (ax * ay)) * brickTexels * layerTexels + (Math.floor(n / ax) % ay) * brickTexels * rowTexels + (n % ax) * brickTexels;
    // The 27 bricks around; a voxel of the layer outside comes from one of them.
    const around = new Int32Array(27).fill(-1);
    for (let i = 0; i < 27; ++i) {
      const x = bx + (i % 3) - 1;
      const y = by + (Math.floor(i / 3) % 3) - 1;
      const z = bz + Math.floor(i / 9) - 1;
      if (x >= 0 && y >= 0 && z >= 0 && x < nx && y < ny && z < nz) around[i] = numbers[(z * ny + y) * nx + x];
    }
    for (let z = -1; z <= brickSide; ++z) {
      const dz = z < 0 ? 0 : z === brickSide ? 18 : 9;
      for (let y = -1; y <= brickSide; ++y) {
        const dy = y < 0 ? 0 : y === brickSide ? 6 : 3;
        let to = corner + (z + 1) * layerTexels + (y + 1) * rowTexels;
        for (let x = -1; x <= brickSide; ++x, ++to) {
          const dx = x < 0 ? 0 : x === brickSide ? 2 : 1;
          const from = around[dz + dy + dx];
          let at: number;
          if (from >= 0) {
            at = from * voxelsOfBrick + ((z & 7) << 6) + ((y & 7) << 3) + (x & 7);
            result.density[to] = table[source[at]];
          } else {
            // Nothing is there: no density; the colour of the voxel beside it.
            const clampTo = (v: number) => (v < 0 ? 0 : v > 7 ? 7 : v);
            at = n * voxelsOfBrick + (clampTo(z) << 6) + (clampTo(y) << 3) + clampTo(x);
          }
          const rgba = 4 * to;
          result.lab[rgba] = color[at];
          result.lab[rgba + 1] = color[plane + at];
          result.lab[rgba + 2] = color[2 * plane + at];
          result.lab[rgba + 3] = 255;
        }
      }
    }
  }
  return result;
}

export function textureBytes(atlas: Atlas): number {
  return atlas.density.byteLength + atlas.lab.byteLength + atlas.index.byteLength;
}
