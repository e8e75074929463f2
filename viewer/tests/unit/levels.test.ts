import { describe, expect, it } from "vitest";
import { textureBudget } from "../../src/levels";

const mib = 2 ** 20;

describe("memory", () => {
  it("is 512 MiB, less on phones and small devices", () => {
    expect(textureBudget({ asked: null, memory: 8, touch: false })).toBe(512 * mib);
    expect(textureBudget({ asked: null, memory: undefined, touch: false })).toBe(512 * mib);
    expect(textureBudget({ asked: null, memory: 8, touch: true })).toBe(192 * mib);
    expect(textureBudget({ asked: null, memory: 1, touch: false })).toBe(192 * mib);
  });
  it("is what the address asks for, if it is a size", () => {
    expect(textureBudget({ asked: "1024", memory: 2, touch: true })).toBe(1024 * mib);
    for (const asked of ["", "-1", "0", "much", "Infinity"]) expect(textureBudget({ asked, memory: 8, touch: false })).toBe(512 * mib);
  });
});
