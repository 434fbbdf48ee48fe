/**
 * What is said of pictures of a target and of the calibration by them, by code. As in nb-statements.js.
 *
 * @type {Record<string, [string, string?]>}
 */
export const targets = {
  target_left_near: ["drei målet 30 til 45 grader: venstre side mot kameraet"],
  target_right_near: ["drei målet 30 til 45 grader: høyre side mot kameraet"],
  target_upper_near: ["vipp målet 30 til 45 grader: overkanten mot kameraet"],
  target_lower_near: ["vipp målet 30 til 45 grader: underkanten mot kameraet"],
  target_roll: ["drei kameraet eller målet 90 grader om siktelinjen: {count} av {wanted} slike bilder"],
  target_distance: ["hold målet nærmere én gang, og lenger unna én gang"],
  target_fill: ["vis målet der det ikke har vært: {percent} % av bildet er dekket, {wanted} % trengs"],
  target_more: ["ta flere bilder: {count} av {wanted} til 15"],
  target_parts: ["fyll bildet: målene dekker bare {percent} % av det"],
  target_aside: ["ta bilder mer fra siden, også ovenfra og nedenfra: retningene skiller seg med høyst {aside} grader, {least} til 60 er godt"],
  target_turn_camera: ["drei kameraet 90 grader for to bilder til: hovedpunkt og stilling kan ikke skilles"],
  target_unsharp: ["still objektivet skarpt: kanter er {width} px brede i alle bildene"],
  target_blurred: ["ta {picture} om igjen: uskarpt (kanter {width} px brede, ellers {usual})"],
  target_residuals: ["hjørnene er {rms} px feil (rms), mer enn målefeil: ingenting må røre seg mens det eksponeres, og målet må være stivt"],
  target_good: ["kamera {camera}: godt nok for 1:{wanted}: objektivet er kjent til {lens_px} px (1:{one_to} av bildets bredde; 1:{needed} trengs)"],
  target_not_good: ["kamera {camera}: IKKE godt nok for 1:{wanted}: objektivet er kjent til {lens_px} px (1:{one_to} av bildets bredde; 1:{needed} trengs)"],
  why_two_lenses: ["kamera {camera}: bilder av to objektiv: c er {other} px i {pictures}, og {c} px i de andre: zoom eller fokus er endret underveis, eller bilder av et annet kamera er blant dem", "legg bildene av hvert objektiv i en mappe for seg"],
  why_calibrating_ended: ["programmet som arbeider med bildene, tok slutt ({why})"],
  keep_calibration: ["skriv calibration = \"{file}\" øverst i den"],
  event_calibration: ["er fra nå av {file}"],
  act_calibrating: ["begynte å ta bilder av et mål"],
  act_calibrating_ended: ["avsluttet kalibreringshjelpen"],
  act_calibrating_undone: ["tok bort det siste bildet av et mål"],
  act_calibrated: ["ba om at en kalibrering regnes ut"],
  act_calibration_saved: ["la kalibreringen i riggfilen"],
};
