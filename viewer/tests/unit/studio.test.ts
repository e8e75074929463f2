import { afterEach, describe, expect, it, vi } from "vitest";
import { follow } from "../../src/follow";
import { Api, Lost, Refusal } from "../../src/studio/api";
import { Brush } from "../../src/studio/brush";
import { merged, StrokeDocument, type StrokeList } from "../../src/studio/document";
import type { Tint } from "../../src/studio/paint";
import type { Scene, State, Stroke, Viewpoint } from "../../src/studio/protocol";
import { Latest, TintFeed } from "../../src/studio/reach";
import { FrameScheduler, type FrameWish } from "../../src/studio/scheduler";
import { Session } from "../../src/studio/session";
import { storage } from "../../src/studio/storage";

afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

const stroke = (id: string, more: Partial<Stroke> = {}): Stroke => ({ id, view: "v", kind: "paint", color: "#c08040", size: 0.02, softness: 0, reach: 1, hidden: false, points: [[0.5, 0.5, 1]], ...more });
const ids = (list: StrokeList) => list.map((s) => s.id).join("");

function shelf() {
  const kept = new Map<string, string>();
  return { kept, getItem: (k: string) => kept.get(k) ?? null, setItem: (k: string, v: string) => void kept.set(k, v), removeItem: (k: string) => void kept.delete(k) };
}
/** A server in memory. */
class Store {
  revision = 0;
  list: Stroke[] = [];
  viewpoints: Viewpoint[] = [];
  everywhere = false;
  puts = 0;
  fail: Error | null = null;
  async strokes() {
    if (this.fail instanceof Lost) throw this.fail;
    return { revision: this.revision, strokes: structuredClone(this.list), viewpoints: structuredClone(this.viewpoints), everywhere: this.everywhere };
  }
  async putStrokes(strokes: StrokeList, revision: number, viewpoints: readonly Viewpoint[], everywhere: boolean) {
    this.puts += 1;
    if (this.fail) throw this.fail;
    if (revision !== this.revision) throw new Refusal(409, "Another tab was faster.");
    this.list = structuredClone([...strokes]);
    this.viewpoints = structuredClone([...viewpoints]);
    this.everywhere = everywhere;
    return ++this.revision;
  }
}
async function opened(store = new Store(), kept = shelf()) {
  const document = new StrokeDocument(store, kept, "key");
  const told: unknown[] = [];
  document.told = (what) => void told.push(what);
  await document.load();
  return { document, store, kept, told };
}

