/** The view and the settings in the address, short: what has its default is left out. */

import type { View } from "./camera";
import { clamp, matrixFromQuat, quatFromMatrix, unit, type Quat, type Vec3 } from "./math";
import { defaultSettings, quantities, type Settings } from "./settings";

/** The settings that are numbers: keys, names, and what they may be. */
const numbers = [
  ["w", "wipe", 0, 1],
  ["s", "saturation", 0, 2],
  ["h", "hue", -180, 180],
  ["e", "exposure", -5, 5],
  ["g", "gain", 0, 100],
  ["d", "threshold", 0, 24],
  ["o", "photo", 0, 1],
] as const;

const short = (x: number) => String(Number(x.toPrecision(6)));
const joined = (list: readonly number[]) => list.map(short).join(",");

export function toHash(view: View, target: Vec3, settings: Settings, defaults: Settings): string {
  const parts: string[] = [];
  const put = (key: string, value: string) => parts.push(`${key}=${value}`);
  put("p", joined(view.position));
  put("q", joined(quatFromMatrix(view.rotation)));
  put("t", joined(target));
  const { lens } = view;
  put("l", joined([lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy]));
  for (const [key, name] of numbers) {
    if (settings[name] !== defaults[name]) put(key, short(settings[name]));
  }
  if (settings.background !== defaults.background) put("b", settings.background.replace("#", ""));
  if (settings.clip) put("c", joined([...settings.clip.low, ...settings.clip.high]));
  if (settings.slice) put("x", `${settings.slice.axis},${short(settings.slice.at)},${settings.slice.quantity}`);
  if (settings.fly) put("f", "1");
  if (settings.showCameras) put("k", "1");
  if (settings.up !== defaults.up) put("u", settings.up);
  return "#" + parts.join("&");
}

function numbersOf(text: string | null, count: number): number[] | null {
  if (!text) return null;
  const list = text.split(",").map(Number);
  return list.length === count && list.every(Number.isFinite) ? list : null;
}

/** What a hash says; anything that makes no sense in it is left out. */
export function fromHash(hash: string, defaults: Settings): { view?: View; target?: Vec3; settings: Settings } {
  const values = new URLSearchParams(hash.replace(/^#/, "").replace(/\+/g, "%2B"));
  const settings: Settings = { ...defaultSettings(defaults.up), ...defaults };
  for (const [key, name, low, high] of numbers) {
    const list = numbersOf(values.get(key), 1);
    if (list) settings[name] = clamp(list[0], low, high);
  }
  const background = values.get("b");
  if (background && /^([0-9a-f]{6}|none|sky)$/i.test(background)) settings.background = background.length === 6 ? `#${background}` : background;
  const clip = numbersOf(values.get("c"), 6);
  if (clip) settings.clip = { low: clip.slice(0, 3) as Vec3, high: clip.slice(3) as Vec3 };
  const slice = values.get("x")?.split(",");
  if (slice?.length === 3) {
    const axis = Number(slice[0]);
    const at = Number(slice[1]);
    const quantity = quantities.find((q) => q === slice[2]);
    if ((axis === 0 || axis === 1 || axis === 2) && Number.isFinite(at) && quantity) settings.slice = { axis, at, quantity };
  }
  settings.fly = values.get("f") === "1";
  settings.showCameras = values.get("k") === "1";
  const up = values.get("u");
  if (up && /^[+-][xyz]$/.test(up)) settings.up = up;
  const p = numbersOf(values.get("p"), 3);
  const q = numbersOf(values.get("q"), 4);
  const l = numbersOf(values.get("l"), 6);
  const target = numbersOf(values.get("t"), 3);
  if (!p || !q || !l || Math.hypot(...q) < 0.5 || l.slice(0, 4).some((v) => v <= 0)) return { settings };
  return {
    settings,
    target: (target as Vec3 | null) ?? undefined,
    view: {
      position: p as Vec3,
      rotation: matrixFromQuat(unit(q as Quat)),
      lens: { width: l[0], height: l[1], fx: l[2], fy: l[3], cx: l[4], cy: l[5] },
    },
  };
}

/** The text `cnerf bake` takes. */
export function aabbText(low: Vec3, high: Vec3): string {
  return `--aabb=${[...low, ...high].map((v) => String(Number(v.toFixed(5)))).join(",")}`;
}
