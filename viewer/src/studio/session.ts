/** What all parts of the studio share: the server's state, the strokes, the brush, and what is open. */

import { toast } from "../ui/dom";
import { Api, Lost, Refusal } from "./api";
import { Brush } from "./brush";
import { StrokeDocument } from "./document";
import { limits, type Scene, type SceneView, type State, type Viewpoint } from "./protocol";
import { Latest } from "./reach";
import { storage } from "./storage";
import { words } from "./words";

/** Between two questions whether the server is back, milliseconds. */
const seekRest = 2000;

export class Session {
  state: State;
  isLost = false;
  readonly strokes: StrokeDocument;
  readonly brush = new Brush();
  /** Name of the photograph, or the viewpoint, that is painted on, else "". */
  open = "";
  /** Id of the stroke that is selected. */
  selected = "";
  private changed = new Set<(state: State) => void>();
  private refined = new Set<() => void>();
  private sceneSeen: number;
  private refining = new Latest();
  private returning: Promise<void> | null = null;
  private painting: Promise<void> = Promise.resolve();
  private all: { viewpoints: readonly Viewpoint[]; views: readonly SceneView[] } | null = null;
  private stopListening = () => {};
  private hasEnded = false;
  /** Whether the server's news come in. */
  private streams = true;
  private seeking: Promise<void> | null = null;

  /** @param scene  what the server said after `state` */
  constructor(readonly api: Api, readonly scene: Scene, state: State) {
    this.sceneSeen = state.scene;
    this.state = state;
    this.strokes = new StrokeDocument(api, storage("localStorage"), `cnerf-studio-strokes ${scene.run}`);
    this.strokes.told = (what) => {
      if (what === "lost") this.lose();
      else if (what === "merged") toast(words.merged);
      else if (what === "unsent") toast(words.unsent);
      else toast(words.unsaved + what.message);
    };
  }

  /** All that can be painted on, by its number: the photographs, then the viewpoints that the server has. */
  get views(): readonly SceneView[] {
    const { savedViewpoints } = this.strokes;
    if (this.all?.viewpoints !== savedViewpoints) {
      const own = savedViewpoints.map((v): SceneView => ({ ...v, held_out: false, width: v.lens.width, height: v.lens.height }));
      this.all = { viewpoints: savedViewpoints, views: [...this.scene.views, ...own] };
    }
    return this.all.views;
  }
  /** Number of the view that is painted on, else -1. */
  get photo(): number {
    return this.open === "" ? -1 : this.views.findIndex((v) => v.name === this.open);
  }
  get view(): SceneView | null {
    return this.views[this.photo] ?? null;
  }
  isViewpoint(index: number): boolean {
    return index >= this.scene.views.length;
  }
  /** Numbers of viewpoints are given anew, addresses are not: their pictures are told apart by this. */
  stamp(index: number): string {
    const { name, position, rotation } = this.views[index];
    return this.isViewpoint(index) ? `&at=${name}.${[...position, ...rotation[2]].map((v) => v.toFixed(3)).join(".")}` : "";
  }
  /** Removes the selected stroke, if it is seen. */
  removeSelected(): void {
    if (this.strokes.of(this.open).some((s) => s.id === this.selected)) this.strokes.remove(this.selected);
  }
  get isTraining(): boolean {
    return this.state.stage === "training";
  }
  get isReadOnly(): boolean {
    return this.state.writer !== "" && this.state.writer !== this.api.client;
  }
  get isBusy(): boolean {
    return this.state.task !== "";
  }

  /** Calls back after every change of the server's state, and when it is lost or comes back. */
  onState(callback: (state: State) => void): void {
    this.changed.add(callback);
  }
  tell(): void {
    for (const callback of this.changed) callback(this.state);
  }
  /** Calls back after the cameras became others. */
  onScene(callback: () => void): void {
    this.refined.add(callback);
  }

