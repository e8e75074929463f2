/**
 * The strokes as a document, with the viewpoints they are painted at: undo and redo over every change, saved as it is
 * made, merged where another tab was faster.
 */

import { Changing } from "../changing";
import { Lost, Refusal } from "./api";
import type { Stroke, Viewpoint } from "./protocol";
import type { Shelf } from "./storage";

export type StrokeList = readonly Stroke[];
/** What undo and redo go between. */
interface Edition {
  list: StrokeList;
  everywhere: boolean;
}

/**
 * What `mine` changed since `base`, done to `theirs`: strokes are told apart by id. Where `theirs` is `base` this is
 * `mine`, order and all.
 */
export function merged(base: StrokeList, mine: StrokeList, theirs: StrokeList): StrokeList {
  if (theirs === base) return mine;
  if (mine === base) return theirs;
  const before = new Map(base.map((s) => [s.id, s]));
  const wanted = new Map(mine.map((s) => [s.id, s]));
  const there = new Set(theirs.map((s) => s.id));
  const same = (a: Stroke, b: Stroke) => a === b || JSON.stringify(a) === JSON.stringify(b);
  const kept = theirs
    .filter((s) => wanted.has(s.id) || !before.has(s.id))
    .map((s) => {
      const ours = wanted.get(s.id);
      const old = before.get(s.id);
      return ours && !(old && same(ours, old)) ? ours : s;
    });
  return [...kept, ...mine.filter((s) => !before.has(s.id) && !there.has(s.id))];
}

/** What strokes are saved to. */
export interface StrokeStore {
  strokes(): Promise<{ revision: number; strokes: Stroke[]; viewpoints: Viewpoint[]; everywhere: boolean }>;
  /** @return the new revision */
  putStrokes(strokes: StrokeList, revision: number, viewpoints: readonly Viewpoint[], everywhere: boolean): Promise<number>;
}
type Answer = Awaited<ReturnType<StrokeStore["strokes"]>>;

interface Kept {
  base: StrokeList;
  list: StrokeList;
  viewpoints?: Viewpoint[];
}

/** Answers that say what is wrong with the strokes, or who paints. Others say that this is not the server that was there. */
const refusesStrokes = new Set([400, 413, 423]);

const numberOf = (viewpoint: Viewpoint) => Number(/\d+$/.exec(viewpoint.name)?.[0] ?? 0);

export class StrokeDocument extends Changing {
  list: StrokeList = [];
  /** The list that the server has. */
  saved: StrokeList = this.list;
  /** The viewpoints that the server has, in its order: they are numbered after the views. */
  savedViewpoints: readonly Viewpoint[] = [];
  revision = 0;
  /** Strokes colour all that there is, not what lies within their reach. */
  everywhere = false;
  private isChosen = false;
  /** Every viewpoint this page has heard of: a redo brings back strokes of one that was dropped. */
  private known: Viewpoint[] = [];
  /** Name of the viewpoint that is open; it stays without strokes too. */
  private held = "";
  /** Counts the changes of the viewpoints, and of what is coloured, that are to be saved though no stroke changed. */
  private wish = 0;
  private savedWish = 0;
  /** The page tells: strokes of another tab came in; something could not be saved; unsent strokes were put back. */
  told: (what: "merged" | "unsent" | "lost" | Refusal) => void = () => {};
  private undone: [Edition, Edition][] = [];
  private done: [Edition, Edition][] = [];
  private busy: Promise<void> | null = null;
  /** The browser keeps what is unsent. */
  isKept = true;
  /** Nobody knows whose server answers, if one does: nothing is sent. */
  isAway = false;
  /** Strokes were promised to be sent, and another tab paints: they stay until it leaves. */
  isWaiting = false;

  constructor(private readonly store: StrokeStore, private readonly shelf: Shelf, private readonly shelfKey: string) {
    super();
  }

  get canUndo(): boolean {
    return this.done.length > 0;
  }
  get canRedo(): boolean {
    return this.undone.length > 0;
  }
  get isSaved(): boolean {
    return this.list === this.saved && this.wish === this.savedWish;
  }
  /** Strokes the server does not have in this form. */
  get unsaved(): Stroke[] {
    const there = new Set(this.saved);
    return this.list === this.saved ? [] : this.list.filter((s) => !there.has(s));
  }
  /** About how long the list is as it is sent. */
  get bytes(): number {
    return this.list.reduce((sum, s) => sum + 200 + 26 * s.points.length, 0);
  }
  of(view: string): Stroke[] {
    return this.list.filter((s) => s.view === view);
  }

