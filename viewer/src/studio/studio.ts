/** The studio: the scene from the field, photographs to paint on, and everything around them. */

import { isTaken } from "../input";
import { Curve, withPoint, type CurvePoint } from "../ui/curve";
import { acceptsFiles, button, el, icon, iconButton, segments, toast } from "../ui/dom";
import { Api } from "./api";
import { tools } from "./brush";
import { Easel } from "./easel";
import { FieldView } from "./field";
import { Palette } from "./palette";
import { commandsPanel, finishPanel, ideasPanel, mayLeaveNow, notice, strokesPanel, TakesPanel, trainingPanel } from "./panels";
import { limits, type State } from "./protocol";
import { receive } from "./reception";
import { Session } from "./session";
import { Strip } from "./strip";
import "./studio.css";
import { Toolbar } from "./toolbar";
import { words } from "./words";

/** Pictures that are painted at free viewpoints: pixels of the longer side at most. */
const longestViewpoint = 1024;

class Studio {
  readonly field: FieldView;
  readonly easel: Easel;
  readonly strip: Strip;
  readonly palette: Palette;
  readonly takes: TakesPanel;
  private toolbar: Toolbar;
  private strokes: HTMLElement & { refresh(): void };
  private stage = el("div", { class: "stage studio-stage", id: "stage" });
  /** Name of the view that is to be opened. */
  private wanted = "";
  private isPlacing = false;
  private help = el("dialog", { class: "card help", "aria-label": words.keysTitle });

  constructor(readonly session: Session, private readonly root: HTMLElement) {
    this.field = new FieldView(session);
    this.easel = new Easel(session);
    this.strip = new Strip(session, (index, fly) => (fly ? this.lookThrough(index) : void this.paint(index)));
    this.palette = new Palette(session.brush);
    this.takes = new TakesPanel(session, this.field);
    this.toolbar = new Toolbar(session, this.easel, () => this.togglePanel(true));
    this.strokes = strokesPanel(session) as unknown as HTMLElement & { refresh(): void };
    this.build();
    this.listen();
    this.field.begin(this.sceneKeys(), () => !this.isPainting && !document.querySelector("dialog[open]"));
  }
  get isPainting(): boolean {
    return this.session.open !== "";
  }

  async paint(index: number): Promise<void> {
    const { session } = this;
    const { views } = session;
    const next = views[(index + views.length) % views.length];
    if (next.held_out) return toast(words.heldOut(next.name));
    if (!(await this.hold(next.name))) return;
    this.field.hidden = true;
    document.body.classList.add("painting");
    const number = session.views.findIndex((view) => view.name === next.name);
    this.strip.mark(number);
    await this.easel.open(number);
    this.strokes.refresh();
    this.easel.canvas.focus({ preventScroll: true });
  }
  /**
   * A viewpoint stays while it is open, and goes afterwards where nothing was painted at it.
   * @param name  of the view that is wanted next, "" = none
   * @return whether it is still the one that is wanted
   */
  private async hold(name: string): Promise<boolean> {
    this.wanted = name;
    const { strokes, isReadOnly } = this.session;
    if (!isReadOnly) await strokes.hold(strokes.savedViewpoints.find((v) => v.name === name) ?? null);
    return this.wanted === name && (name === "" || this.session.views.some((view) => view.name === name));
  }
  /** On the photograph of the camera that is looked through, else on a new viewpoint's picture. */
  async paintHere(): Promise<void> {
    const { session, field } = this;
    const { strokes } = session;
    if (this.isPainting || this.isPlacing) return;
    if (field.captureCamera >= 0) return this.paint(field.captureCamera);
    if (session.isReadOnly) return toast(words.readOnly);
    if (strokes.viewpoints.length >= limits.viewpoints) return toast(words.tooManyViewpoints(limits.viewpoints));
    this.isPlacing = true;
    const name = strokes.freeViewpoint();
    const view = field.viewHere(longestViewpoint);
    // A camera on its way stops here.
    field.setView(field.view);
    await strokes.hold({ name, ...view });
    this.isPlacing = false;
    const index = session.views.findIndex((v) => v.name === name);
    // Where it could not be saved there is no picture of it.
    if (index < 0) return strokes.hold(null);
    return this.paint(index);
  }
  /** The next one that can be painted on. */
  private step(direction: 1 | -1): void {
    const { photo, views } = this.session;
    let index = photo;
    do index = (index + direction + views.length) % views.length;
    while (views[index].held_out && index !== photo);
    void this.paint(index);
  }
  private lookThrough(index: number): void {
    if (this.isPainting) this.leave();
    this.field.goToCamera(index);
  }
  leave(): void {
    const { photo } = this.session;
    this.easel.close();
    document.body.classList.remove("painting");
    this.field.hidden = false;
    if (photo >= 0) this.field.goToCamera(photo, 0);
    else this.field.setView(this.field.view);
    void this.hold("");
    this.field.canvas.focus({ preventScroll: true });
    this.strokes.refresh();
  }

