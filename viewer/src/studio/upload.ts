/** Photographs, a folder or a clip on their way to the server: what is taken along, some files at a time, in pieces. */

import { Lost, Refusal } from "./api";

export interface Incoming {
  /** With the folders it lies in, "capture/images/0001.jpg". */
  name: string;
  file: Blob;
}

const kinds = new Set("jpg jpeg png tif tiff webp mp4 mov mkv avi webm m4v json bin txt npy npz xml csv xmp exr ply".split(" "));
export const pieceBytes = 2 * 2 ** 20;
const atOnce = 3;
/** Silences that are waited for before a server counts as gone, milliseconds. */
const waits = [500, 1000, 2000, 4000, 8000];
/** After so many beginnings a file that comes out wrong is given up. */
const beginnings = 4;

const baseOf = (name: string) => name.slice(name.lastIndexOf("/") + 1);
const isHidden = (name: string) => name.split("/").some((part) => part.startsWith("."));
/** Without its dot, in small letters; "" where there is none. */
export function extensionOf(name: string): string {
  const base = baseOf(name);
  const dot = base.lastIndexOf(".");
  return dot > 0 ? base.slice(dot + 1).toLowerCase() : "";
}
/** Whether the server has a use for such a file. */
export function isWanted({ name, file }: Incoming): boolean {
  return !isHidden(name) && file.size > 0 && kinds.has(extensionOf(name));
}
/** A name as the server takes it: other letters become their nearest, other signs "_". */
export function plainName(name: string): string {
  return name.split("/").map((part) => part.normalize("NFKD").replace(/\p{M}/gu, "").replace(/[^A-Za-z0-9 ._()+-]/g, "_")).join("/");
}

