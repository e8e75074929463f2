/** Mouse, touch and keyboard -> camera. */

import { dollied, looked, moved, orbited, zoomed } from "./camera";
import { add, apply, clamp, norm, sub, type Vec3 } from "./math";
import type { Navigator } from "./navigator";

const radiansAPixel = 0.006;

/** Whether a key is the browser's, or that of the control it goes to. */
export function isTaken(e: KeyboardEvent): boolean {
  // Some keyboards have their brackets on Alt.
  if (e.altKey && !/[[\]{}]/.test(e.key)) return true;
  return (e.key === " " || e.key === "Enter") && (e.target as HTMLElement).matches?.("button, summary, a, input");
}

/** Of a wheel, pixels. */
export const turnOf = (e: WheelEvent) => clamp(e.deltaY * (e.deltaMode === 1 ? 30 : 1), -120, 120);

export type Place = { x: number; y: number };
/** Of two fingers one goes to another place: how many times as far apart they are now, and the middle between them. */
export function pinched(pointers: ReadonlyMap<number, Place>, id: number, to: Place): { factor: number; middle: Place } {
  const from = pointers.get(id)!;
  const [, other] = [...pointers].find(([key]) => key !== id)!;
  const was = Math.hypot(from.x - other.x, from.y - other.y);
  const is = Math.hypot(to.x - other.x, to.y - other.y);
  return { factor: was > 10 && is > 10 ? is / was : 1, middle: { x: (to.x + other.x) / 2, y: (to.y + other.y) / 2 } };
}

export class Input {
  private pointers = new Map<number, Place>();
  private keys = new Set<string>();
  private last = 0;

  /** @param active  whether keys are this camera's at the moment */
  constructor(
    private readonly app: Navigator, private readonly surface: HTMLElement, private readonly actions: Record<string, () => void>,
    private readonly active = () => true,
  ) {
    surface.addEventListener("pointerdown", (e) => this.down(e));
    surface.addEventListener("pointermove", (e) => this.move(e));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"] as const) surface.addEventListener(type, (e) => this.pointers.delete(e.pointerId));
    surface.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    surface.addEventListener("contextmenu", (e) => e.preventDefault());
    window.addEventListener("keydown", (e) => this.key(e));
    window.addEventListener("keyup", (e) => this.keys.delete(e.code));
    window.addEventListener("blur", () => this.keys.clear());
  }

  private down(e: PointerEvent): void {
    this.surface.setPointerCapture(e.pointerId);
    this.pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    (document.activeElement as HTMLElement | null)?.blur();
  }

  private move(e: PointerEvent): void {
    const before = this.pointers.get(e.pointerId);
    if (!before) return;
    const place = { x: e.clientX, y: e.clientY };
    const [dx, dy] = [place.x - before.x, place.y - before.y];
    const fingers = this.pointers.size === 2 ? pinched(this.pointers, e.pointerId, place) : null;
    this.pointers.set(e.pointerId, place);
    if (fingers) {
      this.pan(dx / 2, dy / 2);
      return this.dolly(1 / fingers.factor);
    }
    if (e.buttons & 6 || e.shiftKey) return this.pan(dx, dy);
    const { app } = this;
    if (app.fly) return app.setView(looked(app.view, app.up, dx * radiansAPixel * 0.6, -dy * radiansAPixel * 0.6));
    app.setView(orbited(app.view, app.target, app.up, -dx * radiansAPixel, -dy * radiansAPixel));
  }

  private pan(dx: number, dy: number): void {
    const { app } = this;
    const distance = norm(sub(app.target, app.view.position));
    const pixels = this.surface.clientHeight / app.view.lens.height;
    const unit = distance / (app.view.lens.fy * pixels);
    const shift = apply(app.view.rotation, [-dx * unit, -dy * unit, 0]);
    app.setView({ ...app.view, position: add(app.view.position, shift) }, add(app.target, shift));
  }

  private dolly(factor: number): void {
    const { app } = this;
    app.setView(dollied(app.view, app.target, factor));
  }

  private wheel(e: WheelEvent): void {
    e.preventDefault();
    const factor = Math.exp(turnOf(e) * 0.0015);
    if (e.altKey) return this.app.setView(zoomed(this.app.view, 1 / factor));
    if (this.app.fly) return this.walk(0, 0, (1 - factor) * this.app.reach);
    this.dolly(factor);
  }

  private walk(right: number, down: number, forward: number): void {
    const { app } = this;
    const view = moved(app.view, right, down, forward);
    app.setView(view, add(app.target, sub(view.position, app.view.position)) as Vec3);
  }

  private key(e: KeyboardEvent): void {
    const target = e.target as HTMLElement;
    if (e.ctrlKey || e.metaKey || !this.active() || isTaken(e)) return;
    if (target instanceof HTMLSelectElement || target.closest("dialog")) return;
    if (target instanceof HTMLInputElement && target.type !== "range" && target.type !== "checkbox") return;
    if (/^(Key[WASDQE]|Arrow(Up|Down|Left|Right))$/.test(e.code)) {
      if (target instanceof HTMLInputElement && e.code.startsWith("Arrow")) return;
      this.keys.add(e.code);
      e.preventDefault();
      return;
    }
    const action = this.actions[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!action) return;
    e.preventDefault();
    action();
  }

  /** To be called once an animation frame: keys that are held. */
  step(now: number): void {
    const seconds = Math.min(0.1, (now - this.last) / 1000);
    this.last = now;
    if (!this.active()) this.keys.clear();
    if (this.keys.size === 0) return;
    const held = (...codes: string[]) => (codes.some((code) => this.keys.has(code)) ? 1 : 0);
    const speed = this.app.reach * 0.6 * seconds;
    const right = held("KeyD", "ArrowRight") - held("KeyA", "ArrowLeft");
    const forward = held("KeyW", "ArrowUp") - held("KeyS", "ArrowDown");
    const up = held("KeyE") - held("KeyQ");
    if (right || forward || up) this.walk(right * speed, -up * speed, forward * speed);
  }
}
