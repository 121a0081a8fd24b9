/**
 * Questions of which only the newest answer counts, such as those of a cursor that is dragged.
 *
 * One preview (of a cursor that still moves) is on its way at a time, and beside it one question that is to stay; of
 * those that wait only the newest is asked. An answer that comes after a newer one is dropped: nothing goes back.
 */

export type Ask<T> = (signal: AbortSignal) => Promise<T>;

export class Latest<T> {
  #count = 0;
  #applied = 0;
  #running = 0;
  #waiting: Ask<T> | null = null;
  #abort = new AbortController();

  constructor(
    private readonly onAnswer: (answer: T) => void,
    private readonly onError: (error: unknown) => void,
  ) {}

  ask(question: Ask<T>, { preview = false } = {}): void {
    this.#waiting = question;
    if (this.#running < (preview ? 1 : 2)) this.#next();
  }

  /** What still waits is no preview any more. */
  settle(): void {
    if (this.#running < 2) this.#next();
  }

  /** Forget everything that is on its way. */
  close(): void {
    this.#waiting = null;
    this.#abort.abort();
  }

  async #run(question: Ask<T>): Promise<void> {
    const number = ++this.#count;
    const { signal } = this.#abort;
    this.#running += 1;
    try {
      const answer = await question(signal);
      if (!signal.aborted && number > this.#applied) {
        this.#applied = number;
        this.onAnswer(answer);
      }
    } catch (error) {
      if (!signal.aborted && number === this.#count) this.onError(error);
    }
    this.#running -= 1;
    this.#next();
  }

  #next(): void {
    const next = this.#waiting;
    this.#waiting = null;
    if (next && !this.#abort.signal.aborted) void this.#run(next);
  }
}
