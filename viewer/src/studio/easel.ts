/** A photograph to paint on: zoom, pan, and the tools. What is drawn is drawn here at once; the server hears of it after. */

import { Changing } from "../changing";
import { hexOf, lightnessOfCode, type Rgb } from "../color";
import { pinched, turnOf, type Place } from "../input";
import { el, toast } from "../ui/dom";
import type { Tool } from "./brush";
import { PaintLayer, planesOf, strokeAt, type Box, type Planes } from "./paint";
import { limits, type Stroke, type StrokePoint } from "./protocol";
import { TintFeed, type TintKind } from "./reach";
import type { Session } from "./session";
import { words } from "./words";

/** Longer sides are painted on a smaller picture. */
const longest = 2560;

/** Tells when the place under the pointer, or what is shown, changed. */
export class Easel extends Changing {
  readonly canvas = el("canvas", { id: "easel", tabindex: "0", "aria-label": words.easel, role: "application" });
  readonly node = el("div", { class: "easel", hidden: true }, this.canvas);
  layer: PaintLayer | null = null;
  tint: TintKind = "reach";
  private photo: ImageBitmap | null = null;
  private paint = document.createElement("canvas");
  /** CSS pixels a pixel of the photograph, and where its corner lies. */
  private scale = 1;
  private corner: Place = { x: 0, y: 0 };
  /** Whether nobody zoomed: the photograph follows the window's size. */
  private fits = true;
  private touchedLightness = 60;
  private pointers = new Map<number, Place>();
  /** Id of the pen that was put down last. */
  private pen = -1;
  private cursor: Place | null = null;
  private growing: Stroke | null = null;
  private lineFrom: Place | null = null;
  private lastEnd: StrokePoint | null = null;
  private painted: readonly Stroke[] = [];
  /** Painted pictures of this photograph, in its size, and those that are on their way. */
  private pictures = new Map<string, Planes>();
  private fetching = new Set<string>();
  private dirty = false;
  private dragging = false;
  private held: Tool | null = null;
  private readonly feed: TintFeed;

  constructor(private readonly session: Session) {
    super();
    this.feed = new TintFeed(session, (view, tint) => view === session.open && this.layer && (this.layer.setTint(tint), this.flush(null)));
    session.strokes.onChange(() => this.follow());
    session.brush.onChange(() => this.redraw());
    let [colors, ready] = [session.state.colors, session.state.ready];
    session.onState((state) => {
      const changed = state.colors !== colors && this.tint === "now";
      if (changed || state.ready !== ready) this.askTint();
      [colors, ready] = [state.colors, state.ready];
    });
    new ResizeObserver(() => this.layout()).observe(this.node);
    this.followPixels();
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", (e) => this.up(e, true));
    canvas.addEventListener("pointerleave", () => this.pointers.size === 0 && ((this.cursor = null), this.redraw(), this.tell()));
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("keydown", (e) => this.key(e));
  }

  async open(index: number): Promise<void> {
    const { session } = this;
    const view = session.views[index];
    session.open = view.name;
    this.node.hidden = false;
    this.lastEnd = null;
    this.growing = null;
    // Until the photograph is there nothing can be painted: it would go to another view than the one that is seen.
    this.layer = null;
    delete this.node.dataset.photo;
    const side = Math.max(view.width, view.height) > longest ? `side=${longest}` : "";
    const query = `${side}${session.stamp(index)}`.replace(/^&/, "");
    this.tell();
    try {
      const photo = await createImageBitmap(await (await session.api.send("GET", `photos/${index}${query && `?${query}`}`)).blob());
      if (session.open !== view.name) return photo.close();
      this.show(photo);
    } catch (problem) {
      session.explain(problem);
    }
  }
  private show(photo: ImageBitmap): void {
    this.photo?.close();
    this.photo = photo;
    Object.assign(this.paint, { width: photo.width, height: photo.height });
    const context = this.paint.getContext("2d")!;
    context.drawImage(photo, 0, 0);
    this.layer = new PaintLayer(photo.width, photo.height, context.getImageData(0, 0, photo.width, photo.height).data);
    context.clearRect(0, 0, photo.width, photo.height);
    this.painted = [];
    this.pictures.clear();
    this.fetching.clear();
    this.fits = true;
    this.layout();
    this.follow();
    this.node.dataset.photo = String(this.session.photo);
    this.askTint();
    this.tell();
  }
  close(): void {
    this.session.open = "";
    this.node.hidden = true;
    delete this.node.dataset.photo;
    this.layer = null;
    this.photo?.close();
    this.photo = null;
    this.growing = null;
    this.pointers.clear();
    this.tell();
  }

