/** The studio: the scene from the field, photographs to paint on, and everything around them. */

import { button, el, icon, iconButton, segments, toast } from "../ui/dom";
import { Api } from "./api";
import { tools } from "./brush";
import { Easel } from "./easel";
import { FieldView } from "./field";
import { Palette } from "./palette";
import { commandsPanel, finishPanel, ideasPanel, strokesPanel, TakesPanel } from "./panels";
import type { Scene, State } from "./protocol";
import { Session } from "./session";
import { Strip } from "./strip";
import "./studio.css";
import { Toolbar } from "./toolbar";
import { words } from "./words";

class Studio {
  readonly field: FieldView;
  readonly easel: Easel;
  readonly strip: Strip;
  readonly palette: Palette;
  readonly takes: TakesPanel;
  private toolbar: Toolbar;
  private strokes: HTMLElement & { refresh(): void };
  private stage = el("div", { class: "stage studio-stage", id: "stage" });
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
    return this.session.photo >= 0;
  }

  async paint(index: number): Promise<void> {
    const { views } = this.session.scene;
    const next = (index + views.length) % views.length;
    if (views[next].held_out) return toast(words.heldOut(views[next].name));
    this.field.hidden = true;
    document.body.classList.add("painting");
    this.strip.mark(next);
    await this.easel.open(next);
    this.strokes.refresh();
    this.easel.canvas.focus({ preventScroll: true });
  }
  /** The next photograph that can be painted on. */
  private step(direction: 1 | -1): void {
    const { views } = this.session.scene;
    let index = this.session.photo;
    do index = (index + direction + views.length) % views.length;
    while (views[index].held_out && index !== this.session.photo);
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
    this.field.canvas.focus({ preventScroll: true });
    this.strokes.refresh();
  }

  // The page.

  private build(): void {
    const { session, field, easel } = this;
    this.stage.append(field.node, easel.node);
    const panel = el("aside", { class: "panel", id: "panel", "aria-label": words.panel }, el("div", { class: "only-painting" }, this.palette.node), this.strokes, this.takes.node,
      ideasPanel(session, (file) => this.reference(file)), finishPanel(session), commandsPanel(session));
    this.buildHelp();
    this.root.append(this.stage, this.toolbar.node, this.head(), panel, this.foot(), this.notice(), this.help);
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
    const update = () => {
      const { state, strokes, isReadOnly } = session;
      const figures = Object.entries(state.figures ?? {}).map(([name, value]) => words.figure(name, value));
      status.textContent = state.task ? [words.tasks[state.task] ?? state.task, words.percent(state.fraction), ...figures].join(" · ") : [state.message || words.of(state.take), state.unkept ? words.unkept : ""].filter(Boolean).join(" · ");
      status.classList.toggle("failed", state.failed && !state.task);
      colour.textContent = state.task ? words.stop : words.colour;
      colour.title = state.task ? words.stopTitle : words.colourTitle;
      colour.classList.toggle("stop", state.task !== "");
      colour.disabled = isReadOnly || session.isLost || (!state.task && !state.ready);
      undo.disabled = isReadOnly || !strokes.canUndo;
      redo.disabled = isReadOnly || !strokes.canRedo;
      progress.hidden = state.task === "";
      progress.setAttribute("aria-valuenow", String(Math.round(100 * state.fraction)));
      bar.style.width = `${100 * state.fraction}%`;
    };
    session.onState(update);
    session.strokes.onChange(update);
    update();
    return el("header", { class: "head" }, progress,
      el("div", { class: "title" }, el("img", { src: "./icon.svg", alt: "", width: 28, height: 28 }), el("div", {}, el("h1", {}, session.scene.title || words.program), status)),
      el("div", { class: "tools" }, undo, redo, iconButton("help", words.help, () => this.toggleHelp(), "help"), iconButton("panel", words.panel, () => this.togglePanel(), "settings"), colour));
  }
  private foot(): HTMLElement {
    const { session, field, easel } = this;
    const name = el("span", { class: "camera-name", id: "camera-name" });
    const step = (label: string, sign: string, onclick: () => void, only: string) => el("button", { type: "button", class: `step ${only}`, title: label, "aria-label": label, onclick }, sign);
    const camera = (by: number) => () => field.goToCamera(Math.max(field.captureCamera, -1) + by);
    const paintHere = button(words.paintHere, () => void this.paint(field.captureCamera), { title: words.paintHereTitle, id: "paint-here" });
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
      const view = session.scene.views[index];
      name.textContent = view ? view.name.replace(/^.*\//, "") : words.freeView;
      paintHere.hidden = this.isPainting || !view || view.held_out;
      this.strip.mark(index);
      this.strip.setReach(easel.tint === "reach");
      this.toolbar.node.hidden = !this.isPainting;
      if (this.isPainting) this.palette.setLightness(easel.lightness);
    };
    field.onChange(update);
    easel.onChange(update);
    update();
    return el("footer", { class: "foot" }, bar, this.strip.node);
  }
  private zoomButtons(): HTMLElement {
    const { easel } = this;
    const make = (sign: string, title: string, onclick: () => void) => el("button", { type: "button", class: "step", title, "aria-label": title, onclick }, sign);
    return el("div", { class: "zoom only-painting" }, make("−", words.zoomOut, () => easel.zoomBy(1 / 1.5)), make("+", words.zoomIn, () => easel.zoomBy(1.5)), el("button", { type: "button", class: "step", title: words.fit, "aria-label": words.fit, onclick: () => easel.fit() }, icon("frame")));
  }
  private notice(): HTMLElement {
    const { session } = this;
    const node = el("div", { class: "notice", id: "notice", role: "status", hidden: true });
    session.onState(() => {
      node.textContent = session.isLost ? words.lost : words.readOnly;
      node.hidden = !session.isLost && !session.isReadOnly;
      document.body.classList.toggle("is-read-only", session.isReadOnly);
    });
    return node;
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
      Delete: () => this.session.strokes.remove(this.session.selected),
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
      // Buttons keep their own keys.
      const isControl = target instanceof HTMLButtonElement || target instanceof HTMLInputElement || target.tagName === "SUMMARY";
      if (isControl && (key === " " || key === "Enter")) return;
      if (key === "Enter" && !this.isPainting && target.tagName !== "A" && this.field.captureCamera >= 0) action = () => void this.paint(this.field.captureCamera);
      else action = both[key] ?? (this.isPainting ? painting[key] : undefined);
      if (this.isPainting && this.session.isReadOnly && key === "Delete") return;
    }
    if (!action) return;
    e.preventDefault();
    action();
  }

  reference(file: File): void {
    void this.palette.showPicture(file);
    void this.session.send({ kind: "reference", name: file.name }, file);
  }
  private listenToDrops(): void {
    const veil = el("div", { class: "drop-veil", hidden: true });
    this.root.append(veil);
    const placeOf = (e: DragEvent) => ((e.target as HTMLElement).closest?.("[data-drop=picker]") ? "picker" : this.isPainting ? "easel" : "scene");
    addEventListener("dragover", (e) => {
      if (!e.dataTransfer?.types.includes("Files")) return;
      e.preventDefault();
      const place = placeOf(e);
      veil.hidden = false;
      veil.textContent = place === "picker" ? words.dropPicker : place === "easel" ? words.dropEasel : words.dropScene;
    });
    addEventListener("dragleave", (e) => (veil.hidden = e.relatedTarget === null || veil.hidden));
    addEventListener("drop", (e) => {
      e.preventDefault();
      veil.hidden = true;
      const file = e.dataTransfer?.files[0];
      const place = placeOf(e);
      if (!file) return;
      if (place === "picker") void this.palette.showPicture(file);
      else if (this.session.isReadOnly) toast(words.readOnly);
      else if (place === "easel" && file.type === "image/png") void this.session.send({ kind: "stroke", view: String(this.session.photo) }, file);
      else this.reference(file);
    });
  }
}

/** @param root  what the page is built into */
export async function showStudio(root: HTMLElement, scene: Scene): Promise<void> {
  document.title = `${scene.title} · ${words.program}`;
  document.body.classList.add("loading");
  const api = new Api();
  const state: State = await api.state();
  const session = new Session(api, scene, state);
  const studio = new Studio(session, root);
  await session.begin();
  session.tell();
  // For scripts and tests.
  Object.assign(window, { cnerf: { studio, session } });
}
