/** The tools of painting, in a column beside the photograph. */

import { hexAt } from "../color";
import { el, icon, segments } from "../ui/dom";
import { tools } from "./brush";
import type { Easel } from "./easel";
import type { TintKind } from "./reach";
import type { Session } from "./session";
import { words } from "./words";

export class Toolbar {
  readonly node: HTMLElement;
  readonly tints: HTMLElement;
  private setTint: (kind: TintKind) => void;

  constructor(private readonly session: Session, easel: Easel, openPanel: () => void) {
    const { brush } = session;
    const buttons = tools.map(([tool]) =>
      el("button", { type: "button", class: "icon-button tool", title: words.tools[tool], "aria-label": words.tools[tool], "data-tool": tool, onclick: () => brush.set({ tool }) }, icon(tool)));
    const swatch = el("button", { type: "button", class: "icon-button tool-color", title: words.palette, "aria-label": words.palette, onclick: () => openPanel() }, el("span"));
    this.node = el("div", { class: "toolbar", id: "toolbar", role: "toolbar", "aria-label": words.toolbar, "aria-orientation": "vertical", hidden: true }, ...buttons, swatch);
    const tints = segments<TintKind>("tint", [["reach", words.tints.reach], ["now", words.tints.now], ["none", words.tints.none]], easel.tint, (kind) => easel.setTint(kind));
    for (const child of tints.node.children) (child as HTMLElement).title = words.tintTitle[(child as HTMLElement).dataset.value as TintKind];
    tints.node.setAttribute("aria-label", words.tint);
    this.tints = tints.node;
    this.setTint = tints.set;
    const update = () => {
      for (const b of buttons) {
        b.setAttribute("aria-pressed", String(b.dataset.tool === brush.settings.tool));
        b.disabled = this.session.isReadOnly && b.dataset.tool !== "hand" && b.dataset.tool !== "picker";
      }
      swatch.style.setProperty("--color", hexAt(brush.settings.color, easel.lightness));
    };
    brush.onChange(update);
    session.onState(update);
    easel.onChange(() => (update(), this.setTint(easel.tint)));
    update();
  }
}
