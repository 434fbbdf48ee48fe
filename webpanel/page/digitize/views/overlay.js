/** Draws over the picture of a camera: marks, what is predicted, the pulse before, epipolar curves, the tape. */

import { target } from "../marking/marking.js";
import { said } from "../session/advance.js";
import { cameras, listed, state, thingOf } from "../session/state.js";

/** @typedef {import("../types.js").Place} Place */
/** @typedef {(place: Place) => Place} Project from the image to the canvas */
/** @typedef {CanvasRenderingContext2D} Context */

const HALO = "rgb(5 9 14 / 75%)";
/** Colours of the jumper's parts, as those of the stick model; the rest by their kind. @type {Record<string, string>} */
const COLOURS = { P1: "#fff35c", P2: "#ffffff", P3: "#ff9d2e", "right ski": "#ff9d2e", P4: "#59c2ff", "left ski": "#59c2ff" };
/** Colours of the curves, by the camera that they come from. */
const OF_CAMERA = ["#ff6b6b", "#3fe0c5", "#c29bff", "#ffc861", "#8ee05a"];
const RADIUS = 9;

/** @param {string} thing */
export function colourOf(thing) {
  return COLOURS[thing] ?? thingOf(thing)?.colour ?? (thing.startsWith("ball:") ? "#ff86dd" : "#8dffa8");
}

/** @param {string} camera */
export function cameraColour(camera) {
  return OF_CAMERA[cameras().indexOf(camera) % OF_CAMERA.length];
}

/**
 * @param {Context} context in CSS px
 * @param {string} camera
 * @param {Project} project
 */
export function drawOverlay(context, camera, project) {
  context.lineJoin = context.lineCap = "round";
  context.font = '600 13px "Noto Sans", "Liberation Sans", sans-serif';
  const { view, live, curves, thing } = state;
  if (view && state.ghost) drawGhosts(context, view.previous[camera] ?? {}, project);
  if (view) drawAutomatic(context, camera, project);
  for (const [from, all] of Object.entries(curves)) {
    if (all[camera] && !(live?.camera === from)) drawCurve(context, all[camera], project, cameraColour(from));
  }
  if (live && live.geometry.curves[camera]) drawCurve(context, live.geometry.curves[camera], project, cameraColour(live.camera));
  const predicted = { ...view?.predicted[camera], ...live && live.geometry.predicted[camera] ? { [thing]: live.geometry.predicted[camera] } : {} };
  for (const [name, point] of Object.entries(predicted)) {
    if (name === thing || listed().some((one) => one.name === name)) drawPredicted(context, point, project, name);
  }
  for (const name of Object.keys(view?.marks[camera] ?? {})) drawThing(context, camera, name, project);
  drawTape(context, camera, project);
}

/**
 * A line with a dark edge, seen on white and on black.
 *
 * @param {Context} context
 * @param {() => void} path
 * @param {string} colour
 * @param {number} [width]
 */
function trace(context, path, colour, width = 1.5) {
  for (const [style, wide] of /** @type {[string, number][]} */ ([[HALO, width + 2], [colour, width]])) {
    context.beginPath();
    path();
    context.strokeStyle = style;
    context.lineWidth = wide;
    context.stroke();
  }
}

/**
 * @param {Context} context
 * @param {Place[]} places on the canvas
 */
function polyline(context, places) {
  places.forEach(([x, y], index) => { if (index) context.lineTo(x, y); else context.moveTo(x, y); });
}

/**
 * @param {Context} context
 * @param {Place} at on the canvas
 * @param {string} words
 * @param {string} colour
 */
function label(context, [x, y], words, colour) {
  context.strokeStyle = HALO;
  context.lineWidth = 3;
  context.strokeText(words, x + RADIUS + 2, y - RADIUS + 2);
  context.fillStyle = colour;
  context.fillText(words, x + RADIUS + 2, y - RADIUS + 2);
}

/** @param {string} thing @returns {string} what stands at its mark */
function short(thing) {
  return { "right ski": "R", "left ski": "L" }[thing] ?? thing.replace(/^\w+:/, "");
}

/**
 * @param {Context} context
 * @param {Record<string, Place[]>} previous
 * @param {Project} project
 */
function drawGhosts(context, previous, project) {
  context.globalAlpha = 0.5;
  for (const [thing, places] of Object.entries(previous)) {
    const at = places.map(project);
    trace(context, () => {
      if (at.length > 1) return polyline(context, at);
      for (const [x, y] of at) context.arc(x, y, RADIUS - 3, 0, 2 * Math.PI);
    }, colourOf(thing), 1);
  }
  context.globalAlpha = 1;
}

/**
 * What the automatic measurement found and nobody has accepted or replaced: dashed squares and lines.
 *
 * @param {Context} context
 * @param {string} camera
 * @param {Project} project
 */