  setTint(kind: TintKind): void {
    this.tint = kind;
    this.askTint();
    this.tell();
  }
  askTint(): void {
    if (this.layer) this.feed.ask(this.tint, this.session.open, this.growing);
  }

  /** The strokes changed: by the user, by undo, or in another tab. */
  private follow(): void {
    const { session } = this;
    if (!this.layer || !session.view) return;
    const strokes = session.strokes.of(session.view.name);
    const same = strokes.length === this.painted.length && strokes.every((s, i) => s === this.painted[i]);
    // A stroke that grows is not disturbed: what is painted is drawn anew after it.
    if (!same && !this.growing) {
      this.painted = strokes;
      this.redrawPaint();
    }
    for (const { picture } of strokes) if (picture) void this.fetchPicture(picture);
    if (!this.growing) this.askTint();
  }
  private async fetchPicture(name: string): Promise<void> {
    const { layer } = this;
    if (!layer || this.pictures.has(name) || this.fetching.has(name)) return;
    this.fetching.add(name);
    try {
      const blob = await (await this.session.api.send("GET", `painted?picture=${name}`)).blob();
      const picture = await createImageBitmap(blob, { resizeWidth: layer.width, resizeHeight: layer.height });
      const context = new OffscreenCanvas(layer.width, layer.height).getContext("2d", { willReadFrequently: true })!;
      context.drawImage(picture, 0, 0);
      picture.close();
      if (this.layer !== layer) return;
      this.pictures.set(name, planesOf(context.getImageData(0, 0, layer.width, layer.height).data));
    } catch (problem) {
      this.session.explain(problem);
    }
    if (this.layer !== layer) return;
    this.fetching.delete(name);
    // As in follow().
    if (this.growing) this.painted = [];
    else this.redrawPaint();
  }
  private redrawPaint(): void {
    this.layer?.redraw(this.painted, this.pictures);
    this.flush(null);
  }
  /** Brings what the layer changed to the canvas. */
  private flush(box: Box | null): void {
    const { layer } = this;
    if (!layer) return;
    const image = new ImageData(layer.pixels, layer.width, layer.height);
    const context = this.paint.getContext("2d")!;
    if (box === null) context.putImageData(image, 0, 0);
    else if (box.right > box.left) context.putImageData(image, 0, 0, box.left, box.top, box.right - box.left, box.bottom - box.top);
    this.redraw();
  }

  // What is seen.

