/** Norske ord for kinogrammet. De samme nøklene som i en-kinogram.js. */
export const words = {
  "kinogram.title": "Kinogram",
  "kinogram.alt": "Kinogram av {who}: bilder med strekfigur på kanten og 5, 10, 15 og 20 m bak den, og sju tall",
  "kinogram.large": "Vis stort",
  "kinogram.send": "Send",
  "kinogram.save": "Lagre bildet",
  "kinogram.page": "Som side, til utskrift",
};
