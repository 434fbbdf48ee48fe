"""The third renderer of the corpus: path-traced pictures by Debian's `blender` (Cycles), with sun, sky and shadows.

`meshes` makes shapes, `figure` the jumper, `scenery` what stands still; `stage` puts both into one description,
`in_blender` renders it inside Blender, `hill` makes the images of the cameras of what was rendered.
"""
