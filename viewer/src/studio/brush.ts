/** What the next stroke is made with. */

import { Changing } from "../changing";
import { rgbOfHex } from "../color";
import { randomId } from "./api";
import { limits, type Stroke, type StrokeKind, type StrokePoint } from "./protocol";
import { storage, type Shelf } from "./storage";

export type Tool = "brush" | "line" | "fill" | "grey" | "eraser" | "picker" | "hand";
export const tools: [Tool, string][] = [["brush", "b"], ["line", "l"], ["fill", "g"], ["grey", "k"], ["eraser", "e"], ["picker", "i"], ["hand", "h"]];

export interface BrushSettings {
  tool: Tool;
  color: string;
  size: number;
  softness: number;
  reach: number;
  exact: boolean;
}
const shelfKey = "cnerf-studio-brush";
const first: BrushSettings = { tool: "brush", color: "#b4513c", size: 0.04, softness: 0.25, reach: 1, exact: false };
const firstRecent = ["#b4513c", "#c9943f", "#6d8c3e", "#3d7f8c", "#4c66a8", "#8a5a92", "#c08b6a", "#7d6a55"];

export class Brush extends Changing {
  settings: BrushSettings;
  recent: string[];

  constructor(private readonly shelf: Pick<Shelf, "getItem" | "setItem"> = storage("localStorage")) {
    super();
    const kept = this.kept();
    this.settings = { ...first, ...kept.settings, tool: "brush" };
    this.recent = kept.recent?.length ? kept.recent : firstRecent;
  }
  private kept(): { settings?: Partial<BrushSettings>; recent?: string[] } {
    try {
      const kept = JSON.parse(this.shelf.getItem(shelfKey) ?? "{}");
      return rgbOfHex(String(kept.settings?.color)) ? kept : {};
    } catch {
      return {};
    }
  }
  set(partial: Partial<BrushSettings>): void {
    const next = { ...this.settings, ...partial };
    next.size = Math.min(limits.size[1], Math.max(limits.size[0], next.size));
    next.softness = Math.min(1, Math.max(0, next.softness));
    this.settings = next;
    this.tell();
  }
  protected override tell(): void {
    try {
      this.shelf.setItem(shelfKey, JSON.stringify({ settings: this.settings, recent: this.recent }));
    } catch {
      // It is forgotten with the page, then.
    }
    super.tell();
  }
  /** The colour was used. */
  remember(): void {
    const { color } = this.settings;
    if (this.recent[0] === color) return;
    this.recent = [color, ...this.recent.filter((c) => c !== color)].slice(0, 12);
    this.tell();
  }
  get paints(): boolean {
    return this.settings.tool !== "picker" && this.settings.tool !== "hand";
  }
  get kind(): StrokeKind {
    const { tool, exact } = this.settings;
    if (tool === "grey") return "grey";
    if (tool === "eraser") return "erase";
    return exact && tool !== "fill" ? "exact" : "paint";
  }
  /** What a fill is begun from is one small dot. */
  get size(): number {
    return this.settings.tool === "fill" ? Math.min(this.settings.size, 0.015) : this.settings.size;
  }
  stroke(view: string, points: StrokePoint[]): Stroke {
    const { color, softness, reach } = this.settings;
    return { id: randomId(10), view, kind: this.kind, color, size: this.size, softness, reach, hidden: false, points };
  }
}
