/** Pictures that the server makes of strokes: one request in flight, the newest wish waits. */

import { Lost } from "./api";
import { tintOf, type Tint } from "./paint";
import type { Stroke } from "./protocol";
import type { Session } from "./session";
import { fitted } from "../camera";

export type TintKind = "reach" | "now" | "none";

/** Runs one job at a time; of those that come meanwhile only the newest. */
export class Latest {
  private waiting: (() => Promise<void>) | null = null;
  private busy = false;

  get isBusy(): boolean {
    return this.busy;
  }
  async run(job: () => Promise<void>): Promise<void> {
    this.waiting = job;
    if (this.busy) return;
    this.busy = true;
    try {
      while (this.waiting) {
        const next: () => Promise<void> = this.waiting;
        this.waiting = null;
        await next();
      }
    } finally {
      this.busy = false;
    }
  }
}

async function tintOfPicture(picture: ImageBitmap): Promise<Tint> {
  const canvas = new OffscreenCanvas(picture.width, picture.height);
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.drawImage(picture, 0, 0);
  const tint = tintOf(picture.width, picture.height, context.getImageData(0, 0, picture.width, picture.height).data);
  picture.close();
  return tint;
}

/** What a photograph is tinted with: the reach of its strokes, or the colours of the field. */
export class TintFeed {
  private latest = new Latest();
  private wanted: TintKind = "none";

  constructor(private readonly session: Session, private readonly put: (view: string, tint: Tint | null) => void) {}

  /** @param view  name of the view that is open */
  ask(kind: TintKind, view: string, growing: Stroke | null): void {
    this.wanted = kind;
    // What was asked for before another kind was wanted comes too late.
    const put = (tint: Tint | null) => kind === this.wanted && this.put(view, tint);
    if (kind === "none") return void put(null);
    void this.latest.run(async () => {
      const { photo } = this.session;
      if (this.session.open !== view || photo < 0 || kind !== this.wanted) return;
      try {
        put(kind === "now" ? await this.now(photo) : await this.reach(photo, growing));
      } catch (problem) {
        // While views are traced there is no reach, and strokes show all the same.
        if (problem instanceof Lost) this.session.lose();
        else put(null);
      }
    });
  }
  private async reach(view: number, growing: Stroke | null): Promise<Tint> {
    const { strokes, api } = this.session;
    const own = growing ? [...strokes.unsaved, growing] : strokes.unsaved;
    return tintOfPicture(await createImageBitmap(await api.reach(view, own, strokes.revision, strokes.everywhere)));
  }
  private async now(view: number): Promise<Tint | null> {
    const { position, rotation, lens } = this.session.views[view];
    const scale = Math.min(1, 384 / Math.min(lens.width, lens.height));
    const small = fitted(lens, Math.round(lens.width * scale), Math.round(lens.height * scale));
    const frame = await this.session.api.frame({ position, rotation, lens: small, sides: ["now"] });
    return frame && tintOfPicture(frame.pictures[0]);
  }
}