  // Viewpoints.

  /** The viewpoints that are to be saved: those that are painted at, and the one that is open. */
  get viewpoints(): readonly Viewpoint[] {
    const painted = new Set(this.list.map((s) => s.view));
    return this.known.filter((v) => painted.has(v.name) || v.name === this.held).sort((a, b) => numberOf(a) - numberOf(b));
  }
  freeViewpoint(): string {
    return `viewpoint-${1 + Math.max(0, ...this.known.map(numberOf))}`;
  }
  /** Opens a viewpoint, or (null) none: the one that was open goes where nothing was painted at it. */
  async hold(viewpoint: Viewpoint | null): Promise<void> {
    const before = this.held;
    this.held = viewpoint?.name ?? "";
    if (viewpoint) this.learn([viewpoint]);
    const there = (name: string) => this.savedViewpoints.some((v) => v.name === name);
    const isStale = before !== this.held && there(before) && !this.list.some((s) => s.view === before);
    if (!isStale && !(viewpoint && !there(viewpoint.name))) return;
    this.wish += 1;
    await this.save();
  }
  private learn(viewpoints: readonly Viewpoint[]): void {
    const names = new Set(viewpoints.map((v) => v.name));
    this.known = [...viewpoints, ...this.known.filter((v) => !names.has(v.name))];
  }

  /** By the user. */
  setEverywhere(everywhere: boolean): void {
    this.isChosen = true;
    if (everywhere !== this.everywhere) this.step({ list: this.list, everywhere });
  }
  /** What suits the colours that strokes go on, as long as there are none and the user did not choose. */
  suggestEverywhere(everywhere: boolean): void {
    if (this.isChosen || this.list.length > 0 || this.saved.length > 0 || everywhere === this.everywhere) return;
    this.everywhere = everywhere;
    this.tell();
  }

  /** A change by the user: can be undone, and is saved. */
  change(next: StrokeList): void {
    if (next !== this.list) this.step({ list: next, everywhere: this.everywhere });
  }
  private step(next: Edition): void {
    this.remember({ list: this.list, everywhere: this.everywhere }, next);
    this.put(next);
  }
  private remember(before: Edition, after: Edition): void {
    this.done.push([before, after]);
    if (this.done.length > 500) this.done.shift();
    this.undone = [];
  }
  /** The server made strokes of pictures that this page sent, since the list was `before`: they can be undone too. */
  adopt(before: StrokeList): void {
    const { list, everywhere } = this;
    const known = new Set(before.map((s) => s.id));
    const without = list.filter((s) => s.kind !== "picture" || known.has(s.id));
    if (without.length === list.length) return;
    this.remember({ list: without, everywhere }, { list, everywhere });
    this.tell();
  }
  add(stroke: Stroke): void {
    this.change([...this.list, stroke]);
  }
  private has(id: string): boolean {
    return this.list.some((s) => s.id === id);
  }
  edit(id: string, changes: Partial<Stroke>): void {
    if (this.has(id)) this.change(this.list.map((s) => (s.id === id ? { ...s, ...changes } : s)));
  }
  /** Strokes of one word have one colour, as a palette gives it. */
  recolour({ id, word }: Stroke, color: string): void {
    this.change(this.list.map((s) => (s.id === id || (word && s.word === word) ? { ...s, color } : s)));
  }
  remove(id: string): void {
    if (this.has(id)) this.change(this.list.filter((s) => s.id !== id));
  }
  undo(): void {
    const step = this.done.pop();
    if (!step) return;
    this.undone.push(step);
    this.go(step[1], step[0]);
  }
  redo(): void {
    const step = this.undone.pop();
    if (!step) return;
    this.done.push(step);
    this.go(step[0], step[1]);
  }
  /** What others changed meanwhile stays. */
  private go(from: Edition, to: Edition): void {
    this.put({ list: merged(from.list, to.list, this.list), everywhere: from.everywhere === to.everywhere ? this.everywhere : to.everywhere });
  }
  private put({ list, everywhere }: Edition): void {
    if (everywhere !== this.everywhere) this.wish += 1;
    this.everywhere = everywhere;
    this.list = list;
    this.keep();
    this.tell();
    void this.save();
  }

