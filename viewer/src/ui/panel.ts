/** The panel at the side: every setting, key frames, statistics. */

import type { App } from "../app";
import type { View } from "../camera";
import { aabbText } from "../hash";
import { keysFromJson, pathJson, viewAt } from "../keyframes";
import { mix, type Vec3 } from "../math";
import { quantities, type Quantity } from "../settings";
import { button, copyText, download, el, section, segments, slider, toast, toggle } from "./dom";

const backgrounds: [string, string][] = [
  ["#101216", "Night"], ["#000000", "Black"], ["#767676", "Grey"], ["#ffffff", "White"], ["none", "None"],
];
const axisNames = ["x", "y", "z"] as const;
/** Of a slider. */
export const resets = "Double click, or Delete, resets";

export class Panel {
  readonly node: HTMLElement;
  private refreshers: (() => void)[] = [];
  readonly statistics = el("dl", { class: "statistics", id: "statistics" });
  /** What is not shown, and why. */
  private readonly missing = el("p", { class: "note warning", id: "missing", role: "status", hidden: true });
  keys: View[] = [];
  private keyList = el("ol", { class: "keys", id: "key-frames" });
  private playing = 0;
  private seconds = 4;

  constructor(private readonly app: App) {
    this.node = el(
      "aside",
      { class: "panel", id: "panel", "aria-label": "Settings" },
      this.missing,
      this.colour(),
      this.density(),
      this.clip(),
      this.slices(),
      this.cameras(),
      this.keyFrames(),
      section("Statistics", false, this.statistics),
      this.about(),
    );
    app.onChange(() => this.refresh());
    this.refresh();
  }

  private refresh(): void {
    for (const refresher of this.refreshers) refresher();
  }

  private setting(id: "wipe" | "saturation" | "hue" | "exposure" | "gain" | "threshold" | "photo", label: string, min: number, max: number, step: number, show?: (v: number) => string): HTMLElement {
    const { app } = this;
    const made = slider({ id, label, title: resets, min, max, step, value: app.settings[id], reset: app.defaults[id], show, change: (value) => app.set({ [id]: value }) });
    this.refreshers.push(() => made.set(app.settings[id]));
    return made.node;
  }

  private colour(): HTMLElement {
    const { app } = this;
    const custom = el("input", { type: "color", id: "background-color", title: "Any colour", "aria-label": "Background colour" });
    custom.addEventListener("input", () => app.set({ background: custom.value }));
    const offered: [string, string][] = app.bundle.sky ? [["sky", "Sky"], ...backgrounds] : backgrounds;
    const swatches = offered.map(([value, label]) => {
      const b = el("button", { class: "swatch", type: "button", title: label, "aria-label": `Background ${label}`, "data-background": value, onclick: () => app.set({ background: value }) });
      if (value.startsWith("#")) b.style.background = value;
      if (value === "sky") b.style.background = "linear-gradient(#5b87c4, #dfe6ea)";
      return b;
    });
    this.refreshers.push(() => {
      for (const s of swatches) s.setAttribute("aria-pressed", String(s.dataset.background === app.settings.background));
      if (app.settings.background.startsWith("#")) custom.value = app.settings.background;
    });
    return section(
      "Colour", true,
      this.setting("wipe", "Luminance | colour", 0, 1, 0.001, (v) => `${Math.round(100 * v)} %`),
      this.setting("saturation", "Saturation of ab", 0, 2, 0.01),
      this.setting("hue", "Hue", -180, 180, 1, (v) => `${v.toFixed(0)}°`),
      this.setting("exposure", "Exposure", -5, 5, 0.05, (v) => `${v >= 0 ? "+" : ""}${v.toFixed(2)} EV`),
      el("div", { class: "row" }, el("span", { class: "name" }, "Background"), el("div", { class: "swatches" }, ...swatches, custom)),
    );
  }

  private density(): HTMLElement {
    // Gain and threshold go over decades: the sliders are logarithmic.
    const { app } = this;
    const gain = slider({
      id: "gain", label: "Gain", title: resets, min: -2, max: 2, step: 0.01, value: Math.log10(app.settings.gain), reset: 0,
      show: (v) => `× ${(10 ** v).toPrecision(2)}`, change: (v) => app.set({ gain: 10 ** v }),
    });
    const ofThreshold = (t: number) => (t <= 0 ? 0 : (t / 10) ** 3 * 24);
    const threshold = slider({
      id: "threshold", label: "Threshold", title: resets, min: 0, max: 10, step: 0.02, value: 10 * Math.cbrt(app.settings.threshold / 24), reset: 0,
      show: (v) => `${(ofThreshold(v) / app.bundle.volume.voxelSize).toPrecision(3)}`, change: (v) => app.set({ threshold: ofThreshold(v) }),
    });
    this.refreshers.push(() => {
      gain.set(Math.log10(app.settings.gain));
      threshold.set(10 * Math.cbrt(app.settings.threshold / 24));
    });
    return section("Density", false, gain.node, threshold.node, el("p", { class: "note" }, "The threshold is a density, 1 / world unit; what is fainter vanishes."));
  }

