/** What tells of its changes. */
export abstract class Changing {
  private changed = new Set<() => void>();

  /** Calls `callback` after every change. */
  onChange(callback: () => void): void {
    this.changed.add(callback);
  }
  protected tell(): void {
    for (const callback of this.changed) callback();
  }
}
