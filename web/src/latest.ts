/**
 * The newest request wins: one runs, one waits, and those between are dropped.
 *
 * A drag of a slider asks more often than the engine answers. Nothing queues, and the last value is always
 * computed.
 */
export class Latest<T> {
  private running = false;
  private waiting: { readonly request: T } | null = null;
  private idle: (() => void)[] = [];

  constructor(private readonly work: (request: T) => Promise<void>) {}

  ask(request: T): void {
    this.waiting = { request };
    if (!this.running) void this.go();
  }

  /** Resolves when nothing runs and nothing waits. */
  settled(): Promise<void> {
    return this.running ? new Promise((resolve) => this.idle.push(resolve)) : Promise.resolve();
  }

  private async go(): Promise<void> {
    this.running = true;
    while (this.waiting !== null) {
      const { request } = this.waiting;
      this.waiting = null;
      await this.work(request);
    }
    this.running = false;
    const idle = this.idle;
    this.idle = [];
    for (const resolve of idle) resolve();
  }
}
