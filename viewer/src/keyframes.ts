/** Camera key frames, the path through them, and the file that `cnerf render --path` and blender_setup.py read. */

import { fromOpenGlMatrix, interpolated, openGlMatrix, type View } from "./camera";
import type { Vec3 } from "./math";

/** Through all points, smooth: Catmull-Rom, ends repeated. */
function through(points: Vec3[], segment: number, t: number): Vec3 {
  const at = (i: number) => points[Math.min(points.length - 1, Math.max(0, i))];
  const [a, b, c, d] = [at(segment - 1), at(segment), at(segment + 1), at(segment + 2)];
  return [0, 1, 2].map((k) => {
    const p = 2 * b[k] + (c[k] - a[k]) * t + (2 * a[k] - 5 * b[k] + 4 * c[k] - d[k]) * t * t + (3 * b[k] - 3 * c[k] + d[k] - a[k]) * t * t * t;
    return 0.5 * p;
  }) as Vec3;
}

/** The view at `time`, in key frames: 0 is the first one, 1 the second. */
export function viewAt(keys: View[], time: number): View {
  if (keys.length === 1) return keys[0];
  const segment = Math.min(keys.length - 2, Math.max(0, Math.floor(time)));
  const t = Math.min(1, Math.max(0, time - segment));
  const between = interpolated(keys[segment], keys[segment + 1], t);
  return { ...between, position: through(keys.map((key) => key.position), segment, t) };
}

function cameraJson(view: View): Record<string, unknown> {
  const { lens } = view;
  return { w: Math.round(lens.width), h: Math.round(lens.height), fl_x: lens.fx, fl_y: lens.fy, cx: lens.cx, cy: lens.cy, transform_matrix: openGlMatrix(view) };
}

/** transforms.json's manner: OpenGL camera axes, world from camera. One key frame gives one picture. */
export function pathJson(keys: View[], seconds: number, fps: number): string {
  const count = keys.length < 2 ? keys.length : Math.max(2, Math.round(seconds * fps));
  const frames = Array.from({ length: count }, (_, i) => cameraJson(viewAt(keys, count < 2 ? 0 : (i * (keys.length - 1)) / (count - 1))));
  return JSON.stringify({ camera_model: "PINHOLE", fps, frames, key_frames: keys.map(cameraJson) }, null, 1) + "\n";
}

/** Key frames of such a file; its frames, where it has no key frames. @throws Error saying what is wrong. */
export function keysFromJson(text: string): View[] {
  const json = JSON.parse(text) as Record<string, any>;
  const list = (json.key_frames ?? json.frames) as Record<string, any>[] | undefined;
  if (!Array.isArray(list) || list.length === 0) throw new Error("expected a list of frames");
  return list.map((frame, i) => {
    const value = (key: string): number | undefined => frame[key] ?? json[key];
    const rows = frame.transform_matrix;
    if (!Array.isArray(rows) || rows.length < 3 || !rows.every((row: unknown) => Array.isArray(row) && row.length === 4)) {
      throw new Error(`frames[${i}].transform_matrix: expected a 4x4 matrix`);
    }
    const width = value("w");
    const height = value("h");
    const angle = value("camera_angle_x");
    const fx = value("fl_x") ?? (angle && width ? width / 2 / Math.tan(angle / 2) : undefined);
    if (!width || !height || !fx) throw new Error(`frames[${i}]: expected w, h and fl_x`);
    const lens = { width, height, fx, fy: value("fl_y") ?? fx, cx: value("cx") ?? width / 2, cy: value("cy") ?? height / 2 };
    return { ...fromOpenGlMatrix(rows), lens };
  });
}
