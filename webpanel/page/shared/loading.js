/** Loads modules while the page is in use. */

import { Problem } from "./api.js";

/**
 * Load a module.
 *
 * @template T
 * @param {() => Promise<T>} load imports it
 * @returns {Promise<T>}
 * @throws {Problem} it does not come
 */
export async function bring(load) {
  try {
    return await load();
  } catch (error) {
    if (error instanceof TypeError) throw missing(); // how browsers say that a module cannot be fetched
    throw error;
  }
}

/** What is said of a file of the page that does not come. */
export function missing() {
  return new Problem(0, "page_no_connection", "no connection to the service: check network and service, then try again");
}