describe("strokes", () => {
  it("are saved as they are made, one request at a time, the last list last", async () => {
    const { document, store } = await opened();
    document.add(stroke("a"));
    document.add(stroke("b"));
    document.add(stroke("c"));
    expect(store.puts).toBe(1);
    await document.save();
    expect(ids(store.list)).toBe("abc");
    expect(store.puts).toBe(2);
    expect(document.isSaved).toBe(true);
    expect(document.revision).toBe(2);
  });
  it("colour everything where that is suggested before the first, or chosen at any time", async () => {
    const { document, store, kept } = await opened();
    document.suggestEverywhere(true);
    expect([document.everywhere, store.puts]).toEqual([true, 0]);
    document.add(stroke("a"));
    await document.save();
    expect(store.everywhere).toBe(true);
    document.suggestEverywhere(false);
    expect(document.everywhere).toBe(true);
    document.setEverywhere(false);
    expect(document.isSaved).toBe(false);
    await document.save();
    expect([store.everywhere, document.isSaved]).toEqual([false, true]);
    store.everywhere = true;
    expect((await opened(store, kept)).document.everywhere).toBe(true);
  });
  it("keep their words, and those of one word change colour together", async () => {
    const { document, store, kept } = await opened();
    document.add(stroke("a", { word: "jacket" }));
    document.add(stroke("b"));
    document.add(stroke("c", { word: "jacket" }));
    document.edit("a", { hidden: true });
    document.recolour(document.list[2], "#204080");
    document.recolour(document.list[1], "#10a020");
    await document.save();
    const later = (await opened(store, kept)).document.list;
    expect(later.map((s) => [s.word, s.color])).toEqual([["jacket", "#204080"], [undefined, "#10a020"], ["jacket", "#204080"]]);
    document.undo();
    document.undo();
    expect(document.list.map((s) => s.color)).toEqual(["#c08040", "#c08040", "#c08040"]);
  });
  it("are undone and redone, whatever was done to them", async () => {
    const { document, store } = await opened();
    const states: string[] = [];
    const look = () => JSON.stringify(document.list);
    const step = (change: () => void) => (states.push(look()), change());
    step(() => document.add(stroke("a")));
    step(() => document.add(stroke("b")));
    step(() => document.edit("a", { hidden: true }));
    step(() => document.edit("a", { color: "#112233" }));
    step(() => document.remove("a"));
    states.push(look());
    for (let i = states.length - 2; i >= 0; --i) {
      document.undo();
      expect(look()).toBe(states[i]);
    }
    expect(document.canUndo).toBe(false);
    document.undo();
    for (let i = 1; i < states.length; ++i) {
      document.redo();
      expect(look()).toBe(states[i]);
    }
    expect(document.canRedo).toBe(false);
    document.undo();
    document.add(stroke("d"));
    expect(document.canRedo, "a new stroke ends the way forward").toBe(false);
    await document.save();
    expect(store.list).toEqual(document.list);
  });
  it("and what they colour are undone one after the other", async () => {
    const { document, store } = await opened();
    document.add(stroke("a"));
    document.setEverywhere(true);
    document.add(stroke("b"));
    document.undo();
    expect([ids(document.list), document.everywhere]).toEqual(["a", true]);
    document.undo();
    expect([ids(document.list), document.everywhere]).toEqual(["a", false]);
    await document.save();
    expect([ids(store.list), store.everywhere]).toEqual(["a", false]);
    document.redo();
    expect([ids(document.list), document.everywhere]).toEqual(["a", true]);
    await document.save();
    expect(store.everywhere).toBe(true);
  });
  it("that the server made of a sent picture are undone like the user's own", async () => {
    const { document, store } = await opened();
    document.add(stroke("a"));
    await document.save();
    const before = document.list;
    store.list.push(stroke("p", { kind: "picture", picture: "abc", points: [] }));
    store.revision += 1;
    // The news and the answer tell of the same list.
    await Promise.all([document.follow(2), document.follow(2)]);
    document.adopt(before);
    document.undo();
    await document.save();
    expect(ids(store.list)).toBe("a");
    document.redo();
    await document.save();
    expect(ids(store.list)).toBe("ap");
    document.adopt(document.list);
    document.undo();
    expect(ids(document.list), "nothing new is no step").toBe("a");
  });
  it("that were saved meanwhile are not lost to an older list", async () => {
    const { document, store } = await opened();
    store.list = [stroke("x")];
    store.revision = 1;
    const answers: (() => void)[] = [];
    const { strokes } = store;
    store.strokes = async () => {
      const answer = await strokes.call(store);
      await new Promise<void>((done) => answers.push(done));
      return answer;
    };
    const following = document.follow(1);
    while (answers.length === 0) await Promise.resolve();
    store.strokes = strokes;
    document.add(stroke("a"));
    await document.save();
    expect(ids(store.list)).toBe("xa");
    answers[0]();
    await following;
    expect([ids(document.list), document.revision]).toEqual(["xa", 2]);
  });
  it("of two tabs come together where the other one was faster, and undo takes back only one's own", async () => {
    const { document, store, told } = await opened();
    document.add(stroke("a"));
    await document.save();
    store.list = [stroke("a", { color: "#000000" }), stroke("x")];
    store.revision = 7;
    document.add(stroke("b"));
    await document.save();
    expect(ids(store.list)).toBe("axb");
    expect(store.list[0].color).toBe("#000000");
    expect(document.revision).toBe(8);
    expect(told).toEqual(["merged"]);
    document.undo();
    await document.save();
    expect(ids(store.list)).toBe("ax");
  });
  it("are followed without being sent back", async () => {
    const { document, store } = await opened();
    store.list = [stroke("x")];
    store.revision = 3;
    await document.follow(3);
    expect(ids(document.list)).toBe("x");
    expect(store.puts).toBe(0);
    await document.follow(2);
    expect(document.revision).toBe(3);
  });
  it("outlive a server that is away, and a page that is closed meanwhile", async () => {
    const { document, store, kept, told } = await opened();
    document.add(stroke("a"));
    await document.save();
    store.fail = new Lost("away");
    document.add(stroke("b"));
    document.remove("a");
    await document.save();
    expect(told).toContain("lost");
    expect(document.isSaved).toBe(false);
    store.fail = null;
    store.list.push(stroke("x"));
    store.revision += 1;
    const later = await opened(store, kept);
    expect(ids(later.document.list)).toBe("xb");
    expect(ids(store.list)).toBe("xb");
    expect(later.told).toEqual(["unsent"]);
    expect(kept.kept.size).toBe(0);
    // The first page comes back too: nothing is doubled.
    await document.load();
    expect(ids(store.list)).toBe("xb");
  });
  it("that the server refuses are taken back, with its reason", async () => {
    const { document, store, told } = await opened();
    document.add(stroke("a"));
    await document.save();
    store.fail = new Refusal(423, "Another tab paints here.");
    document.add(stroke("b"));
    await document.save();
    expect(ids(document.list)).toBe("a");
    expect((told[0] as Refusal).message).toBe("Another tab paints here.");
    expect(document.isSaved).toBe(true);
  });
  it("stay unsaved where another server answers in place of theirs", async () => {
    const { document, store, told, kept } = await opened();
    document.add(stroke("a"));
    await document.save();
    for (const status of [401, 404, 405]) {
      store.fail = new Refusal(status, "open the address with its ?token=");
      document.add(stroke(`b${status}`));
      await document.save();
      expect([document.isSaved, document.canUndo, kept.kept.size]).toEqual([false, true, 1]);
    }
    expect(told).toEqual(["lost", "lost", "lost"]);
    store.fail = null;
    await document.load();
    expect(ids(store.list)).toBe("ab401b404b405");
  });
  it("that are refused stay where the server's own list cannot be had", async () => {
    const { document, store, told } = await opened();
    store.fail = new Refusal(413, "too large");
    store.strokes = () => Promise.reject(new Lost("away"));
    document.add(stroke("a"));
    await document.save();
    expect([ids(document.list), document.isSaved, document.canUndo]).toEqual(["a", false, true]);
    expect(told).toContain("lost");
  });
  it("are not sent as long as nobody knows whose server answers", async () => {
    const { document, store, told } = await opened();
    document.isAway = true;
    document.add(stroke("a"));
    await document.save();
    expect([store.puts, document.isSaved, told]).toEqual([0, false, ["lost"]]);
    document.isAway = false;
    await document.load();
    expect(ids(store.list)).toBe("a");
  });
  it("that are not there are neither changed nor removed, and no step is added", async () => {
    const { document, store } = await opened();
    document.add(stroke("a"));
    document.undo();
    await document.save();
    const { puts } = store;
    document.remove("a");
    document.edit("a", { hidden: true });
    expect([document.canUndo, document.canRedo, store.puts]).toEqual([false, true, puts]);
  });
  it("that were promised to be sent wait while another tab paints", async () => {
    const { document, store, told, kept } = await opened();
    store.fail = new Lost("away");
    document.add(stroke("a"));
    await document.save();
    store.fail = new Refusal(423, "Another tab paints here.");
    await document.load();
    expect(ids(document.list)).toBe("a");
    expect(document.isWaiting).toBe(true);
    expect(kept.kept.size).toBe(1);
    const words = told.length;
    store.list = [stroke("x")];
    store.revision = 3;
    await document.follow(3);
    expect(told.length, "not said at each stroke of the other").toBe(words + 1);
    store.fail = null;
    await document.save();
    expect(ids(store.list)).toBe("xa");
    expect(document.isWaiting).toBe(false);
    expect(kept.kept.size).toBe(0);
  });
  it("survive a shelf with nonsense on it", async () => {
    for (const text of ["", "{", "[]", '{"base":1}']) {
      const kept = shelf();
      kept.setItem("key", text);
      expect((await opened(new Store(), kept)).document.list).toEqual([]);
    }
  });
  it("merge by what was done to them", () => {
    const base = [stroke("a"), stroke("b"), stroke("c")];
    const mine = [stroke("a"), stroke("c", { hidden: true }), stroke("m")];
    const theirs = [stroke("t"), stroke("b"), stroke("a", { color: "#111111" }), stroke("c")];
    const both = merged(base, mine, theirs);
    expect(ids(both)).toBe("tacm");
    expect(both[1].color).toBe("#111111");
    expect(both[2].hidden).toBe(true);
    expect(merged(base, mine, base)).toBe(mine);
    expect(merged(base, base, theirs)).toBe(theirs);
  });
});

