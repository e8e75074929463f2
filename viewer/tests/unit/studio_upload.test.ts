import { describe, expect, it } from "vitest";
import { Lost, Refusal } from "../../src/studio/api";
import { extensionOf, filesOf, isWanted, pieceBytes, plainName, Upload, type Incoming } from "../../src/studio/upload";

/** A blob that is large without taking memory. */
const blob = (size: number): Blob => ({ size, slice: (from: number, to: number) => blob(Math.min(to, size) - from) }) as Blob;
const incoming = (name: string, size = 1000): Incoming => ({ name, file: blob(size) });

/** A server in memory that says no where it is told to. */
class Host {
  there = new Map<string, number>();
  puts: [string, number, number][] = [];
  waited: number[] = [];
  /** Called before each piece; what it throws is the answer. */
  before: (name: string, offset: number, count: number) => void = () => {};
  atOnce = 0;
  most = 0;
  upload = new Upload({
    put: (name, offset, piece) => this.put(name, offset, piece),
    wait: async (milliseconds) => void this.waited.push(milliseconds),
    changed: () => {},
  });
  async put(name: string, offset: number, piece: Blob) {
    this.puts.push([name, offset, piece.size]);
    this.most = Math.max(this.most, ++this.atOnce);
    await Promise.resolve();
    this.atOnce -= 1;
    this.before(name, offset, this.puts.length);
    const size = offset === 0 ? 0 : (this.there.get(name) ?? 0);
    if (size !== offset) throw new Refusal(409, `${name}: ${size} bytes are here.`);
    this.there.set(name, offset + piece.size);
    return offset + piece.size;
  }
  async done() {
    while (this.upload.isBusy) await new Promise((next) => setTimeout(next));
  }
}
async function sent(files: Incoming[], before?: Host["before"]) {
  const host = new Host();
  if (before) host.before = before;
  host.upload.add(files);
  await host.done();
  return host;
}

describe("what is sent", () => {
  it("is what the server has a use for", () => {
    const wanted = (name: string) => isWanted(incoming(name));
    for (const name of ["a.jpg", "a/b/IMG 1.JPEG", "x.tif", "clip.MOV", "sparse/0/cameras.bin", "points3D.txt", "poses_bounds.npy", "a.b.png"]) expect(wanted(name), name).toBe(true);
    for (const name of ["Thumbs.db", "IMG_1.HEIC", "notes.doc", "README", ".DS_Store", "._IMG.jpg", ".git/x.jpg", "a/.cache/b.png", "jpg"]) expect(wanted(name), name).toBe(false);
    expect(isWanted(incoming("empty.jpg", 0))).toBe(false);
    expect([extensionOf("a/b.c/D.TIFF"), extensionOf("a.b/c"), extensionOf(".jpg")]).toEqual(["tiff", "", ""]);
  });
  it("is named as the server takes it, and no two alike", async () => {
    expect(plainName("Küche/Über uns (2)+1.jpg")).toBe("Kuche/Uber uns (2)+1.jpg");
    const host = await sent([incoming("写真.jpg"), incoming("図面.jpg"), incoming("a/é.jpg")]);
    expect([...host.there.keys()]).toEqual(["__.jpg", "__-2.jpg", "a/e.jpg"]);
    expect(host.upload.list.map((a) => a.source)).toEqual(["写真.jpg", "図面.jpg", "a/é.jpg"]);
  });
  it("leaves out the rest and counts it", async () => {
    const host = await sent([incoming("a.jpg"), incoming("Thumbs.db"), incoming("b.heic"), incoming("c.heic"), incoming(".DS_Store")]);
    expect(host.upload.totals).toEqual({ files: 1, filesThere: 1, bytes: 1000, bytesThere: 1000 });
    expect(Object.fromEntries(host.upload.left)).toEqual({ db: 1, heic: 2 });
  });
  it("is found in folders in folders, a hundred at a time, without the hidden ones", async () => {
    const file = (fullPath: string) => ({ isFile: true, name: fullPath.split("/").at(-1), fullPath, file: (done: (f: Blob) => void) => done(blob(5)) });
    const folder = (fullPath: string, inner: unknown[]) => ({
      isFile: false, name: fullPath.split("/").at(-1), fullPath,
      createReader: () => {
        const rest = [...inner];
        return { readEntries: (done: (list: unknown[]) => void) => done(rest.splice(0, 100)) };
      },
    });
    const broken = { isFile: true, name: "broken.jpg", fullPath: "/capture/broken.jpg", file: (_: unknown, failed: (e: Error) => void) => failed(new Error("gone")) };
    const images = Array.from({ length: 230 }, (_, i) => file(`/capture/images/${i}.jpg`));
    const entries = [folder("/capture", [broken, folder("/capture/images", images), folder("/capture/.git", [file("/capture/.git/x.jpg")])]), file("/loose.png")];
    const found = await filesOf(entries as unknown as FileSystemEntry[]);
    expect(found).toHaveLength(231);
    expect(found[0].name).toBe("capture/images/0.jpg");
    expect(found.at(-1)!.name).toBe("loose.png");
  });
});

