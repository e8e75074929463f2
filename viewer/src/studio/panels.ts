/** The panel's sections beside the palette: strokes, takes, ideas, finish, commands. */

import { button, copyText, el, icon, section, segments, slider, toast, toggle } from "../ui/dom";
import type { StrokeDocument } from "./document";
import type { FieldView } from "./field";
import { limits, type Finish, type Stroke, type Take } from "./protocol";
import { Latest } from "./reach";
import type { Session } from "./session";
import { words } from "./words";

/** Asks for a name, which may be empty, or (without a value) for a yes. */
export function ask(question: string, value?: string, yes = value === undefined ? words.leave : words.ok): Promise<string | null> {
  const input = el("input", { type: "text", class: "hex", value: value ?? "", maxlength: 60, "aria-label": question, hidden: value === undefined });
  const dialog = el("dialog", { class: "card" }, el("form", { method: "dialog" }, el("h1", {}, question), input,
    el("div", { class: "buttons" }, el("button", { class: "button primary", value: "yes" }, yes), el("button", { class: "button", value: "", type: "submit", formnovalidate: true }, words.cancel))));
  document.body.append(dialog);
  dialog.showModal();
  input.select();
  return new Promise((done) => dialog.addEventListener("close", () => {
    dialog.remove();
    const text = value === undefined ? "yes" : input.value.trim();
    done(dialog.returnValue === "yes" ? text : null);
  }));
}

/** Whether what no take has may go. */
export async function mayLeaveNow(session: Session): Promise<boolean> {
  return !session.state.unkept || (await ask(words.loseNow)) !== null;
}

function small(name: string, title: string, onclick: () => void): HTMLButtonElement {
  return el("button", { type: "button", class: "small", title, "aria-label": title, onclick }, icon(name));
}

/** A list whose rows are made anew only where their text changed, so that the keyboard's focus stays. */
export function keyed<T>(list: HTMLElement, items: readonly T[], keyOf: (item: T) => string, make: (item: T) => HTMLElement): void {
  const there = new Map([...list.children].map((node) => [(node as HTMLElement).dataset.key!, node]));
  const nodes = items.map((item) => {
    const key = keyOf(item);
    const node = there.get(key) ?? make(item);
    (node as HTMLElement).dataset.key = key;
    return node;
  });
  // A row that leaves the page and returns loses the focus, and the click that was begun on it.
  const kept = new Set<Element>(nodes);
  for (const node of [...list.children]) if (!kept.has(node)) node.remove();
  nodes.forEach((node, i) => list.children[i] !== node && list.insertBefore(node, list.children[i] ?? null));
}

/** What everybody must know: the server is away, or another tab paints. */
export function notice(session: Session): HTMLElement {
  const node = el("div", { class: "notice", id: "notice", role: "status", hidden: true });
  session.onState(() => {
    node.textContent = session.isLost ? words.lost : words.readOnly;
    node.hidden = !session.isLost && !session.isReadOnly;
  });
  return node;
}

/** A section is seen and cannot be used, by keyboard neither. */
function lock(node: HTMLElement, locked: boolean): void {
  (node.lastElementChild as HTMLElement).inert = locked;
}

/** A painted picture as a small one. */
function paintedDot(picture: string): HTMLElement {
  return el("img", { class: "dot picture", src: `./studio/painted?picture=${picture}`, alt: "", draggable: "false" });
}

