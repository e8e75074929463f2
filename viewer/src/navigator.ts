/** A camera that people drive: it jumps or flies, and knows what it turns about. */

import { interpolated, pivotOf, type View } from "./camera";
import { Changing } from "./changing";
import { mix, type Vec3 } from "./math";

const ease = (t: number) => (t < 0.5 ? 4 * t * t * t : 1 - (2 - 2 * t) ** 3 / 2);

interface Flight {
  from: View;
  to: View;
  targetFrom: Vec3;
  targetTo: Vec3;
  begin: number;
  length: number;
  camera: number;
}

export abstract class Navigator extends Changing {
  view!: View;
  /** What the camera turns about. */
  target!: Vec3;
  /** Number of the capture's camera that is looked through, else -1. */
  captureCamera = -1;
  /** Whether cameras jump instead of flying. */
  protected readonly still = new URLSearchParams(location.search).has("still") || matchMedia("(prefers-reduced-motion: reduce)").matches;
  private flight: Flight | null = null;

  abstract get cameras(): readonly View[];
  abstract get centre(): Vec3;
  abstract get up(): Vec3;
  /** Whether the camera looks around from where it stands instead of turning about its target. */
  abstract get fly(): boolean;
  /** Half the size of what is looked at, world units: the measure of a walk. */
  abstract get reach(): number;
  /** Called after every change of the view. */
  protected abstract moved(): void;

  pivot(view: View): Vec3 {
    return pivotOf(view, this.centre);
  }

  setView(view: View, target?: Vec3): void {
    this.flight = null;
    this.captureCamera = -1;
    this.put(view, target);
  }
  private put(view: View, target?: Vec3): void {
    this.view = view;
    if (target) this.target = target;
    this.moved();
  }

  moveTo(view: View, target: Vec3, camera = -1, milliseconds = 550): void {
    if (this.still || milliseconds <= 0) {
      this.captureCamera = camera;
      this.flight = null;
      return this.put(view, target);
    }
    this.captureCamera = -1;
    this.flight = { from: this.view, to: view, targetFrom: this.target, targetTo: target, begin: performance.now(), length: milliseconds, camera };
  }
  /** To be called once an animation frame. */
  animate(now: number): void {
    const a = this.flight;
    if (!a) return;
    const t = Math.min(1, Math.max(0, (now - a.begin) / a.length));
    if (t >= 1) {
      this.flight = null;
      this.captureCamera = a.camera;
      return this.put(a.to, a.targetTo);
    }
    this.put(interpolated(a.from, a.to, ease(t)), mix(a.targetFrom, a.targetTo, ease(t)));
  }

  goToCamera(index: number, milliseconds?: number): void {
    const count = this.cameras.length;
    if (count === 0) return;
    const wrapped = ((index % count) + count) % count;
    const { position, rotation, lens } = this.cameras[wrapped];
    const view: View = { position, rotation, lens };
    this.moveTo(view, this.pivot(view), wrapped, milliseconds);
  }
}