  private clip(): HTMLElement {
    const { app } = this;
    const on = toggle("clip", "Clip box", false, (value) => app.set({ clip: value ? { low: [...app.low] as Vec3, high: [...app.high] as Vec3 } : null }));
    const rows = axisNames.map((axis, i) => {
      const span = app.high[i] - app.low[i];
      const make = (side: "low" | "high") => {
        const made = slider({
          id: `clip-${axis}-${side}`, label: `${axis} ${side === "low" ? "from" : "to"}`, title: resets, min: app.low[i], max: app.high[i], step: span / 500,
          value: app[side][i], reset: app[side][i], show: (v) => v.toFixed(3),
          change: (v) => {
            const clip = app.settings.clip!;
            const next = { low: [...clip.low] as Vec3, high: [...clip.high] as Vec3 };
            const least = app.bundle.levels.at(-1)!.voxelSize;
            next[side][i] = side === "low" ? Math.min(v, clip.high[i] - least) : Math.max(v, clip.low[i] + least);
            app.set({ clip: next });
          },
        });
        this.refreshers.push(() => app.settings.clip && made.set(app.settings.clip[side][i]));
        return made.node;
      };
      return el("div", { class: "pair" }, make("low"), make("high"));
    });
    const text = el("code", { id: "aabb" });
    const copy = button("Copy", () => void copyText(text.textContent ?? "", "--aabb copied", "--aabb:"), { id: "copy-aabb" });
    const body = el("div", { class: "stack" }, ...rows, text, el("div", { class: "buttons" }, copy), el("p", { class: "note" }, "For cnerf bake. The handles in the picture move the sides."));
    this.refreshers.push(() => {
      const { clip } = app.settings;
      on.set(!!clip);
      body.hidden = !clip;
      if (clip) text.textContent = aabbText(clip.low, clip.high);
    });
    return section("Clip", false, on.node, body);
  }

  private slices(): HTMLElement {
    const { app } = this;
    const middle = (axis: 0 | 1 | 2) => mix(app.low, app.high, 0.5)[axis];
    const on = toggle("slice", "Slice", false, (value) => app.set({ slice: value ? { axis: 2, at: middle(2), quantity: "density" } : null }));
    const axis = segments<string>("slice-axis", axisNames.map((n, i) => [String(i), n]), "2", (value) => {
      const a = Number(value) as 0 | 1 | 2;
      app.set({ slice: { ...app.settings.slice!, axis: a, at: middle(a) } });
    });
    const quantity = segments<Quantity>("slice-quantity", quantities.map((q) => [q, q === "L" ? "L*" : q]), "density", (value) => app.set({ slice: { ...app.settings.slice!, quantity: value } }));
    const at = slider({
      id: "slice-at", label: "Position", title: resets, min: 0, max: 1, step: 0.002, value: 0.5, reset: 0.5, show: () => (app.settings.slice ? app.settings.slice.at.toFixed(3) : ""),
      change: (t) => {
        const slice = app.settings.slice!;
        app.set({ slice: { ...slice, at: app.low[slice.axis] + t * (app.high[slice.axis] - app.low[slice.axis]) } });
      },
    });
    const legend = el("div", { class: "legend" });
    const body = el("div", { class: "stack" }, axis.node, quantity.node, at.node, legend);
    const legends: Record<Quantity, [string, string, string]> = {
      density: ["0", "", "max"], L: ["0", "50", "100"], a: ["−80", "0", "80"], b: ["−80", "0", "80"],
    };
    this.refreshers.push(() => {
      const { slice } = app.settings;
      on.set(!!slice);
      body.hidden = !slice;
      if (!slice) return;
      axis.set(String(slice.axis));
      quantity.set(slice.quantity);
      at.set((slice.at - app.low[slice.axis]) / (app.high[slice.axis] - app.low[slice.axis]));
      legend.className = `legend ${slice.quantity}`;
      legend.replaceChildren(...legends[slice.quantity].map((t) => el("span", {}, t)));
    });
    return section("Slices", false, on.node, body);
  }

