/** Whose the files of a result are, where a recording has several jumps. */

/** Of these every jump has its own; all others are of the whole recording. */
const OF_ONE = /\.(c3d|trc)$|^kinogram.*\.jpg$/;

/**
 * The files of one jump, and those of the whole recording.
 *
 * @param {string[]} files
 * @param {number} order of the jump among those that were measured, from 1
 */
export function filesOf(files, order) {
  return files.filter((name) => !OF_ONE.test(name) || orderOf(name) === order);
}

/** @param {string} name of a file: that of the first jump has no number */
function orderOf(name) {
  return Number(name.match(/-(\d+)\.\w+$/)?.[1] ?? 1);
}
