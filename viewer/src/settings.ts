/** Everything a user can set, and its default. */

import type { Vec3 } from "./math";

export type Quantity = "density" | "L" | "a" | "b";
export const quantities: Quantity[] = ["density", "L", "a", "b"];

export interface Settings {
  /** Share of the picture, from the left, that is shown without colour. */
  wipe: number;
  saturation: number;
  /** Degrees. */
  hue: number;
  /** Stops. */
  exposure: number;
  /** sRGB, "#rrggbb"; "none", which is transparent; "sky", where the bundle has one. */
  background: string;
  gain: number;
  /** Optical depth of a voxel below which there is nothing. */
  threshold: number;
  /** World units; null = all of it. */
  clip: { low: Vec3; high: Vec3 } | null;
  slice: { axis: 0 | 1 | 2; at: number; quantity: Quantity } | null;
  fly: boolean;
  /** Opacity of the photograph over its camera's view. */
  photo: number;
  /** Signed axis, "+z". */
  up: string;
  showCameras: boolean;
}

export const defaultBackground = "#101216";

export function defaultSettings(up: string, background = defaultBackground): Settings {
  return {
    wipe: 0,
    saturation: 1,
    hue: 0,
    exposure: 0,
    background,
    gain: 1,
    threshold: 0,
    clip: null,
    slice: null,
    fly: false,
    photo: 0,
    up,
    showCameras: false,
  };
}

/** What only changes how the marched light is shown, and needs no new rays. */
export const displayOnly = new Set<keyof Settings>(["wipe", "saturation", "hue", "exposure", "background", "photo", "showCameras", "fly", "up"]);