/** All files of what was dropped, folders and their folders too. What cannot be read is left out. */
export async function filesOf(entries: readonly FileSystemEntry[]): Promise<Incoming[]> {
  const found: Incoming[] = [];
  const read = async (entry: FileSystemEntry): Promise<void> => {
    if (entry.name.startsWith(".")) return;
    if (entry.isFile) {
      const file = await new Promise<File>((done, failed) => (entry as FileSystemFileEntry).file(done, failed));
      found.push({ name: entry.fullPath.replace(/^\//, ""), file });
      return;
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    for (;;) {
      // It gives a hundred at a time, and none at the end.
      const some = await new Promise<FileSystemEntry[]>((done, failed) => reader.readEntries(done, failed));
      if (some.length === 0) return;
      for (const inner of some) await read(inner).catch(() => undefined);
    }
  };
  for (const entry of entries) await read(entry).catch(() => undefined);
  return found;
}
/** Files of an input; those of a folder know where in it they lie. */
export function filesOfList(files: Iterable<File>): Incoming[] {
  return [...files].map((file) => ({ name: file.webkitRelativePath || file.name, file }));
}

export interface Arrival extends Incoming {
  /** What it is called on the user's disk. */
  source: string;
  /** Bytes that the server has. */
  sent: number;
  at: "waiting" | "sending" | "there" | "refused";
  reason: string;
  /** Whether the same file could be taken another time. */
  again: boolean;
}

export interface UploadHost {
  /** @return how much of the file the server has, bytes */
  put(name: string, offset: number, piece: Blob): Promise<number>;
  wait(milliseconds: number): Promise<void>;
  changed(): void;
}

export class Upload {
  list: Arrival[] = [];
  /** Files that nobody has a use for: how many of each kind. */
  readonly left = new Map<string, number>();
  private running = new Set<Promise<void>>();

  constructor(private readonly host: UploadHost) {}

  get isBusy(): boolean {
    return this.running.size > 0;
  }
  get refused(): Arrival[] {
    return this.list.filter((a) => a.at === "refused");
  }
  /** Of the files that are not refused. */
  get totals(): { files: number; filesThere: number; bytes: number; bytesThere: number } {
    const going = this.list.filter((a) => a.at !== "refused");
    const sum = (of: (arrival: Arrival) => number) => going.reduce((total, a) => total + of(a), 0);
    return { files: going.length, filesThere: sum((a) => Number(a.at === "there")), bytes: sum((a) => a.file.size), bytesThere: sum((a) => a.sent) };
  }

  add(files: readonly Incoming[]): void {
    const known = new Map(this.list.map((a) => [a.source, a]));
    const names = new Set(this.list.map((a) => a.name));
    for (const incoming of files) {
      const { name: source, file } = incoming;
      if (!isWanted(incoming)) {
        if (!isHidden(source)) this.left.set(extensionOf(source), (this.left.get(extensionOf(source)) ?? 0) + 1);
        continue;
      }
      const before = known.get(source);
      // The same folder a second time.
      if (before && before.at !== "refused" && before.file.size === file.size) continue;
      const name = before?.name ?? this.freeName(plainName(source), names);
      const arrival: Arrival = { source, name, file, sent: 0, at: "waiting", reason: "", again: false };
      names.add(name);
      known.set(source, arrival);
      if (before) this.list.splice(this.list.indexOf(before), 1);
      this.list.push(arrival);
    }
    this.pump();
  }
  /** Two files may become alike where names are made plain. */
  private freeName(name: string, taken: ReadonlySet<string>): string {
    let number = 2;
    const dot = name.lastIndexOf(".");
    let free = name;
    while (taken.has(free)) free = `${name.slice(0, dot)}-${number++}${name.slice(dot)}`;
    return free;
  }
  /** Sends what the server could not take for a reason of its own. */
  retry(): void {
    for (const arrival of this.list) if (arrival.at === "refused" && arrival.again) Object.assign(arrival, { at: "waiting", reason: "", sent: 0 });
    this.pump();
  }
  /** Forgets everything; over when nothing is on its way any more. */
  async clear(): Promise<void> {
    this.list = [];
    this.left.clear();
    this.host.changed();
    await Promise.all(this.running);
  }

  private pump(): void {
    for (const arrival of this.list) {
      if (this.running.size >= atOnce) break;
      if (arrival.at !== "waiting") continue;
      arrival.at = "sending";
      const job: Promise<void> = this.send(arrival).then(() => void (arrival.at = "there"), (problem) => this.fail(arrival, problem)).finally(() => {
        this.running.delete(job);
        this.pump();
      });
      this.running.add(job);
    }
    this.host.changed();
  }
  private async send(arrival: Arrival): Promise<void> {
    const { name, file } = arrival;
    let begun = 1;
    let silent = 0;
    while (arrival.sent < file.size && this.list.includes(arrival)) {
      const end = Math.min(file.size, arrival.sent + pieceBytes);
      try {
        const bytes = await this.host.put(name, arrival.sent, file.slice(arrival.sent, end));
        if (bytes !== end) throw new Refusal(409, `${name}: ${bytes} bytes arrived of ${end}.`);
        arrival.sent = end;
        silent = 0;
      } catch (problem) {
        if (problem instanceof Refusal && problem.status === 409 && begun < beginnings) {
          begun += 1;
          arrival.sent = 0;
        } else if (problem instanceof Lost && silent < waits.length) {
          await this.host.wait(waits[silent++]);
        } else {
          throw problem;
        }
      }
      this.host.changed();
    }
  }
  private fail(arrival: Arrival, problem: unknown): void {
    const reason = problem instanceof Error ? problem.message : String(problem);
    const status = problem instanceof Refusal ? problem.status : 0;
    // A name that is refused stays refused; so does a file that is too large.
    const refuse = (a: Arrival) => Object.assign(a, { at: "refused", reason, again: status !== 400 && status !== 413, sent: 0 });
    refuse(arrival);
    // Where another tab has the word, the disk is full or nobody answers, the next file has no better luck.
    if (status === 423 || status === 507 || problem instanceof Lost) this.list.filter((a) => a.at === "waiting").forEach(refuse);
  }
}
