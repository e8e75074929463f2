/**
 * What is looked through. Conventions are those of the program: camera axes +X right, +Y down, +Z forward; pixel
 * positions are continuous, the centre of the first pixel is (0.5, 0.5).
 */

import {
  add, apply, clamp, column, cross, dot, fromColumns, matrixFromQuat, mix, multiply, norm, normalized, quatFromMatrix,
  rotationAbout, scale, slerp, sub, transposed, type Mat3, type Quat, type Vec3,
} from "./math";

/** A pinhole picture, in pixels. */
export interface Lens {
  width: number;
  height: number;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
}

export interface View {
  position: Vec3;
  /** world_from_camera */
  rotation: Mat3;
  lens: Lens;
}

export function lensOfFov(width: number, height: number, fovY: number): Lens {
  const f = height / 2 / Math.tan(fovY / 2);
  return { width, height, fx: f, fy: f, cx: width / 2, cy: height / 2 };
}

/** The lens for a canvas that shows all of the lens's picture, centred; what is beyond it fills the rest. */
export function fitted(lens: Lens, width: number, height: number): Lens {
  const s = Math.min(width / lens.width, height / lens.height);
  return {
    width,
    height,
    fx: lens.fx * s,
    fy: lens.fy * s,
    cx: (width - lens.width * s) / 2 + lens.cx * s,
    cy: (height - lens.height * s) / 2 + lens.cy * s,
  };
}

/** The part of such a canvas that the lens's own picture covers. */
export function pictureRectangle(lens: Lens, width: number, height: number) {
  const s = Math.min(width / lens.width, height / lens.height);
  return { left: (width - lens.width * s) / 2, top: (height - lens.height * s) / 2, width: lens.width * s, height: lens.height * s };
}

/** Direction in the world, of unit depth along the optical axis, through a pixel position. */
export function rayThrough(view: View, lens: Lens, x: number, y: number): Vec3 {
  return apply(view.rotation, [(x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1]);
}

/** Pixel position and depth of a world point; depth <= 0 is behind the camera. */
export function project(view: View, lens: Lens, point: Vec3): { x: number; y: number; depth: number } {
  const p = apply(transposed(view.rotation), sub(point, view.position));
  return { x: lens.cx + (lens.fx * p[0]) / p[2], y: lens.cy + (lens.fy * p[1]) / p[2], depth: p[2] };
}

export function lookAt(position: Vec3, target: Vec3, up: Vec3): Mat3 {
  const forward = normalized(sub(target, position));
  let right = cross(forward, up);
  if (norm(right) < 1e-6) right = cross(forward, Math.abs(forward[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
  right = normalized(right);
  return fromColumns(right, cross(forward, right), forward);
}

/** Nearer to the zenith than this the horizon would spin. */
const steepest = Math.cos((2 * Math.PI) / 180);

/** Turns camera and position about `target`: yaw about `up`, pitch about the picture's horizontal. */
export function orbited(view: View, target: Vec3, up: Vec3, yaw: number, pitch: number): View {
  let rotation = multiply(rotationAbout(up, yaw), view.rotation);
  let arm = apply(rotationAbout(up, yaw), sub(view.position, target));
  const axis = column(rotation, 0);
  const tilt = rotationAbout(axis, pitch);
  const forward = apply(tilt, column(rotation, 2));
  const steeper = Math.abs(dot(forward, up)) > Math.abs(dot(column(rotation, 2), up));
  if (!(steeper && Math.abs(dot(forward, up)) > steepest)) {
    rotation = multiply(tilt, rotation);
    arm = apply(tilt, arm);
  }
  return { ...view, rotation, position: add(target, arm) };
}

/** Turns the camera on the spot. */
export function looked(view: View, up: Vec3, yaw: number, pitch: number): View {
  return { ...orbited(view, view.position, up, yaw, pitch), position: view.position };
}

export function moved(view: View, right: number, down: number, forward: number): View {
  return { ...view, position: add(view.position, apply(view.rotation, [right, down, forward])) };
}

export function dollied(view: View, target: Vec3, factor: number): View {
  return { ...view, position: add(target, scale(sub(view.position, target), factor)) };
}

export function zoomed(view: View, factor: number): View {
  const { lens } = view;
  const fy = clamp(lens.fy * factor, 0.3 * lens.height, 30 * lens.height);
  return { ...view, lens: { ...lens, fx: (lens.fx * fy) / lens.fy, fy } };
}

export function interpolated(a: View, b: View, t: number): View {
  const lens = { ...a.lens };
  for (const key of ["width", "height", "fx", "fy", "cx", "cy"] as const) lens[key] = a.lens[key] + (b.lens[key] - a.lens[key]) * t;
  return {
    position: mix(a.position, b.position, t),
    rotation: matrixFromQuat(slerp(quatFromMatrix(a.rotation), quatFromMatrix(b.rotation), t)),
    lens,
  };
}

/** The point of the optical axis nearest to `point`, but in front of the camera. */
export function pivotOf(view: View, point: Vec3): Vec3 {
  const forward = column(view.rotation, 2);
  const depth = Math.max(dot(sub(point, view.position), forward), 0.25 * norm(sub(point, view.position)), 1e-6);
  return add(view.position, scale(forward, depth));
}

/** A camera that sees the whole box, in the direction of `view`. */
export function framed(view: View, low: Vec3, high: Vec3, up: Vec3): View {
  const centre = mix(low, high, 0.5);
  const radius = norm(sub(high, low)) / 2;
  const { lens } = view;
  const half = Math.min(lens.height / lens.fy, lens.width / lens.fx) / 2;
  const distance = radius / Math.sin(Math.atan(half));
  const forward = column(view.rotation, 2);
  const position = sub(centre, scale(forward, distance));
  return { position, rotation: lookAt(position, centre, up), lens };
}

/** A 4x4 matrix, row by row, world from camera in OpenGL's camera axes, as transforms.json has it. */
export function openGlMatrix(view: View): number[][] {
  const rows: number[][] = view.rotation.map((row, i) => [row[0], -row[1], -row[2], view.position[i]]);
  rows.push([0, 0, 0, 1]);
  return rows;
}
export function fromOpenGlMatrix(rows: number[][]): { position: Vec3; rotation: Mat3 } {
  const rotation = rows.slice(0, 3).map((r) => [r[0], -r[1], -r[2]]) as Mat3;
  return { rotation, position: [rows[0][3], rows[1][3], rows[2][3]] };
}

/** Signed axes and their names. */
export const axes: Record<string, Vec3> = {
  "+x": [1, 0, 0], "-x": [-1, 0, 0], "+y": [0, 1, 0], "-y": [0, -1, 0], "+z": [0, 0, 1], "-z": [0, 0, -1],
};

/**
 * The manifest's up axis, unless most cameras say otherwise: then the signed axis nearest to what is up in their
 * pictures. (A bake records "z" where nobody said anything.)
 */
export function upAxis(named: string, cameras: { rotation: Mat3 }[]): string {
  const stated = `+${named}`;
  let mean: Vec3 = [0, 0, 0];
  for (const camera of cameras) mean = sub(mean, column(camera.rotation, 1));
  if (norm(mean) < 0.3 * cameras.length || cameras.length === 0) return stated;
  mean = normalized(mean);
  if (dot(mean, axes[stated]) > 0.5) return stated;
  return Object.keys(axes).reduce((best, name) => (dot(axes[name], mean) > dot(axes[best], mean) ? name : best), stated);
}

export type { Mat3, Quat, Vec3 };