  async begin(): Promise<void> {
    await Promise.all([this.listen(), this.strokes.load()]);
    this.strokes.suggestEverywhere(this.state.take === "");
  }
  /** Hears of the server's state, without strokes. @return when it heard first: the server knows of this page then */
  listen(): Promise<void> {
    return new Promise((first) => {
      this.stopListening = this.api.listen((state) => {
        this.streams = true;
        this.hear(state);
        first();
      }, () => {
        this.streams = false;
        this.lose();
      });
    });
  }
  end(): void {
    this.stopListening();
    this.hasEnded = true;
    this.isLost = false;
    this.changed.clear();
  }
  private hear(state: State): void {
    const wasLost = this.isLost;
    this.isLost = false;
    this.state = state;
    this.strokes.suggestEverywhere(state.take === "");
    if (state.stage === "photographs") {
      // There is nothing yet that strokes could be on.
      if (wasLost) toast(words.back);
    } else if (wasLost || this.strokes.isAway) {
      if (wasLost) toast(words.back);
      void (this.returning ??= this.returned().finally(() => (this.returning = null))).catch((problem) => this.explain(problem));
    } else if (state.strokes > this.strokes.revision) {
      void this.strokes.follow(state.strokes).then(() => this.sendWaiting()).catch((problem) => this.explain(problem));
    } else {
      void this.sendWaiting().catch((problem) => this.explain(problem));
    }
    if (state.scene !== this.sceneSeen && this.scene.views.length > 0) void this.refining.run(() => this.refine());
    this.tell();
  }
  /** A server answers again: this run's, or that of another one on the same port. */
  private async returned(): Promise<void> {
    if ((await this.api.scene()).run !== this.scene.run) return this.reload();
    this.strokes.isAway = false;
    await this.strokes.load();
  }
  /** Nothing of this page fits the server any more. Unsent strokes stay on the shelf of their run. */
  private reload(): void {
    // The shelf may be too small for a long painting.
    if (!this.strokes.isSaved && !this.strokes.isKept) return toast(words.otherRun);
    this.isLost = true;
    location.reload();
  }
  /** What was painted while the server was away, and another tab painted. */
  private async sendWaiting(): Promise<void> {
    if (this.strokes.isWaiting && !this.isReadOnly) await this.strokes.save();
  }
  /** Training made the cameras better: the same ones are given their new places. */
  private async refine(): Promise<void> {
    const { scene } = this.state;
    if (scene === this.sceneSeen) return;
    try {
      const next = await this.api.scene();
      const { views } = this.scene;
      if (next.run !== this.scene.run || next.views.length !== views.length || next.views.some((v, i) => v.name !== views[i].name)) {
        return this.reload();
      }
      next.views.forEach((view, i) => Object.assign(views[i], view));
      Object.assign(this.scene, next, { views });
      this.sceneSeen = scene;
      for (const callback of this.refined) callback();
    } catch (problem) {
      // The next state tries again.
      this.explain(problem);
    }
  }
  lose(): void {
    if (this.hasEnded) return;
    this.strokes.isAway = true;
    if (this.isLost) return;
    this.isLost = true;
    this.tell();
    void (this.seeking ??= this.seek().finally(() => (this.seeking = null)));
  }
  /** One request may fail while the stream lives, which says nothing as long as nothing changes. */
  private async seek(): Promise<void> {
    for (;;) {
      await new Promise((done) => setTimeout(done, seekRest));
      if (!this.isLost) return;
      const state = await this.api.state().catch(() => null);
      // A stream that broke says itself that it is back.
      if (state && this.isLost && this.streams) this.hear(state);
    }
  }
  explain(problem: unknown): void {
    if (problem instanceof Lost) this.lose();
    else if (problem instanceof Refusal) toast(problem.message);
    else throw problem;
  }

  /** @return whether the server took it */
  async order(order: Record<string, unknown>): Promise<boolean> {
    try {
      await this.strokes.save();
      const state = await this.api.order(order);
      if (state && state.version >= this.state.version) this.hear(state);
      return true;
    } catch (problem) {
      this.explain(problem);
      return false;
    }
  }
  /** @return what the server said; nothing where it did not take the picture */
  async send(query: Record<string, string>, file: Blob): Promise<State | undefined> {
    if (!/^image\/(png|jpeg|tiff|webp)$/.test(file.type)) return void toast(words.notAPicture);
    if (file.size > limits.pictureBytes) return void toast(words.tooLarge);
    try {
      return await this.api.picture(query, file);
    } catch (problem) {
      return void this.explain(problem);
    }
  }
  /** A painted PNG becomes a stroke on the view that is open. One at a time: each is known by what its list has more. */
  sendPainted(file: File): Promise<void> {
    const { open } = this;
    return (this.painting = this.painting.catch(() => undefined).then(() => this.addPainted(open, file)));
  }
  private async addPainted(name: string, file: File): Promise<void> {
    await this.strokes.save();
    const view = this.views.findIndex((v) => v.name === name);
    if (view < 0) return;
    const before = this.strokes.list;
    const state = await this.send({ kind: "stroke", view: String(view), name: file.name }, file);
    if (!state) return;
    try {
      await this.strokes.follow(state.strokes);
      this.strokes.adopt(before);
    } catch (problem) {
      this.explain(problem);
    }
  }
  colour(): void {
    void this.order({ order: this.isBusy ? "stop" : this.isTraining ? "train" : "colour" });
  }
}
