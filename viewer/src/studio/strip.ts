/** The photographs of the capture, then the viewpoints, as thumbnails in the colours of now, with what strokes will reach. */

import { el, markCurrent } from "../ui/dom";
import type { State } from "./protocol";
import type { Session } from "./session";
import { words } from "./words";

/** Pictures that load at the same time. */
const atOnce = 2;

interface Item {
  name: string;
  node: HTMLButtonElement;
  image: HTMLImageElement;
  reach: HTMLImageElement;
  count: HTMLElement;
  rank: HTMLElement;
  isSeen: boolean;
}

export class Strip {
  readonly node = el("nav", { class: "strip", id: "strip", "aria-label": words.strip });
  /** Whether thumbnails show the reach of the strokes. */
  showsReach = true;
  private items: Item[] = [];
  private loading = 0;
  private turn = -1;
  private failed = new Set<string>();

  private observer: IntersectionObserver;
  private marked = -1;
  private ledTo: string;

  constructor(private readonly session: Session, private readonly choose: (index: number, fly: boolean) => void) {
    this.ledTo = JSON.stringify(session.state.key_views ?? []);
    this.observer = new IntersectionObserver((entries) => {
      const items = new Map(this.items.map((item) => [item.node as Element, item]));
      for (const { target, isIntersecting } of entries) {
        const item = items.get(target);
        if (item) item.isSeen = isIntersecting;
      }
      this.pump();
    }, { root: this.node, rootMargin: "0px 80px" });
    session.onState(() => (this.failed.clear(), this.update()));
    session.strokes.onChange(() => this.update());
    this.update();
  }

  private make(index: number): Item {
    const { name, held_out } = this.session.views[index];
    const image = el("img", { alt: "", draggable: "false" });
    const reach = el("img", { alt: "", class: "reach", draggable: "false" });
    const count = el("span", { class: "count", hidden: true });
    const rank = el("span", { class: "rank", hidden: true });
    const own = this.session.isViewpoint(index);
    const node = el("button", { type: "button", class: "thumbnail", title: own ? words.view(name) : name }, image, reach, count, rank, own ? el("span", { class: "caption" }, words.view(name)) : null);
    node.addEventListener("click", (e) => this.choose(this.items.findIndex((item) => item.node === node), e.shiftKey || held_out));
    node.classList.toggle("held-out", held_out);
    node.classList.toggle("viewpoint", own);
    this.observer.observe(node);
    return { name, node, image, reach, count, rank, isSeen: false };
  }
  /** One thumbnail a view; those that stay are left as they are. */
  private follow(): void {
    const { views } = this.session;
    if (views.length === this.items.length && views.every((view, i) => view.name === this.items[i].name)) return;
    const there = new Map(this.items.map((item) => [item.name, item]));
    this.items = views.map((view, i) => there.get(view.name) ?? this.make(i));
    for (const { name } of this.items) there.delete(name);
    for (const { node } of there.values()) {
      this.observer.unobserve(node);
      node.remove();
    }
    this.items.forEach(({ node }, i) => {
      node.dataset.view = String(i);
      if (this.node.children[i] !== node) this.node.insertBefore(node, this.node.children[i] ?? null);
    });
    this.mark(this.marked);
  }

  setReach(shown: boolean): void {
    if (shown === this.showsReach) return;
    this.showsReach = shown;
    this.node.classList.toggle("no-reach", !shown);
    this.pump();
  }
  /** Shows which view is open. */
  mark(index: number): void {
    this.marked = index;
    markCurrent(this.node, this.items.map(({ node }) => node), index);
  }

  private update(): void {
    this.follow();
    const counts = new Map<string, number>();
    for (const { view } of this.session.strokes.list) counts.set(view, (counts.get(view) ?? 0) + 1);
    const { key_views: keyViews = [] } = this.session.state;
    this.session.views.forEach((view, i) => {
      const count = counts.get(view.name) ?? 0;
      const item = this.items[i];
      item.count.textContent = String(count);
      item.count.hidden = count === 0;
      const rank = keyViews.findIndex((one) => one.view === i);
      item.rank.textContent = String(rank + 1);
      item.rank.hidden = rank < 0;
      const label = view.held_out ? words.heldOut(view.name) : words.photograph(view.name, count);
      item.node.setAttribute("aria-label", rank < 0 ? label : `${label}, ${words.keyView(rank + 1, keyViews[rank].adds)}`);
    });
    this.lead(keyViews);
    this.pump();
  }

  /** To the first of new suggestions, with the keyboard too where it asked for them. */
  private lead(keyViews: State["key_views"]): void {
    const text = JSON.stringify(keyViews);
    if (text === this.ledTo) return;
    this.ledTo = text;
    const first = this.items[keyViews[0]?.view];
    first?.node.scrollIntoView({ inline: "center", block: "nearest" });
    // The button that asked cannot keep the focus while the answer is found.
    const focused = document.activeElement;
    if (focused === document.body || focused?.id === "which-view") first?.node.focus();
  }

  private addresses(i: number): { image: string; reach: string } {
    const { views, state, strokes } = this.session;
    const stamp = this.session.stamp(i);
    const image = state.ready ? `./studio/thumbnails/${i}?v=${state.colors}${stamp}` : `./studio/photos/${i}?side=160${stamp}`;
    // What is saved counts; unsaved strokes follow in a moment.
    const reach = state.ready && this.showsReach && !views[i].held_out && strokes.list.length > 0 && strokes.isSaved ? `./studio/reach/${i}?revision=${strokes.revision}${stamp}` : "";
    return { image, reach };
  }
  /** Loads what is seen and out of date, a few at a time. */
  private pump(): void {
    this.follow();
    // In turns: where colours change all the time, the last ones shall be seen to change too.
    for (let k = 0; k < this.items.length && this.loading < atOnce; ++k) {
      const i = (this.turn + 1) % this.items.length;
      this.turn = i;
      const item = this.items[i];
      const wanted = this.addresses(i);
      if (this.session.strokes.list.length === 0) item.reach.hidden = true;
      if (!item.isSeen) continue;
      if (!this.load(item.image, wanted.image) && this.loading < atOnce) this.load(item.reach, wanted.reach);
    }
  }
  private load(image: HTMLImageElement, address: string): boolean {
    if (address === "" || image.dataset.wanted === address || this.failed.has(address)) return false;
    image.dataset.wanted = address;
    this.loading += 1;
    // The old picture stays until the new one is there.
    const next = new Image();
    const done = (good: boolean) => {
      this.loading -= 1;
      if (good) {
        image.src = next.src;
        image.hidden = false;
      } else {
        this.failed.add(address);
        delete image.dataset.wanted;
      }
      this.pump();
    };
    next.onload = () => done(true);
    next.onerror = () => done(false);
    next.src = address;
    return true;
  }
}