const viewpoint = (name: string, x = 0): Viewpoint => ({ name, position: [x, 0, 1], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], lens: { width: 8, height: 6, fx: 9, fy: 9, cx: 4, cy: 3 } });
const names = (list: readonly Viewpoint[]) => list.map((v) => v.name).join(" ");

describe("viewpoints", () => {
  it("are saved while they are open, and go again where nothing was painted", async () => {
    const { document, store } = await opened();
    expect(document.freeViewpoint()).toBe("viewpoint-1");
    await document.hold(viewpoint("viewpoint-1"));
    expect(names(store.viewpoints)).toBe("viewpoint-1");
    expect(names(document.savedViewpoints)).toBe("viewpoint-1");
    expect(document.isSaved).toBe(true);
    await document.hold(null);
    expect(store.viewpoints).toEqual([]);
    expect(document.freeViewpoint(), "a name is not given twice").toBe("viewpoint-2");
    await document.hold(viewpoint("viewpoint-2"));
    document.add(stroke("a", { view: "viewpoint-2" }));
    await document.save();
    const { puts } = store;
    await document.hold(null);
    expect(names(store.viewpoints)).toBe("viewpoint-2");
    expect(store.puts, "nothing was to be saved").toBe(puts);
  });
  it("go with their last stroke and come back with undo", async () => {
    const { document, store } = await opened();
    await document.hold(viewpoint("viewpoint-1"));
    document.add(stroke("a", { view: "viewpoint-1" }));
    await document.hold(viewpoint("viewpoint-2", 5));
    document.add(stroke("b", { view: "viewpoint-2" }));
    await document.hold(null);
    document.remove("a");
    await document.save();
    expect(names(store.viewpoints)).toBe("viewpoint-2");
    document.undo();
    await document.save();
    expect(names(store.viewpoints)).toBe("viewpoint-1 viewpoint-2");
    expect(store.viewpoints[1].position).toEqual([5, 0, 1]);
  });
  it("of another tab are followed, and not sent back", async () => {
    const { document, store } = await opened();
    store.viewpoints = [viewpoint("viewpoint-4", 2)];
    store.revision = 5;
    await document.follow(5);
    expect(names(document.savedViewpoints)).toBe("viewpoint-4");
    expect(document.isSaved, "an empty one is the other tab's that paints there").toBe(true);
    expect(store.puts).toBe(0);
    expect(document.freeViewpoint()).toBe("viewpoint-5");
  });
  it("outlive a server that is away together with their strokes", async () => {
    const { document, store, kept } = await opened();
    await document.hold(viewpoint("viewpoint-1", 7));
    store.fail = new Lost("away");
    document.add(stroke("a", { view: "viewpoint-1" }));
    await document.save();
    await document.hold(null);
    store.fail = null;
    store.viewpoints = [];
    store.revision += 1;
    const later = await opened(store, kept);
    expect(later.document.isSaved).toBe(true);
    expect(names(store.viewpoints)).toBe("viewpoint-1");
    expect(store.viewpoints[0].position).toEqual([7, 0, 1]);
  });
  it("survive that another tab was faster", async () => {
    const { document, store, told } = await opened();
    store.list = [stroke("x")];
    store.revision = 3;
    await document.hold(viewpoint("viewpoint-1"));
    expect(names(store.viewpoints)).toBe("viewpoint-1");
    expect(ids(store.list)).toBe("x");
    expect(told).toEqual([]);
  });
  it("that are refused leave nothing unsaved behind", async () => {
    const { document, store, told } = await opened();
    store.fail = new Refusal(423, "Another tab paints here.");
    await document.hold(viewpoint("viewpoint-1"));
    expect(document.savedViewpoints).toEqual([]);
    expect(document.isSaved).toBe(true);
    expect((told[0] as Refusal).status).toBe(423);
  });
});

