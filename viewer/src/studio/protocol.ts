/** What page and server of the studio say to each other. */

import type { View } from "../camera";
import type { Vec3 } from "../math";

export interface SceneView extends View {
  name: string;
  held_out: boolean;
  width: number;
  height: number;
}

/** Does not change while the server runs. */
export interface Scene {
  title: string;
  run: string;
  /** Signed axis, "+y". */
  up: string;
  centre: Vec3;
  radius: number;
  views: SceneView[];
  home: number;
}

export interface Take {
  name: string;
  colorizer: string;
  seconds: number;
}

export interface State {
  version: number;
  /** Grows whenever the colours shown as "now" change. */
  colors: number;
  task: string;
  fraction: number;
  figures: Record<string, number>;
  message: string;
  failed: boolean;
  /** Whether the views are traced: before, there is neither reach nor thumbnail. */
  ready: boolean;
  /** The client that may change things; "" = nobody yet. */
  writer: string;
  /** Revision of the strokes. */
  strokes: number;
  take: string;
  unkept: boolean;
  takes: Take[];
  commands: string[];
  downloads: { name: string; address: string; bytes: number }[];
  blender: string;
  cards?: { number: number; address: string }[];
  finish?: Finish;
}

export interface Finish {
  saturation: number;
  hue: number;
  exposure: number;
}

export type StrokeKind = "paint" | "exact" | "grey" | "erase" | "picture";
/** x and y as shares of the picture's width and height, pressure 0..1. */
export type StrokePoint = [number, number, number];

export interface Stroke {
  readonly id: string;
  readonly view: string;
  readonly kind: StrokeKind;
  /** sRGB, "#rrggbb"; only its hue and chroma count. */
  readonly color: string;
  /** Diameter at full pressure, share of the picture's shorter side. */
  readonly size: number;
  /** Share of the radius that fades out. */
  readonly softness: number;
  readonly reach: number;
  readonly hidden: boolean;
  readonly points: readonly StrokePoint[];
}

export const limits = { strokes: 2000, points: 20000, bytes: 4e6, size: [0.0005, 0.5], reach: [0.1, 4] } as const;

export interface FrameRequest extends View {
  /** "grey", "now" or the name of a take; two of them come one above the other. */
  sides: string[];
}
