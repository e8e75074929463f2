/** What page and server of the studio say to each other. */

import type { View } from "../camera";
import type { Vec3 } from "../math";

export interface SceneView extends View {
  name: string;
  held_out: boolean;
  width: number;
  height: number;
}

/** A camera of the user's own, that is painted at as if it had a photograph. */
export interface Viewpoint extends View {
  readonly name: string;
}

/** Its cameras become better while the field is trained: State.scene tells. Without a capture it has no views. */
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
}

/** What there is: nothing yet, a capture whose field is being trained, or a field that can be coloured. */
export type Stage = "photographs" | "training" | "field";

export interface State {
  version: number;
  stage: Stage;
  /** Grows where GET studio/scene says something else than before. */
  scene: number;
  /** Grows whenever the colours shown as "now" change. */
  colors: number;
  task: string;
  /** Of the task, in words. */
  step?: string;
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
  cards: { number: number; address: string }[];
  /** Photographs that tell most of the others once they are painted, the one to begin with first. */
  key_views: { view: number; adds: number }[];
  finish: Finish;
  /** What the work said lately, oldest first. */
  notes: string[];
  /** Photographs, or a clip, that the server has; `source` was named to it before, "" = nothing was. */
  arrived: { files: number; bytes: number; source: string };
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
  /** Of a painted picture: what studio/painted?picture= calls it. */
  readonly picture?: string;
  /** What is painted: a palette's colour of that word replaces `color` on the command line. */
  readonly word?: string;
}

export const limits = { strokes: 2000, viewpoints: 50, points: 20000, bytes: 15e6, pictureBytes: 32 * 2 ** 20, wordBytes: 64, size: [0.0005, 0.5], reach: [0.1, 4] } as const;

export interface FrameRequest extends View {
  /** "" (uncoloured), "now" or the name of a take; a picture each, one behind the other. */
  sides: string[];
  /** Somebody moves the camera; otherwise a training may let it wait. */
  moving?: boolean;
}
