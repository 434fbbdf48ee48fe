/** What this browser remembers between visits: look, language, session fields. Nothing secret. */

const PREFIX = "svev.";

/**
 * @template T
 * @param {string} name
 * @param {T} otherwise when nothing (or nothing readable) is remembered
 * @returns {T}
 */
export function load(name, otherwise) {
  try {
    const text = localStorage.getItem(PREFIX + name);
    return text === null ? otherwise : JSON.parse(text);
  } catch {
    return otherwise; // storage is switched off, or was written by another version: begin anew
  }
}

/**
 * @param {string} name
 * @param {unknown} value
 */
export function save(name, value) {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch {
    console.warn(`"${name}" cannot be remembered: this browser's storage is full or switched off`);
  }
}
