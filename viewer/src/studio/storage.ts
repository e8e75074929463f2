/** What keeps something in the browser. */
export type Shelf = Pick<Storage, "getItem" | "setItem" | "removeItem">;

/** The browser's own store; where it lets pages keep nothing, one that is as full as can be. */
export function storage(kind: "localStorage" | "sessionStorage"): Shelf {
  try {
    if (globalThis[kind]) return globalThis[kind];
  } catch {
    // It may not even be read, then.
  }
  return { getItem: () => null, setItem: () => { throw new Error(`${kind} cannot be had`); }, removeItem: () => {} };
}
