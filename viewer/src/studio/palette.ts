/** The colours there are at the light under the brush, recent ones, and those of a picture. */

import { hexAt, hexOf, inGamut, labOfHex, mappedIntoGamut, rgbFromLab, rgbOfHex, type Rgb } from "../color";
import { button, dragged, el, section, slider, toast, toggle } from "../ui/dom";
import type { Brush } from "./brush";
import { words } from "./words";

const pixels = 128;
/** Chroma at the disc's edge: a little more than the gamut has at a lightness, so that its colours fill the disc. */
function extentAt(lightness: number): number {
  const chroma = Array.from({ length: 36 }, (_, i) => {
    const { a, b } = mappedIntoGamut({ lightness, a: 140 * Math.cos((i * Math.PI) / 18), b: 140 * Math.sin((i * Math.PI) / 18) }, 10);
    return Math.hypot(a, b);
  });
  return 1.06 * Math.max(...chroma);
}

export class Palette {
  readonly node: HTMLElement;
  readonly picture = el("canvas", { class: "picker-picture", hidden: true, tabindex: "0", role: "application", "aria-label": words.pickerPictureAlt });
  private spot = el("span", { class: "marker" });
  /** Where the picture's colour is taken, as shares of it. */
  private aimed = { x: 0.5, y: 0.5 };
  private disc = el("canvas", { class: "disc", width: pixels, height: pixels, tabindex: "0", role: "slider", "aria-label": words.disc, "aria-valuemin": "0", "aria-valuemax": "140" });
  private marker = el("span", { class: "marker" });
  private swatch = el("span", { class: "current" });
  private hex = el("input", { type: "text", id: "hex", class: "hex", maxlength: 7, spellcheck: "false", autocomplete: "off", "aria-label": words.hex });
  private light = el("span", { class: "note" });
  private recent = el("div", { class: "recent", role: "group", "aria-label": words.recent });
  private drop: HTMLElement;
  private remove: HTMLButtonElement;
  private lightness = 60;
  private extent = extentAt(60);
  private drawn = -1;
  private shownRecent = "";

  constructor(private readonly brush: Brush) {
    const file = el("input", { type: "file", accept: "image/*", hidden: true });
    file.addEventListener("change", () => (file.files?.[0] && void this.showPicture(file.files[0]), (file.value = "")));
    this.remove = button(words.removePicture, () => this.clearPicture(), { hidden: true });
    this.drop = el("div", { class: "stack", "data-drop": "picker" }, el("div", { class: "picker" }, this.picture, this.spot), el("p", { class: "note" }, words.pickerPictureNote),
      el("div", { class: "buttons" }, button(words.choosePicture, () => file.click(), { id: "choose-picture" }), this.remove), file);
    const wheel = el("div", { class: "wheel" }, this.disc, this.marker);
    this.node = section(words.palette, true,
      el("div", { class: "colors" }, wheel, el("div", { class: "side-colors" }, this.swatch, this.hex, this.light)),
      this.recent, ...this.sliders(),
      el("details", { class: "more" }, el("summary", {}, words.pickerPicture), this.drop));
    this.listen(wheel);
    brush.onChange(() => this.update());
    this.update();
  }

  private sliders(): HTMLElement[] {
    const { brush } = this;
    const { settings } = brush;
    // Sizes and reaches go over decades.
    const size = slider({ id: "size", label: words.size, title: words.resets, min: -3.3, max: -0.301, step: 0.01, value: Math.log10(settings.size), reset: Math.log10(0.04), show: (v) => `${(100 * 10 ** v).toPrecision(2)} %`, change: (v) => brush.set({ size: 10 ** v }) });
    const softness = slider({ id: "softness", label: words.softness, title: words.resets, min: 0, max: 1, step: 0.01, value: settings.softness, reset: 0.25, show: words.percent, change: (v) => brush.set({ softness: v }) });
    const reach = slider({ id: "reach", label: words.reach, title: words.resets, min: -1, max: 0.602, step: 0.01, value: Math.log10(settings.reach), reset: 0, show: (v) => `× ${(10 ** v).toPrecision(2)}`, change: (v) => brush.set({ reach: 10 ** v }) });
    const exact = toggle("exact", words.exact, settings.exact, (value) => brush.set({ exact: value }));
    const show = () => {
      size.set(Math.log10(brush.settings.size));
      softness.set(brush.settings.softness);
      reach.set(Math.log10(brush.settings.reach));
      exact.set(brush.settings.exact);
      reach.node.inert = brush.kind === "exact" || brush.kind === "erase";
    };
    brush.onChange(show);
    show();
    return [size.node, softness.node, reach.node, exact.node];
  }

