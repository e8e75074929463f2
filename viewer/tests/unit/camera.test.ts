import { describe, expect, it } from "vitest";
import { axes, dollied, fitted, framed, fromOpenGlMatrix, interpolated, lookAt, moved, openGlMatrix, orbited, pictureRectangle, pivotOf, project, rayThrough, upAxis, type View } from "../../src/camera";
import { column, dot, matrixFromQuat, norm, normalized, quatFromMatrix, rotationAbout, slerp, sub, type Vec3 } from "../../src/math";
import { bundle, expected } from "./fixture";

const view: View = {
  position: [3, -2, 1.5],
  rotation: lookAt([3, -2, 1.5], [0, 0, 0], [0, 0, 1]),
  lens: { width: 320, height: 240, fx: 300, fy: 310, cx: 150, cy: 130 },
};
const near = (a: Vec3, b: Vec3, digits = 9) => a.forEach((v, i) => expect(v).toBeCloseTo(b[i], digits));

describe("cameras against what C++ says", () => {
  it.skipIf(!expected)("projects points to the same pixels", () => {
    expect(expected!.projections.length).toBeGreaterThan(5);
    for (const { camera, point, pixel } of expected!.projections) {
      const { rotation, position, lens } = bundle!.cameras[camera];
      const p = project({ rotation, position, lens }, lens, point);
      expect(p.x).toBeCloseTo(pixel[0], 6);
      expect(p.y).toBeCloseTo(pixel[1], 6);
    }
  });
});

describe("camera", () => {
  it("has rays that project back", () => {
    const ray = rayThrough(view, view.lens, 17.5, 200.25);
    const p = project(view, view.lens, [view.position[0] + 2 * ray[0], view.position[1] + 2 * ray[1], view.position[2] + 2 * ray[2]]);
    expect(p.x).toBeCloseTo(17.5, 9);
    expect(p.y).toBeCloseTo(200.25, 9);
    expect(p.depth).toBeCloseTo(2, 9);
  });
  it("looks at its target with the horizon level", () => {
    const p = project(view, { ...view.lens, cx: 0, cy: 0 }, [0, 0, 0]);
    expect(p.x).toBeCloseTo(0, 9);
    expect(p.y).toBeCloseTo(0, 9);
    expect(dot(column(view.rotation, 0), [0, 0, 1])).toBeCloseTo(0, 12);
    expect(dot(column(view.rotation, 1), [0, 0, 1])).toBeLessThan(0);
  });
  it("keeps the target's pixel and distance while it turns about it", () => {
    let turned = view;
    for (let i = 0; i < 50; ++i) turned = orbited(turned, [0, 0, 0], [0, 0, 1], 0.3, 0.4);
    expect(norm(turned.position)).toBeCloseTo(norm(view.position), 9);
    expect(norm(sub(normalized(sub([0, 0, 0], turned.position)), column(turned.rotation, 2)))).toBeLessThan(1e-9);
    expect(Math.abs(dot(column(turned.rotation, 2), [0, 0, 1]))).toBeLessThan(0.9995);
    near(orbited(orbited(view, [0, 0, 0], [0, 0, 1], 0.2, 0), [0, 0, 0], [0, 0, 1], -0.2, 0).position, view.position);
  });
  it("fits a picture into any canvas", () => {
    for (const [w, h] of [[1280, 720], [390, 844], [320, 240]]) {
      const box = pictureRectangle(view.lens, w, h);
      expect(box.width <= w + 1e-9 && box.height <= h + 1e-9).toBe(true);
      const lens = fitted(view.lens, w, h);
      const inside = project(view, view.lens, [0.1, 0.2, 0.3]);
      const shown = project(view, lens, [0.1, 0.2, 0.3]);
      expect(shown.x).toBeCloseTo(box.left + (inside.x * box.width) / view.lens.width, 9);
      expect(shown.y).toBeCloseTo(box.top + (inside.y * box.height) / view.lens.height, 9);
    }
  });
  it("frames the whole box", () => {
    const low: Vec3 = [-1, 2, 0];
    const high: Vec3 = [3, 3, 5];
    const shown = framed({ ...view, lens: { ...view.lens, cx: 160, cy: 120 } }, low, high, [0, 0, 1]);
    for (let i = 0; i < 8; ++i) {
      const p = project(shown, shown.lens, [i & 1 ? low[0] : high[0], i & 2 ? low[1] : high[1], i & 4 ? low[2] : high[2]]);
      expect(p.depth).toBeGreaterThan(0);
      expect(p.x > 0 && p.x < 320 && p.y > 0 && p.y < 240).toBe(true);
    }
  });
  it("moves along its own axes, and towards its target", () => {
    near(sub(moved(view, 0, 0, 2).position, view.position), column(view.rotation, 2).map((v) => 2 * v) as Vec3);
    expect(norm(dollied(view, [0, 0, 0], 0.5).position)).toBeCloseTo(norm(view.position) / 2, 9);
    expect(dot(sub(pivotOf(view, [9, 9, 9]), view.position), column(view.rotation, 2))).toBeGreaterThan(0);
  });
  it("writes OpenGL matrices that come back", () => {
    const rows = openGlMatrix(view);
    const back = fromOpenGlMatrix(rows);
    near(back.position, view.position);
    back.rotation.forEach((row, i) => near(row, view.rotation[i]));
    expect(rows[2][1]).toBeGreaterThan(0); // OpenGL's +Y is up, so is the world's z
    expect(rows[3]).toEqual([0, 0, 0, 1]);
  });
  it("comes to the second view at the end of an interpolation", () => {
    const other = { ...orbited(view, [0, 0, 0], [0, 0, 1], 2, 0.2), lens: { ...view.lens, fx: 500 } };
    near(interpolated(view, other, 1).position, other.position);
    interpolated(view, other, 1).rotation.forEach((row, i) => near(row, other.rotation[i]));
    expect(interpolated(view, other, 0.5).lens.fx).toBeCloseTo(400, 9);
  });
  it("takes the manifest's up axis unless most cameras disagree", () => {
    const upright = { rotation: lookAt([3, 0, 0], [0, 0, 0], [0, 0, 1]) };
    const sideways = { rotation: lookAt([3, 0, 0], [0, 0, 0], [0, -1, 0]) };
    expect(upAxis("z", [upright, upright])).toBe("+z");
    expect(upAxis("z", [sideways, sideways, upright])).toBe("-y");
    expect(upAxis("y", [])).toBe("+y");
    expect(Object.keys(axes)).toHaveLength(6);
  });
});

describe("rotations", () => {
  it("come back from quaternions in every quadrant", () => {
    for (const axis of [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, -0.48, 0.64]] as Vec3[]) {
      for (const angle of [0, 0.1, 1.5, 3.1, -2.8]) {
        const m = rotationAbout(axis, angle);
        matrixFromQuat(quatFromMatrix(m)).forEach((row, i) => near(row, m[i], 7));
      }
    }
  });
  it("are interpolated the short way at constant speed", () => {
    const a = quatFromMatrix(rotationAbout([0, 0, 1], 0.2));
    const b = quatFromMatrix(rotationAbout([0, 0, 1], 1.0)).map((v) => -v) as [number, number, number, number];
    matrixFromQuat(slerp(a, b, 0.25)).forEach((row, i) => near(row, rotationAbout([0, 0, 1], 0.4)[i]));
  });
});
