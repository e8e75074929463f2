/** The viewer: what is looked at, how, and who is told. */

import type { Bundle } from "./bundle";
import { axes, framed, lensOfFov, upAxis, type Lens, type View } from "./camera";
import { fromHash, toHash } from "./hash";
import { add, mix, norm, scale, sub, type Vec3 } from "./math";
import { Navigator } from "./navigator";
import type { Renderer } from "./renderer";
import { defaultSettings, displayOnly, type Settings } from "./settings";

export class App extends Navigator {
  readonly defaults: Settings;
  readonly low: Vec3;
  readonly high: Vec3;
  settings: Settings;
  private hashTimer = 0;
  readonly home: View;

  constructor(readonly bundle: Bundle, readonly renderer: Renderer) {
    super();
    const { volume } = bundle;
    this.low = volume.origin;
    this.high = add(volume.origin, scale(volume.bricks, 8 * volume.voxelSize));
    this.defaults = defaultSettings(upAxis(bundle.upAxis, bundle.cameras), bundle.sky ? "sky" : undefined);
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
  get cameras(): View[] {
    return this.bundle.cameras;
  }
  get fly(): boolean {
    return this.settings.fly;
  }
  get reach(): number {
    return norm(sub(this.high, this.low)) / 2;
  }

  /** After every change of the view or the settings. */
  protected override tell(): void {
    super.tell();
    window.clearTimeout(this.hashTimer);
    this.hashTimer = window.setTimeout(() => this.writeHash(), 250);
  }

  set(partial: Partial<Settings>): void {
    this.settings = { ...this.settings, ...partial };
    const march = (Object.keys(partial) as (keyof Settings)[]).some((key) => !displayOnly.has(key));
    this.renderer.setSettings(this.settings, march);
    this.tell();
  }

  protected moved(): void {
    this.renderer.setView(this.view);
    this.tell();
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
    super.tell();
  }
  private cameraAt(view: View): number {
    const near = (a: number, b: number) => Math.abs(a - b) < 1e-4 * (1 + Math.abs(a));
    return this.bundle.cameras.findIndex(
      (c) => c.position.every((v, i) => near(v, view.position[i])) && c.rotation.flat().every((v, i) => Math.abs(v - view.rotation.flat()[i]) < 1e-4) && near(c.lens.fx, view.lens.fx),
    );
  }
}
