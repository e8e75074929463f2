import { describe, expect, it } from "vitest";
import { lookAt, orbited, type View } from "../../src/camera";
import { aabbText, fromHash, toHash } from "../../src/hash";
import { isTaken, pinched } from "../../src/input";
import { keysFromJson, pathJson, viewAt } from "../../src/keyframes";
import { durationText, figureText } from "../../src/live";
import { curvePath, withPoint, type CurvePoint } from "../../src/ui/curve";
import { defaultSettings, type Settings } from "../../src/settings";

const view: View = {
  position: [3, -2, 1.5],
  rotation: lookAt([3, -2, 1.5], [0, 0, 0], [0, 0, 1]),
  lens: { width: 320, height: 240, fx: 300, fy: 310, cx: 150, cy: 130 },
};
const defaults = defaultSettings("+z");

describe("address", () => {
  it("holds everything that was set", () => {
    const settings: Settings = {
      ...defaults, wipe: 0.25, saturation: 1.5, hue: -40, exposure: 1.25, background: "none", gain: 2.5, threshold: 0.125, photo: 0.5,
      clip: { low: [-1, -2, -3], high: [1, 2, 3.5] }, slice: { axis: 1, at: 0.25, quantity: "b" }, fly: true, showCameras: true, up: "-y",
    };
    const read = fromHash(toHash(view, [0.5, 0, 0], settings, defaults), defaults);
    expect(read.settings).toEqual(settings);
    expect(read.target).toEqual([0.5, 0, 0]);
    read.view!.rotation.flat().forEach((v, i) => expect(v).toBeCloseTo(view.rotation.flat()[i], 5));
    expect(read.view!.lens).toEqual(view.lens);
  });
  it("leaves out what has its default", () => expect(toHash(view, [0, 0, 0], defaults, defaults)).not.toMatch(/[&#][wsheg]=/));
  it("survives nonsense", () => {
    for (const hash of ["", "#", "#w=9&s=abc&c=1,2&x=7,0,L&p=1,2&b=red&u=up", "#p=a,b,c&q=0,0,0,0&l=1"]) {
      const read = fromHash(hash, defaults);
      expect(read.view).toBeUndefined();
      expect(read.settings.saturation).toBe(1);
      expect(read.settings.wipe >= 0 && read.settings.wipe <= 1).toBe(true);
    }
  });
  it("prints the box as cnerf bake takes it", () => expect(aabbText([-1.5, 0, 0.1234567], [1, 2, 3])).toBe("--aabb=-1.5,0,0.12346,1,2,3"));
});

describe("key frames", () => {
  const keys = [view, orbited(view, [0, 0, 0], [0, 0, 1], 0.8, 0), orbited(view, [0, 0, 0], [0, 0, 1], 1.6, 0.2)];
  it("are passed through", () => {
    keys.forEach((key, i) => viewAt(keys, i).position.forEach((v, k) => expect(v).toBeCloseTo(key.position[k], 9)));
    expect(viewAt([view], 0.7)).toBe(view);
  });
  it("go to a file in the manner of transforms.json and back", () => {
    const json = JSON.parse(pathJson(keys, 2, 30));
    expect(json.frames).toHaveLength(60);
    expect(json.frames[0].transform_matrix[0][3]).toBeCloseTo(3, 9);
    expect(json.frames[59]).toMatchObject({ w: 320, h: 240, fl_x: 300, fl_y: 310 });
    const back = keysFromJson(JSON.stringify(json));
    expect(back).toHaveLength(3);
    back[2].rotation.flat().forEach((v, i) => expect(v).toBeCloseTo(keys[2].rotation.flat()[i], 9));
  });
  it("of other programs are read, and wrong ones refused by name", () => {
    const other = { camera_angle_x: 0.9, w: 100, h: 80, frames: [{ transform_matrix: [[1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]] }] };
    expect(keysFromJson(JSON.stringify(other))[0].lens.fx).toBeCloseTo(50 / Math.tan(0.45), 9);
    expect(() => keysFromJson("{}")).toThrow(/frames/);
    expect(() => keysFromJson('{"frames":[{"transform_matrix":[1]}]}')).toThrow(/frames\[0\].transform_matrix/);
  });
});

describe("keys and fingers", () => {
  it("leave to the browser and to buttons what is theirs", () => {
    const taken = (key: string, target: string, altKey = false) => isTaken({ key, altKey, target: { matches: (list: string) => list.split(", ").includes(target) } } as unknown as KeyboardEvent);
    for (const control of ["button", "summary", "a", "input"]) expect([" ", "Enter", "g"].map((key) => taken(key, control))).toEqual([true, true, false]);
    expect([" ", "Enter"].map((key) => taken(key, "body"))).toEqual([false, false]);
    expect(["ArrowLeft", "d", "["].map((key) => taken(key, "body", true))).toEqual([true, true, false]);
  });
  it("tell how far two fingers went apart", () => {
    const fingers = new Map([[4, { x: 0, y: 0 }], [7, { x: 20, y: 0 }]]);
    expect(pinched(fingers, 7, { x: 50, y: 0 })).toEqual({ factor: 2.5, middle: { x: 25, y: 0 } });
    expect(pinched(fingers, 4, { x: 19, y: 0 }).factor, "as good as one").toBe(1);
  });
});

describe("live page", () => {
  it("draws a rising curve upwards over the whole width", () => {
    expect(curvePath([[1, 10], [2, 20], [3, 30]], 100, 50, false)).toBe("M0.0 50.0L50.0 25.0L100.0 0.0");
    expect(curvePath([[1, 1], [2, 10], [3, 100]], 100, 50, true)).toBe("M0.0 50.0L50.0 25.0L100.0 0.0");
    expect(curvePath([[1, 1]], 100, 50, false)).toBe("");
    let points: CurvePoint[] = [];
    for (let i = 0; i < 5000; ++i) points = withPoint(points, [i, i], 100);
    expect(points.length).toBeLessThanOrEqual(100);
    expect([points[0], points.at(-1)]).toEqual([[0, 0], [4999, 4999]]);
  });
  it("says durations and figures as the program does", () => {
    expect([durationText(12), durationText(200), durationText(3720)]).toEqual(["12 s", "3 min 20 s", "1 h 02 min"]);
    expect([figureText(27.1345), figureText(213_456), figureText(null)]).toEqual(["27.13", "213 k", "–"]);
  });
});