describe("brush", () => {
  it("makes strokes of its tool's kind, and remembers colours", () => {
    const kept = shelf();
    const brush = new Brush(kept);
    const kinds = (["brush", "line", "fill", "grey", "eraser"] as const).map((tool) => (brush.set({ tool }), brush.stroke("v", [[0, 0, 1]]).kind));
    expect(kinds).toEqual(["paint", "paint", "paint", "grey", "erase"]);
    brush.set({ tool: "brush", exact: true, size: 9, softness: -1, color: "#123456" });
    expect(brush.stroke("v", [])).toMatchObject({ kind: "exact", size: 0.5, softness: 0, color: "#123456" });
    brush.remember();
    brush.remember();
    const again = new Brush(kept);
    expect(again.settings.color).toBe("#123456");
    expect(again.recent.filter((c) => c === "#123456")).toEqual([again.recent[0]]);
    expect(new Set(Array.from({ length: 500 }, () => brush.stroke("v", []).id)).size).toBe(500);
  });
});

/** A clock and a server that do only what they are told. */
class Bench {
  time = 1000;
  timers: { at: number; call: () => void }[] = [];
  sent: { wish: FrameWish<string>; answer: (frame: string | null) => void; fail: (e: Error) => void }[] = [];
  shown: string[] = [];
  dropped: string[] = [];
  drawing = 0;
  problems: unknown[] = [];
  failed = (problem: unknown) => void this.problems.push(problem);
  scheduler = new FrameScheduler<string, string>({
    fetch: (wish) => new Promise((answer, fail) => this.sent.push({ wish, answer, fail })),
    cost: () => this.drawing,
    show: (frame, wish) => this.shown.push(`${frame} ${wish.share.toFixed(2)}`),
    drop: (frame) => this.dropped.push(frame),
    failed: (problem) => this.failed(problem),
    now: () => this.time,
    later: (call, milliseconds) => void this.timers.push({ at: this.time + milliseconds, call }),
  });
  async pass(milliseconds: number) {
    this.time += milliseconds;
    const due = this.timers.filter((t) => t.at <= this.time);
    this.timers = this.timers.filter((t) => t.at > this.time);
    for (const timer of due) timer.call();
    await this.settle();
  }
  async settle() {
    for (let i = 0; i < 8; ++i) await Promise.resolve();
  }
  /** The oldest request is answered after so long. */
  async answer(milliseconds = 0, frame?: string | null) {
    await this.pass(milliseconds);
    const { wish, answer } = this.sent.shift()!;
    answer(frame === undefined ? wish.camera : frame);
    await this.settle();
  }
  shares = () => this.sent.map((s) => Number(s.wish.share.toFixed(2)));
}

