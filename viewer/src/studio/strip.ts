/** The photographs of the capture as a strip of thumbnails, in the colours of now, with what strokes will reach. */

import { el } from "../ui/dom";
import type { Session } from "./session";
import { words } from "./words";

/** Pictures that load at the same time. */
const atOnce = 2;

interface Item {
  node: HTMLButtonElement;
  image: HTMLImageElement;
  reach: HTMLImageElement;
  count: HTMLElement;
  isSeen: boolean;
}

export class Strip {
  readonly node = el("nav", { class: "strip", id: "strip", "aria-label": words.strip });
  /** Whether thumbnails show the reach of the strokes. */
  showsReach = true;
  private items: Item[];
  private loading = 0;
  private turn = -1;
  private failed = new Set<string>();

  constructor(private readonly session: Session, choose: (index: number, fly: boolean) => void) {
    this.items = session.scene.views.map((view, i) => {
      const image = el("img", { alt: "", draggable: "false" });
      const reach = el("img", { alt: "", class: "reach", draggable: "false" });
      const count = el("span", { class: "count", hidden: true });
      const node = el("button", { type: "button", class: "thumbnail", title: view.name, "data-view": i, onclick: (e: MouseEvent) => choose(i, e.shiftKey || view.held_out) }, image, reach, count);
      node.classList.toggle("held-out", view.held_out);
      return { node, image, reach, count, isSeen: false };
    });
    this.node.append(...this.items.map((item) => item.node));
    const observer = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) this.items[Number((target as HTMLElement).dataset.view)].isSeen = isIntersecting;
      this.pump();
    }, { root: this.node, rootMargin: "0px 80px" });
    for (const item of this.items) observer.observe(item.node);
    session.onState(() => (this.failed.clear(), this.update()));
    session.strokes.onChange(() => this.update());
    this.update();
  }

  setReach(shown: boolean): void {
    if (shown === this.showsReach) return;
    this.showsReach = shown;
    this.node.classList.toggle("no-reach", !shown);
    this.pump();
  }
  /** Shows which view is open. */
  mark(index: number): void {
    this.items.forEach(({ node }, i) => {
      const is = i === index;
      if (is && node.getAttribute("aria-current") !== "true") this.node.scrollTo({ left: node.offsetLeft - this.node.clientWidth / 2 + node.clientWidth / 2, behavior: "smooth" });
      node.setAttribute("aria-current", String(is));
    });
  }

  private update(): void {
    const counts = new Map<string, number>();
    for (const { view } of this.session.strokes.list) counts.set(view, (counts.get(view) ?? 0) + 1);
    this.session.scene.views.forEach((view, i) => {
      const count = counts.get(view.name) ?? 0;
      const item = this.items[i];
      item.count.textContent = String(count);
      item.count.hidden = count === 0;
      item.node.setAttribute("aria-label", view.held_out ? words.heldOut(view.name) : words.photograph(view.name, count));
    });
    this.pump();
  }

  private addresses(i: number): { image: string; reach: string } {
    const { scene, state, strokes } = this.session;
    const image = state.ready ? `./studio/thumbnails/${i}?v=${state.colors}` : `./studio/photos/${i}?side=160`;
    // What is saved counts; unsaved strokes follow in a moment.
    const reach = state.ready && this.showsReach && !scene.views[i].held_out && strokes.list.length > 0 && strokes.isSaved ? `./studio/reach/${i}?revision=${strokes.revision}` : "";
    return { image, reach };
  }
  /** Loads what is seen and out of date, a few at a time. */
  private pump(): void {
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
