/** English words of loading a start list. Every key stands in nb-startlist.js too (a test looks). */
export const words = {
  "list.load": "Load a list",
  "list.loaded": "The start list has {jumpers} jumpers.",
  "list.refused": "The list was not loaded: {why}",
  "list.columns": "An Excel workbook (.xlsx) or CSV. One line names the columns: bib, athlete, gate, club, and any others.",
  "list.preview": "Load this list?",
  "list.found": "Jumpers in the file: {jumpers}; in the list now: {present}.",
  "list.heading_alone": "The file has columns, but no jumper. In the list now: {present}. Loading it empties the list.",
  "list.columns_added": "New columns: {columns}",
  "list.columns_removed": "No longer there: {columns}",
  "list.and_more": "and {more} more",
  "list.which_sheet": "Several sheets hold a list. Which one?",
  "list.which_letters": "Its letters can be read in several ways. Which names are right?",
  "list.replace": "Replace",
  "list.empty": "Empty the list",
};
