/** What strokes paint on a grey photograph: chroma, at the light that is there. */

import { coloredPixel, labFromRgb, labOfHex, type Rgb } from "../color";
import type { Stroke, StrokePoint } from "./protocol";

export interface Box {
  left: number;
  top: number;
  right: number;
  bottom: number;
}
export const emptyBox = (): Box => ({ left: Infinity, top: Infinity, right: -Infinity, bottom: -Infinity });
const joined = (a: Box, b: Box): Box => ({ left: Math.min(a.left, b.left), top: Math.min(a.top, b.top), right: Math.max(a.right, b.right), bottom: Math.max(a.bottom, b.bottom) });

/** Distance of a place to a segment, and how far along it the nearest point lies. */
function nearest(x: number, y: number, a: StrokePoint, dx: number, dy: number, squared: number): [number, number] {
  const along = squared > 0 ? Math.min(1, Math.max(0, ((x - a[0]) * dx + (y - a[1]) * dy) / squared)) : 0;
  return [Math.hypot(x - a[0] - along * dx, y - a[1] - along * dy), along];
}

/**
 * Raises `coverage` (0..255) to what the segment between two points covers.
 * @param a, b  points in pixels
 * @param full  radius at full pressure, pixels
 * @return what was touched
 */
export function coverSegment(coverage: Uint8Array, width: number, height: number, a: StrokePoint, b: StrokePoint, full: number, softness: number): Box {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const squared = dx * dx + dy * dy;
  const box = {
    left: Math.max(0, Math.floor(Math.min(a[0], b[0]) - full - 1)),
    top: Math.max(0, Math.floor(Math.min(a[1], b[1]) - full - 1)),
    right: Math.min(width, Math.ceil(Math.max(a[0], b[0]) + full + 1)),
    bottom: Math.min(height, Math.ceil(Math.max(a[1], b[1]) + full + 1)),
  };
  for (let y = box.top; y < box.bottom; ++y) {
    for (let x = box.left; x < box.right; ++x) {
      const [distance, along] = nearest(x + 0.5, y + 0.5, a, dx, dy, squared);
      const radius = Math.max(full * (a[2] + (b[2] - a[2]) * along), 0.5);
      // An edge fades over a pixel at least.
      const value = Math.round(255 * Math.min(1, Math.max(0, (radius + 0.5 - distance) / Math.max(softness * radius, 1))));
      if (value > coverage[y * width + x]) coverage[y * width + x] = value;
    }
  }
  return box;
}

/** The topmost visible stroke at a place (shares of the picture). */
export function strokeAt(strokes: readonly Stroke[], x: number, y: number, width: number, height: number): Stroke | null {
  const covers = (stroke: Stroke) => {
    const full = (stroke.size * Math.min(width, height)) / 2;
    return stroke.points.some((end, i) => {
      const [a, b] = [stroke.points[Math.max(0, i - 1)], end].map((p): StrokePoint => [p[0] * width, p[1] * height, p[2]]);
      const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
      const [distance, along] = nearest(x * width, y * height, a, dx, dy, dx * dx + dy * dy);
      return distance <= Math.max(full * (a[2] + (b[2] - a[2]) * along), 1);
    });
  };
  return strokes.findLast((stroke) => !stroke.hidden && stroke.kind !== "picture" && covers(stroke)) ?? null;
}

/** A small picture of chroma: what the strokes reach, or what the field has. */
export interface Tint {
  width: number;
  height: number;
  /** a, b and opacity of each pixel; a and b are multiplied by the opacity. */
  a: Int8Array;
  b: Int8Array;
}

/** @param rgba  bytes of sRGB with straight alpha */
export function tintOf(width: number, height: number, rgba: Uint8ClampedArray): Tint {
  const count = width * height;
  const tint: Tint = { width, height, a: new Int8Array(count), b: new Int8Array(count) };
  for (let p = 0; p < count; ++p) {
    const alpha = rgba[4 * p + 3] / 255;
    if (alpha === 0) continue;
    const lab = labFromRgb([rgba[4 * p], rgba[4 * p + 1], rgba[4 * p + 2]]);
    tint.a[p] = Math.round(lab.a * alpha);
    tint.b[p] = Math.round(lab.b * alpha);
  }
  return tint;
}

