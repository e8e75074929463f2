/** A line of figures over time. */

import { svg } from "./dom";

export type CurvePoint = [number, number];

/** An SVG line through points, from the lowest to the highest value. Loss is shown on a logarithmic scale. */
export function curvePath(points: readonly CurvePoint[], width: number, height: number, logarithmic: boolean): string {
  if (points.length < 2) return "";
  const y = (v: number) => (logarithmic ? Math.log(Math.max(v, 1e-12)) : v);
  const values = points.map((p) => y(p[1]));
  const low = Math.min(...values);
  const span = Math.max(...values) - low || 1;
  const begin = points[0][0];
  const time = points[points.length - 1][0] - begin || 1;
  return points.map((p, i) => `${i ? "L" : "M"}${((width * (p[0] - begin)) / time).toFixed(1)} ${(height - (height * (values[i] - low)) / span).toFixed(1)}`).join("");
}

/** Such a line as a picture that fills its box. */
export class Curve {
  readonly node: SVGSVGElement;
  private path = svg("path");

  constructor(private readonly width: number, private readonly height: number) {
    this.node = svg("svg", { viewBox: `0 0 ${width} ${height}`, preserveAspectRatio: "none" }, this.path);
  }
  draw(points: readonly CurvePoint[], logarithmic = false): void {
    this.path.setAttribute("d", curvePath(points, this.width, this.height, logarithmic));
  }
}

/** One point more; of many, every other one is left out, so that a long curve stays as light as a short one. */
export function withPoint(points: readonly CurvePoint[], point: CurvePoint, most = 400): CurvePoint[] {
  return [...(points.length < most ? points : points.filter((_, i) => i % 2 === 0)), point];
}