  private cameras(): HTMLElement {
    const { app } = this;
    const shown = toggle("show-cameras", "Show the capture's cameras", false, (value) => app.set({ showCameras: value }));
    const mode = segments<"orbit" | "fly">("mode", [["orbit", "Orbit"], ["fly", "Fly"]], "orbit", (value) => app.set({ fly: value === "fly" }));
    const up = el("select", { id: "up" }, ...["+x", "-x", "+y", "-y", "+z", "-z"].map((name) => el("option", { value: name }, name)));
    up.addEventListener("change", () => app.set({ up: up.value }));
    this.refreshers.push(() => {
      shown.set(app.settings.showCameras);
      mode.set(app.settings.fly ? "fly" : "orbit");
      up.value = app.settings.up;
    });
    return section("Camera", false, mode.node, el("label", { class: "row" }, el("span", { class: "name" }, "Up axis"), up), shown.node);
  }

  private keyFrames(): HTMLElement {
    const { app } = this;
    const length = slider({ id: "path-seconds", label: "Length", title: resets, min: 1, max: 30, step: 0.5, value: this.seconds, reset: 4, show: (v) => `${v} s`, change: (v) => (this.seconds = v) });
    const file = el("input", { type: "file", accept: ".json,application/json", hidden: true, id: "import-path" });
    file.addEventListener("change", async () => {
      try {
        this.keys = keysFromJson(await file.files![0].text());
        this.showKeys();
        app.moveTo(this.keys[0], app.pivot(this.keys[0]));
      } catch (problem) {
        toast(`No camera path: ${(problem as Error).message}`);
      }
      file.value = "";
    });
    this.showKeys();
    return section(
      "Key frames", false, this.keyList,
      el(
        "div", { class: "buttons" },
        button("Add this view", () => this.addKey(), { id: "add-key" }),
        button("Play", () => this.play(), { id: "play-path" }),
        button("Export JSON", () => this.exportPath(), { id: "export-path" }),
        button("Import", () => file.click()),
      ),
      length.node, file,
      el("p", { class: "note" }, "The file goes to cnerf render --path and to blender_setup.py --path."),
    );
  }

  addKey(): void {
    this.keys.push(this.app.view);
    this.showKeys();
    toast(`Key frame ${this.keys.length}`);
  }
  pathJson(fps = 30): string {
    return pathJson(this.keys, this.seconds, fps);
  }
  private exportPath(): void {
    if (this.keys.length === 0) return toast("Add a key frame first");
    download("camera_path.json", new Blob([this.pathJson()], { type: "application/json" }));
  }
  play(): void {
    if (this.playing) {
      cancelAnimationFrame(this.playing);
      this.playing = 0;
      return;
    }
    if (this.keys.length < 2) return toast("Two key frames make a path");
    const begin = performance.now();
    const step = (now: number) => {
      this.playing = 0;
      // Key frames can be removed meanwhile.
      if (this.keys.length < 2) return;
      const t = Math.max(0, (now - begin) / 1000 / this.seconds);
      const view = viewAt(this.keys, Math.min(1, t) * (this.keys.length - 1));
      this.app.setView(view, this.app.pivot(view));
      if (t < 1) this.playing = requestAnimationFrame(step);
    };
    this.playing = requestAnimationFrame(step);
  }
  private showKeys(): void {
    this.keyList.replaceChildren(
      ...this.keys.map((key, i) =>
        el(
          "li", {},
          el("button", { type: "button", class: "key", onclick: () => this.app.moveTo(key, this.app.pivot(key)) }, `Key frame ${i + 1}`),
          el("button", { type: "button", class: "remove", title: "Remove", "aria-label": `Remove key frame ${i + 1}`, onclick: () => (this.keys.splice(i, 1), this.showKeys()) }, "×"),
        ),
      ),
    );
    this.keyList.hidden = this.keys.length === 0;
  }

  private about(): HTMLElement {
    const { bundle } = this.app;
    const origin = bundle.inferred ? `Colour is inferred, by colorizer ${bundle.colorizer}, take ${bundle.take}.` : "Grey: not colorized.";
    return el("p", { class: "note about" }, `${origin} ${bundle.program}.`);
  }

  showNote(text: string): void {
    this.missing.textContent = text;
    this.missing.hidden = text === "";
  }

  showStatistics(entries: [string, string][]): void {
    this.statistics.replaceChildren(...entries.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]));
  }
}
