/**
 * Questions of which only the newest answer counts, such as those of a cursor that is dragged.
 *
 * At most two are on their way; of those that wait only the newest is asked. An answer that comes after a newer one
 * is dropped, so what is shown never goes back.
 */

const ON_THEIR_WAY = 2;

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

  ask(question: Ask<T>): void {
    if (this.#running >= ON_THEIR_WAY) this.#waiting = question;
    else void this.#run(question);
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
    const next = this.#waiting;
    this.#waiting = null;
    if (next && !signal.aborted) void this.#run(next);
  }
}
