/**
 * The live picture some seconds late: pictures wait in the browser, as they came, until their time.
 *
 * Their memory is bounded: ten a second come at most, for a minute at most; where they are so large that they would take
 * more, every second one is left out, and fewer are kept from then on.
 */

/** All that wait take at most so many bytes. */
export const BYTES_MAX = 48e6;
/** So long apart two pictures are at first, ms: not every one that comes is needed. */
const APART_MS = 95;
/** A picture that is older than its time by this is old: none came after it. */
const OLD_MS = 3000;

/** @typedef {{ image: Blob, at: number }} Waiting */

/**
 * @param {() => number} clock ms
 */
export function makeDelay(clock = () => performance.now()) {
  /** @type {Waiting[]} */
  let waiting = [];
  let [bytes, apartMs] = [0, APART_MS];

  return {
    /** @param {Blob} image that has just come */
    put(image) {
      const at = clock();
      if (waiting.length && at - waiting[waiting.length - 1].at < apartMs) return;
      waiting.push({ image, at });
      bytes += image.size;
      while (bytes > BYTES_MAX && waiting.length > 1) {
        waiting = waiting.filter((_, index) => (waiting.length - 1 - index) % 2 === 0);
        bytes = waiting.reduce((sum, each) => sum + each.image.size, 0);
        apartMs *= 2;
      }
    },

    /**
     * The picture of so long ago; those before it are let go.
     *
     * @param {number} seconds
     * @returns {Blob|null} null: there is none of that time
     */
    take(seconds) {
      const then = clock() - 1000 * seconds;
      while (waiting.length > 1 && waiting[1].at <= then) bytes -= waiting.shift()?.image.size ?? 0;
      const first = waiting[0];
      return first && first.at <= then && then - first.at < OLD_MS ? first.image : null;
    },

    /** How much waits. */
    held: () => ({ pictures: waiting.length, bytes }),

    clear() {
      [waiting, bytes, apartMs] = [[], 0, APART_MS];
    },
  };
}