function drawAutomatic(context, camera, project) {
  context.setLineDash([4, 3]);
  for (const [thing, { xy }] of Object.entries(state.view?.automatic[camera] ?? {})) {
    if (said(state.view, camera, thing)) continue;
    const places = /** @type {Place[]} */ (typeof xy[0] === "number" ? [xy] : xy).map(project);
    trace(context, () => {
      if (places.length > 1) return polyline(context, places);
      context.rect(places[0][0] - 6, places[0][1] - 6, 12, 12);
    }, colourOf(thing));
    if (thing === state.thing) label(context, places[0], `${short(thing)} auto`, colourOf(thing));
  }
  context.setLineDash([]);
}

/**
 * An epipolar curve in the middle of its band of two sigmas.
 *
 * @param {Context} context
 * @param {import("../types.js").Curve} curve
 * @param {Project} project
 * @param {string} colour
 */
function drawCurve(context, { line, low, high }, project, colour) {
  const [below, above] = [low.map(project), high.map(project)];
  context.beginPath();
  polyline(context, [...below, ...above.reverse()]);
  context.globalAlpha = 0.25;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = 1;
  trace(context, () => polyline(context, line.map(project)), colour, 1);
}

/**
 * Where a thing should be: an ellipse of two sigmas, with a small cross.
 *
 * @param {Context} context
 * @param {import("../types.js").PredictedPoint} point
 * @param {Project} project
 * @param {string} thing
 */
function drawPredicted(context, { xy, ellipse, source }, project, thing) {
  const [[x, y], [right]] = [project(xy), project([xy[0] + 1, xy[1]])];
  const [a, b, angle] = ellipse;
  const scale = 2 * (right - x);
  context.setLineDash(source === "time" ? [2, 4] : [6, 3]);
  context.globalAlpha = thing === state.thing ? 1 : 0.55;
  trace(context, () => context.ellipse(x, y, Math.max(2, scale * a), Math.max(2, scale * b), angle, 0, 2 * Math.PI), colourOf(thing));
  context.setLineDash([]);
  trace(context, () => { for (const [dx, dy] of [[3, 3], [3, -3]]) { context.moveTo(x - dx, y - dy); context.lineTo(x + dx, y + dy); } }, colourOf(thing), 1);
  if (thing === state.thing) label(context, [x, y], `${short(thing)}?`, colourOf(thing));
  context.globalAlpha = 1;
}

/**
 * A thing that was marked: a cross that leaves its middle free, and around it a sign of how the place came about.
 *
 * @param {Context} context
 * @param {string} camera
 * @param {string} thing
 * @param {Project} project
 */
function drawThing(context, camera, thing, project) {
  const { dragged } = state;
  const marks = said(state.view, camera, thing)?.marks.filter(({ xy }) => xy) ?? [];
  if (!marks.length) return;
  const [colour, aim] = [colourOf(thing), target()];
  const at = marks.map((mark) => {
    const moving = dragged?.camera === camera && dragged.thing === thing && dragged.vertex === mark.vertex;
    return project(moving ? dragged.xy : /** @type {Place} */ (mark.xy));
  });
  if (at.length > 1) trace(context, () => polyline(context, at), colour);
  marks.forEach(({ source, state: how, vertex }, index) => {
    const [x, y] = at[index];
    trace(context, () => {
      for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
        context.moveTo(x + 3 * dx, y + 3 * dy);
        context.lineTo(x + RADIUS * dx, y + RADIUS * dy);
      }
    }, colour);
    if (how === "guess") context.setLineDash([2, 3]);
    trace(context, () => {
      if (how === "guess") context.arc(x, y, RADIUS + 2, 0, 2 * Math.PI);
      else if (source === "refined") context.arc(x, y, RADIUS - 3, 0, 2 * Math.PI);
      else if (source === "tracked") polyline(context, [[x - 7, y], [x, y - 7], [x + 7, y], [x, y + 7], [x - 7, y]]);
      else if (source === "automatic") context.rect(x - 6, y - 6, 12, 12);
    }, colour, 1);
    context.setLineDash([]);
    const aimed = aim?.camera === camera && aim.thing === thing && aim.vertex === vertex;
    if (aimed) trace(context, () => context.arc(x, y, RADIUS + 5, 0, 2 * Math.PI), "#ffffff", 1);
  });
  label(context, at[0], short(thing) + (marks[0].state === "guess" ? " ?" : ""), colour);
}

/**
 * @param {Context} context
 * @param {string} camera
 * @param {Project} project
 */
function drawTape(context, camera, project) {
  if (!state.tape) return;
  const ends = [state.tape.from[camera], state.tape.to[camera]].filter((place) => place !== undefined).map(project);
  trace(context, () => polyline(context, ends), "#ffffff", 2);
  for (const [x, y] of ends) trace(context, () => context.rect(x - 4, y - 4, 8, 8), "#ffffff", 2);
}