/** Chroma of the paint, and how much of it there is. */
export interface Planes {
  a: Int8Array;
  b: Int8Array;
  alpha: Uint8Array;
}

/** A painted picture's paint. @param rgba  bytes of sRGB with straight alpha */
export function planesOf(rgba: Uint8ClampedArray): Planes {
  const count = rgba.length / 4;
  const planes: Planes = { a: new Int8Array(count), b: new Int8Array(count), alpha: new Uint8Array(count) };
  for (let p = 0; p < count; ++p) {
    planes.alpha[p] = rgba[4 * p + 3];
    if (planes.alpha[p] === 0) continue;
    const lab = labFromRgb([rgba[4 * p], rgba[4 * p + 1], rgba[4 * p + 2]]);
    planes.a[p] = Math.round(lab.a);
    planes.b[p] = Math.round(lab.b);
  }
  return planes;
}

/** The paint over one photograph, as pixels of the photograph's size: opaque where there is chroma or a stroke. */
export class PaintLayer {
  readonly pixels: Uint8ClampedArray<ArrayBuffer>;
  private readonly words: Uint32Array;
  private readonly grey: Uint8Array;
  private readonly paint: Planes;
  private before: Planes | null = null;
  private coverage: Uint8Array;
  private live: { stroke: Stroke; count: number; box: Box } | null = null;
  private tint: Tint | null = null;

  /** @param rgba  the photograph, width x height */
  constructor(readonly width: number, readonly height: number, rgba: Uint8ClampedArray) {
    const count = width * height;
    this.pixels = new Uint8ClampedArray(4 * count);
    this.words = new Uint32Array(this.pixels.buffer);
    this.grey = Uint8Array.from({ length: count }, (_, p) => Math.round(0.2126 * rgba[4 * p] + 0.7152 * rgba[4 * p + 1] + 0.0722 * rgba[4 * p + 2]));
    this.paint = { a: new Int8Array(count), b: new Int8Array(count), alpha: new Uint8Array(count) };
    this.coverage = new Uint8Array(count);
  }

  private get whole(): Box {
    return { left: 0, top: 0, right: this.width, bottom: this.height };
  }
  /** The mean grey code of a pixel and its neighbours. */
  greyAround(x: number, y: number): number {
    let [sum, count] = [0, 0];
    for (let v = Math.max(0, y - 1); v <= Math.min(this.height - 1, y + 1); ++v) {
      for (let u = Math.max(0, x - 1); u <= Math.min(this.width - 1, x + 1); ++u) [sum, count] = [sum + this.grey[v * this.width + u], count + 1];
    }
    return count > 0 ? Math.round(sum / count) : 128;
  }
  /** The colour that is seen at a pixel; null where there is none. */
  colorAt(x: number, y: number): Rgb | null {
    const p = y * this.width + x;
    const word = this.words[p];
    return word ? [word & 255, (word >> 8) & 255, (word >> 16) & 255] : null;
  }

