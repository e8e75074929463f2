/** What all parts of the studio share: the server's state, the strokes, the brush, and what is open. */

import { toast } from "../ui/dom";
import { Api, Lost, Refusal } from "./api";
import { Brush } from "./brush";
import { StrokeDocument } from "./document";
import type { Scene, SceneView, State } from "./protocol";
import { words } from "./words";

export class Session {
  state: State;
  isLost = false;
  readonly strokes: StrokeDocument;
  readonly brush = new Brush();
  /** Number of the photograph that is painted on, else -1. */
  photo = -1;
  /** Id of the stroke that is selected. */
  selected = "";
  private changed = new Set<(state: State) => void>();

  constructor(readonly api: Api, readonly scene: Scene, state: State) {
    this.state = state;
    this.strokes = new StrokeDocument(api, localStorage, `cnerf-studio-strokes ${scene.run}`);
    this.strokes.told = (what) => {
      if (what === "lost") this.lose();
      else if (what === "merged") toast(words.merged);
      else if (what === "unsent") toast(words.unsent);
      else toast(words.unsaved + what.message);
    };
  }

  get view(): SceneView | null {
    return this.scene.views[this.photo] ?? null;
  }
  get isReadOnly(): boolean {
    return this.state.writer !== "" && this.state.writer !== this.api.client;
  }
  get isBusy(): boolean {
    return this.state.task !== "";
  }
  get hasColors(): boolean {
    return this.state.take !== "" || this.state.unkept;
  }

  /** Calls back after every change of the server's state, and when it is lost or comes back. */
  onState(callback: (state: State) => void): void {
    this.changed.add(callback);
  }
  tell(): void {
    for (const callback of this.changed) callback(this.state);
  }

  async begin(): Promise<void> {
    this.api.listen((state) => this.hear(state), () => this.lose());
    await this.strokes.load();
  }
  private hear(state: State): void {
    const wasLost = this.isLost;
    this.isLost = false;
    this.state = state;
    if (wasLost) {
      toast(words.back);
      void this.strokes.load().catch((problem) => this.explain(problem));
    } else if (state.strokes > this.strokes.revision) {
      void this.strokes.follow(state.strokes).catch((problem) => this.explain(problem));
    }
    this.tell();
  }
  lose(): void {
    if (this.isLost) return;
    this.isLost = true;
    this.tell();
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
  async send(query: Record<string, string>, file: Blob): Promise<void> {
    if (!/^image\/(png|jpeg|tiff|webp)$/.test(file.type)) return toast(words.notAPicture);
    if (file.size > 64 * 2 ** 20) return toast(words.tooLarge);
    try {
      await this.api.picture(query, file);
    } catch (problem) {
      this.explain(problem);
    }
  }
  colour(): void {
    void this.order({ order: this.isBusy ? "stop" : "colour" });
  }
}
