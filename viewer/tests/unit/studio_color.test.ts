import { describe, expect, it } from "vitest";
import { coloredPixel, hexAt, hexOf, inGamut, labFromRgb, labOfHex, lightnessOfCode, linearFromSrgb, mappedIntoGamut, rgbFromLab, rgbOfHex, type Rgb } from "../../src/color";
import { coverSegment, PaintLayer, planesOf, strokeAt, tintOf } from "../../src/studio/paint";
import type { Stroke, StrokePoint } from "../../src/studio/protocol";

/** The textbook's way: the matrix of IEC 61966-2-1, its white, CIE 15. */
function textbookLab(rgb: Rgb): [number, number, number] {
  const [r, g, b] = rgb.map((v) => linearFromSrgb(v / 255));
  const f = (t: number) => (t > (6 / 29) ** 3 ? t ** (1 / 3) : t / (3 * (6 / 29) ** 2) + 4 / 29);
  const [x, y, z] = [
    f((0.4124564 * r + 0.3575761 * g + 0.1804375 * b) / 0.95047),
    f(0.2126729 * r + 0.7151522 * g + 0.072175 * b),
    f((0.0193339 * r + 0.119192 * g + 0.9503041 * b) / 1.08883),
  ];
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
const seeded = (seed: number) => () => (seed = (seed * 1103515245 + 12345) % 2147483648) / 2147483648;
const lightnessOf = (rgb: Rgb) => labFromRgb(rgb).lightness;

describe("colours", () => {
  it("are those of the textbook", () => {
    expect(labOfHex("#ff0000").lightness).toBeCloseTo(53.24, 1);
    expect(labOfHex("#0000ff").b).toBeCloseTo(-107.86, 1);
    const random = seeded(7);
    for (let i = 0; i < 200; ++i) {
      const rgb = [0, 0, 0].map(() => Math.floor(256 * random())) as Rgb;
      const { lightness, a, b } = labFromRgb(rgb);
      // The textbook's matrix has seven digits, ours makes greys exact.
      textbookLab(rgb).forEach((v, k) => expect([lightness, a, b][k]).toBeCloseTo(v, 1));
    }
  });
  it("of greys have no chroma at all, and stay what they are", () => {
    for (let grey = 0; grey < 256; ++grey) {
      const lab = labFromRgb([grey, grey, grey]);
      expect([lab.a, lab.b]).toEqual([0, 0]);
      expect(rgbFromLab(lab)).toEqual([grey, grey, grey]);
      expect(lightnessOfCode[grey]).toBeCloseTo(lab.lightness, 12);
    }
  });
  it("go to Lab and back", () => {
    const random = seeded(3);
    for (let i = 0; i < 300; ++i) {
      const rgb = [0, 0, 0].map(() => Math.floor(256 * random())) as Rgb;
      expect(rgbFromLab(labFromRgb(rgb))).toEqual(rgb);
    }
  });
  it("beyond the gamut keep lightness and hue", () => {
    const random = seeded(11);
    let reduced = 0;
    for (let i = 0; i < 300; ++i) {
      const wanted = { lightness: 100 * random(), a: 200 * random() - 100, b: 200 * random() - 100 };
      const mapped = mappedIntoGamut(wanted);
      expect(mapped.lightness).toBe(wanted.lightness);
      expect(Math.atan2(mapped.b, mapped.a)).toBeCloseTo(Math.atan2(wanted.b, wanted.a), 9);
      expect(inGamut(mapped)).toBe(true);
      if (inGamut(wanted)) continue;
      reduced += 1;
      expect(inGamut({ ...mapped, a: mapped.a * 1.01, b: mapped.b * 1.01 })).toBe(Math.hypot(mapped.a, mapped.b) < 1e-3);
    }
    expect(reduced).toBeGreaterThan(100);
  });
  it("are read and written as text", () => {
    expect(rgbOfHex(" #c08040 ")).toEqual([192, 128, 64]);
    expect(rgbOfHex("abc")).toEqual([170, 187, 204]);
    for (const text of ["", "#12345", "red", "#gggggg"]) expect(rgbOfHex(text)).toBeNull();
    expect(hexOf([1, 16, 255])).toBe("#0110ff");
    expect(Math.abs(lightnessOf(rgbOfHex(hexAt("#ff0000", 20))!) - 20)).toBeLessThan(0.5);
  });
  it("of pixels are those of the slow way, remembered or not", () => {
    const random = seeded(5);
    const asked = Array.from({ length: 400 }, () => [Math.floor(256 * random()), Math.floor(160 * random()) - 80, Math.floor(160 * random()) - 80]);
    for (const [grey, a, b] of [...asked, ...asked]) {
      const word = coloredPixel(grey, a, b);
      const slow = rgbFromLab({ lightness: lightnessOfCode[grey], a, b });
      // Twelve halvings leave a chroma of 0.03: a code at most.
      [word & 255, (word >> 8) & 255, (word >> 16) & 255].forEach((v, k) => expect(Math.abs(v - slow[k])).toBeLessThanOrEqual(1));
      expect(word >>> 24).toBe(255);
    }
  });
});

function stroke(points: StrokePoint[], more: Partial<Stroke> = {}): Stroke {
  return { id: "a", view: "v", kind: "paint", color: "#c03020", size: 0.3, softness: 0.5, reach: 1, hidden: false, points, ...more };
}
/** A photograph that goes from black to white. */
function ramp(width: number, height: number): Uint8ClampedArray {
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let p = 0; p < width * height; ++p) rgba.fill(Math.round((255 * (p % width)) / (width - 1)), 4 * p, 4 * p + 3), (rgba[4 * p + 3] = 255);
  return rgba;
}
const pixel = (layer: PaintLayer, x: number, y: number) => [...layer.pixels.subarray(4 * (y * layer.width + x), 4 * (y * layer.width + x) + 4)];
const isGrey = ([r, g, b]: number[]) => r === g && g === b;