describe("frames", () => {
  it("are coarse while moving, then half, then full", async () => {
    const bench = new Bench();
    bench.scheduler.look("a");
    expect(bench.shares()).toEqual([0.17]);
    await bench.answer(100);
    expect(bench.sent).toHaveLength(0);
    await bench.pass(150);
    expect(bench.shares()).toEqual([0.5]);
    await bench.answer(900);
    await bench.answer(3000);
    expect(bench.shown.map((s) => s.split(" ")[1])).toEqual(["0.17", "0.50", "1.00"]);
    expect(bench.scheduler.settled).toBe(true);
    expect(bench.sent).toHaveLength(0);
  });
  it("follow the latest camera, one in flight and one waiting", async () => {
    const bench = new Bench();
    for (const camera of "abcde") bench.scheduler.look(camera);
    expect(bench.sent).toHaveLength(1);
    await bench.answer(80);
    expect(bench.sent.map((s) => s.wish.camera)).toEqual(["e"]);
    await bench.answer(80);
    expect(bench.shown.map((s) => s[0])).toEqual(["a", "e"]);
    await bench.pass(200);
    expect(bench.shares()).toEqual([0.5]);
    bench.scheduler.look("f");
    expect(bench.sent.map((s) => s.wish.camera), "a fine frame is overtaken").toEqual(["e", "f"]);
    bench.scheduler.look("g");
    expect(bench.sent).toHaveLength(2);
    await bench.answer(10, null);
    await bench.answer(60);
    expect(bench.sent.map((s) => s.wish.camera)).toEqual(["g"]);
    expect(bench.shown.at(-1)![0]).toBe("f");
  });
  it("never go back to an older or coarser one", async () => {
    const bench = new Bench();
    bench.scheduler.look("a");
    await bench.answer(100);
    await bench.pass(200);
    bench.scheduler.look("b");
    const [old] = bench.sent.splice(0, 1);
    await bench.answer(50);
    expect(bench.shown.at(-1)![0]).toBe("b");
    old.answer("a");
    await bench.settle();
    expect(bench.shown.at(-1)![0]).toBe("b");
    expect(bench.dropped, "it is let go").toEqual(["a"]);
  });
  it("get as fine as a tenth of a second allows", async () => {
    for (const [cost, share] of [[1000, Math.sqrt(0.1)], [40, 1], [8000, Math.sqrt(100 / 8000)]]) {
      const bench = new Bench();
      for (let i = 0; i < 10; ++i) {
        bench.scheduler.look(String(i));
        while (bench.sent.length > 0) await bench.answer(cost * bench.sent[0].wish.share ** 2);
      }
      expect(bench.scheduler.coarse).toBeCloseTo(share, 6);
    }
  });
  it("are asked for again when colours change, without a coarse one", async () => {
    const bench = new Bench();
    bench.scheduler.refresh();
    expect(bench.sent, "nothing before there is a camera").toHaveLength(0);
    bench.scheduler.look("a");
    await bench.answer(100);
    await bench.pass(200);
    await bench.answer(500);
    await bench.answer(2000);
    bench.scheduler.refresh();
    bench.scheduler.refresh();
    expect(bench.shares()).toEqual([0.5]);
    await bench.answer(500);
    expect(bench.shares(), "the second change came while the first was drawn").toEqual([0.5]);
  });
  it("stay small while the server draws in passing, by what it drew and not by how long it waited", async () => {
    const bench = new Bench();
    bench.scheduler.inPassing = true;
    bench.drawing = 100;
    bench.scheduler.look("a");
    expect(bench.sent[0].wish.moving).toBe(true);
    await bench.answer(20000);
    expect(bench.scheduler.coarse, "a long wait says nothing").toBeCloseTo(1 / 6, 6);
    await bench.pass(200);
    expect(bench.shares()).toEqual([0.33]);
    expect(bench.sent[0].wish.moving).toBe(false);
    bench.drawing = 400;
    await bench.answer(20000);
    expect(bench.sent).toHaveLength(0);
    expect(bench.scheduler.settled, "that is as fine as it gets").toBe(true);
    bench.scheduler.inPassing = false;
    expect(bench.scheduler.settled).toBe(false);
    expect(bench.shares()).toEqual([0.5]);
    await bench.answer(500);
    await bench.answer(2000);
    expect(bench.scheduler.settled).toBe(true);
    bench.scheduler.coarse = 1;
    bench.scheduler.inPassing = true;
    bench.scheduler.look("b");
    expect(bench.shares(), "while moving too").toEqual([0.5]);
  });
  it("stop for a while where the server is away", async () => {
    const bench = new Bench();
    bench.scheduler.look("a");
    bench.sent.shift()!.fail(new Lost("away"));
    await bench.settle();
    expect(bench.problems).toHaveLength(1);
    bench.scheduler.look("b");
    expect(bench.sent).toHaveLength(0);
    await bench.pass(2000);
    expect(bench.sent.map((s) => s.wish.camera)).toEqual(["b"]);
  });
  it("go on after a failure that nobody expected", async () => {
    const bench = new Bench();
    bench.failed = (problem) => {
      throw problem;
    };
    const asked = vi.spyOn(bench.scheduler as unknown as { ask(): Promise<void> }, "ask");
    bench.scheduler.look("a");
    const told = expect(asked.mock.results[0].value).rejects.toThrow("odd");
    bench.sent.shift()!.fail(new Error("odd"));
    await told;
    await bench.pass(2000);
    expect(bench.sent.map((s) => s.wish.camera)).toEqual(["a"]);
  });
});

