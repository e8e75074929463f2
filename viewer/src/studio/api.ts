/** The server, as seen from the page. */

import { follow } from "../follow";
import type { FrameRequest, Scene, State, Stroke, Viewpoint } from "./protocol";
import { storage } from "./storage";
import { words } from "./words";

/** The server says no, with its reason. */
export class Refusal extends Error {
  constructor(readonly status: number, reason: string) {
    super(reason);
  }
}
/** The server did not answer. */
export class Lost extends Error {}

/** Survives a reload of the page, so that it stays the writer; a second tab gets one of its own. */
function clientId(): string {
  const key = "cnerf-studio-client";
  const [navigation] = performance.getEntriesByType("navigation") as PerformanceNavigationTiming[];
  const shelf = storage("sessionStorage");
  const id = (navigation?.type === "reload" ? shelf.getItem(key) : null) ?? randomId(16);
  try {
    shelf.setItem(key, id);
  } catch {
    // After a reload it is another one, then.
  }
  return id;
}

export function randomId(length: number): string {
  const letters = "abcdefghijklmnopqrstuvwxyz0123456789";
  return [...crypto.getRandomValues(new Uint8Array(length))].map((byte) => letters[byte % letters.length]).join("");
}

export class Api {
  readonly client = clientId();

  /** @return the answer with all of its body */
  async send(method: string, path: string, body?: BodyInit, headers: Record<string, string> = {}): Promise<Response> {
    const own: Record<string, string> = method === "GET" ? {} : { "X-Cnerf": "1", "X-Cnerf-Client": this.client };
    let answer: Response;
    try {
      answer = await fetch(`./studio/${path}`, { method, body, headers: { ...own, ...headers }, cache: method === "GET" ? "default" : "no-store" });
      if (answer.ok && answer.status !== 204) answer = new Response(await answer.blob(), answer);
    } catch {
      throw new Lost(words.lostForGood);
    }
    if (answer.ok) return answer;
    const reason = (await answer.text().catch(() => "")).trim();
    throw new Refusal(answer.status, reason && reason.length < 500 ? reason : `${answer.status} ${answer.statusText}`);
  }

  private async stateIn(answer: Response): Promise<State | undefined> {
    const said = (await answer.json().catch(() => ({}))) as State & { state?: State };
    return said.state ?? (said.version ? said : undefined);
  }
  private post(path: string, value: unknown): Promise<Response> {
    return this.send("POST", path, JSON.stringify(value), { "Content-Type": "application/json" });
  }

  async scene(): Promise<Scene> {
    return (await this.send("GET", "scene", undefined, { "Cache-Control": "no-cache" })).json();
  }
  async state(): Promise<State> {
    return (await this.send("GET", "state")).json();
  }
  async order(order: Record<string, unknown>): Promise<State | undefined> {
    return this.stateIn(await this.post("orders", order));
  }
  /** null: a newer frame was asked for meanwhile. */
  async frame(request: FrameRequest): Promise<{ pictures: ImageBitmap[]; colors: number; milliseconds: number } | null> {
    const answer = await this.post("frame", request);
    if (answer.status === 204) return null;
    const all = await answer.blob();
    let end = 0;
    const parts = (answer.headers.get("X-Cnerf-Sizes") ?? String(all.size)).split(",").map((size) => all.slice(end, (end += Number(size)), all.type));
    const pictures = await Promise.all(parts.map((part) => createImageBitmap(part)));
    return { pictures, colors: Number(answer.headers.get("X-Cnerf-Colors") ?? -1), milliseconds: Number(answer.headers.get("X-Cnerf-Milliseconds") ?? 0) };
  }

  async strokes(): Promise<{ revision: number; strokes: Stroke[]; viewpoints: Viewpoint[]; everywhere: boolean }> {
    const { revision, strokes, viewpoints = [], everywhere = false } = await (await this.send("GET", "strokes", undefined, { "Cache-Control": "no-cache" })).json();
    // The server leaves out what is 0, false or empty.
    return { revision, strokes: strokes.map((stroke: Partial<Stroke>) => ({ softness: 0, hidden: false, points: [], ...stroke })), viewpoints, everywhere };
  }
  async putStrokes(strokes: readonly Stroke[], revision: number, viewpoints: readonly Viewpoint[] = [], everywhere = false): Promise<number> {
    const headers = { "Content-Type": "application/json", "X-Cnerf-Revision": String(revision) };
    return (await (await this.send("PUT", "strokes", JSON.stringify({ strokes, viewpoints, everywhere }), headers)).json()).revision;
  }
  async reach(view: number, strokes: readonly Stroke[], revision: number, everywhere = false): Promise<Blob> {
    return (await (strokes.length > 0 ? this.post("reach", { view, strokes, everywhere }) : this.send("GET", `reach/${view}?revision=${revision}`))).blob();
  }
  async picture(query: Record<string, string>, file: Blob): Promise<State | undefined> {
    return this.stateIn(await this.send("POST", `pictures?${new URLSearchParams(query)}`, file, { "Content-Type": file.type || "application/octet-stream" }));
  }
  /** The next piece of a file that is sent. @return how much of it the server has now, bytes */
  async arrive(name: string, offset: number, piece: Blob): Promise<number> {
    // Not URLSearchParams: its "+" for a space is not every server's.
    const answer = await this.send("PUT", `arrivals?name=${encodeURIComponent(name)}&offset=${offset}`, piece, { "Content-Type": "application/octet-stream" });
    return (await answer.json()).bytes;
  }
  /** Follows the states. @return what ends it */
  listen(heard: (state: State) => void, lost: () => void): () => void {
    // A stream cannot carry headers: the client's name goes into its address.
    return follow(`./studio/events?client=${this.client}`, heard, lost);
  }
}