  layout(): void {
    if (this.node.clientWidth === 0) return;
    if (this.fits) this.fit();
    this.redraw();
  }
  /** A window that moves to another screen keeps its size and gets other pixels. */
  private followPixels(): void {
    matchMedia(`(resolution: ${devicePixelRatio || 1}dppx)`).addEventListener("change", () => (this.redraw(), this.followPixels()), { once: true });
  }
  private sizeCanvas(ratio: number): void {
    const width = Math.round(this.node.clientWidth * ratio);
    const height = Math.round(this.node.clientHeight * ratio);
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
  }
  /** What covers the stage around the photograph, CSS pixels. */
  private get margin() {
    if (this.node.clientWidth > 700) return { top: 76, bottom: 152, left: 74, right: 16 };
    const panel = document.body.classList.contains("panel-open");
    return { top: 72, bottom: panel ? 0.52 * innerHeight + 8 : 206, left: 8, right: 8 };
  }
  private get fitScale(): number {
    const { photo, node } = this;
    const { left, right, top, bottom } = this.margin;
    return photo ? Math.min((node.clientWidth - left - right) / photo.width, (node.clientHeight - top - bottom) / photo.height) : 1;
  }
  fit(): void {
    const { photo, node } = this;
    if (!photo) return;
    this.fits = true;
    this.scale = this.fitScale;
    const { left, right, top, bottom } = this.margin;
    this.corner = { x: (node.clientWidth + left - right - photo.width * this.scale) / 2, y: (node.clientHeight + top - bottom - photo.height * this.scale) / 2 };
    this.redraw();
  }
  zoomBy(factor: number, at: Place = { x: this.node.clientWidth / 2, y: this.node.clientHeight / 2 }): void {
    const next = Math.min(64, Math.max(Math.min(0.1, this.fitScale), this.scale * factor));
    const f = next / this.scale;
    this.fits = false;
    this.scale = next;
    this.corner = { x: at.x - (at.x - this.corner.x) * f, y: at.y - (at.y - this.corner.y) * f };
    this.redraw();
  }
  /** Moves the photograph. */
  private moveBy(x: number, y: number): void {
    this.corner = { x: this.corner.x + x, y: this.corner.y + y };
    if (this.lineFrom) this.lineFrom = { x: this.lineFrom.x + x, y: this.lineFrom.y + y };
    this.redraw();
  }
  actualSize(): void {
    this.zoomBy(1 / (devicePixelRatio || 1) / this.scale, this.cursor ?? undefined);
  }
  get zoom(): number {
    return this.scale * (devicePixelRatio || 1);
  }
  private redraw(): void {
    if (this.dirty || this.node.hidden) return;
    this.dirty = true;
    requestAnimationFrame(() => {
      this.dirty = false;
      this.draw();
    });
  }
  private draw(): void {
    const ratio = devicePixelRatio || 1;
    const context = this.canvas.getContext("2d")!;
    this.sizeCanvas(ratio);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (!this.photo) return;
    const s = this.scale * ratio;
    context.setTransform(s, 0, 0, s, this.corner.x * ratio, this.corner.y * ratio);
    // Above 100 % single pixels are to be seen.
    context.imageSmoothingEnabled = s < 1;
    context.imageSmoothingQuality = "high";
    context.drawImage(this.photo, 0, 0);
    context.drawImage(this.paint, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.drawCursor(context);
  }
  private drawCursor(context: CanvasRenderingContext2D): void {
    const { cursor } = this;
    const drawn = this.tool !== "hand" && this.tool !== "picker" && !this.session.isReadOnly;
    this.canvas.style.cursor = this.tool === "hand" ? (this.dragging ? "grabbing" : "grab") : drawn ? "none" : "crosshair";
    if (!cursor || !drawn) return;
    const radius = Math.max(2, this.tool === "fill" ? 4 : this.radius);
    const ring = (r: number, color: string) => {
      context.beginPath();
      context.arc(cursor.x, cursor.y, r, 0, 2 * Math.PI);
      context.strokeStyle = color;
      context.stroke();
    };
    context.lineWidth = 1.5;
    ring(radius + 0.75, "rgb(0 0 0 / 65%)");
    ring(radius, "rgb(255 255 255 / 90%)");
    if (radius > 5) ring(0.8, "rgb(255 255 255 / 90%)");
    if (this.lineFrom) {
      context.beginPath();
      context.moveTo(this.lineFrom.x, this.lineFrom.y);
      context.lineTo(cursor.x, cursor.y);
      context.stroke();
    }
  }
  /** Of the brush, CSS pixels. */
  private get radius(): number {
    return this.photo ? (this.session.brush.size * Math.min(this.photo.width, this.photo.height) * this.scale) / 2 : 1;
  }

  // Places.

  private placeOf(e: { clientX: number; clientY: number }): Place {
    const box = this.canvas.getBoundingClientRect();
    return { x: e.clientX - box.left, y: e.clientY - box.top };
  }
  private pixelOf(place: Place): Place {
    return { x: Math.floor((place.x - this.corner.x) / this.scale), y: Math.floor((place.y - this.corner.y) / this.scale) };
  }
  private pointOf(place: Place, pressure = 1): StrokePoint {
    const { photo } = this;
    const share = (v: number, corner: number, size: number) => Math.min(2, Math.max(-1, Number(((v - corner) / this.scale / size).toFixed(5))));
    return [share(place.x, this.corner.x, photo!.width), share(place.y, this.corner.y, photo!.height), Number(pressure.toFixed(3))];
  }
  private isInside({ x, y }: Place): boolean {
    return !!this.photo && x >= 0 && y >= 0 && x < this.photo.width && y < this.photo.height;
  }
  /** L* under the pointer, else of the place that was touched last. */
  get lightness(): number {
    const pixel = this.cursor && this.pixelOf(this.cursor);
    return pixel && this.layer && this.isInside(pixel) ? lightnessOfCode[this.layer.greyAround(pixel.x, pixel.y)] : this.touchedLightness;
  }
  private get tool(): Tool {
    return this.held ?? this.session.brush.settings.tool;
  }
  /** A tool while a key is held; null = the brush's own again. */
  hold(tool: Tool | null): void {
    this.held = tool;
    this.redraw();
  }

  // Pointers.

  private down(e: PointerEvent): void {
    if (!this.layer || this.isPalm(e)) return;
    if (e.pointerType === "pen") {
      this.pen = e.pointerId;
      // The hand may have come to rest before its pen.
      if (this.pointers.size > 0) this.cancel();
      this.pointers.clear();
    }
    this.canvas.setPointerCapture(e.pointerId);
    this.canvas.focus({ preventScroll: true });
    const place = this.placeOf(e);
    this.cursor = place;
    this.pointers.set(e.pointerId, place);
    this.touchedLightness = this.lightness;
    if (this.pointers.size > 1) return this.cancel();
    this.dragging = e.button === 1 || e.button === 2 || this.tool === "hand";
    this.tell();
    if (this.dragging) return this.redraw();
    const tool = e.altKey ? "picker" : this.tool;
    if (tool === "picker") return this.pick(place);
    this.startStroke(place, this.pressureOf(e), e.shiftKey);
  }
  /** A hand comes to rest where its pen draws. */
  private isPalm(e: PointerEvent): boolean {
    return e.pointerType === "touch" && this.pointers.has(this.pen);
  }
  private pressureOf(e: PointerEvent): number {
    return e.pointerType === "pen" ? Math.max(0.02, e.pressure) : 1;
  }
  private move(e: PointerEvent): void {
    if (this.isPalm(e)) return;
    const place = this.placeOf(e);
    const before = this.pointers.get(e.pointerId);
    this.cursor = place;
    this.redraw();
    this.tell();
    if (!before) return;
    if (this.pointers.size === 2) return this.pinch(e.pointerId, before, place);
    this.pointers.set(e.pointerId, place);
    if (this.dragging) return this.moveBy(place.x - before.x, place.y - before.y);
    if (!this.growing || this.tool === "line") return;
    const events = e.getCoalescedEvents?.() ?? [];
    this.grow((events.length > 0 ? events : [e]).map((event) => this.pointOf(this.placeOf(event), this.pressureOf(event))));
  }
  private pinch(id: number, before: Place, place: Place): void {
    const { factor, middle } = pinched(this.pointers, id, place);
    this.pointers.set(id, place);
    this.moveBy((place.x - before.x) / 2, (place.y - before.y) / 2);
    this.zoomBy(factor, middle);
  }
  private up(e: PointerEvent, cancelled = false): void {
    if (!this.pointers.delete(e.pointerId)) return;
    if (e.pointerType === "touch") this.cursor = this.pointers.size > 0 ? this.cursor : this.placeOf(e);
    this.dragging = false;
    if (cancelled) return this.cancel();
    if (this.growing && this.lineFrom) this.grow([this.pointOf(this.placeOf(e))]);
    this.finishStroke();
    this.redraw();
  }
  private wheel(e: WheelEvent): void {
    e.preventDefault();
    this.zoomBy(Math.exp(-turnOf(e) * (e.ctrlKey ? 0.01 : 0.0025)), this.placeOf(e));
    this.tell();
  }

  // Strokes.

  private startStroke(place: Place, pressure: number, joins: boolean): void {
    const { session } = this;
    if (!this.layer || !session.view) return;
    if (session.isReadOnly) return toast(words.readOnly);
    if (session.strokes.list.length >= limits.strokes) return toast(words.tooMany(limits.strokes));
    if (session.strokes.bytes > limits.bytes) return toast(words.tooMuch);
    const point = this.pointOf(place, pressure);
    const points = joins && this.lastEnd ? [this.lastEnd, point] : [point];
    this.growing = session.brush.stroke(session.view.name, points);
    this.lineFrom = this.tool === "line" ? place : null;
    this.layer.begin(this.growing);
    this.flush(this.layer.extend(this.growing));
    this.askTint();
  }
  private grow(points: StrokePoint[]): void {
    const { growing, layer } = this;
    if (!growing || !layer || this.tool === "fill") return;
    const list = [...growing.points];
    for (const point of points) {
      const last = list[list.length - 1];
      const far = Math.hypot((point[0] - last[0]) * layer.width, (point[1] - last[1]) * layer.height) * this.scale;
      if ((far > 0.7 || Math.abs(point[2] - last[2]) > 0.05) && list.length < limits.points) list.push(point);
    }
    if (list.length === growing.points.length) return;
    this.growing = { ...growing, points: list };
    this.flush(layer.extend(this.growing));
    this.askTint();
  }
  private finishStroke(): void {
    const { growing, layer, session } = this;
    this.lineFrom = null;
    if (!growing || !layer) return;
    layer.end();
    this.growing = null;
    this.lastEnd = growing.points[growing.points.length - 1];
    // It is painted already.
    this.painted = [...this.painted, growing];
    if (growing.kind === "paint" || growing.kind === "exact") session.brush.remember();
    session.selected = growing.id;
    session.strokes.add(growing);
  }
  /** A second finger came, or Escape: it was no stroke. @return whether there was one */
  cancel(): void {
    if (!this.growing || !this.layer) return;
    this.growing = this.lineFrom = null;
    this.painted = this.session.strokes.of(this.session.open);
    this.redrawPaint();
    this.askTint();
  }
  get isDrawing(): boolean {
    return this.growing !== null;
  }

  private pick(place: Place): void {
    const { layer, session } = this;
    const pixel = this.pixelOf(place);
    if (!layer || !this.isInside(pixel)) return;
    const stroke = strokeAt(this.painted, (pixel.x + 0.5) / layer.width, (pixel.y + 0.5) / layer.height, layer.width, layer.height);
    if (stroke && (stroke.kind === "paint" || stroke.kind === "exact")) {
      // The stroke's own colour has chroma that this place's light may not show.
      session.selected = stroke.id;
      return session.brush.set({ color: stroke.color });
    }
    const color: Rgb | null = layer.colorAt(pixel.x, pixel.y);
    const grey = layer.greyAround(pixel.x, pixel.y);
    session.brush.set({ color: hexOf(color ?? [grey, grey, grey]) });
  }

  /** Moves the keyboard's brush over the photograph, and that below the brush where it would leave what is seen. */
  private moveCursor(from: Place, x: number, y: number): void {
    const { photo, node, corner, scale, margin } = this;
    if (!photo) return;
    const within = (v: number, low: number, high: number) => Math.max(low, Math.min(high, v));
    const wanted = {
      x: within(from.x + x, corner.x + scale / 2, corner.x + (photo.width - 0.5) * scale),
      y: within(from.y + y, corner.y + scale / 2, corner.y + (photo.height - 0.5) * scale),
    };
    this.cursor = { x: within(wanted.x, margin.left, node.clientWidth - margin.right), y: within(wanted.y, margin.top, node.clientHeight - margin.bottom) };
    this.moveBy(this.cursor.x - wanted.x, this.cursor.y - wanted.y);
  }
  /** The keyboard's brush: arrows move it, Enter begins and ends. With the hand, arrows move the photograph. */
  private key(e: KeyboardEvent): void {
    const steps: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[e.key];
    if (!step && e.key !== "Enter") return;
    e.preventDefault();
    e.stopPropagation();
    this.cursor ??= { x: this.node.clientWidth / 2, y: this.node.clientHeight / 2 };
    if (step && this.tool === "hand") {
      const length = e.shiftKey ? 200 : 40;
      this.moveBy(step[0] * length, step[1] * length);
    } else if (step) {
      const length = e.shiftKey ? 40 : Math.max(2, Math.min(this.radius / 2, 12));
      this.moveCursor(this.cursor, step[0] * length, step[1] * length);
      if (this.growing && !this.lineFrom) this.grow([this.pointOf(this.cursor)]);
    } else if (this.growing) {
      if (this.lineFrom) this.grow([this.pointOf(this.cursor)]);
      this.finishStroke();
    } else if (this.tool === "picker") {
      this.pick(this.cursor);
    } else if (this.tool !== "hand") {
      this.startStroke(this.cursor, 1, false);
      // Shift + Enter, and a line, go on with the arrows until the next Enter.
      if (!e.shiftKey && this.tool !== "line") this.finishStroke();
    }
    this.redraw();
    this.tell();
  }
}
