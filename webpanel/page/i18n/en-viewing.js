/** English words of what was measured, over the pictures and beside them. Every key stands in nb-viewing.js too (a test looks). */
export const viewing = {
  "jump.number": "Jump {jump}",
  "jump.which": "Jump of this recording",
  "jump.stick": "Stick figure",
  "jump.full_screen": "Full screen",
  "jump.more": "More",
  "jump.no_drawing": "No stick figure and no curves: this jump was measured by an older version of svev. Measure it again to see them.",

  "curves.title": "Curves",
  "curves.all": "All curves",
  "curves.about": "Time and distance count from the take-off. The band is one standard deviation either side. Drag in a curve to move the video.",
  "curves.not_in_sight": "the jumper is not in sight",
  "curves.unsure": "uncertain here",
  "curves.speed": "Speed",
  "curves.height": "Height of the bindings",
  "curves.alpha": "Skis to legs, α",
  "curves.beta": "Hip, β",
  "curves.gamma": "V angle, γ",
  "curves.dphi": "Right ski minus left, Δφ",
  "curves.phi": "Slope of the skis, φ",
  "curves.angle_of_attack": "Angle of attack",
};
