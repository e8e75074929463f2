/** The scene, drawn by the server from the field: a camera that is driven, frames that follow it, a wipe of two sides. */

import { axes, fitted, framed, type View } from "../camera";
import { Input } from "../input";
import { add, type Vec3 } from "../math";
import { Navigator } from "../navigator";
import { el, slidesAcross } from "../ui/dom";
import { FrameScheduler } from "./scheduler";
import type { Session } from "./session";
import { words } from "./words";

type Frame = { pictures: ImageBitmap[]; colors: number; milliseconds: number };
const largest = 4096;
const drop = ({ pictures }: Frame) => pictures.forEach((picture) => picture.close());

/** Tells when the camera or the sides changed. */
export class FieldView extends Navigator {
  readonly canvas = el("canvas", { id: "field", tabindex: "0", "aria-label": words.stage, role: "img" });
  readonly node: HTMLElement;
  fly = false;
  /** Share of the picture, from the left, that shows the left side. */
  wipe = 0;
  left = "";
  right = "now";
  private readonly scheduler: FrameScheduler<{ view: View; sides: string[] }, Frame>;
  private readonly handle: HTMLElement;
  private readonly labels: [HTMLElement, HTMLElement];
  private frameShown: Frame | null = null;
  private colorsShown = -1;
  private input: Input | null = null;
  hidden = false;

  constructor(private readonly session: Session) {
    super();
    this.labels = [el("span", { class: "side left" }), el("span", { class: "side right" })];
    this.handle = this.wipeHandle();
    this.node = el("div", { class: "field" }, this.canvas, this.handle);
    this.scheduler = new FrameScheduler({
      fetch: (wish) => this.ask(wish.camera, wish.share, wish.moving),
      cost: (frame) => frame.milliseconds,
      show: (frame) => this.show(frame),
      drop,
      failed: (problem) => session.explain(problem),
      now: () => performance.now(),
      later: (callback, milliseconds) => void setTimeout(callback, milliseconds),
    });
    this.view = this.home;
    this.target = this.pivot(this.view);
    this.captureCamera = session.scene.home;
    this.showWipe();
  }
  /** The capture's, then the viewpoints. */
  get cameras(): readonly View[] {
    return this.session.views;
  }
  get home(): View {
    const { views, home } = this.session.scene;
    const { position, rotation, lens } = views[home] ?? views[0];
    return { position, rotation, lens };
  }
  get up(): Vec3 {
    return axes[this.session.scene.up] ?? axes["+y"];
  }
  get centre(): Vec3 {
    return this.session.scene.centre;
  }
  get reach(): number {
    return this.session.scene.radius;
  }
  get settled(): boolean {
    return this.scheduler.settled;
  }
  /** Colours of the frame that is shown. */
  get colors(): number {
    return this.frameShown?.colors ?? -1;
  }

  /** Starts frames and keys. */
  begin(actions: Record<string, () => void>, active: () => boolean): void {
    this.input = new Input(this, this.canvas, actions, active);
    const step = (now: number) => {
      requestAnimationFrame(step);
      this.input!.step(now);
      this.animate(now);
    };
    requestAnimationFrame(step);
    new ResizeObserver(() => this.layout()).observe(this.node);
    this.session.onState((state) => {
      const names = new Set(["", "now", ...state.takes.map((take) => take.name)]);
      if (!names.has(this.left) || !names.has(this.right)) this.compare(names.has(this.left) ? this.left : "", names.has(this.right) ? this.right : "now");
      // Frames in passing do not hold up a training.
      const inPassing = this.session.isTraining && state.task !== "";
      if (inPassing !== this.scheduler.inPassing) this.scheduler.inPassing = inPassing;
      if (this.session.isTraining) this.setWipe(0);
      this.showWipe();
      if (state.colors === this.colorsShown) return;
      this.colorsShown = state.colors;
      this.refresh();
    });
    // A camera that is looked through is followed where training moves it.
    this.session.onScene(() => (this.captureCamera >= 0 && !this.hidden ? this.goToCamera(this.captureCamera, 0) : this.refresh()));
    this.session.strokes.onChange(() => this.findViewpoint());
  }
  /** Viewpoints come and go: the one that is looked through may have another number now, or none. */
  private findViewpoint(): void {
    if (this.captureCamera >= 0 && !this.session.isViewpoint(this.captureCamera)) return;
    const here = (camera: View) => JSON.stringify([camera.position, camera.rotation]);
    const wanted = here(this.view);
    const found = this.cameras.findIndex((camera, i) => this.session.isViewpoint(i) && here(camera) === wanted);
    if (found === this.captureCamera) return;
    this.captureCamera = found;
    this.tell();
  }
  /** The camera as it stands, for a picture of what is seen, of `longest` pixels at most. */
  viewHere(longest: number): View {
    // Not the canvas's own size: that follows the page a moment later.
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [this.node.clientWidth * ratio, this.node.clientHeight * ratio];
    const scale = Math.min(1, longest / Math.max(width, height));
    const { position, rotation, lens } = this.view;
    return { position, rotation, lens: fitted(lens, Math.max(16, Math.round(width * scale)), Math.max(16, Math.round(height * scale))) };
  }
  protected moved(): void {
    if (!this.hidden) this.scheduler.look({ view: this.view, sides: this.sides });
    this.tell();
  }
  /** The same camera anew: sides, colours or the canvas changed. */
  refresh(): void {
    if (!this.hidden && this.canvas.width > 16) this.scheduler.refresh({ view: this.view, sides: this.sides });
    this.tell();
  }
  reset(): void {
    this.moveTo(this.home, this.pivot(this.home), this.session.scene.home);
  }
  frame(): void {
    const { centre, reach } = this;
    const size: Vec3 = [0.6 * reach, 0.6 * reach, 0.6 * reach];
    const lens = { ...this.view.lens, cx: this.view.lens.width / 2, cy: this.view.lens.height / 2 };
    this.moveTo(framed({ ...this.view, lens }, add(centre, size.map((v) => -v) as Vec3), add(centre, size), this.up), centre);
  }

