/** Work that can be stopped, one at a time: starting it again stops what runs. */
export class Job {
  private stopper: AbortController | null = null;
  private work: Promise<void> = Promise.resolve();
  private turn = 0;

  get isRunning(): boolean {
    return this.stopper !== null;
  }

  start(work: (signal: AbortSignal) => Promise<void>): Promise<void> {
    this.stop();
    const turn = ++this.turn;
    this.work = this.work.then(async () => {
      if (turn !== this.turn) return; // a later start has taken its place
      const stopper = (this.stopper = new AbortController());
      try {
        await work(stopper.signal);
      } finally {
        if (this.stopper === stopper) this.stopper = null;
      }
    });
    return this.work;
  }

  stop(): void {
    this.stopper?.abort(new DOMException("stopped", "AbortError"));
    this.stopper = null;
  }

  settled(): Promise<void> {
    return this.work;
  }
}