  /** Gets the server's list, and puts back what it never got. Also after the server was away. */
  async load(): Promise<void> {
    await this.busy;
    const answer = await this.store.strokes();
    const kept = this.taken();
    // A page that has unsaved strokes itself knows them better than the shelf does.
    const { base, list, viewpoints } = this.isSaved && kept ? kept : { base: this.saved, list: this.list };
    const unsent = list !== base;
    if (viewpoints) this.learn(viewpoints);
    this.take(answer);
    this.list = unsent ? merged(base, list, answer.strokes) : answer.strokes;
    this.keep();
    this.tell();
    if (unsent) this.told("unsent");
    this.isWaiting = unsent;
    if (!this.isSaved) await this.save();
  }
  /** Another tab wrote: its list is taken, with what is unsaved here on top. */
  async follow(revision: number): Promise<void> {
    await this.busy;
    if (revision <= this.revision) return;
    const answer = await this.store.strokes();
    // A save, or another call of this, may have been faster.
    if (answer.revision > this.revision) this.receive(answer);
    if (!this.isSaved && !this.isWaiting) await this.save();
  }
  private async fetched(): Promise<void> {
    this.receive(await this.store.strokes());
  }
  private receive(answer: Answer): void {
    const unsaved = this.list !== this.saved;
    this.list = unsaved ? merged(this.saved, this.list, answer.strokes) : answer.strokes;
    this.take(answer);
    this.tell();
    if (unsaved) this.told("merged");
  }
  private take({ revision, strokes, viewpoints, everywhere }: Answer): void {
    if (strokes.length > 0 && this.wish === this.savedWish) this.everywhere = everywhere;
    this.saved = strokes;
    this.savedViewpoints = viewpoints;
    this.learn(viewpoints);
    this.revision = revision;
  }

  /** Saves until everything is; one request at a time. */
  save(): Promise<void> {
    return (this.busy ??= this.saveAll().finally(() => (this.busy = null)));
  }
  private async saveAll(): Promise<void> {
    try {
      while (!this.isSaved) await this.saveOnce(this.list);
    } catch (problem) {
      if (problem instanceof Refusal && refusesStrokes.has(problem.status)) await this.refused(problem);
      else if (problem instanceof Lost || problem instanceof Refusal) this.told("lost");
      else throw problem;
    }
    this.keep();
  }
  private async saveOnce(list: StrokeList): Promise<void> {
    const { wish, viewpoints, everywhere } = this;
    if (this.isAway) throw new Lost("away");
    try {
      this.revision = await this.store.putStrokes(list, this.revision, viewpoints, everywhere);
      this.saved = list;
      this.savedViewpoints = viewpoints;
      this.savedWish = wish;
      this.isWaiting = false;
      this.tell();
    } catch (problem) {
      if (!(problem instanceof Refusal && problem.status === 409)) throw problem;
      await this.fetched();
    }
  }
  /** What the server will never take is not asked again and again: its own list stands. */
  private async refused(problem: Refusal): Promise<void> {
    this.told(problem);
    if (this.isWaiting && problem.status === 423) return;
    this.isWaiting = false;
    const { saved, savedWish } = this;
    this.saved = this.list;
    this.savedWish = this.wish;
    try {
      await this.fetched();
      this.done = [];
      this.undone = [];
    } catch {
      Object.assign(this, { saved, savedWish });
      this.told("lost");
    }
  }

  private keep(): void {
    this.isKept = true;
    try {
      // A viewpoint alone, without strokes, is not worth keeping.
      if (this.list === this.saved) this.shelf.removeItem(this.shelfKey);
      else this.shelf.setItem(this.shelfKey, JSON.stringify({ base: this.saved, list: this.list, viewpoints: this.known } satisfies Kept));
    } catch {
      // A full or forbidden store: the strokes are still in the page.
      this.isKept = false;
    }
  }
  private taken(): Kept | null {
    try {
      const kept = JSON.parse(this.shelf.getItem(this.shelfKey) ?? "null") as Kept | null;
      return kept && Array.isArray(kept.base) && Array.isArray(kept.list) ? kept : null;
    } catch {
      return null;
    }
  }
}