  /** Only what is seen is asked for: a parked wipe needs one side. */
  private get sides(): string[] {
    if (this.wipe < 0.004 || this.left === this.right) return [this.right];
    return this.wipe > 0.996 ? [this.left] : [this.left, this.right];
  }
  private ask({ view, sides }: { view: View; sides: string[] }, share: number, moving: boolean): Promise<Frame | null> {
    const scale = share * Math.min(1, largest / Math.max(this.canvas.width, this.canvas.height));
    const width = Math.max(16, Math.round(this.canvas.width * scale));
    const height = Math.max(16, Math.round(this.canvas.height * scale));
    return this.session.api.frame({ position: view.position, rotation: view.rotation, lens: fitted(view.lens, width, height), sides, moving });
  }
  private show(frame: Frame): void {
    if (this.frameShown) drop(this.frameShown);
    this.frameShown = frame;
    document.body.classList.remove("loading");
    document.body.dataset.ready = "yes";
    this.draw();
  }
  private draw(): void {
    const frame = this.frameShown;
    if (!frame) return;
    const { width, height } = this.canvas;
    const context = this.canvas.getContext("2d")!;
    const { pictures } = frame;
    const cut = pictures.length === 2 ? Math.round(width * this.wipe) : 0;
    context.imageSmoothingQuality = "high";
    const put = (picture: ImageBitmap, from: number, to: number) => {
      if (to <= from) return;
      const scale = picture.width / width;
      context.drawImage(picture, from * scale, 0, (to - from) * scale, picture.height, from, 0, to - from, height);
    };
    if (pictures.length === 2) put(pictures[0], 0, cut);
    put(pictures[pictures.length - 1], cut, width);
  }
  private layout(): void {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(16, Math.round(this.node.clientWidth * ratio));
    const height = Math.max(16, Math.round(this.node.clientHeight * ratio));
    if (width === this.canvas.width && height === this.canvas.height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.draw();
    this.refresh();
  }

  compare(left: string, right: string): void {
    this.left = left;
    this.right = right;
    this.showWipe();
    this.refresh();
  }
  setWipe(share: number): void {
    if (this.session.isTraining && share > 0) return;
    if (share === this.wipe) return;
    const before = this.sides.join();
    this.wipe = Math.min(1, Math.max(0, share));
    this.showWipe();
    if (this.sides.join() === before) return this.draw();
    this.refresh();
  }
  private showWipe(): void {
    this.labels[0].textContent = words.side(this.left);
    this.labels[1].textContent = words.side(this.right);
    this.handle.style.left = `${100 * this.wipe}%`;
    this.handle.setAttribute("aria-valuenow", String(Math.round(100 * this.wipe)));
    this.handle.setAttribute("aria-label", words.wipe(words.side(this.left), words.side(this.right)));
    this.handle.classList.toggle("parked", this.wipe < 0.004 || this.wipe > 0.996);
    // While it is trained the field has one look only.
    this.handle.hidden = this.left === this.right || this.session.isTraining;
  }
  private wipeHandle(): HTMLElement {
    const handle = el("div", { class: "wipe", id: "wipe-handle", role: "slider", "aria-valuemin": "0", "aria-valuemax": "100", tabindex: "0" },
      this.labels[0], el("span", { class: "grip" }), this.labels[1]);
    slidesAcross(handle, () => this.node, () => this.wipe, (share) => this.setWipe(share));
    return handle;
  }
}