/** What the server answers next. */
const answering = (body: BodyInit | null, status = 200) => vi.stubGlobal("fetch", async () => new Response(body, { status }));

describe("the server's answers", () => {
  it("leave out of strokes what has its default", async () => {
    const [painted, hard] = [{ id: "p", view: "v", kind: "picture", color: "#808080", size: 0.02, reach: 1, picture: "0123456789ab" }, { ...stroke("h"), softness: undefined, hidden: undefined }];
    answering(JSON.stringify({ revision: 3, strokes: [painted, hard], viewpoints: [] }));
    const { strokes, everywhere } = await new Api().strokes();
    expect(strokes[0]).toEqual({ ...painted, softness: 0, hidden: false, points: [] });
    expect(strokes[1]).toEqual(stroke("h"));
    expect(everywhere).toBe(false);
  });
  it("that break off are those of a server that is lost", async () => {
    answering(new ReadableStream({ start: (body) => body.error(new TypeError("the connection was reset")) }));
    await expect(new Api().state()).rejects.toBeInstanceOf(Lost);
  });
  it("may have no body", async () => {
    answering(null, 204);
    expect(await new Api().frame({ ...viewpoint("v"), sides: [""] })).toBe(null);
  });
});

describe("a browser that keeps nothing", () => {
  const kinds = ["localStorage", "sessionStorage"] as const;
  it("has a studio all the same, which knows that it is not kept", async () => {
    for (const kind of kinds) Object.defineProperty(globalThis, kind, { configurable: true, get: () => { throw new Error("SecurityError"); } });
    expect(new Api().client).toMatch(/^[a-z0-9]{16}$/);
    const brush = new Brush();
    brush.set({ size: 0.1 });
    expect(brush.settings.size).toBe(0.1);
    const store = new Store();
    const document = new StrokeDocument(store, storage("localStorage"), "key");
    store.fail = new Lost("away");
    document.add(stroke("a"));
    await document.save();
    expect(document.isKept).toBe(false);
    for (const kind of kinds) delete (globalThis as Record<string, unknown>)[kind];
  });
});

