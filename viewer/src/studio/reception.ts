/** Where there is no capture yet: photographs come in here, and become a scene. */

import { acceptsFiles, button, el, icon, toast } from "../ui/dom";
import type { Api } from "./api";
import { ask, keyed, notice } from "./panels";
import type { State } from "./protocol";
import { Session } from "./session";
import { filesOf, filesOfList, Upload } from "./upload";
import { words } from "./words";

/** Refused files that are shown by name. */
const mostNames = 8;

class Reception {
  readonly node: HTMLElement;
  private upload: Upload;
  private zone: HTMLElement;
  private zoneTitle = el("h2", {}, words.reception.title);
  private count = el("p", { class: "count-line", id: "arrived", role: "status" });
  private bar = el("div", { class: "bar" });
  private progress = el("div", { class: "progress", role: "progressbar", "aria-label": words.reception.progress, "aria-valuemin": "0", "aria-valuemax": "100", hidden: true }, this.bar);
  private refusedTitle = el("p", { class: "name" });
  private refusedList = el("ul", { class: "refused-list" });
  private again = button(words.reception.again, () => this.upload.retry());
  private refused = el("div", { class: "refused", id: "refused", role: "status", hidden: true }, this.refusedTitle, this.refusedList, this.again);
  private left = el("p", { class: "note", id: "left-out", hidden: true });
  private build = button(words.reception.build, () => void this.session.order({ order: "prepare" }), { class: "button primary", id: "build", title: words.reception.buildTitle });
  private clear = button(words.reception.clear, () => void this.startOver(), { id: "clear" });
  private arrivals: HTMLElement;
  private work: HTMLElement;
  private task = el("h2");
  private percent = el("span", { class: "percent" });
  private workBar = el("div", { class: "bar" });
  private workProgress = el("div", { class: "progress", role: "progressbar", "aria-valuemin": "0", "aria-valuemax": "100" }, this.workBar);
  private log = el("ol", { class: "log", id: "notes", "aria-label": words.reception.log, "aria-live": "polite" });
  private failure = el("p");
  private failed = el("div", { class: "failure", id: "failure", role: "alert", hidden: true }, el("h2", {}, words.reception.failed), this.failure, el("p", { class: "note" }, words.reception.failedNote));

  constructor(private readonly session: Session) {
    const { api } = session;
    this.upload = new Upload({
      put: (name, offset, piece) => api.arrive(name, offset, piece),
      wait: (milliseconds) => new Promise((done) => setTimeout(done, milliseconds)),
      changed: () => this.update(),
    });
    this.zone = this.buildZone();
    this.arrivals = el("div", { class: "arrivals" }, this.count, this.progress, this.left, this.refused, el("div", { class: "buttons" }, this.build, this.clear));
    this.work = el("section", { class: "work", id: "work", hidden: true }, el("div", { class: "row" }, this.task, this.percent), this.workProgress,
      el("div", { class: "buttons" }, button(words.stop, () => void session.order({ order: "stop" }), { class: "button primary stop", id: "stop", title: words.stopTitle })));
    this.node = el("main", { class: "reception", id: "reception" },
      el("header", {}, el("img", { src: "./icon.svg", alt: "", width: 28, height: 28 }), el("h1", {}, words.program)),
      this.failed, this.zone, this.arrivals, this.work, this.log);
    session.onState(() => this.update());
    this.update();
  }

  private buildZone(): HTMLElement {
    const add = (input: HTMLInputElement) => input.addEventListener("change", () => {
      this.upload.add(filesOfList(input.files ?? []));
      input.value = "";
    });
    const files = el("input", { type: "file", multiple: true, hidden: true, id: "files", accept: "image/jpeg,image/png,image/tiff,image/webp,video/*,.mkv,.avi,.exr,.ply,.json,.bin,.txt,.npy,.npz,.xml,.csv,.xmp" });
    const folder = el("input", { type: "file", multiple: true, hidden: true, id: "folder", webkitdirectory: true });
    for (const input of [files, folder]) add(input);
    const zone = el("section", { class: "drop-zone", id: "drop-zone", "aria-label": words.reception.title }, icon("photographs"), this.zoneTitle, el("p", {}, words.reception.note),
      el("div", { class: "buttons" }, button(words.reception.photographs, () => files.click(), { class: "button primary", id: "choose-files" }), button(words.reception.folder, () => folder.click(), { id: "choose-folder" })), files, folder);
    // All of it is a button for the pointer; the keyboard has the real ones.
    zone.addEventListener("click", (e) => (e.target as HTMLElement).closest("button, input") || files.click());
    return zone;
  }