/** What is painted, for a palette of words. */
async function nameStroke(strokes: StrokeDocument, stroke: Stroke): Promise<void> {
  const word = await ask(words.whatIsIt, stroke.word ?? "");
  if (word === null) return;
  if (/[,;=#]/.test(word)) return toast(words.badWord);
  if (new TextEncoder().encode(word).length > limits.wordBytes) return toast(words.longWord(limits.wordBytes));
  strokes.edit(stroke.id, { word: word || undefined });
}

export function strokesPanel(session: Session): HTMLElement {
  const { strokes } = session;
  let all = false;
  const list = el("ul", { class: "rows", id: "strokes" });
  const none = el("p", { class: "note" }, words.noStrokes);
  const which = segments<"view" | "all">("strokes-of", [["view", words.ofThisView], ["all", words.ofAllViews]], "view", (value) => {
    all = value === "all";
    update();
  });
  const file = el("input", { type: "file", accept: "image/png", hidden: true });
  file.addEventListener("change", () => (file.files?.[0] && void session.sendPainted(file.files[0]), (file.value = "")));
  const paintedPicture = button(words.paintedPicture, () => file.click());
  const row = (stroke: Stroke) => {
    const kind = stroke.kind === "paint" && stroke.points.length === 1 ? words.dot : words.kinds[stroke.kind];
    const name = el("button", { type: "button", class: "name-button", "aria-label": words.selected(stroke.word ?? kind), onclick: () => ((session.selected = stroke.id), update()) }, stroke.picture ? paintedDot(stroke.picture) : el("span", { class: `dot ${stroke.kind}` }), el("span", {}, stroke.word ?? kind), el("small", {}, all ? words.view(stroke.view) : ""));
    (name.firstChild as HTMLElement).style.setProperty("--color", stroke.color);
    const hide = small(stroke.hidden ? "hidden" : "shown", stroke.hidden ? words.show : words.hide, () => strokes.edit(stroke.id, { hidden: !stroke.hidden }));
    const recolour = small("drop", words.recolour, () => strokes.recolour(stroke, session.brush.settings.color));
    const naming = small("pencil", words.nameIt, () => void nameStroke(strokes, stroke));
    recolour.hidden = naming.hidden = stroke.kind !== "paint" && stroke.kind !== "exact";
    return el("li", { class: stroke.hidden ? "off" : "" }, name, naming, hide, recolour, small("close", words.remove, () => strokes.remove(stroke.id)));
  };
  const everywhere = toggle("everywhere", words.everywhere, strokes.everywhere, (value) => strokes.setEverywhere(value));
  everywhere.node.title = words.everywhereTitle;
  const update = () => {
    everywhere.set(strokes.everywhere);
    const shown = all || session.open === "" ? strokes.list : strokes.of(session.open);
    keyed(list, [...shown].reverse(), (s) => `${s.id} ${s.color} ${s.hidden} ${all} ${s.word ?? ""}`, row);
    for (const node of list.children) (node as HTMLElement).setAttribute("aria-current", String((node as HTMLElement).dataset.key!.startsWith(`${session.selected} `)));
    none.hidden = shown.length > 0;
    paintedPicture.hidden = !session.view;
    whichView.disabled = session.isBusy || session.isLost;
    lock(node, session.isReadOnly);
  };
  const whichView = button(words.whichView, () => void session.order({ order: "key-views" }), { id: "which-view", title: words.whichViewTitle });
  const node = section(words.strokes, true, everywhere.node, which.node, list, none, el("div", { class: "buttons" }, whichView, paintedPicture), file);
  strokes.onChange(update);
  session.onState(update);
  update();
  return Object.assign(node, { refresh: update });
}

/** While the field is trained: what is to come, and what can be done already. */
export function trainingPanel(): HTMLElement {
  return el("section", { class: "section only-training" }, el("p", { class: "note training-note" }, words.trainingNote));
}

export class TakesPanel {
  private list = el("ul", { class: "rows", id: "takes" });
  private sides = ["left", "right"].map((side) => el("select", { id: `side-${side}`, "aria-label": side === "left" ? words.left : words.right }));
  private keepButton = button(words.keep, () => void this.keep(), { id: "keep" });
  readonly node: HTMLElement;

  constructor(private readonly session: Session, private readonly field: FieldView) {
    this.sides.forEach((select, i) => select.addEventListener("change", () => {
      field.compare(this.sides[0].value, this.sides[1].value);
      if (i === 0 || field.wipe < 0.02) field.setWipe(0.5);
    }));
    this.node = section(words.takes, true, this.list, el("div", { class: "buttons" }, this.keepButton),
      el("div", { class: "row" }, ...this.sides.flatMap((select, i) => (i ? [el("span", { class: "name" }, "|"), select] : [select]))));
    session.onState(() => this.update());
    field.onChange(() => this.showSides());
    this.update();
  }
  private update(): void {
    const { state, isReadOnly } = this.session;
    const grey: Take = { name: "", colorizer: "" };
    keyed(this.list, [grey, ...state.takes], (take) => `${take.name} ${take.colorizer} ${take.name === state.take} ${state.unkept}`, (take) => this.row(take));
    const choices = ["", "now", ...state.takes.map((take) => take.name)];
    for (const select of this.sides) {
      if (select.dataset.choices === choices.join("\n")) continue;
      select.dataset.choices = choices.join("\n");
      select.replaceChildren(...choices.map((name) => el("option", { value: name }, words.side(name))));
    }
    this.showSides();
    this.keepButton.disabled = !state.unkept || isReadOnly || state.task !== "";
    lock(this.node, isReadOnly);
  }
  private showSides(): void {
    this.sides[0].value = this.field.left;
    this.sides[1].value = this.field.right;
  }
  private row({ name, colorizer }: Take): HTMLElement {
    const { state } = this.session;
    const isNow = name === state.take;
    const begin = el("button", { type: "button", class: "name-button", title: words.begin, onclick: () => void this.begin(name) },
      el("span", {}, words.take(name)), el("small", {}, isNow && state.unkept ? words.unkept : name ? colorizer : ""));
    const row = el("li", { "aria-current": String(isNow), "data-take": name }, begin);
    if (name) {
      row.append(
        small("compare", words.compare, () => (this.field.compare(name, "now"), this.field.setWipe(0.5))),
        small("pencil", words.rename, () => void this.named("rename", words.renameTo, name)),
        small("copy", words.duplicate, () => void this.named("duplicate", words.duplicateTo, name)),
        small("close", words.remove, () => void this.remove(name)));
    }
    return row;
  }
  async keep(): Promise<void> {
    const name = await this.askName(words.keepName, this.freeName(this.session.state.take || "take"));
    if (name) await this.session.order({ order: "keep", name });
  }
  private freeName(name: string): string {
    const taken = new Set(this.session.state.takes.map((take) => take.name));
    let number = 2;
    if (!taken.has(name)) return name;
    while (taken.has(`${name}-${number}`)) number += 1;
    return `${name}-${number}`;
  }
  private async askName(question: string, value: string): Promise<string | null> {
    const name = await ask(question, value);
    if (name === value || (name !== "grey" && name !== "now")) return name;
    return this.askName(words.reserved(name), value);
  }
  private async named(order: "rename" | "duplicate", question: string, take: string): Promise<void> {
    const name = await this.askName(question, order === "rename" ? take : this.freeName(take));
    if (name && name !== take) await this.session.order({ order, take, name });
  }
  private async begin(take: string): Promise<void> {
    if (await mayLeaveNow(this.session)) await this.session.order({ order: "begin", take });
  }
  private async remove(take: string): Promise<void> {
    if (await ask(words.removeTake(take), undefined, words.remove)) await this.session.order({ order: "delete", take });
  }
}

export function ideasPanel(session: Session, reference: (file: File) => void): HTMLElement {
  const cards = el("div", { class: "cards", id: "cards" });
  const file = el("input", { type: "file", accept: "image/png,image/jpeg,image/tiff,image/webp", hidden: true });
  file.addEventListener("change", () => (file.files?.[0] && reference(file.files[0]), (file.value = "")));
  const liked = new Set<number>();
  const choose = (card: HTMLElement, number: number) => {
    if (!liked.delete(number)) liked.add(number);
    card.setAttribute("aria-pressed", String(liked.has(number)));
  };
  const ofItself = async () => {
    const bases = session.state.cards.map((card) => card.number).filter((number) => liked.has(number));
    if (await mayLeaveNow(session)) await session.order({ order: "builtin", bases });
  };
  const suggestAnew = () => {
    liked.clear();
    // New cards at the same addresses are the same nodes.
    for (const card of cards.children) card.setAttribute("aria-pressed", "false");
    void session.order({ order: "suggest" });
  };
  const suggest = button(words.suggest, suggestAnew, { id: "suggest" });
  const builtin = button(words.builtin, () => void ofItself(), { id: "builtin", title: words.builtinTitle });
  const node = section(words.ideas, true,
    el("div", { class: "buttons" }, suggest, builtin, button(words.reference, () => file.click())),
    el("p", { class: "note" }, `${words.suggestNote} ${words.referenceNote}`), cards, file);
  session.onState((state) => {
    suggest.disabled = builtin.disabled = session.isBusy || session.isLost;
    keyed(cards, state.cards, (card) => card.address, ({ number, address }) => {
      const card = el("button", { type: "button", class: "idea", "aria-label": words.card(number), "aria-pressed": "false" }, el("img", { src: address, alt: "" }));
      card.addEventListener("click", () => choose(card, number));
      return card;
    });
    lock(node, session.isReadOnly);
  });
  return node;
}

/** Between two orders of the finish, milliseconds. */
const finishRest = 250;

export function finishPanel(session: Session): HTMLElement {
  const latest = new Latest();
  let values: Finish = session.state.finish;
  let heard = JSON.stringify(values);
  const put = (partial: Partial<Finish>) => {
    values = { ...values, ...partial };
    // A few orders a second: what a slider passes meanwhile is left out, where it stops is not.
    void latest.run(async () => {
      await session.order({ order: "finish", ...values });
      await new Promise((done) => setTimeout(done, finishRest));
    });
  };
  const sliders = [
    slider({ id: "saturation", label: words.saturation, title: words.resets, min: 0, max: 2, step: 0.01, value: values.saturation, reset: 1, change: (v) => put({ saturation: v }) }),
    slider({ id: "hue", label: words.hue, title: words.resets, min: -180, max: 180, step: 1, value: values.hue, reset: 0, show: (v) => `${v.toFixed(0)}°`, change: (v) => put({ hue: v }) }),
    slider({ id: "exposure", label: words.exposure, title: words.resets, min: -3, max: 3, step: 0.05, value: values.exposure, reset: 0, show: words.stops, change: (v) => put({ exposure: v }) }),
  ];
  const formats = Object.entries(words.formats).map(([value, label], i) => {
    const input = el("input", { type: "checkbox", value, checked: i < 2 });
    return { input, node: el("label", { class: "check" }, input, label) };
  });
  const photographs = el("select", { "aria-label": words.photographs }, ...Object.entries(words.photographFormats).map(([value, label]) => el("option", { value }, label)));
  const bake = button(words.bake, () => void session.order({ order: "bake", formats: formats.filter((f) => f.input.checked).map((f) => f.input.value) }), { id: "bake" });
  const write = button(words.photographs, () => void session.order({ order: "photographs", format: photographs.value }), { id: "photographs" });
  const downloads = el("ul", { class: "rows", id: "downloads" });
  const blender = el("div", { class: "commands" });
  const node = section(words.finish, true, ...sliders.map((s) => s.node), el("div", { class: "buttons checks" }, ...formats.map((f) => f.node), bake), el("div", { class: "row" }, photographs, write), downloads, blender);
  session.onState((state) => {
    keyed(downloads, state.downloads, (d) => `${d.address} ${d.bytes}`, (d) => el("li", {}, el("a", { class: "name-button", href: d.address, download: d.name }, el("span", {}, d.name), el("small", {}, words.mebibytes(d.bytes)))));
    showLines(blender, state.blender ? [state.blender] : [], words.blender);
    bake.disabled = write.disabled = session.isBusy || session.isLost;
    lock(node, session.isReadOnly);
    const { finish } = state;
    // The server's finish is followed, but not while the sliders are under way.
    if (JSON.stringify(finish) === heard || latest.isBusy) return;
    heard = JSON.stringify(finish);
    values = finish;
    [finish.saturation, finish.hue, finish.exposure].forEach((value, i) => sliders[i].set(value));
  });
  return node;
}

function showLines(box: HTMLElement, lines: string[], title: string): void {
  box.hidden = lines.length === 0;
  keyed(box, lines.length ? [title, ...lines] : [], (line) => line, (line) =>
    line === title ? el("span", { class: "name" }, title) : el("div", { class: "command" }, el("code", {}, line), small("copy", words.copy, () => void copyText(line, words.copied, words.copyLine))));
}

export function commandsPanel(session: Session): HTMLElement {
  const box = el("div", { class: "commands", id: "commands" });
  const node = section(words.repeat, false, box);
  session.onState((state) => {
    // A line that comes twice is shown once.
    showLines(box, [...new Set(state.commands)], words.repeatNote);
    node.hidden = state.commands.length === 0;
  });
  return node;
}