describe("a stream", () => {
  it("is opened anew where it was refused, until it is ended", () => {
    vi.useFakeTimers();
    const made: { readyState: number; onmessage: (event: { data: string }) => void; onerror: () => void; close: () => void }[] = [];
    class Stream {
      static readonly CLOSED = 2;
      readyState = 0;
      close = vi.fn();
      constructor(readonly url: string) {
        made.push(this as never);
      }
    }
    vi.stubGlobal("EventSource", Stream);
    const heard: number[] = [];
    const lost = vi.fn();
    const end = follow<{ version: number }>("./events", ({ version }) => heard.push(version), lost);
    made[0].onerror();
    vi.advanceTimersByTime(5000);
    expect(made, "the browser connects again by itself").toHaveLength(1);
    made[0].readyState = Stream.CLOSED;
    made[0].onerror();
    vi.advanceTimersByTime(5000);
    expect(made).toHaveLength(2);
    made[1].onmessage({ data: '{"version":7}' });
    end();
    vi.advanceTimersByTime(5000);
    expect([heard, lost.mock.calls.length, made.length]).toEqual([[7], 2, 2]);
    expect(made[1].close).toHaveBeenCalled();
  });
});

describe("a session", () => {
  it("that lost the server asks until it answers, though its stream says nothing", async () => {
    vi.useFakeTimers();
    vi.stubGlobal("window", globalThis);
    vi.stubGlobal("document", { getElementById: () => ({ classList: { add: () => {}, remove: () => {} } }) });
    const store = new Store();
    const state = { stage: "field", scene: 1, strokes: 0, take: "", writer: "", version: 1 } as State;
    const answers = vi.fn(async () => state).mockRejectedValueOnce(new Lost("away"));
    const api = Object.assign(store, { client: "me", state: answers, scene: async () => ({ run: "r" }) });
    const session = new Session(api as unknown as Api, { run: "r", views: [] as Scene["views"] } as Scene, state);
    session.explain(new Lost("one request"));
    session.strokes.add(stroke("a"));
    await vi.advanceTimersByTimeAsync(2000);
    expect([session.isLost, store.list]).toEqual([true, []]);
    await vi.advanceTimersByTimeAsync(2000);
    expect([session.isLost, ids(store.list)]).toEqual([false, "a"]);
    await vi.advanceTimersByTimeAsync(9000);
    expect(answers).toHaveBeenCalledTimes(2);
  });
  it("whose stream broke waits for it, and one that ended asks for nothing", async () => {
    vi.useFakeTimers();
    const state = { stage: "field", scene: 1, strokes: 0, take: "", writer: "", version: 1 } as State;
    const answers = vi.fn(async () => state);
    let broken = () => {};
    const listen = (_: unknown, lost: () => void) => ((broken = lost), () => {});
    const api = Object.assign(new Store(), { client: "me", state: answers, listen });
    const session = new Session(api as unknown as Api, { run: "r", views: [] as Scene["views"] } as Scene, state);
    void session.listen();
    broken();
    await vi.advanceTimersByTimeAsync(5000);
    expect(session.isLost).toBe(true);
    session.end();
    session.lose();
    answers.mockClear();
    await vi.advanceTimersByTimeAsync(9000);
    expect([session.isLost, answers.mock.calls.length]).toEqual([false, 0]);
  });
});