  // The page.

  private build(): void {
    const { session, field, easel } = this;
    this.stage.append(field.node, easel.node);
    const panel = el("aside", { class: "panel", id: "panel", "aria-label": words.panel }, el("div", { class: "only-painting" }, this.palette.node), trainingPanel(), this.strokes,
      el("div", { class: "after-training" }, this.takes.node, ideasPanel(session, (file) => void this.reference(file)), finishPanel(session)), commandsPanel(session));
    this.buildHelp();
    this.root.append(this.stage, this.toolbar.node, this.head(), panel, this.foot(), notice(session), this.help);
    session.onState(() => document.body.classList.toggle("training", session.isTraining));
    session.strokes.onChange(() => this.isPainting && session.photo < 0 && session.strokes.isSaved && this.leave());
    document.body.classList.add("studio");
    if (innerWidth > 900) document.body.classList.add("panel-open");
  }
  private head(): HTMLElement {
    const { session } = this;
    const status = el("p", { id: "status" });
    const colour = el("button", { type: "button", class: "button primary", id: "colour", onclick: () => session.colour() });
    const undo = iconButton("undo", words.undo, () => session.strokes.undo(), "undo");
    const redo = iconButton("redo", words.redo, () => session.strokes.redo(), "redo");
    const bar = el("div", { class: "bar" });
    const progress = el("div", { class: "task", role: "progressbar", "aria-valuemin": "0", "aria-valuemax": "100", hidden: true }, bar);
    const title = el("h1");
    const curve = this.curve();
    const update = () => {
      const { state, strokes, isReadOnly, isTraining } = session;
      const all = Object.entries(state.figures).map(([name, value]) => words.figure(name, value));
      // A training has more figures than are worth reading while it runs.
      const figures = isTraining && "psnr" in state.figures ? [words.dB(state.figures.psnr)] : all;
      status.title = isTraining ? all.join(" · ") : "";
      title.textContent = session.scene.title || words.program;
      status.textContent = state.task ? [words.tasks[state.task] ?? state.task, words.percent(state.fraction), ...figures].join(" · ") : [state.message || (isTraining ? "" : words.of(state.take)), state.unkept ? words.unkept : ""].filter(Boolean).join(" · ");
      status.classList.toggle("failed", state.failed && !state.task);
      colour.textContent = state.task ? words.stop : isTraining ? words.train : words.colour;
      colour.title = state.task ? words.stopTitle : isTraining ? words.trainTitle : words.colourTitle;
      colour.classList.toggle("stop", state.task !== "");
      colour.disabled = isReadOnly || session.isLost;
      undo.disabled = isReadOnly || !strokes.canUndo;
      redo.disabled = isReadOnly || !strokes.canRedo;
      progress.hidden = state.task === "";
      progress.setAttribute("aria-valuenow", String(Math.round(100 * state.fraction)));
      bar.style.width = `${100 * state.fraction}%`;
    };
    session.onState(update);
    session.onScene(update);
    session.strokes.onChange(update);
    update();
    return el("header", { class: "head" }, progress,
      el("div", { class: "title" }, el("img", { src: "./icon.svg", alt: "", width: 28, height: 28 }), el("div", {}, title, status), curve),
      el("div", { class: "tools" }, undo, redo, iconButton("help", words.help, () => this.toggleHelp(), "help"), iconButton("panel", words.panel, () => this.togglePanel(), "settings"), colour));
  }
  /** How good the field has become, while it is trained. */
  private curve(): HTMLElement {
    const { session } = this;
    const curve = new Curve(96, 30);
    const node = el("figure", { class: "small-curve", id: "curve", role: "img", hidden: true });
    let points: CurvePoint[] = [];
    node.append(curve.node);
    session.onState(({ figures, task }) => {
      if (session.isTraining && task === "train" && figures.psnr !== undefined) {
        points = withPoint(points, [performance.now(), figures.psnr]);
        curve.draw(points);
        node.setAttribute("aria-label", words.curve(figures.psnr));
        node.title = words.curve(figures.psnr);
      }
      node.hidden = !session.isTraining || points.length < 2;
    });
    return node;
  }
  private foot(): HTMLElement {
    const { session, field, easel } = this;
    const name = el("span", { class: "camera-name", id: "camera-name" });
    const step = (label: string, sign: string, onclick: () => void, only: string) => el("button", { type: "button", class: `step ${only}`, title: label, "aria-label": label, onclick }, sign);
    const camera = (by: number) => () => field.goToCamera(Math.max(field.captureCamera, -1) + by);
    const paintHere = button(words.paintHere, () => void this.paintHere(), { title: words.paintHereTitle, id: "paint-here" });
    const mode = segments<"orbit" | "fly">("mode", [["orbit", words.orbit], ["fly", words.fly]], "orbit", (value) => (field.fly = value === "fly"));
    mode.node.classList.add("only-scene");
    const bar = el("div", { class: "camera-bar" },
      button(words.backToScene, () => this.leave(), { class: "button only-painting", title: words.backToSceneTitle, id: "leave" }),
      step(words.previousCamera, "‹", camera(-1), "only-scene"), step(words.previousPhoto, "‹", () => this.step(-1), "only-painting"), name,
      step(words.nextCamera, "›", camera(1), "only-scene"), step(words.nextPhoto, "›", () => this.step(1), "only-painting"),
      mode.node, paintHere, this.zoomButtons(), this.toolbar.tints);
    this.toolbar.tints.classList.add("only-painting");
    const update = () => {
      const index = this.isPainting ? session.photo : field.captureCamera;
      const view = this.session.views[index];
      name.textContent = view ? words.view(view.name) : words.freeView;
      paintHere.hidden = this.isPainting || (view ? view.held_out : session.isReadOnly);
      paintHere.title = view ? words.paintHereTitle : words.paintFreeTitle;
      this.strip.mark(index);
      this.strip.setReach(easel.tint === "reach");
      this.toolbar.node.hidden = !this.isPainting;
      if (this.isPainting) this.palette.setLightness(easel.lightness);
    };
    field.onChange(update);
    easel.onChange(update);
    session.onState(update);
    update();
    return el("footer", { class: "foot" }, bar, this.strip.node);
  }
  private zoomButtons(): HTMLElement {
    const { easel } = this;
    const make = (sign: string, title: string, onclick: () => void) => el("button", { type: "button", class: "step", title, "aria-label": title, onclick }, sign);
    return el("div", { class: "zoom only-painting" }, make("−", words.zoomOut, () => easel.zoomBy(1 / 1.5)), make("+", words.zoomIn, () => easel.zoomBy(1.5)), el("button", { type: "button", class: "step", title: words.fit, "aria-label": words.fit, onclick: () => easel.fit() }, icon("frame")));
  }
  private buildHelp(): void {
    const rows = (list: [string, string][]) => el("dl", {}, ...list.flatMap(([key, what]) => [el("dt", {}, key), el("dd", {}, what)]));
    this.help.append(el("h1", {}, words.keysTitle), ...Object.values(words.keys).map(rows), el("p", { class: "note" }, words.keysNote), button(words.close, () => this.help.close()));
    this.help.addEventListener("click", (e) => e.target === this.help && this.help.close());
  }
  private togglePanel(open?: boolean): void {
    document.body.classList.toggle("panel-open", open);
    this.easel.layout();
  }
  private toggleHelp(): void {
    if (this.help.open) this.help.close();
    else this.help.showModal();
  }

