/** English words of the kinogram. Every key stands in nb-kinogram.js too (a test looks). */
export const words = {
  "kinogram.title": "Kinogram",
  "kinogram.alt": "Kinogram of {who}: pictures with the stick figure at the edge and 5, 10, 15 and 20 m behind it, and seven figures",
  "kinogram.large": "Show it large",
  "kinogram.send": "Send",
  "kinogram.save": "Save the picture",
  "kinogram.page": "As a page, to print",
};
