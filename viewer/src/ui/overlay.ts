/** Lines over the picture: the clip box with its handles, and the capture's cameras. */

import type { App } from "../app";
import { fitted, project, rayThrough } from "../camera";
import { add, norm, scale, sub, type Vec3 } from "../math";
import { dragged, svg } from "./dom";

const axisColor = ["#ff6b6b", "#7bd88f", "#6aa9ff"];

export class Overlay {
  private box = svg("path", { class: "box" });
  private cameras = svg("g", { class: "cameras" });
  readonly svg = svg("svg", { class: "overlay" }, this.cameras, this.box);
  private handles: SVGCircleElement[] = [];

  constructor(private readonly app: App) {
    for (let i = 0; i < 6; ++i) {
      const handle = svg("circle", { r: "9", class: "handle", fill: axisColor[i % 3], "data-handle": String(i) });
      dragged(handle, (_, x, y) => this.pull(i, x, y), (e) => e.preventDefault());
      this.handles.push(handle);
      this.svg.append(handle);
    }
    app.cameras.forEach((_, i) => {
      const path = svg("path", { class: "frustum", "data-camera": String(i) });
      path.addEventListener("click", () => app.goToCamera(i));
      this.cameras.append(path);
    });
  }

  private at(point: Vec3): { x: number; y: number; depth: number } {
    const lens = fitted(this.app.view.lens, this.svg.clientWidth, this.svg.clientHeight);
    return project(this.app.view, lens, point);
  }

  private line(a: Vec3, b: Vec3): string {
    const p = this.at(a);
    const q = this.at(b);
    const near = 1e-3;
    if (p.depth < near && q.depth < near) return "";
    // Cut at the picture plane what runs behind the camera.
    const cut = (from: Vec3, to: Vec3, d0: number, d1: number) => this.at(add(from, scale(sub(to, from), (near - d0) / (d1 - d0))));
    const u = p.depth < near ? cut(a, b, p.depth, q.depth) : p;
    const v = q.depth < near ? cut(b, a, q.depth, p.depth) : q;
    return `M${u.x.toFixed(1)} ${u.y.toFixed(1)}L${v.x.toFixed(1)} ${v.y.toFixed(1)}`;
  }

  private handlePoint(i: number): Vec3 {
    const { low, high } = this.app.settings.clip!;
    const point = scale(add(low, high), 0.5);
    point[i % 3] = i < 3 ? low[i % 3] : high[i % 3];
    return point;
  }

  update(): void {
    const { app } = this;
    const { clip, slice, showCameras } = app.settings;
    let lines = "";
    if (clip || slice) {
      const low = clip?.low ?? app.low;
      const high = clip?.high ?? app.high;
      const corner = (i: number): Vec3 => [i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]];
      for (let i = 0; i < 8; ++i) for (const bit of [1, 2, 4]) if (!(i & bit)) lines += this.line(corner(i), corner(i | bit));
    }
    this.box.setAttribute("d", lines);
    this.handles.forEach((handle, i) => {
      const p = clip ? this.at(this.handlePoint(i)) : null;
      const shown = !!p && p.depth > 0;
      handle.style.display = shown ? "" : "none";
      if (!shown) return;
      handle.setAttribute("cx", p.x.toFixed(1));
      handle.setAttribute("cy", p.y.toFixed(1));
    });
    this.cameras.style.display = showCameras ? "" : "none";
    if (showCameras) this.drawCameras();
  }

  private drawCameras(): void {
    const size = 0.06 * norm(sub(this.app.high, this.app.low));
    this.app.cameras.forEach((camera, i) => {
      const { lens } = camera;
      const corners = [[0, 0], [lens.width, 0], [lens.width, lens.height], [0, lens.height]].map(([x, y]) => {
        const ray = rayThrough(camera, lens, x, y);
        return add(camera.position, scale(ray, size));
      });
      let d = "";
      corners.forEach((corner, k) => (d += this.line(camera.position, corner) + this.line(corner, corners[(k + 1) % 4])));
      const path = this.cameras.children[i];
      path.setAttribute("d", d);
      path.classList.toggle("current", i === this.app.captureCamera);
    });
  }

  /** Moves a side along its axis, as far as the pointer went, pixels. */
  private pull(i: number, x: number, y: number): void {
    const { app } = this;
    const { clip } = app.settings;
    if (!clip) return;
    const axis = i % 3;
    const point = this.handlePoint(i);
    const step = 0.01 * norm(sub(app.high, app.low));
    const along: Vec3 = [0, 0, 0];
    along[axis] = step;
    const from = this.at(point);
    const to = this.at(add(point, along));
    const direction = { x: to.x - from.x, y: to.y - from.y };
    const length2 = Math.max(direction.x ** 2 + direction.y ** 2, 1);
    const shift = (step * (x * direction.x + y * direction.y)) / length2;
    const low: Vec3 = [...clip.low];
    const high: Vec3 = [...clip.high];
    const least = app.bundle.levels.at(-1)!.voxelSize;
    if (i < 3) low[axis] = Math.min(high[axis] - least, Math.max(app.low[axis], low[axis] + shift));
    else high[axis] = Math.max(low[axis] + least, Math.min(app.high[axis], high[axis] + shift));
    app.set({ clip: { low, high } });
  }
}
