/** The page of a running command: progress, curves, pictures, and buttons to pause and to stop. */

import { follow } from "./follow";
import { Curve, type CurvePoint } from "./ui/curve";
import { button, el, toast } from "./ui/dom";

interface State {
  version: number;
  title: string;
  task: string;
  fraction: number;
  seconds: number;
  paused: boolean;
  stopping: boolean;
  finished: boolean;
  message: string;
  figures: Record<string, number | null>;
  curves: Record<string, CurvePoint[]>;
  pictures: { name: string; version: number }[];
}

export function durationText(seconds: number): string {
  const s = Math.round(seconds);
  if (s >= 3600) return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, "0")} min`;
  return s >= 60 ? `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, "0")} s` : `${s} s`;
}

export function figureText(value: number | null): string {
  if (value === null) return "–";
  const v = Math.abs(value);
  if (v >= 1e6) return `${(value / 1e6).toFixed(2)} M`;
  if (v >= 1e4) return `${(value / 1e3).toFixed(0)} k`;
  return String(Number(value.toPrecision(4)));
}

/** A curve with its lowest, highest and last value. */
class Chart {
  readonly node: HTMLElement;
  private curve = new Curve(400, 120);
  private last = el("strong");
  private range = el("span", { class: "range" });

  constructor(readonly name: string) {
    const [task, figure] = name.split(": ").length > 1 ? [name.slice(0, name.lastIndexOf(": ")), name.slice(name.lastIndexOf(": ") + 2)] : ["", name];
    this.node = el("figure", { class: "chart", "data-curve": name }, el("figcaption", {}, el("span", {}, figure), el("small", {}, task), this.last), this.curve.node, this.range);
  }
  update(points: CurvePoint[]): void {
    const values = points.map((p) => p[1]);
    this.curve.draw(points, /loss|distance/.test(this.name));
    this.last.textContent = figureText(values[values.length - 1] ?? null);
    this.range.textContent = values.length ? `${figureText(Math.min(...values))} to ${figureText(Math.max(...values))}` : "";
  }
}

/** Curves that say how good it gets; the rest are figures only. */
const isCurve = (name: string) => /psnr|loss|ab distance|accepted/.test(name);

export function showLive(root: HTMLElement, first: State): void {
  document.title = `${first.title} · cnerf`;
  document.body.classList.add("live");
  const bar = el("div", { class: "bar" });
  const progress = el("div", { class: "progress", role: "progressbar", "aria-label": "Progress", "aria-valuemin": "0", "aria-valuemax": "100" }, bar);
  const status = el("p", { class: "status", id: "live-status" });
  const figures = el("dl", { class: "statistics", id: "live-figures" });
  const charts = el("div", { class: "charts" });
  const pictures = el("div", { class: "previews", id: "live-pictures" });
  const made = new Map<string, Chart>();
  const shown = new Map<string, { node: HTMLElement; ours: HTMLImageElement; input: HTMLImageElement }>();

  const ask = async (action: string): Promise<void> => {
    try {
      const answer = await fetch("./live/control", { method: "POST", headers: { "X-Cnerf": "1", "Content-Type": "application/json" }, body: JSON.stringify({ action }) });
      if (!answer.ok) throw new Error(`the server says ${answer.status}`);
      update((await answer.json()) as State);
    } catch (problem) {
      toast(`It did not hear: ${(problem as Error).message}`);
    }
  };
  let state = first;
  const pause = button("Pause", () => void ask(state.paused ? "resume" : "pause"), { id: "pause" });
  const stop = button("Stop and save", () => void ask("stop"), { id: "stop", class: "button danger" });
  root.append(
    el("main", { class: "live-page" },
      el("header", { class: "head" }, el("div", { class: "title" }, el("img", { src: "./icon.svg", alt: "", width: 28, height: 28 }), el("div", {}, el("h1", {}, first.title), status)), el("div", { class: "buttons" }, pause, stop)),
      progress, figures, charts, pictures),
  );

  function update(next: State): void {
    state = next;
    const percent = Math.round(100 * next.fraction);
    bar.style.width = `${100 * next.fraction}%`;
    progress.setAttribute("aria-valuenow", String(percent));
    document.title = `${next.finished ? "✓" : `${percent} %`} ${next.title} · cnerf`;
    status.textContent = next.finished
      ? next.message
      : next.stopping
        ? "Stopping and saving…"
        : `${next.paused ? "Paused · " : ""}${next.task || "starting"} · ${percent} % · ${durationText(next.seconds)}`;
    pause.textContent = next.paused ? "Go on" : "Pause";
    pause.hidden = stop.hidden = next.finished || next.stopping;
    figures.replaceChildren(...Object.entries(next.figures).flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, figureText(value))]));
    for (const [name, points] of Object.entries(next.curves)) {
      if (!isCurve(name)) continue;
      if (!made.has(name)) {
        const chart = new Chart(name);
        made.set(name, chart);
        charts.append(chart.node);
      }
      made.get(name)!.update(points);
    }
    for (const { name, version } of next.pictures) {
      const [view, kind] = [name.slice(0, name.lastIndexOf(".")), name.slice(name.lastIndexOf(".") + 1) as "ours" | "input"];
      if (!shown.has(view)) {
        const input = el("img", { alt: `${view}, input` });
        const ours = el("img", { alt: `${view}, ours` });
        const node = el("figure", {}, el("div", { class: "pair" }, input, ours), el("figcaption", {}, el("span", {}, view), el("small", {}, "input · ours")));
        shown.set(view, { node, ours, input });
        pictures.append(node);
      }
      const image = shown.get(view)![kind];
      const source = `./live/pictures/${name}?v=${version}`;
      if (image && image.getAttribute("src") !== source) image.src = source;
    }
  }
  update(first);

  const end = follow<State>("./live/events", (news) => {
    update(news);
    if (state.finished) end();
  }, () => {
    if (!state.finished) status.textContent = "The connection to cnerf is lost; waiting for it…";
  });
}
