/** Loads the levels of a bundle, coarsest first, into as much memory as a browser should spend. */

import { makeTexels, planAtlas, type AtlasPlan } from "./bricks";
import { loadLevel, type Bundle } from "./bundle";
import type { Vec3 } from "./math";
import { GraphicsError, type Renderer } from "./renderer";

const mib = 2 ** 20;

/** What is known of the device and what its user asks for. */
export interface Device {
  /** `?budget=` of the address, MiB. */
  asked: string | null;
  /** GiB, where the browser tells; it tells no more than 8. */
  memory: number | undefined;
  touch: boolean;
}

/**
 * Bytes of textures that the page takes at most. 512 MiB hold four levels of 256 voxels, and are an eighth of what a
 * small laptop shares between processor and graphics. Phones end a tab at about 1 GiB with all it holds, of which the
 * textures are counted twice while they are made.
 */
export function textureBudget({ asked, memory, touch }: Device): number {
  const wanted = Number(asked);
  if (asked !== null && Number.isFinite(wanted) && wanted > 0) return wanted * mib;
  return (touch || (memory !== undefined && memory <= 2) ? 192 : 512) * mib;
}

export function thisDevice(): Device {
  return {
    asked: new URLSearchParams(location.search).get("budget"),
    memory: (navigator as { deviceMemory?: number }).deviceMemory,
    touch: matchMedia("(pointer: coarse)").matches,
  };
}

/** Lets the browser draw in between. */
const pause = () => new Promise<void>((done) => setTimeout(done, 0));

export class Levels {
  /** Levels that are shown. */
  there = 0;
  /** Of the levels that were tried, bricks that did not fit. */
  private missing = 0;
  /** Why finer levels did not come. */
  private problem = "";
  /** Whether nothing more will come. */
  complete = false;
  private atlas: AtlasPlan;
  private readonly eyes: Vec3[];

  /** @throws BundleError, GraphicsError  when not even the coarsest level fits. */
  constructor(private readonly base: string, readonly bundle: Bundle, private readonly renderer: Renderer, private budget: number) {
    this.eyes = bundle.cameras.map((camera) => camera.position);
    for (;;) {
      this.atlas = planAtlas(bundle, renderer.maxTexture, this.budget);
      try {
        renderer.allocate(bundle, this.atlas);
        return;
      } catch (problem) {
        // Drivers say so when there is less; the coarsest level alone is better than nothing.
        if (!(problem instanceof GraphicsError) || this.atlas.levels.length === 1) throw problem;
        this.budget /= 2;
      }
    }
  }

  /** The coarsest level. @throws BundleError, GraphicsError. */
  first(onProgress: (share: number) => void): Promise<void> {
    return this.load(onProgress);
  }

  /** All others, one after another. What does not come is said by `note`; nothing is thrown. */
  async rest(changed: () => void): Promise<void> {
    try {
      while (this.there < this.atlas.levels.length) {
        await this.load(() => {});
        changed();
      }
    } catch (problem) {
      this.problem = (problem as Error).message;
    }
    this.complete = true;
    changed();
  }

  private async load(onProgress: (share: number) => void): Promise<void> {
    const level = this.bundle.levels[this.there];
    const plan = this.atlas.levels[this.there];
    const packed = await loadLevel(this.base, this.bundle, level, onProgress);
    const texels = makeTexels(level, packed, this.atlas, plan, this.eyes);
    for (let slab = 0; slab < texels.slabs; ++slab) {
      this.renderer.putSlab(plan.first + slab, texels.slab(slab));
      await pause();
    }
    this.renderer.addLevel(texels.index);
    this.missing += texels.missing;
    this.there += 1;
  }

  /** What is not shown, and why; empty when all is. */
  get note(): string {
    const { levels } = this.bundle;
    if (this.problem) return `The volume is shown coarser than it is: ${this.problem}`;
    const without = levels.length - this.atlas.levels.length;
    if (!this.complete || (without === 0 && this.missing === 0)) return "";
    const parts = [];
    if (this.missing > 0) parts.push(`${this.missing.toLocaleString("en")} ${this.missing === 1 ? "brick" : "bricks"} of level ${this.there}`);
    if (without > 0) parts.push(without === 1 ? "the finest level" : `the ${without} finest levels`);
    return `Left out: ${parts.join(" and ")}, for want of memory (${Math.round(this.budget / mib)} MiB). ?budget=1024 in the address asks for more.`;
  }

  /** For the statistics. */
  get rows(): [string, string][] {
    const { levels, units } = this.bundle;
    const sizes = levels.slice(0, this.there).map((level) => level.voxelSize.toPrecision(3));
    const sum = (of: "voxels" | "storedBricks") => levels.slice(0, this.there).reduce((total, level) => total + level[of], 0);
    return [
      ["levels", levels.length === this.there ? String(this.there) : `${this.there} of ${levels.length}`],
      ["voxels", `${sum("voxels").toLocaleString("en")} of ${sizes.join(", ")} ${units}`],
      ["bricks", (sum("storedBricks") - this.missing).toLocaleString("en")],
    ];
  }
}
