/**
 * What the service says while somebody measures by hand, by code. As in nb-statements.js.
 *
 * @type {Record<string, [string, string?]>}
 */
export const digitizing = {
  hand_ended: ["programmet som regner, ble avsluttet av noe annet: regn ut på nytt"],
};