describe("coverage of a brush", () => {
  it("has the area of its disc, and the volume of its fading edge", () => {
    const size = 80;
    for (const [radius, softness] of [[20, 0], [20, 0.5], [30, 1]]) {
      const coverage = new Uint8Array(size * size);
      coverSegment(coverage, size, size, [40, 40, 1], [40, 40, 1], radius, softness);
      const fade = Math.max(softness * radius, 1);
      const outer = radius + 0.5;
      const flat = outer - fade;
      // Shells of 2 pi d, of height (outer - d) / fade beyond the flat part.
      const primitive = (d: number) => ((2 * Math.PI) / fade) * ((outer * d * d) / 2 - d ** 3 / 3);
      const volume = Math.PI * flat ** 2 + primitive(outer) - primitive(flat);
      const measured = coverage.reduce((sum, v) => sum + v, 0) / 255;
      expect(Math.abs(measured / volume - 1)).toBeLessThan(0.01);
    }
  });
  it("follows pressure along a line, and stays in the picture", () => {
    const coverage = new Uint8Array(100 * 40);
    const box = coverSegment(coverage, 100, 40, [-10, 20, 0.1], [110, 20, 1], 15, 0);
    expect([box.left, box.right]).toEqual([0, 100]);
    const width = (x: number) => Array.from({ length: 40 }, (_, y) => coverage[y * 100 + x] / 255).reduce((a, b) => a + b);
    // Pressure at x = 20 and 80 lies at (x + 10) / 120 of the way.
    for (const x of [20, 80]) expect(Math.abs(width(x) - 30 * (0.1 + (0.9 * (x + 10.5)) / 120))).toBeLessThan(1.1);
  });
});

