/** Small pieces of interface. */

type Props = { [key: string]: unknown };

export function el<K extends keyof HTMLElementTagNameMap>(tag: K, props: Props = {}, ...children: (Node | string | null)[]): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(props)) {
    if (key.startsWith("on") && typeof value === "function") node.addEventListener(key.slice(2), value as EventListener);
    else if (key === "class") node.className = String(value);
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value !== undefined && value !== null) node.setAttribute(key, String(value));
  }
  for (const child of children) if (child !== null) node.append(child);
  return node;
}

export function svg<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Record<string, string> = {}, ...children: Node[]): SVGElementTagNameMap[K] {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

const paths: Record<string, string> = {
  home: "M4 11 12 4l8 7M6 10v10h4v-6h4v6h4V10",
  frame: "M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5M12 9.500a2.500 2.500 0 1 0 0 5 2.500 2.500 0 0 0 0-5",
  camera: "M4 8h3l2-3h6l2 3h3v11H4zM12 10a3.500 3.500 0 1 0 0 7 3.500 3.500 0 0 0 0-7",
  link: "M10 14a4 4 0 0 0 6 .4l3-3a4 4 0 0 0-5.600-5.600l-1.500 1.500M14 10a4 4 0 0 0-6-.4l-3 3A4 4 0 0 0 10.600 18.200l1.500-1.500",
  help: "M9 9a3 3 0 1 1 4.500 2.600c-1 .6-1.500 1.200-1.500 2.400M12 17.500v.6M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18",
  panel: "M4 7h10M18 7h2M4 17h2M10 17h10M14 5v4M6 15v4",
  close: "M6 6l12 12M18 6 6 18",
  brush: "M20 4 9.500 13.500M9.500 13.500c-2.600-.3-4.300 1.300-4.500 3.500-.1 1.400-.7 2.300-1.800 3 4.200.9 8.600-.5 8.500-4.200-.1-1.200-.9-2.100-2.200-2.300",
  line: "M5 19 19 5M3.500 19a1.500 1.500 0 1 0 3 0 1.500 1.500 0 0 0-3 0M17.500 5a1.500 1.500 0 1 0 3 0 1.500 1.500 0 0 0-3 0",
  fill: "M11 3.500v3M4.500 12.500 11 6l7 7-5.500 5.500a2 2 0 0 1-2.800 0l-4.200-4.200a1.300 1.300 0 0 1 0-1.800zM5 13h12.500M20 16c1 1.600 1.500 2.500 1.500 3.200a1.500 1.500 0 0 1-3 0c0-.7.5-1.600 1.500-3.200",
  grey: "M12 3.500c3.600 4.200 5.500 7.200 5.500 10a5.500 5.500 0 0 1-11 0c0-2.800 1.900-5.800 5.500-10M5 4l14 16",
  eraser: "M9 19 4.500 14.500a1.600 1.600 0 0 1 0-2.200l7.800-7.800a1.600 1.600 0 0 1 2.200 0l5 5a1.600 1.600 0 0 1 0 2.200L12.300 19zM8.500 8.500l7 7M9 19h11",
  picker: "M14 6.500 17.500 10M15.500 8 7 16.500 4.500 19.500 4 20l.5-.5 3-2.500L16 8.500M12.500 5l6.500 6.500M16 7l1.800-1.900a1.600 1.600 0 0 1 2.300 2.300L18 9.200",
  hand: "M8 12V6a1.300 1.300 0 0 1 2.600 0v5M10.600 10.500V4.800a1.300 1.300 0 0 1 2.600 0v5.700M13.200 10.500V6a1.300 1.300 0 0 1 2.600 0v6M15.800 12V8.500a1.300 1.300 0 0 1 2.600 0V14c0 4-2.300 6.500-5.800 6.500-3 0-4.400-1.300-5.900-4.200L5 13.200c-.9-1.700 1-2.700 2-1.400l1 1.400",
  undo: "M8 5 4 9l4 4M4 9h10a5.500 5.500 0 0 1 0 11H9",
  redo: "M16 5l4 4-4 4M20 9H10a5.500 5.500 0 0 0 0 11h5",
  shown: "M2.500 12c2.500-4.500 5.700-6.700 9.500-6.700s7 2.200 9.500 6.700c-2.500 4.500-5.700 6.700-9.500 6.700S5 16.500 2.500 12M12 9.200a2.800 2.800 0 1 0 0 5.600 2.800 2.800 0 0 0 0-5.600",
  hidden: "M4 4l16 16M6.500 7C5 8.200 3.700 9.800 2.500 12c2.500 4.500 5.700 6.700 9.500 6.700 1.700 0 3.300-.4 4.700-1.300M10 5.500c4.800-.9 8.700 1.300 11.500 6.500-.6 1.100-1.300 2-2 2.800",
  drop: "M12 3.500c3.600 4.200 5.500 7.200 5.500 10a5.500 5.500 0 0 1-11 0c0-2.800 1.900-5.800 5.500-10",
  compare: "M12 3v18M9 7H4v10h5M15 7h5v10h-5",
  pencil: "M4 20l1-4.500L16 4.500l3.500 3.500-11 11zM14 6.500l3.500 3.500",
  copy: "M9 9h11v11H9zM15 9V4H4v11h5",
  photographs: "M3 7h14v11H3zM6.500 4h14.500v11M3 15.500l4-4 3.500 3.500 2-2 4.500 4.500M13 10.500v.1",
};

export function icon(name: string): SVGSVGElement {
  return svg("svg", { viewBox: "0 0 24 24", class: "icon", "aria-hidden": "true" }, svg("path", { d: paths[name] }));
}

export function iconButton(name: string, title: string, onclick: () => void, id?: string): HTMLButtonElement {
  return el("button", { class: "icon-button", title, "aria-label": title, onclick, type: "button", id }, icon(name));
}
export function button(label: string, onclick: () => void, props: Props = {}): HTMLButtonElement {
  return el("button", { class: "button", type: "button", onclick, ...props }, label);
}

export interface Slider {
  node: HTMLElement;
  set(value: number): void;
}

export interface SliderOptions {
  id: string;
  label: string;
  /** Says how it is reset. */
  title: string;
  min: number;
  max: number;
  step: number;
  value: number;
  /** What a double click, or the Delete key, goes back to. */
  reset: number;
  show?: (value: number) => string;
  change: (value: number) => void;
}

export function slider(options: SliderOptions): Slider {
  const show = options.show ?? ((v: number) => v.toFixed(2));
  const output = el("output", { for: options.id });
  const input = el("input", { type: "range", id: options.id, min: options.min, max: options.max, step: options.step });
  const set = (value: number) => {
    input.value = String(value);
    output.value = show(value);
    input.style.setProperty("--fill", `${(100 * (value - options.min)) / (options.max - options.min)}%`);
  };
  input.addEventListener("input", () => {
    const value = Number(input.value);
    set(value);
    options.change(value);
  });
  const node = el("label", { class: "slider", title: options.title }, el("span", { class: "name" }, options.label), output, input);
  const reset = () => {
    set(options.reset);
    options.change(options.reset);
  };
  node.addEventListener("dblclick", reset);
  // Home is the smallest value, as the browser has it.
  input.addEventListener("keydown", (e) => {
    if (e.key !== "Delete" && e.key !== "Backspace") return;
    e.preventDefault();
    e.stopPropagation();
    reset();
  });
  set(options.value);
  return { node, set };
}

export interface Segments<T extends string> {
  node: HTMLElement;
  set(value: T): void;
}

export function segments<T extends string>(id: string, choices: [T, string][], value: T, change: (value: T) => void): Segments<T> {
  const buttons = choices.map(([key, label]) => el("button", { type: "button", "data-value": key, onclick: () => (set(key), change(key)) }, label));
  const node = el("div", { class: "segments", id, role: "group" }, ...buttons);
  function set(wanted: T): void {
    for (const b of buttons) b.setAttribute("aria-pressed", String(b.dataset.value === wanted));
  }
  set(value);
  return { node, set };
}

/** Marks one of a list's nodes as the current one, and brings it into sight where it was not. */
export function markCurrent(list: HTMLElement, nodes: readonly HTMLElement[], index: number): void {
  nodes.forEach((node, i) => {
    const is = i === index;
    if (is && node.getAttribute("aria-current") !== "true") list.scrollTo({ left: node.offsetLeft - list.clientWidth / 2 + node.clientWidth / 2, behavior: "smooth" });
    node.setAttribute("aria-current", String(is));
  });
}

export interface Toggle {
  node: HTMLElement;
  set(value: boolean): void;
}

export function toggle(id: string, label: string, value: boolean, change: (value: boolean) => void): Toggle {
  const input = el("input", { type: "checkbox", id, role: "switch" });
  input.checked = value;
  input.addEventListener("change", () => change(input.checked));
  return { node: el("label", { class: "toggle" }, el("span", { class: "name" }, label), input), set: (v) => (input.checked = v) };
}

export function section(title: string, open: boolean, ...children: (Node | string)[]): HTMLDetailsElement {
  return el("details", { class: "section", open }, el("summary", {}, title), el("div", { class: "body" }, ...children));
}

/** Follows a pointer from where it is pressed on a node until it lets go. @param moved  takes its way since the last time too, pixels */
export function dragged(node: GlobalEventHandlers & Element, moved: (e: PointerEvent, x: number, y: number) => void, begun = moved): void {
  let last: PointerEvent | null = null;
  node.addEventListener("pointerdown", (e) => {
    last = e.button === 0 ? e : null;
    if (!last) return;
    node.setPointerCapture(e.pointerId);
    begun(e, 0, 0);
  });
  node.addEventListener("pointermove", (e) => {
    // The browser takes it back where it is let go, and for a gesture of its own.
    if (!last || !node.hasPointerCapture(e.pointerId)) return;
    const { clientX, clientY } = last;
    moved((last = e), e.clientX - clientX, e.clientY - clientY);
  });
}
/** Lets a handle be drawn across an area, or moved by its keys. @param put takes the share of the area's width */
export function slidesAcross(handle: HTMLElement, area: () => HTMLElement, at: () => number, put: (share: number) => void, begin: () => void = () => {}): void {
  dragged(handle, (e) => {
    const box = area().getBoundingClientRect();
    put((e.clientX - box.left) / box.width);
  }, begin);
  handle.addEventListener("keydown", (e) => {
    const step = e.key === "ArrowRight" ? 0.02 : e.key === "ArrowLeft" ? -0.02 : 0;
    if (!step) return;
    e.preventDefault();
    e.stopPropagation();
    put(at() + step);
  });
}

/** Takes files that are dropped anywhere on the page, under a veil that says what becomes of them. */
export function acceptsFiles(root: HTMLElement, textOf: (e: DragEvent) => string, dropped: (e: DragEvent) => void, signal?: AbortSignal): void {
  const veil = el("div", { class: "drop-veil", hidden: true });
  root.append(veil);
  addEventListener("dragover", (e) => {
    if (!e.dataTransfer?.types.includes("Files")) return;
    e.preventDefault();
    veil.hidden = false;
    veil.textContent = textOf(e);
  }, { signal });
  addEventListener("dragleave", (e) => (veil.hidden = e.relatedTarget === null || veil.hidden), { signal });
  addEventListener("drop", (e) => {
    e.preventDefault();
    veil.hidden = true;
    dropped(e);
  }, { signal });
}

let toastTimer = 0;
export function toast(text: string): void {
  let node = document.getElementById("toast");
  if (!node) {
    node = el("div", { id: "toast", role: "status" });
    document.body.append(node);
  }
  node.textContent = text;
  node.classList.add("shown");
  window.clearTimeout(toastTimer);
  toastTimer = window.setTimeout(() => node!.classList.remove("shown"), 2400);
}

/** @param copied  says that it is done  @param question  above the text where the browser lets no page copy */
export async function copyText(text: string, copied: string, question: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    toast(copied);
  } catch {
    window.prompt(question, text);
  }
}

export function download(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  const link = el("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