  /** Things were dropped: folders are read through. */
  async drop(transfer: DataTransfer): Promise<void> {
    if (this.session.isReadOnly) return toast(words.readOnly);
    if (this.session.isBusy) return toast(words.reception.busy);
    // The list of a drop is gone after the event: everything is asked for now.
    const items = [...transfer.items].filter((item) => item.kind === "file").map((item) => ({ entry: item.webkitGetAsEntry?.() ?? null, file: item.getAsFile() }));
    const loose = filesOfList(items.flatMap(({ entry, file }) => (entry === null && file ? [file] : [])));
    this.upload.add([...loose, ...(await filesOf(items.flatMap(({ entry }) => (entry ? [entry] : []))))]);
  }
  private async startOver(): Promise<void> {
    if (!(await ask(words.reception.clearQuestion, undefined, words.reception.clearYes))) return;
    await this.upload.clear();
    await this.session.order({ order: "clear" });
  }
  get isSending(): boolean {
    return this.upload.isBusy;
  }

  private update(): void {
    const { upload, session } = this;
    const { state, isReadOnly, isBusy, isLost } = session;
    const { bytes: text } = words.reception;
    const totals = upload.totals;
    const { files, source, bytes } = state.arrived;
    const anything = files > 0 || upload.list.length > 0;
    this.zone.hidden = isBusy;
    this.zone.inert = isReadOnly || isLost;
    this.zone.classList.toggle("compact", anything);
    this.zoneTitle.textContent = anything ? words.reception.more : words.reception.title;

    this.arrivals.hidden = isBusy;
    const sending = upload.isBusy;
    this.count.textContent = sending
      ? words.reception.sending(totals.filesThere, totals.files, words.reception.bytesOf(text(totals.bytesThere), text(totals.bytes)))
      : files > 0 ? words.reception.arrived(files, text(bytes)) : source ? words.reception.named(source) : words.reception.nothing;
    const share = totals.bytes > 0 ? totals.bytesThere / totals.bytes : 0;
    this.progress.hidden = !sending;
    this.progress.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    this.bar.style.width = `${100 * share}%`;
    this.showRefused();
    this.build.disabled = sending || isBusy || isReadOnly || isLost || (files === 0 && !source);
    this.clear.hidden = !anything;
    this.clear.disabled = isReadOnly || isLost;

    this.work.hidden = !isBusy;
    this.work.inert = isReadOnly;
    this.task.textContent = words.tasks[state.task] ?? state.task;
    this.percent.textContent = [state.step, state.fraction > 0 ? words.percent(state.fraction) : words.reception.starting].filter(Boolean).join(" · ");
    this.workProgress.setAttribute("aria-valuenow", String(Math.round(100 * state.fraction)));
    this.workBar.style.width = `${100 * state.fraction}%`;
    // Lines may come twice: they are told apart by how often they came before.
    const seen = new Map<string, number>();
    const lines = state.notes.map((line) => {
      seen.set(line, (seen.get(line) ?? 0) + 1);
      return `${seen.get(line)} ${line}`;
    });
    keyed(this.log, lines, (line) => line, (line) => el("li", {}, line.slice(line.indexOf(" ") + 1)));
    this.log.hidden = lines.length === 0;
    this.failed.hidden = isBusy || !state.failed;
    this.failure.textContent = state.message;
  }
  private showRefused(): void {
    const { refused, left } = this.upload;
    this.refused.hidden = refused.length === 0;
    this.refusedTitle.textContent = words.reception.refused(refused.length);
    // The server's sentence may begin with the name.
    const lines = refused.slice(0, mostNames).map(({ source, name, reason }) => [source, reason.startsWith(`${name}: `) ? reason.slice(name.length + 2) : reason]);
    if (refused.length > mostNames) lines.push([words.reception.others(refused.length - mostNames), ""]);
    keyed(this.refusedList, lines, (line) => line.join("\n"), ([name, reason]) => el("li", {}, el("strong", {}, name), reason && ` – ${reason}`));
    this.again.hidden = !refused.some((a) => a.again);
    const count = [...left.values()].reduce((a, b) => a + b, 0);
    const kinds = [...left.keys()].filter(Boolean).slice(0, 6).map((kind) => `.${kind}`).join(", ");
    this.left.hidden = count === 0;
    this.left.textContent = [words.reception.left(count, kinds), left.has("heic") || left.has("heif") ? words.reception.heic : ""].filter(Boolean).join(" ");
  }
}

/** Receives photographs until there is a capture. @return what takes the reception away again */
export async function receive(root: HTMLElement, api: Api, state: State): Promise<() => void> {
  document.title = words.program;
  document.body.classList.add("studio");
  const session = new Session(api, { title: "", run: "", up: "+y", centre: [0, 0, 0], radius: 1, views: [], home: 0 }, state);
  const reception = new Reception(session);
  const ended = new AbortController();
  const { signal } = ended;
  const box = el("div", { class: "reception-box" }, reception.node, notice(session));
  acceptsFiles(box, () => words.reception.veil, (e) => e.dataTransfer && void reception.drop(e.dataTransfer), signal);
  addEventListener("beforeunload", (e) => reception.isSending && e.preventDefault(), { signal });
  root.append(box);
  document.body.dataset.ready = "yes";
  // For scripts and tests.
  Object.assign(window, { cnerf: { reception, session } });
  const capture = new Promise<void>((done) => session.onState(({ stage }) => stage !== "photographs" && done()));
  void session.listen();
  session.tell();
  await capture;
  return () => {
    ended.abort();
    session.end();
    box.remove();
  };
}