describe("paint", () => {
  const [width, height] = [128, 40];
  const line: StrokePoint[] = [[0.02, 0.5, 1], [0.4, 0.4, 0.6], [0.98, 0.5, 1]];
  it("changes colour, never light", () => {
    const layer = new PaintLayer(width, height, ramp(width, height));
    layer.redraw([stroke(line), stroke([[0.5, 0.5, 1]], { id: "b", color: "#2040c0", softness: 1, size: 0.5 })]);
    let painted = 0;
    let worst = 0;
    for (let y = 0; y < height; ++y) {
      for (let x = 0; x < width; ++x) {
        const [r, g, b, a] = pixel(layer, x, y);
        if (a === 0) continue;
        painted += isGrey([r, g, b]) ? 0 : 1;
        worst = Math.max(worst, Math.abs(lightnessOf([r, g, b]) - lightnessOfCode[Math.round((255 * x) / (width - 1))]));
      }
    }
    expect(painted).toBeGreaterThan(800);
    // Half a code of each channel, in L*.
    expect(worst).toBeLessThan(0.6);
  });
  it("that grows under the pen is the same as when it is painted at once", () => {
    const live = new PaintLayer(width, height, ramp(width, height));
    const under = stroke([[0.5, 0.5, 1]], { id: "b", color: "#2040c0", size: 0.5 });
    live.redraw([under]);
    live.begin(stroke(line.slice(0, 1)));
    live.extend(stroke(line.slice(0, 1)));
    live.extend(stroke(line.slice(0, 2)));
    const box = live.extend(stroke(line));
    live.end();
    expect(box.right).toBeGreaterThan(box.left);
    const once = new PaintLayer(width, height, ramp(width, height));
    once.redraw([under, stroke(line)]);
    expect(live.pixels).toEqual(once.pixels);
    // And nothing of a stroke is left for the next one.
    live.redraw([]);
    expect(live.pixels.every((v) => v === 0)).toBe(true);
  });
  it("is erased, kept grey and hidden", () => {
    const layer = new PaintLayer(width, height, ramp(width, height));
    const dot = (kind: Stroke["kind"]) => stroke([[0.4, 0.4, 1]], { id: kind, kind, size: 0.5, softness: 0 });
    const [x, y] = [51, 16];
    layer.redraw([stroke(line)]);
    expect(isGrey(pixel(layer, x, y))).toBe(false);
    layer.redraw([stroke(line), dot("erase")]);
    expect(pixel(layer, x, y)[3]).toBe(0);
    layer.redraw([dot("erase"), stroke(line)]);
    expect(isGrey(pixel(layer, x, y)), "an eraser takes only what was there before").toBe(false);
    layer.redraw([stroke(line), dot("grey")]);
    expect(pixel(layer, x, y)).toEqual([...Array(3).fill(Math.round((255 * x) / (width - 1))), 255]);
    layer.redraw([stroke(line, { hidden: true })]);
    expect(pixel(layer, x, y)[3]).toBe(0);
  });
  it("lies over a tint, which keeps the light too", () => {
    const layer = new PaintLayer(width, height, ramp(width, height));
    layer.redraw([stroke([[0.25, 0.5, 1]], { color: "#2040c0", softness: 0, size: 0.4 })]);
    layer.setTint(tintOf(2, 1, new Uint8ClampedArray([200, 60, 60, 255, 0, 0, 0, 0])));
    const [r, g, b] = pixel(layer, 60, 4);
    expect(r).toBeGreaterThan(b);
    expect(Math.abs(lightnessOf([r, g, b] as Rgb) - lightnessOfCode[Math.round((255 * 60) / 127)])).toBeLessThan(0.6);
    expect(pixel(layer, 32, 20)[2], "paint is on top").toBeGreaterThan(pixel(layer, 32, 20)[0]);
    expect(pixel(layer, 100, 20)[3], "nothing where nothing is reached").toBe(0);
    layer.setTint(null);
    expect(pixel(layer, 60, 4)[3]).toBe(0);
  });
  it("is found under the pointer, the topmost first", () => {
    const list = [stroke(line), stroke([[0.4, 0.4, 1]], { id: "b" }), stroke([[0.4, 0.4, 1]], { id: "c", hidden: true })];
    expect(strokeAt(list, 0.4, 0.4, width, height)?.id).toBe("b");
    expect(strokeAt(list, 0.9, 0.5, width, height)?.id).toBe("a");
    expect(strokeAt(list, 0.5, 0.95, width, height)).toBeNull();
  });
});

describe("painted pictures", () => {
  const grey = new Uint8ClampedArray(4 * 4 * 2).fill(128);
  const picture = new Uint8ClampedArray(4 * 4 * 2);
  // The left half is red, with one pixel of half the strength.
  for (const p of [0, 1, 4, 5]) picture.set([200, 40, 30, p === 5 ? 128 : 255], 4 * p);
  const stroke: Stroke = { id: "p", view: "v", kind: "picture", picture: "abc", color: "#808080", size: 0.01, softness: 0, reach: 1, hidden: false, points: [] };
  const pictures = new Map([["abc", planesOf(picture)]]);

  it("colour where they are painted, at the photograph's light", () => {
    const layer = new PaintLayer(4, 2, grey);
    layer.redraw([stroke], pictures);
    const [full, half] = [layer.colorAt(0, 0)!, layer.colorAt(1, 1)!];
    expect(full[0]).toBeGreaterThan(full[2] + 40);
    expect(half[0] - half[2]).toBeGreaterThan(20);
    expect(half[0] - half[2]).toBeLessThan(full[0] - full[2]);
    expect(layer.colorAt(2, 0)).toBeNull();
    expect(labFromRgb(full).lightness).toBeCloseTo(labFromRgb([128, 128, 128]).lightness, 0);
  });
  it("are hidden with their stroke, lie below later strokes, and are left out while they are not there", () => {
    const layer = new PaintLayer(4, 2, grey);
    layer.redraw([{ ...stroke, hidden: true }], pictures);
    expect(layer.colorAt(0, 0)).toBeNull();
    layer.redraw([stroke], new Map());
    expect(layer.colorAt(0, 0)).toBeNull();
    layer.redraw([stroke, { ...stroke, id: "e", kind: "erase", picture: undefined, size: 0.5, points: [[0.125, 0.25, 1]] }], pictures);
    expect(layer.colorAt(0, 0)).toBeNull();
    expect(layer.colorAt(1, 1)).not.toBeNull();
  });
});
