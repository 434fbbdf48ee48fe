/** Norske ord om å lese inn en startliste. De samme nøklene som i en-startlist.js. */
export const words = {
  "list.load": "Les inn en liste",
  "list.loaded": "Startlisten har {jumpers} hoppere.",
  "list.refused": "Listen ble ikke lest inn: {why}",
  "list.columns": "En Excel-arbeidsbok (.xlsx) eller CSV. Én linje navngir kolonnene: startnr, navn, bom, klubb, og eventuelt andre.",
  "list.preview": "Lese inn denne listen?",
  "list.found": "Hoppere i filen: {jumpers}; i listen nå: {present}.",
  "list.heading_alone": "Filen har kolonner, men ingen hopper. I listen nå: {present}. Å lese den inn tømmer listen.",
  "list.columns_added": "Nye kolonner: {columns}",
  "list.columns_removed": "Ikke lenger med: {columns}",
  "list.and_more": "og {more} til",
  "list.which_sheet": "Flere ark har en liste. Hvilket?",
  "list.which_letters": "Bokstavene kan leses på flere måter. Hvilke navn er riktige?",
  "list.replace": "Erstatt",
  "list.empty": "Tøm listen",
};
