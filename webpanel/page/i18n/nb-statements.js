/**
 * What the service states and refuses, by code: text, and advice. The English stands in the service. A test looks
 * that every code of the service is here.
 *
 * @type {Record<string, [string, string?]>}
 */
export const statements = {
  page_no_connection: ["ingen forbindelse med tjenesten: sjekk nettverket og tjenesten, og prøv igjen"],
  page_timeout: ["ikke noe svar i tide: se om det skjedde likevel, og prøv igjen"],
};
