/**
 * sRGB and CIELAB as the program has them (src/color/colorspace_math.h): tristimulus relative to white, so a grey has
 * a = b = 0 exactly; chroma that leaves the gamut is reduced at its lightness and hue.
 */

export type Rgb = [number, number, number];
export interface Lab {
  /** L*, 0..100. */
  lightness: number;
  a: number;
  b: number;
}

const epsilon = 216 / 24389;
const kappa = 24389 / 27;
const forward = (t: number) => (t > epsilon ? Math.cbrt(t) : (kappa * t + 16) / 116);
const inverse = (f: number) => {
  const cube = f * f * f;
  return cube > epsilon ? cube : (116 * f - 16) / kappa;
};

export const linearFromSrgb = (v: number) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
export const srgbFromLinear = (v: number) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const code = (linear: number) => Math.round(255 * srgbFromLinear(Math.min(1, Math.max(0, linear))));

const linearOfCode = Float64Array.from({ length: 256 }, (_, i) => linearFromSrgb(i / 255));

/** @param rgb  sRGB codes, 0..255 */
export function labFromRgb([r8, g8, b8]: Rgb): Lab {
  const [r, g, b] = [linearOfCode[r8], linearOfCode[g8], linearOfCode[b8]];
  const red = r - g;
  const blue = b - g;
  const x = g + 0.433949981682422492 * red + 0.189840271935357158 * blue;
  const y = g + 0.212672851405622476 * red + 0.072174993306559576 * blue;
  const z = g + 0.017756578696701338 * red + 0.872775436511087799 * blue;
  const fy = forward(y);
  return { lightness: 116 * fy - 16, a: 500 * (forward(x) - fy), b: 200 * (fy - forward(z)) };
}

/** Linear Rec.709; may leave the gamut. */
function linearFromLab(lightness: number, a: number, b: number): Rgb {
  const fy = (lightness + 16) / 116;
  const y = inverse(fy);
  const x = inverse(fy + a / 500) - y;
  const z = inverse(fy - b / 200) - y;
  return [
    y + 3.079954467464594003 * x - 0.542815954666877154 * z,
    y - 0.921258284014264905 * x + 0.045247438567570818 * z,
    y + 0.052887411823709742 * x + 1.151138501693044214 * z,
  ];
}

export function inGamut({ lightness, a, b }: Lab): boolean {
  return linearFromLab(lightness, a, b).every((v) => v >= -1e-9 && v <= 1 + 1e-9);
}

/** The colour with as much of its chroma as the gamut has at its lightness. */
export function mappedIntoGamut(lab: Lab, steps = 30): Lab {
  const lightness = Math.min(100, Math.max(0, lab.lightness));
  const scaled = (share: number): Lab => ({ lightness, a: lab.a * share, b: lab.b * share });
  if (inGamut(scaled(1))) return scaled(1);
  let low = 0;
  let high = 1;
  for (let step = 0; step < steps; ++step) {
    const middle = (low + high) / 2;
    if (inGamut(scaled(middle))) low = middle;
    else high = middle;
  }
  return scaled(low);
}

/** sRGB codes at a lightness; chroma is reduced into the gamut. */
export function rgbFromLab(lab: Lab, steps = 30): Rgb {
  const { lightness, a, b } = mappedIntoGamut(lab, steps);
  return linearFromLab(lightness, a, b).map(code) as Rgb;
}

export const hexOf = (rgb: Rgb) => `#${rgb.map((v) => v.toString(16).padStart(2, "0")).join("")}`;

/** null where the text is no colour; "#abc" and a missing "#" are taken too. */
export function rgbOfHex(text: string): Rgb | null {
  let digits = text.trim().replace(/^#/, "");
  if (/^[0-9a-f]{3}$/i.test(digits)) digits = [...digits].map((d) => d + d).join("");
  if (!/^[0-9a-f]{6}$/i.test(digits)) return null;
  return [0, 2, 4].map((i) => parseInt(digits.slice(i, i + 2), 16)) as Rgb;
}
/** Linear Rec.709; black where the text is no colour. */
export const linearOfHex = (text: string) => (rgbOfHex(text) ?? [0, 0, 0]).map((v) => linearOfCode[v]) as Rgb;
export const labOfHex = (text: string): Lab => labFromRgb(rgbOfHex(text) ?? [128, 128, 128]);
/** How a brush's colour looks at a lightness. */
export const hexAt = (color: string, lightness: number) => hexOf(rgbFromLab({ ...labOfHex(color), lightness }));

/** L* of a grey's sRGB code. */
export const lightnessOfCode = Float64Array.from(linearOfCode, (y) => 116 * forward(y) - 16);

const cacheKeys = new Int32Array(1 << 16).fill(-1);
const cacheValues = new Uint32Array(1 << 16);

/**
 * The pixel of a grey code that got chroma: R, G, B, A bytes of little-endian ImageData, opaque. a and b are whole
 * numbers -128..127. Pictures ask for few different ones, many times over: they are remembered.
 */
export function coloredPixel(grey: number, a: number, b: number): number {
  if (a === 0 && b === 0) return (0xff000000 | (grey << 16) | (grey << 8) | grey) >>> 0;
  const key = (grey << 16) | ((a + 128) << 8) | (b + 128);
  const slot = (Math.imul(key, 0x9e3779b1) >>> 16) & 0xffff;
  if (cacheKeys[slot] === key) return cacheValues[slot];
  const [red, green, blue] = rgbFromLab({ lightness: lightnessOfCode[grey], a, b }, 12);
  cacheKeys[slot] = key;
  return (cacheValues[slot] = (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0);
}
