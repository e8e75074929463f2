/** Which frame to ask for next: coarse ones while the camera moves, finer ones at rest, one in flight and one waiting. */

export interface FrameWish<Camera> {
  camera: Camera;
  /** Share of the canvas's pixels across. */
  share: number;
  /** Whether it is needed at once. */
  moving: boolean;
}

export interface FrameHost<Camera, Frame> {
  /** null: the server had a newer wish. */
  fetch(wish: FrameWish<Camera>): Promise<Frame | null>;
  show(frame: Frame, wish: FrameWish<Camera>): void;
  /** A frame that came too late to be shown. */
  drop(frame: Frame): void;
  /** Milliseconds that the server drew at it; it may have waited for longer. */
  cost(frame: Frame): number;
  failed(problem: unknown): void;
  now(): number;
  later(callback: () => void, milliseconds: number): void;
}

interface Sent {
  version: number;
  share: number;
}

/** A frame while moving should take about this long, milliseconds. */
const wanted = 100;
const restAfter = 140;
const coarsest = 1 / 12;
const largestInPassing = 0.5;

export class FrameScheduler<Camera, Frame> {
  /** Share of the canvas's pixels across, while moving. */
  coarse = 1 / 6;
  private passing = false;
  /** Share of the canvas's pixels across that no frame of the wanted version exceeds. */
  private top = 1;
  private camera: Camera | null = null;
  private version = 0;
  private shown: Sent = { version: 0, share: 0 };
  private movedAt = -Infinity;
  private inFlight = new Set<Sent>();
  /** Shares of the wanted version that were answered, or are on their way. */
  private asked = 0;
  private paused = false;

  constructor(private readonly host: FrameHost<Camera, Frame>) {}

  /** The camera moved. */
  look(camera: Camera): void {
    this.camera = camera;
    this.movedAt = this.host.now();
    this.renew();
    this.host.later(() => this.next(), restAfter + 1);
  }
  /** Colours or sides changed, the camera did not. */
  refresh(camera: Camera | null = this.camera): void {
    if (camera === null) return;
    this.camera = camera;
    this.paused = false;
    this.renew();
  }
  /** Whether the server has other work and draws in passing: then nothing large is asked for. */
  get inPassing(): boolean {
    return this.passing;
  }
  set inPassing(passing: boolean) {
    this.passing = passing;
    this.top = this.largest();
    this.next();
  }
  private largest(): number {
    return this.passing ? Math.min(largestInPassing, 2 * this.coarse) : 1;
  }
  private renew(): void {
    this.version += 1;
    this.asked = 0;
    this.top = this.largest();
    this.next();
  }
  /** Whether the frame that is shown is the final one. */
  get settled(): boolean {
    return this.shown.version === this.version && this.shown.share >= this.top;
  }

  private get moving(): boolean {
    return this.host.now() - this.movedAt < restAfter;
  }
  private share(): number {
    if (this.moving) return this.asked === 0 ? Math.min(this.coarse, this.top) : 0;
    // A full frame that comes at once needs no half one before it.
    const half = Math.min(this.top, Math.max(0.5, this.coarse));
    const quick = this.coarse * Math.sqrt(2.5) >= this.top;
    const share = this.asked < half && !quick ? half : this.top;
    return this.asked < share ? share : 0;
  }
  private next(): void {
    if (this.camera === null || this.paused) return;
    const share = this.share();
    if (share === 0) return;
    // A fine frame of an old wish is overtaken; coarse ones are soon there.
    const [busy] = this.inFlight;
    const overtakes = this.inFlight.size === 1 && busy.version < this.version && busy.share > this.coarse && this.moving;
    if (this.inFlight.size > 0 && !overtakes) return;
    void this.ask(this.camera, { version: this.version, share });
  }
  private async ask(camera: Camera, sent: Sent): Promise<void> {
    this.inFlight.add(sent);
    this.asked = sent.share;
    const begin = this.host.now();
    const alone = this.inFlight.size === 1;
    let frame: Frame | null = null;
    try {
      frame = await this.host.fetch({ camera, share: sent.share, moving: this.moving });
    } catch (problem) {
      // A server that is away is not asked again and again.
      this.paused = true;
      this.asked = 0;
      this.host.later(() => ((this.paused = false), this.next()), 1500);
      this.host.failed(problem);
    } finally {
      this.inFlight.delete(sent);
    }
    if (frame !== null) this.arrived(frame, camera, sent, this.passing ? this.host.cost(frame) : alone ? this.host.now() - begin : 0);
    else if (sent.version === this.version && !this.paused) this.asked = 0;
    this.next();
  }
  private arrived(frame: Frame, camera: Camera, sent: Sent, milliseconds: number): void {
    if (milliseconds > 0) {
      const fitting = sent.share * Math.sqrt(wanted / milliseconds);
      const factor = Math.min(1.5, Math.max(0.6, fitting / this.coarse));
      this.coarse = Math.min(1, Math.max(coarsest, this.coarse * factor));
    }
    const { shown } = this;
    if (sent.version < shown.version || (sent.version === shown.version && sent.share < shown.share)) return this.host.drop(frame);
    this.shown = sent;
    this.host.show(frame, { camera, share: sent.share, moving: this.moving });
  }
}