  // Keys and drops.

  private sceneKeys(): Record<string, () => void> {
    const { field } = this;
    const current = () => Math.max(field.captureCamera, -1);
    return {
      r: () => field.reset(), f: () => field.frame(),
      "[": () => field.goToCamera(current() - 1), "]": () => field.goToCamera(current() + 1),
      g: () => field.setWipe(field.wipe < 0.5 ? 1 : 0),
    };
  }
  private paintingKeys(): Record<string, () => void> {
    const { brush } = this.session;
    const { easel } = this;
    const sized = (factor: number) => () => brush.set({ size: brush.settings.size * factor });
    const softened = (by: number) => () => brush.set({ softness: brush.settings.softness + by });
    const tints = ["reach", "now", "none"] as const;
    return {
      ...Object.fromEntries(tools.map(([tool, key]) => [key, () => brush.set({ tool })])),
      "[": sized(1 / 1.2), "]": sized(1.2), "{": softened(-0.1), "}": softened(0.1),
      "+": () => easel.zoomBy(1.5), "=": () => easel.zoomBy(1.5), "-": () => easel.zoomBy(1 / 1.5), "0": () => easel.fit(), "1": () => easel.actualSize(),
      o: () => easel.setTint(tints[(tints.indexOf(easel.tint) + 1) % tints.length]),
      ",": () => this.step(-1), ".": () => this.step(1),
      " ": () => easel.hold("hand"),
      Escape: () => (easel.isDrawing ? easel.cancel() : this.leave()),
      Delete: () => this.session.removeSelected(),
    };
  }
  private listen(): void {
    const painting = this.paintingKeys();
    addEventListener("keydown", (e) => this.key(e, painting));
    addEventListener("keyup", (e) => e.key === " " && this.easel.hold(null));
    addEventListener("blur", () => this.easel.hold(null));
    this.listenToDrops();
    addEventListener("beforeunload", (e) => !this.session.strokes.isSaved && !this.session.isLost && e.preventDefault());
  }
  private key(e: KeyboardEvent, painting: Record<string, () => void>): void {
    const target = e.target as HTMLElement;
    const isText = target instanceof HTMLInputElement && target.type === "text";
    if (isText || target.closest?.("dialog") || target instanceof HTMLSelectElement) return;
    const key = e.key.length === 1 ? e.key.toLowerCase() : e.key;
    const both: Record<string, () => void> = { c: () => this.session.isReadOnly || this.session.colour(), "?": () => this.toggleHelp(), p: () => this.togglePanel() };
    let action: (() => void) | undefined;
    if (e.ctrlKey || e.metaKey) {
      if (key === "z") action = () => !this.session.isReadOnly && (e.shiftKey ? this.session.strokes.redo() : this.session.strokes.undo());
      if (key === "y") action = () => !this.session.isReadOnly && this.session.strokes.redo();
    } else {
      if (isTaken(e)) return;
      if (key === "Enter" && !this.isPainting) action = () => void this.paintHere();
      else action = both[key] ?? (this.isPainting ? painting[key] : undefined);
      if (this.isPainting && this.session.isReadOnly && key === "Delete") return;
    }
    if (!action) return;
    e.preventDefault();
    action();
  }