  private listen(wheel: HTMLElement): void {
    dragged(wheel, (e) => {
      const box = this.disc.getBoundingClientRect();
      this.choose((2 * (e.clientX - box.left) / box.width - 1) * this.extent, (1 - (2 * (e.clientY - box.top)) / box.height) * this.extent);
    });
    this.disc.addEventListener("keydown", (e) => {
      const steps: Record<string, [number, number]> = { ArrowLeft: [-2, 0], ArrowRight: [2, 0], ArrowUp: [0, 2], ArrowDown: [0, -2] };
      const step = steps[e.key];
      if (!step) return;
      e.preventDefault();
      e.stopPropagation();
      const { a, b } = this.shownColor();
      this.choose(a + step[0], b + step[1]);
    });
    this.hex.addEventListener("change", () => {
      const rgb = rgbOfHex(this.hex.value);
      if (rgb) this.brush.set({ color: hexOf(rgb) });
      else toast(words.badHex);
      this.update();
    });
    this.listenToPicture();
  }
  private listenToPicture(): void {
    const { picture } = this;
    dragged(picture, (e) => {
      const box = picture.getBoundingClientRect();
      this.aim((e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height);
      this.pickFromPicture();
    });
    picture.addEventListener("keydown", (e) => {
      const steps: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
      const step = steps[e.key];
      if (!step && e.key !== "Enter") return;
      e.preventDefault();
      e.stopPropagation();
      const pixels = e.shiftKey ? 24 : 2;
      if (step) this.aim(this.aimed.x + (step[0] * pixels) / picture.width, this.aimed.y + (step[1] * pixels) / picture.height);
      else this.pickFromPicture();
    });
  }
  private choose(a: number, b: number): void {
    this.brush.set({ color: hexOf(rgbFromLab({ lightness: this.lightness, a, b })) });
  }
  private shownColor() {
    return mappedIntoGamut({ ...labOfHex(this.brush.settings.color), lightness: this.lightness });
  }

  /** The light under the brush. */
  setLightness(lightness: number): void {
    // Near black and white there are hardly any colours to show.
    const next = Math.round(Math.min(97, Math.max(8, lightness)));
    if (next === this.lightness) return;
    this.lightness = next;
    this.update();
  }
  private update(): void {
    const { color } = this.brush.settings;
    if (this.drawn !== this.lightness) this.drawDisc();
    const { a, b } = this.shownColor();
    Object.assign(this.marker.style, { left: `${50 + (50 * a) / this.extent}%`, top: `${50 - (50 * b) / this.extent}%`, background: hexAt(color, this.lightness) });
    this.swatch.style.background = `linear-gradient(135deg, ${hexAt(color, this.lightness)} 50%, ${color} 50%)`;
    this.disc.setAttribute("aria-valuenow", String(Math.round(Math.hypot(a, b))));
    this.disc.setAttribute("aria-valuetext", `a ${Math.round(a)}, b ${Math.round(b)}`);
    if (document.activeElement !== this.hex) this.hex.value = color;
    this.light.textContent = words.lightness(this.lightness);
    this.showRecent();
  }
  private drawDisc(): void {
    this.drawn = this.lightness;
    const extent = (this.extent = extentAt(this.lightness));
    const image = new ImageData(pixels, pixels);
    for (let y = 0; y < pixels; ++y) {
      for (let x = 0; x < pixels; ++x) {
        const lab = { lightness: this.lightness, a: ((2 * x + 1) / pixels - 1) * extent, b: (1 - (2 * y + 1) / pixels) * extent };
        if (inGamut(lab)) image.data.set([...rgbFromLab(lab), 255], 4 * (y * pixels + x));
      }
    }
    this.disc.getContext("2d")!.putImageData(image, 0, 0);
  }
  private showRecent(): void {
    const { recent, settings } = this.brush;
    const text = recent.join() + this.lightness + settings.color;
    if (text === this.shownRecent) return;
    this.shownRecent = text;
    this.recent.replaceChildren(...recent.map((color) => {
      const node = el("button", { type: "button", class: "recent-color", title: color, "aria-label": color, "aria-pressed": String(color === settings.color), onclick: () => this.brush.set({ color }) });
      node.style.setProperty("--color", hexAt(color, this.lightness));
      return node;
    }));
  }

  async showPicture(file: Blob): Promise<void> {
    try {
      const bitmap = await createImageBitmap(file);
      const scale = Math.min(1, 512 / Math.max(bitmap.width, bitmap.height));
      Object.assign(this.picture, { width: Math.round(bitmap.width * scale), height: Math.round(bitmap.height * scale) });
      this.picture.getContext("2d", { willReadFrequently: true })!.drawImage(bitmap, 0, 0, this.picture.width, this.picture.height);
      this.picture.hidden = this.remove.hidden = false;
      this.aim(0.5, 0.5);
      this.drop.closest("details")!.open = true;
    } catch {
      toast(words.notAPicture);
    }
  }
  private clearPicture(): void {
    this.picture.hidden = this.remove.hidden = true;
  }
  private aim(x: number, y: number): void {
    const inside = (share: number) => Math.min(1, Math.max(0, share));
    this.aimed = { x: inside(x), y: inside(y) };
    Object.assign(this.spot.style, { left: `${100 * this.aimed.x}%`, top: `${100 * this.aimed.y}%` });
  }
  private pickFromPicture(): void {
    const { width, height } = this.picture;
    const x = Math.min(width - 1, Math.floor(this.aimed.x * width));
    const y = Math.min(height - 1, Math.floor(this.aimed.y * height));
    const [r, g, b] = this.picture.getContext("2d")!.getImageData(x, y, 1, 1).data;
    this.brush.set({ color: hexOf([r, g, b] as Rgb) });
  }
}
