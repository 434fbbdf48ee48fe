"""Runs inside Blender: renders what a description asks for. `blender -b --python in_blender.py -- DESCRIPTION.json`.

The description is made by `bench.corpus.path_traced.stage`. A picture that is there already is not rendered again, so
that a run that was stopped goes on where it was. Blender's own Python has neither NumPy nor this package.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Vector

_FRAMES = 10  # from shot to shot: the moments before and after one have no part in the next one's motion blur


def main() -> None:
    """Render all shots of the description that the command line names."""
    path = Path(sys.argv[sys.argv.index("--") + 1])
    told = json.loads(path.read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    _settings(told)
    _light(told)
    materials = {name: _material(name, of) for name, of in told["materials"].items()}
    meshes = {name: _mesh(name, of, materials) for name, of in told["meshes"].items()}
    for name, places in told["still"].items():
        for place in places:
            _put(meshes[name]).matrix_world = Matrix(place)
    mover = bpy.data.objects.new("mover", None)
    bpy.context.collection.objects.link(mover)
    parts = {name: _put(meshes[mesh]) for name, mesh in told["parts"].items()}
    for part in parts.values():
        part.parent = mover
    _move(mover, told["shots"])
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    for number, shot in enumerate(told["shots"]):
        if not (path.parent / f"{shot['name']}.json").exists():
            _shoot(path.parent, told, shot, number, camera, parts)


def _settings(told: dict[str, Any]) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.use_persistent_data = True
    scene.render.resolution_percentage = 100
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 1.0
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.dither_intensity = 0.0
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "BW"
    scene.render.image_settings.color_depth = "16"
    scene.view_settings.view_transform = "Raw"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.max_bounces = cycles.diffuse_bounces = told["bounces"]
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 2.0


def _light(told: dict[str, Any]) -> None:
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    background.inputs["Strength"].default_value = told["sky"]
    if told["sun"]:
        light = bpy.data.lights.new("sun", "SUN")
        light.energy, light.angle = told["sun"]["irradiance"], math.radians(0.53)
        sun = bpy.data.objects.new("sun", light)
        sun.rotation_euler = Vector(told["sun"]["towards"]).to_track_quat("Z", "Y").to_euler()
        bpy.context.collection.objects.link(sun)


def _material(name: str, of: dict[str, Any]) -> Any:
    """A rough material: albedo with a texture of its contrast and grain, bumps, a share of gloss."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.remove(nodes["Principled BSDF"])
    rough = nodes.new("ShaderNodeBsdfDiffuse")
    rough.inputs["Color"].default_value = (of["albedo"],) * 3 + (1,)
    rough.inputs["Roughness"].default_value = of["roughness"]
    surfaces, top = [rough], rough.outputs["BSDF"]
    if of["gloss"]:
        glossy, both = nodes.new("ShaderNodeBsdfGlossy"), nodes.new("ShaderNodeMixShader")
        glossy.inputs["Roughness"].default_value = 0.4
        both.inputs["Fac"].default_value = of["gloss"]
        links.new(rough.outputs["BSDF"], both.inputs[1])
        links.new(glossy.outputs["BSDF"], both.inputs[2])
        surfaces, top = [rough, glossy], both.outputs["Shader"]
    links.new(top, nodes["Material Output"].inputs["Surface"])
    if of["contrast"]:
        place, noise, shade = (nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "TexNoise", "MapRange"))
        noise.inputs["Scale"].default_value = 1 / of["grain_m"]
        noise.inputs["Detail"].default_value = 2.0
        links.new(place.outputs["Object"], noise.inputs["Vector"])
        low, high = (min(1.0, of["albedo"] * (1 + sign * of["contrast"])) for sign in (-1, 1))
        for key, value in {"From Min": 0.25, "From Max": 0.75, "To Min": max(0.0, low), "To Max": high}.items():
            shade.inputs[key].default_value = value
        links.new(noise.outputs["Fac"], shade.inputs["Value"])
        links.new(shade.outputs["Result"], rough.inputs["Color"])
        if of["bump_m"]:
            bump = nodes.new("ShaderNodeBump")
            bump.inputs["Distance"].default_value = of["bump_m"]
            links.new(noise.outputs["Fac"], bump.inputs["Height"])
            for surface in surfaces:
                links.new(bump.outputs["Normal"], surface.inputs["Normal"])
    return material


def _mesh(name: str, of: dict[str, Any], materials: dict[str, Any]) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(of["corners"], [], of["faces"])
    for material in of["materials"]:
        mesh.materials.append(materials[material])
    for face in mesh.polygons:
        face.use_smooth = of["smooth"]
    for face in of["marked"]:
        mesh.polygons[face].material_index = 1
    mesh.update()
    return mesh


def _put(mesh: Any) -> Any:
    thing = bpy.data.objects.new(mesh.name, mesh)
    bpy.context.collection.objects.link(thing)
    return thing


def _move(mover: Any, shots: list[dict[str, Any]]) -> None:
    """Let the jumper move through each exposure, which lasts half a frame before and half a frame after the shot."""
    for number, shot in enumerate(shots):
        for frame in (-1, 0, 1):
            mover.location = Vector(shot["way"]) * frame
            mover.keyframe_insert("location", frame=number * _FRAMES + frame)
    for curve in mover.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def _shoot(folder: Path, told: dict[str, Any], shot: dict[str, Any], number: int, camera: Any, parts: Any) -> None:
    """Render the rectangles of a shot, and find out which share of each plate the camera sees."""
    scene, of = bpy.context.scene, told["cameras"][shot["camera"]]
    width, height = of["size"]
    scene.render.resolution_x, scene.render.resolution_y = width, height
    camera.data.sensor_fit, camera.data.sensor_width = "HORIZONTAL", 36.0
    camera.data.lens = 36.0 * of["c"] / width
    camera.data.clip_end = 1000.0
    camera.matrix_world = Matrix(of["pose"])
    for name, part in parts.items():
        part.hide_render = part.hide_viewport = name not in shot["places"]
        if name in shot["places"]:
            part.matrix_local = Matrix(shot["places"][name])
    scene.frame_set(number * _FRAMES)
    scene.cycles.samples, scene.cycles.seed = shot["samples"], number
    for k, (left, top, right, bottom) in enumerate(shot["rectangles"]):
        # A quarter of a pixel more, since Blender cuts to whole pixels.
        scene.render.border_min_x, scene.render.border_max_x = (left + 0.25) / width, (right + 0.25) / width
        scene.render.border_min_y = (height - bottom + 0.25) / height
        scene.render.border_max_y = (height - top + 0.25) / height
        scene.render.filepath = str(folder / f"{shot['name']}.{k}.png")
        bpy.ops.render.render(write_still=True)
    seen = {name: _share(points, of["pose"]) for name, points in shot["samples_of"].items()}
    (folder / f"{shot['name']}.json").write_text(json.dumps(seen))


def _share(points: list[list[float]], pose: list[list[float]]) -> float:
    """Share of the points that nothing hides from the camera."""
    graph, eye = bpy.context.evaluated_depsgraph_get(), Vector([row[3] for row in pose[:3]])
    seen = 0
    for point in map(Vector, points):
        way = eye - point
        towards = way.normalized()
        hit, *_ = bpy.context.scene.ray_cast(graph, point + 0.004 * towards, towards, distance=way.length)
        seen += not hit
    return seen / len(points)


main()