describe("a tint", () => {
  it("that comes when another one is wanted is left out, and its picture let go", async () => {
    const answers: (() => void)[] = [];
    const close = vi.fn();
    vi.stubGlobal("createImageBitmap", async () => ({ width: 1, height: 1, close }));
    vi.stubGlobal("OffscreenCanvas", class {
      getContext = () => ({ drawImage: () => {}, getImageData: () => ({ data: new Uint8ClampedArray([200, 40, 30, 255]) }) });
    });
    const session = { open: "v", photo: 0, strokes: { unsaved: [], revision: 1, everywhere: false }, api: { reach: () => new Promise<Blob>((done) => answers.push(() => done(new Blob()))) } };
    const put: (Tint | null)[] = [];
    const feed = new TintFeed(session as unknown as Session, (_, tint) => put.push(tint));
    const answer = async () => {
      answers.shift()!();
      await new Promise((done) => setTimeout(done));
    };
    feed.ask("reach", "v", null);
    feed.ask("reach", "v", null);
    feed.ask("none", "v", null);
    await answer();
    expect(put).toEqual([null]);
    expect(answers, "nor is it asked for").toHaveLength(0);
    // While a stroke grows one wish follows the other: each answer is shown.
    feed.ask("reach", "v", null);
    feed.ask("reach", "v", null);
    await answer();
    expect(put).toHaveLength(2);
    await answer();
    expect(put[2]).toMatchObject({ width: 1, height: 1 });
    expect(close).toHaveBeenCalledTimes(3);
  });
});

describe("latest", () => {
  it("leaves out what was overtaken", async () => {
    const latest = new Latest();
    const ran: string[] = [];
    let end = () => {};
    const first = latest.run(() => (ran.push("a"), new Promise((done) => (end = done))));
    for (const name of "bcd") void latest.run(async () => void ran.push(name));
    end();
    await first;
    expect(ran.join("")).toBe("ad");
  });
});
