/** The viewer: what is looked at, how, and who is told. */

import type { Bundle } from "./bundle";
import { axes, framed, interpolated, lensOfFov, pivotOf, upAxis, type Lens, type View } from "./camera";
import { fromHash, toHash } from "./hash";
import { add, mix, scale, type Vec3 } from "./math";
import type { Renderer } from "./renderer";
import { defaultSettings, displayOnly, type Settings } from "./settings";

const ease = (t: number) => (t < 0.5 ? 4 * t * t * t : 1 - (2 - 2 * t) ** 3 / 2);

export class App {
  readonly defaults: Settings;
  readonly low: Vec3;
  readonly high: Vec3;
  settings: Settings;
  view: View;
  /** What the camera turns about. */
  target: Vec3;
  /** Number of the capture's camera that is looked through, else -1. */
  captureCamera = -1;
  private animation: { from: View; to: View; targetTo: Vec3; targetFrom: Vec3; begin: number; length: number; camera: number } | null = null;
  private changed = new Set<() => void>();
  private hashTimer = 0;
  readonly home: View;
  private readonly still: boolean;

  constructor(readonly bundle: Bundle, readonly renderer: Renderer) {
    const { volume } = bundle;
    this.low = volume.origin;
    this.high = add(volume.origin, scale(volume.bricks, 8 * volume.voxelSize));
    this.still = new URLSearchParams(location.search).has("still") || matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.defaults = defaultSettings(upAxis(bundle.upAxis, bundle.cameras));
    this.home = this.firstView();
    this.view = this.home;
    this.target = this.pivot(this.home);
    this.captureCamera = bundle.cameras.length > 0 ? 0 : -1;
    this.settings = this.defaults;
    this.readHash();
    window.addEventListener("hashchange", () => this.readHash());
  }

  private firstView(): View {
    const camera = this.bundle.cameras[0];
    if (camera) return { position: camera.position, rotation: camera.rotation, lens: camera.lens };
    const up = axes[this.defaults.up];
    const diagonal = add(add([1, 1, 1], scale(up, -0.4)), [0, 0, 0]);
    const view: View = { position: add(this.centre, diagonal), rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], lens: lensOfFov(1280, 960, 0.7) };
    const forward = scale(diagonal, -1);
    return framed({ ...view, rotation: [[1, 0, forward[0]], [0, 1, forward[1]], [0, 0, forward[2]]] }, this.low, this.high, up);
  }

  get centre(): Vec3 {
    return mix(this.low, this.high, 0.5);
  }
  get up(): Vec3 {
    return axes[this.settings.up];
  }
  pivot(view: View): Vec3 {
    return pivotOf(view, this.centre);
  }

  /** Calls `callback` after every change of the view or the settings. */
  onChange(callback: () => void): void {
    this.changed.add(callback);
  }
  private tell(): void {
    for (const callback of this.changed) callback();
    window.clearTimeout(this.hashTimer);
    this.hashTimer = window.setTimeout(() => this.writeHash(), 250);
  }

  set(partial: Partial<Settings>): void {
    this.settings = { ...this.settings, ...partial };
    const march = (Object.keys(partial) as (keyof Settings)[]).some((key) => !displayOnly.has(key));
    this.renderer.setSettings(this.settings, march);
    this.tell();
  }

  setView(view: View, target?: Vec3): void {
    this.animation = null;
    this.captureCamera = -1;
    this.put(view, target);
  }
  private put(view: View, target?: Vec3): void {
    this.view = view;
    if (target) this.target = target;
    this.renderer.setView(view);
    this.tell();
  }

  moveTo(view: View, target: Vec3, camera = -1, milliseconds = 550): void {
    if (this.still) {
      this.captureCamera = camera;
      this.animation = null;
      return this.put(view, target);
    }
    this.captureCamera = -1;
    this.animation = { from: this.view, to: view, targetFrom: this.target, targetTo: target, begin: performance.now(), length: milliseconds, camera };
  }
  /** To be called once an animation frame. */
  animate(now: number): void {
    const a = this.animation;
    if (!a) return;
    const t = Math.min(1, Math.max(0, (now - a.begin) / a.length));
    if (t >= 1) {
      this.animation = null;
      this.captureCamera = a.camera;
      return this.put(a.to, a.targetTo);
    }
    this.put(interpolated(a.from, a.to, ease(t)), mix(a.targetFrom, a.targetTo, ease(t)));
  }

  goToCamera(index: number): void {
    const count = this.bundle.cameras.length;
    if (count === 0) return;
    const wrapped = ((index % count) + count) % count;
    const camera = this.bundle.cameras[wrapped];
    const view: View = { position: camera.position, rotation: camera.rotation, lens: camera.lens };
    this.moveTo(view, this.pivot(view), wrapped);
  }
  reset(): void {
    this.set({ ...this.defaults });
    this.moveTo(this.home, this.pivot(this.home), this.bundle.cameras.length > 0 ? 0 : -1);
  }
  frame(): void {
    const clip = this.settings.clip;
    const low = clip?.low ?? this.low;
    const high = clip?.high ?? this.high;
    const lens: Lens = { ...this.view.lens, cx: this.view.lens.width / 2, cy: this.view.lens.height / 2 };
    this.moveTo(framed({ ...this.view, lens }, low, high, this.up), mix(low, high, 0.5));
  }

  get hash(): string {
    return toHash(this.view, this.target, this.settings, this.defaults);
  }
  private writeHash(): void {
    history.replaceState(null, "", this.hash);
  }
  private readHash(): void {
    const read = fromHash(location.hash, this.defaults);
    this.settings = read.settings;
    this.renderer.setSettings(this.settings, true);
    if (read.view) {
      this.captureCamera = this.cameraAt(read.view);
      this.view = read.view;
      this.target = read.target ?? this.pivot(read.view);
    }
    this.renderer.setView(this.view);
    for (const callback of this.changed) callback();
  }
  private cameraAt(view: View): number {
    const near = (a: number, b: number) => Math.abs(a - b) < 1e-4 * (1 + Math.abs(a));
    return this.bundle.cameras.findIndex(
      (c) => c.position.every((v, i) => near(v, view.position[i])) && c.rotation.flat().every((v, i) => Math.abs(v - view.rotation.flat()[i]) < 1e-4) && near(c.lens.fx, view.lens.fx),
    );
  }
}