describe("sending", () => {
  it("goes in pieces, one after the other, three files at a time", async () => {
    const large = 2.5 * pieceBytes;
    const host = await sent([incoming("clip.mp4", large), ...Array.from({ length: 8 }, (_, i) => incoming(`${i}.jpg`))]);
    expect(host.puts.filter(([name]) => name === "clip.mp4").map(([, offset, size]) => [offset / pieceBytes, size / pieceBytes])).toEqual([[0, 1], [1, 1], [2, 0.5]]);
    expect(host.most).toBe(3);
    expect(host.there.get("clip.mp4")).toBe(large);
    expect(host.upload.totals.filesThere).toBe(9);
  });
  it("begins a file anew where the server has another part of it", async () => {
    let isOther = true;
    const host = await sent([incoming("clip.mp4", 3 * pieceBytes)], (_, offset) => {
      if (offset !== pieceBytes || !isOther) return;
      isOther = false;
      throw new Refusal(409, "17 bytes are here.");
    });
    expect(host.puts.map(([, offset]) => offset / pieceBytes)).toEqual([0, 1, 0, 1, 2]);
    expect(host.upload.list[0]).toMatchObject({ at: "there", sent: 3 * pieceBytes });
  });
  it("gives up a file that never comes out right", async () => {
    const host = await sent([incoming("a.jpg"), incoming("b.jpg")], (name) => {
      if (name === "a.jpg") throw new Refusal(409, "another length");
    });
    expect(host.upload.refused.map((a) => [a.name, a.reason, a.again])).toEqual([["a.jpg", "another length", true]]);
    expect(host.there.get("b.jpg")).toBe(1000);
    expect(host.puts.filter(([name]) => name === "a.jpg")).toHaveLength(4);
  });
  it("waits for a server that is silent, longer each time", async () => {
    const host = await sent([incoming("a.jpg", 2 * pieceBytes)], (_, offset, count) => {
      if (offset > 0 && count <= 4) throw new Lost("away");
    });
    expect(host.waited).toEqual([500, 1000, 2000]);
    expect(host.upload.list[0].at).toBe("there");
  });
  it("does not stop at a refusal", async () => {
    const host = await sent(Array.from({ length: 6 }, (_, i) => incoming(`${i}.jpg`)), (name) => {
      if (name === "1.jpg") throw new Refusal(400, "1.jpg: it is no picture.");
      if (name === "2.jpg") throw new Refusal(413, "2.jpg: too large.");
    });
    expect(host.upload.refused.map((a) => [a.reason, a.again])).toEqual([["1.jpg: it is no picture.", false], ["2.jpg: too large.", false]]);
    expect(host.there.size).toBe(4);
    expect(host.upload.totals).toEqual({ files: 4, filesThere: 4, bytes: 4000, bytesThere: 4000 });
  });
  it("stops where the disk is full, and can be taken up again", async () => {
    let full = true;
    const host = await sent(Array.from({ length: 8 }, (_, i) => incoming(`${i}.jpg`)), () => {
      if (full) throw new Refusal(507, "The disk is full.");
    });
    expect(host.puts.length).toBeLessThanOrEqual(3);
    expect(host.upload.refused).toHaveLength(8);
    full = false;
    host.upload.retry();
    await host.done();
    expect(host.there.size).toBe(8);
    expect(host.upload.refused).toHaveLength(0);
  });
  it("sends a folder once that is dropped twice, and forgets it when told to", async () => {
    const host = await sent([incoming("a.jpg"), incoming("b.jpg")]);
    host.upload.add([incoming("a.jpg"), incoming("b.jpg", 2000), incoming("c.jpg")]);
    await host.done();
    expect(host.puts.map(([name]) => name).join(" ")).toBe("a.jpg b.jpg b.jpg c.jpg");
    host.upload.add([incoming("d.mp4", 9 * pieceBytes)]);
    await host.upload.clear();
    expect(host.upload.list).toEqual([]);
    expect(host.there.get("d.mp4"), "what is under way ends with its piece").toBe(pieceBytes);
    host.upload.add([incoming("a.jpg")]);
    await host.done();
    expect(host.upload.totals.filesThere).toBe(1);
  });
});