  private pointOf([x, y, pressure]: StrokePoint): StrokePoint {
    return [x * this.width, y * this.height, pressure];
  }
  /** Covers the segments that end at points from number `from` on. */
  private cover(stroke: Stroke, from: number): Box {
    const full = (stroke.size * Math.min(this.width, this.height)) / 2;
    let box = emptyBox();
    for (let i = from; i < stroke.points.length; ++i) {
      const end = this.pointOf(stroke.points[i]);
      const begin = i > 0 ? this.pointOf(stroke.points[i - 1]) : end;
      box = joined(box, coverSegment(this.coverage, this.width, this.height, begin, end, full, stroke.softness));
    }
    return box;
  }
  /** Mixes a stroke, where it covers, with the paint of `from`. */
  private mix(stroke: Stroke, box: Box, from: Planes): void {
    const color = stroke.kind === "grey" ? { a: 0, b: 0 } : labOfHex(stroke.color);
    const erases = stroke.kind === "erase";
    for (let y = box.top; y < box.bottom; ++y) {
      for (let p = y * this.width + box.left; p < y * this.width + box.right; ++p) {
        const share = this.coverage[p] / 255;
        if (share === 0) continue;
        const there = (from.alpha[p] / 255) * (1 - share);
        const alpha = erases ? there : there + share;
        this.paint.alpha[p] = Math.round(255 * alpha);
        if (erases || alpha === 0) continue;
        this.paint.a[p] = Math.round((from.a[p] * there + color.a * share) / alpha);
        this.paint.b[p] = Math.round((from.b[p] * there + color.b * share) / alpha);
      }
    }
  }
  /** Lays a painted picture over the paint. */
  private lay(picture: Planes): void {
    const { a, b, alpha } = this.paint;
    for (let p = 0; p < alpha.length; ++p) {
      const share = picture.alpha[p] / 255;
      if (share === 0) continue;
      const there = (alpha[p] / 255) * (1 - share);
      const whole = there + share;
      alpha[p] = Math.round(255 * whole);
      a[p] = Math.round((a[p] * there + picture.a[p] * share) / whole);
      b[p] = Math.round((b[p] * there + picture.b[p] * share) / whole);
    }
  }
  private clearCoverage(box: Box): void {
    for (let y = box.top; y < box.bottom; ++y) this.coverage.fill(0, y * this.width + box.left, y * this.width + box.right);
  }

  /** A stroke that grows: `extend` as points come, `end` when it is whole. */
  begin(stroke: Stroke): void {
    this.end();
    this.before = { a: this.paint.a.slice(), b: this.paint.b.slice(), alpha: this.paint.alpha.slice() };
    this.live = { stroke, count: 0, box: emptyBox() };
  }
  /** @return what changed */
  extend(stroke: Stroke): Box {
    const { live, before } = this;
    if (!live || !before) return emptyBox();
    live.stroke = stroke;
    const box = this.cover(stroke, live.count);
    live.count = stroke.points.length;
    live.box = joined(live.box, box);
    this.mix(stroke, box, before);
    this.compose(box);
    return box;
  }
  end(): void {
    if (this.live) this.clearCoverage(this.live.box);
    this.live = this.before = null;
  }
  /** Paints all of the strokes anew. @param pictures  painted pictures in the layer's size, as far as they are there */
  redraw(strokes: readonly Stroke[], pictures: ReadonlyMap<string, Planes> = new Map()): void {
    this.end();
    this.paint.alpha.fill(0);
    for (const stroke of strokes) {
      if (stroke.hidden) continue;
      if (stroke.kind === "picture") {
        const picture = pictures.get(stroke.picture ?? "");
        if (picture?.alpha.length === this.paint.alpha.length) this.lay(picture);
        continue;
      }
      const box = this.cover(stroke, 0);
      this.mix(stroke, box, this.paint);
      this.clearCoverage(box);
    }
    this.compose(this.whole);
  }
  setTint(tint: Tint | null): void {
    this.tint = tint;
    this.compose(this.whole);
  }

  private compose(box: Box): void {
    const { tint, width } = this;
    const row = tint ? tint.width : 0;
    for (let y = box.top; y < box.bottom; ++y) {
      const line = tint ? Math.min(tint.height - 1, Math.floor(((y + 0.5) * tint.height) / this.height)) * row : 0;
      for (let x = box.left; x < box.right; ++x) {
        const p = y * width + x;
        const alpha = this.paint.alpha[p] / 255;
        let [a, b] = [0, 0];
        if (tint && alpha < 1) {
          const t = line + Math.min(row - 1, Math.floor(((x + 0.5) * row) / width));
          [a, b] = [tint.a[t], tint.b[t]];
        }
        if (alpha === 0 && a === 0 && b === 0) {
          this.words[p] = 0;
          continue;
        }
        this.words[p] = coloredPixel(this.grey[p], Math.round(a + (this.paint.a[p] - a) * alpha), Math.round(b + (this.paint.b[p] - b) * alpha));
      }
    }
  }
}