  private async reference(file: File): Promise<void> {
    void this.palette.showPicture(file);
    if (await mayLeaveNow(this.session)) await this.session.send({ kind: "reference", name: file.name }, file);
  }
  private listenToDrops(): void {
    const placeOf = (e: DragEvent) => ((e.target as HTMLElement).closest?.("[data-drop=picker]") ? "picker" : this.isPainting ? "easel" : "scene");
    const textOf = (e: DragEvent) => ({ picker: words.dropPicker, easel: words.dropEasel, scene: this.session.isTraining ? words.afterTraining : words.dropScene })[placeOf(e)];
    acceptsFiles(this.root, textOf, (e) => {
      const file = e.dataTransfer?.files[0];
      const place = placeOf(e);
      if (!file) return;
      if (place === "picker") void this.palette.showPicture(file);
      else if (this.session.isReadOnly) toast(words.readOnly);
      else if (place === "easel" && file.type !== "image/png") toast(words.notPainted);
      else if (place === "easel") void this.session.sendPainted(file);
      else if (this.session.isTraining) toast(words.afterTraining);
      else void this.reference(file);
    });
  }
}

/** @param root  what the page is built into */
export async function showStudio(root: HTMLElement, first: State): Promise<void> {
  const api = new Api();
  let state = first;
  let leaveReception = () => {};
  if (state.stage === "photographs") {
    leaveReception = await receive(root, api, state);
    state = await api.state();
  }
  // After the state: it is not older than that says.
  const scene = await api.scene();
  document.title = scene.title ? `${scene.title} · ${words.program}` : words.program;
  document.body.classList.add("loading");
  const session = new Session(api, scene, state);
  const studio = new Studio(session, root);
  await session.begin();
  // Only now: a page that hears nothing in between would lose the right to paint.
  leaveReception();
  session.tell();
  // For scripts and tests.
  Object.assign(window, { cnerf: { studio, session } });
}
