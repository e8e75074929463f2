"""Shows a cnerf bake in Blender the way it was trained: a volume that emits and absorbs, the textured mesh at the same
place, and the capture's cameras.

In Blender:  open this file in the Scripting tab and press Run. It makes a scene of its own and leaves others alone.
As add-on:   Edit > Preferences > Add-ons > Install, this file; then File > Import > cnerf bake (manifest.json).
Headless:    blender -b --python blender_setup.py -- --render out.exr --camera 3 --samples 64
             blender -b --python blender_setup.py -- --save scene.blend
Works with Blender 3.4 and later. Colours are linear Rec.709; the view transform is set to Standard, because Filmic and
AgX would change them.
"""

import argparse
import json
import math
import os
import re
import sys
import traceback

import bpy
from mathutils import Matrix, Vector

bl_info = {
    "name": "cnerf bake",
    "description": "Shows a cnerf bake: emitting and absorbing volumes, the textured mesh, the capture's cameras",
    "blender": (3, 4, 0),
    "category": "Import-Export",
    "location": "File > Import > cnerf bake",
}

BAKE_FOLDER = ""

# Up to some release of 2025 Blender draws voxel i of a VDB at (i + 0.5) h, although OpenVDB says that its value sits at
# index i: files that follow OpenVDB appear shifted by half a voxel. The fix is Blender's pull request 138449; whether
# 4.5 or 5.0 was the first release with it is not certain, and this constant is the only place that depends on it.
FIRST_VERSION_WITHOUT_HALF_VOXEL = (4, 5, 0)

SENSOR_MM = 36.0
MAX_STEPS_OF_BLENDER = 65536


def folder_of_open_text():
    """Of the text that the text editor runs, which gives no usable __file__; empty where the text has no file."""
    text = getattr(getattr(bpy.context, "space_data", None), "text", None)
    return os.path.dirname(bpy.path.abspath(text.filepath)) if text else ""


def find_manifest(given):
    """The manifest given, else the one beside this file or the open text, else the one where the bake was written."""
    folders = [folder_of_open_text(), BAKE_FOLDER]
    if "__file__" in globals():
        folders.insert(0, os.path.dirname(os.path.abspath(__file__)))
    candidates = [given] if given else [os.path.join(folder, "manifest.json") for folder in folders if folder]
    for candidate in candidates:
        if os.path.isfile(candidate):
            return os.path.abspath(candidate)
    raise FileNotFoundError("no manifest.json at " + " or ".join(candidates) + "; name it with --manifest")


def half_voxel_shift(volume):
    """What to move the volume by, along each axis, so that every voxel's centre is where it was baked."""
    half = 0.5 * volume["voxel_size"]
    blender_adds_half = bpy.app.version < FIRST_VERSION_WITHOUT_HALF_VOXEL
    drawn_too_far = half if volume["voxel_origin"] == "center" else 0.0
    return half - drawn_too_far - (half if blender_adds_half else 0.0)


def set_if_known(settings, name, value):
    """Settings that only some releases have."""
    if hasattr(settings, name):
        setattr(settings, name, value)


def is_alone():
    """Whether Blender was started for this script only, and ends with it."""
    return bpy.app.background and __name__ == "__main__"


def make_scene():
    if is_alone():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        scene.name = "cnerf"
        return scene
    scene = bpy.data.scenes.new("cnerf")
    bpy.context.window.scene = scene
    return scene


def add_socket(tree, name, kind, is_input, default=None, low=None, high=None):
    """A socket of a node group; Blender 4.0 changed how they are made."""
    if hasattr(tree, "interface"):
        socket = tree.interface.new_socket(name, in_out="INPUT" if is_input else "OUTPUT", socket_type=kind)
    else:
        socket = (tree.inputs if is_input else tree.outputs).new(kind, name)
    if default is not None:
        socket.default_value = default
    if low is not None:
        socket.min_value, socket.max_value = low, high


class MathNodes:
    """Formulas as nodes: every method makes a node and returns its output."""

    def __init__(self, tree):
        self.tree, self.count = tree, 0

    def node(self, kind, **properties):
        made = self.tree.nodes.new(kind)
        made.location = (180 * (self.count % 12), -170 * (self.count // 12))
        self.count += 1
        for name, value in properties.items():
            setattr(made, name, value)
        return made

    def put(self, value, socket):
        if isinstance(value, (int, float)):
            socket.default_value = value
        else:
            self.tree.links.new(value, socket)

    def math(self, operation, *values):
        made = self.node("ShaderNodeMath", operation=operation)
        for value, socket in zip(values, made.inputs):
            self.put(value, socket)
        return made.outputs[0]

    def times(self, a, b):
        return self.math("MULTIPLY", a, b)

    def plus(self, a, b):
        return self.math("ADD", a, b)

    def weighted(self, weights, values):
        terms = [self.times(value, weight) for weight, value in zip(weights, values)]
        return self.plus(self.plus(terms[0], terms[1]), terms[2])

    def choose(self, condition, yes, no):
        """condition is 0 or 1."""
        return self.plus(self.times(condition, yes), self.times(self.math("SUBTRACT", 1.0, condition), no))


# CIE 1976 L*a*b*, D65 2 degrees, and Rec.709 primaries.
LAB_EPSILON, LAB_KAPPA = 216.0 / 24389.0, 24389.0 / 27.0
WHITE = (0.95047, 1.0, 1.08883)
RGB_FROM_XYZ = ((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560),
                (0.0556434, -0.2040259, 1.0572252))


def make_regrade_group():
    """Colour rebuilt from luminance and Lab a, b, for regrading the colorization without training anew.

    At Regrade 0 the baked colour passes through, and Cycles drops the rest. Exposure is in stops, Hue in degrees."""
    name = "cnerf regrade"
    if name in bpy.data.node_groups:
        return bpy.data.node_groups[name]
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    add_socket(tree, "Color", "NodeSocketColor", True)
    for grid in ("luminance", "lab_a", "lab_b"):
        add_socket(tree, grid, "NodeSocketFloat", True, 0.0)
    add_socket(tree, "Regrade", "NodeSocketFloat", True, 0.0, 0.0, 1.0)
    add_socket(tree, "Exposure", "NodeSocketFloat", True, 0.0, -10.0, 10.0)
    add_socket(tree, "Saturation", "NodeSocketFloat", True, 1.0, 0.0, 4.0)
    add_socket(tree, "Hue", "NodeSocketFloat", True, 0.0, -180.0, 180.0)
    add_socket(tree, "Color", "NodeSocketColor", False)

    nodes = MathNodes(tree)
    given = nodes.node("NodeGroupInput").outputs
    y = nodes.math("MAXIMUM", given["luminance"], 0.0)
    turn = nodes.math("RADIANS", given["Hue"])
    cosine = nodes.times(nodes.math("COSINE", turn), given["Saturation"])
    sine = nodes.times(nodes.math("SINE", turn), given["Saturation"])
    a = nodes.math("SUBTRACT", nodes.times(given["lab_a"], cosine), nodes.times(given["lab_b"], sine))
    b = nodes.plus(nodes.times(given["lab_a"], sine), nodes.times(given["lab_b"], cosine))

    is_bright = nodes.math("GREATER_THAN", y, LAB_EPSILON)
    linear_part = nodes.times(nodes.plus(nodes.times(y, LAB_KAPPA), 16.0), 1.0 / 116.0)
    f_y = nodes.choose(is_bright, nodes.math("POWER", y, 1.0 / 3.0), linear_part)

    def inverse(f):
        cubed = nodes.times(nodes.times(f, f), f)
        low = nodes.times(nodes.math("SUBTRACT", nodes.times(f, 116.0), 16.0), 1.0 / LAB_KAPPA)
        return nodes.choose(nodes.math("GREATER_THAN", cubed, LAB_EPSILON), cubed, low)

    x = nodes.times(inverse(nodes.plus(f_y, nodes.times(a, 1.0 / 500.0))), WHITE[0])
    z = nodes.times(inverse(nodes.math("SUBTRACT", f_y, nodes.times(b, 1.0 / 200.0))), WHITE[2])
    gain = nodes.math("POWER", 2.0, given["Exposure"])
    rgb = nodes.node("ShaderNodeCombineXYZ")
    for row, socket in zip(RGB_FROM_XYZ, rgb.inputs):
        channel = nodes.math("MAXIMUM", nodes.weighted(row, (x, y, z)), 0.0)
        nodes.put(nodes.times(channel, gain), socket)
    mix = nodes.node("ShaderNodeMixRGB", blend_type="MIX")
    nodes.put(given["Regrade"], mix.inputs[0])
    nodes.put(given["Color"], mix.inputs[1])
    nodes.put(rgb.outputs[0], mix.inputs[2])
    nodes.put(mix.outputs[0], nodes.node("NodeGroupOutput").inputs["Color"])
    return tree


def make_material(density_scale):
    """Absorption and emission, both of the density: exactly c (1 - exp(-tau)). Principled Volume would not multiply
    emission by density."""
    material = bpy.data.materials.new("cnerf volume")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()

    def node(kind, x, y, **properties):
        made = nodes.new(kind)
        made.location = (x, y)
        for name, value in properties.items():
            setattr(made, name, value)
        return made

    density = node("ShaderNodeAttribute", -700, 120, attribute_name="density", label="density")
    color = node("ShaderNodeAttribute", -920, -120, attribute_name="color", label="color")
    regrade = node("ShaderNodeGroup", -480, -120, label="regrade")
    regrade.node_tree = make_regrade_group()
    links.new(color.outputs["Color"], regrade.inputs["Color"])
    for number, name in enumerate(("luminance", "lab_a", "lab_b")):
        grid = node("ShaderNodeAttribute", -920, -300 - 180 * number, attribute_name=name, label=name)
        links.new(grid.outputs["Fac"], regrade.inputs[name])
    gain = node("ShaderNodeMath", -480, 120, operation="MULTIPLY", label="density gain")
    gain.inputs[1].default_value = density_scale  # 1, unless the file's density is normalized
    absorption = node("ShaderNodeVolumeAbsorption", -240, 120)
    absorption.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    emission = node("ShaderNodeEmission", -240, -80)
    both = node("ShaderNodeAddShader", 0, 40)
    output = node("ShaderNodeOutputMaterial", 200, 40)

    links.new(density.outputs["Fac"], gain.inputs[0])
    links.new(gain.outputs[0], absorption.inputs["Density"])
    links.new(gain.outputs[0], emission.inputs["Strength"])
    links.new(regrade.outputs["Color"], emission.inputs["Color"])
    links.new(absorption.outputs[0], both.inputs[0])
    links.new(emission.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Volume"])

    set_if_known(material.cycles, "homogeneous_volume", False)
    set_if_known(material.cycles, "volume_interpolation", "LINEAR")
    return material


def add_volume(scene, root, volume, folder, material):
    data = bpy.data.volumes.new("cnerf volume")
    data.filepath = file = os.path.join(folder, volume["file"])
    if not data.grids.load():  # renders would go on without it
        raise ValueError("%s: %s" % (file, data.grids.error_message))
    data.render.space = "OBJECT"
    data.render.step_size = 0.0  # automatic: one voxel times the scene's step rate
    data.render.clipping = 0.0  # the default cuts densities below 0.001 per unit, which large scenes have
    if hasattr(data.render, "precision"):
        data.render.precision = "HALF" if volume["half_density"] else "FULL"
    data.materials.append(material)
    shown = bpy.data.objects.new("cnerf volume", data)
    shown.parent = root
    turned_back = Matrix(volume.get("world_from_file", Matrix.Identity(4)))  # the file may stand up, the poses do not
    shown.matrix_basis = Matrix.Translation((half_voxel_shift(volume),) * 3) @ turned_back
    scene.collection.objects.link(shown)
    return shown


def blender_from_gltf():
    """What Blender's importer does to a glTF, which is Y-up: (x, y, z) -> (x, -z, y)."""
    return Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))


def restore_numpy_bool():
    """Blender 3.4's glTF importer says numpy.bool, which NumPy 1.24, its companion on Debian 12, no longer has."""
    import numpy
    if not hasattr(numpy, "bool"):
        numpy.bool = bool


def import_mesh(path):
    """The mesh object of a GLB. What else it brings (cameras, without their principal points) is removed."""
    restore_numpy_bool()
    known = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=path)
    brought = [made for made in bpy.data.objects if made not in known]
    meshes = [made for made in brought if made.type == "MESH"]
    for made in brought:
        if made not in meshes:
            bpy.data.objects.remove(made)
    return meshes[0]


def add_mesh(scene, root, mesh, folder, use):
    """`use`: hidden (from renders), shown, holdout (cuts its shape out), shadow (catches shadows only)."""
    placed = import_mesh(os.path.join(folder, mesh["glb"]))
    for collection in list(placed.users_collection):
        collection.objects.unlink(placed)
    scene.collection.objects.link(placed)
    placed.name = "cnerf mesh"
    placed.parent = root
    # The volume and the cameras are in the frame of the poses; so is the mesh, once Blender's turn is taken back.
    placed.matrix_basis = Matrix(mesh["world_from_gltf"]) @ blender_from_gltf().inverted() @ placed.matrix_basis
    placed.hide_render = use == "hidden"
    placed.is_holdout = use == "holdout"
    placed.is_shadow_catcher = use == "shadow"
    return placed


def blender_from_opencv_camera():
    """Blender's cameras look along -Z with +Y up; the manifest's along +Z with +Y down."""
    return Matrix(((1, 0, 0, 0), (0, -1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1)))


def pixel_aspect(camera):
    """Blender wants both at least 1."""
    ratio = camera["fx"] / camera["fy"]
    return (1.0, ratio) if ratio >= 1.0 else (1.0 / ratio, 1.0)


def scene_radius(bounded):
    """Of the volume or the mesh: both have bounds."""
    low, high = Vector(bounded["bounds"]["min"]), Vector(bounded["bounds"]["max"])
    return 0.5 * (high - low).length, 0.5 * (high + low)


def set_lens(data, camera):
    """Focal length and principal point."""
    aspect_x, aspect_y = pixel_aspect(camera)
    width = camera["width"] * aspect_x
    data.lens = SENSOR_MM * camera["fx"] / camera["width"]
    data.shift_x = (0.5 * camera["width"] - camera["cx"]) * aspect_x / width
    data.shift_y = (camera["cy"] - 0.5 * camera["height"]) * aspect_y / width


def add_camera(scene, root, camera, volume):
    data = bpy.data.cameras.new(camera["name"])
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_MM
    set_lens(data, camera)

    world_from_camera = Matrix(camera["world_from_camera"])
    radius, centre = scene_radius(volume)
    distance = (world_from_camera.to_translation() - centre).length
    scale = root.matrix_basis.median_scale  # of the Empty; clipping is in metres
    data.clip_start = scale * 1e-4 * radius
    data.clip_end = scale * 1e3 * (distance + radius)  # the Empty may be scaled, and paths lead away
    data.display_size = 0.05 * radius

    placed = bpy.data.objects.new(camera["name"], data)
    placed.parent = root
    placed.matrix_basis = world_from_camera @ blender_from_opencv_camera()
    scene.collection.objects.link(placed)
    return placed


def show_plate(data, file):
    """A photograph behind what the camera sees; it is without lens distortion, as Blender's camera is."""
    if not os.path.isfile(file):
        print("cnerf:", file, "is not there; the camera has no background")
        return
    plate = data.background_images.new()
    plate.image = bpy.data.images.load(file, check_existing=True)
    plate.alpha = 0.5
    plate.display_depth = "BACK"
    data.show_background_images = True


def lay_over_plate(scene, data, opacity):
    """Lays renders over the photograph of their camera."""
    if not data.background_images:
        raise ValueError("%s has no photograph to render over" % data.name)
    if bpy.app.version >= (5, 0, 0):
        raise ValueError("renders are laid over photographs by Blender 3.4 to 4; lay them over in your compositor")
    scene.render.film_transparent = True
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    photograph, rendered = tree.nodes.new("CompositorNodeImage"), tree.nodes.new("CompositorNodeRLayers")
    photograph.image = data.background_images[0].image
    fitted = tree.nodes.new("CompositorNodeScale")
    fitted.space, fitted.frame_method = "RENDER_SIZE", "STRETCH"
    over = tree.nodes.new("CompositorNodeAlphaOver")
    over.inputs[0].default_value = opacity
    output = tree.nodes.new("CompositorNodeComposite")
    rendered.scene = scene
    for number, node in enumerate((photograph, fitted, rendered, over, output)):
        node.location = (260 * number, -60 * number)
    tree.links.new(photograph.outputs["Image"], fitted.inputs[0])
    tree.links.new(fitted.outputs[0], over.inputs[1])
    tree.links.new(rendered.outputs["Image"], over.inputs[2])
    tree.links.new(over.outputs[0], output.inputs[0])


def frame_number(name):
    """The number that a picture's name ends with, as frames of a film do; None without one."""
    stem = re.sub(r"\.(png|jpe?g|exr|tiff?|webp)$", "", name, flags=re.IGNORECASE)
    found = re.search(r"(\d+)$", stem)
    # Longer numbers are dates and times, and beyond Blender's last frame. Telephones put the time behind the date.
    if not found or len(found.group(1)) > 6 or re.search(r"(^|\D)(19|20)\d{6}[_-]\d{6}$", stem):
        return None
    return int(found.group(1))


def numbered_frames(cameras):
    """Frame number and camera, in order; nothing unless every picture has a number of its own."""
    numbers = [frame_number(camera["name"]) for camera in cameras]
    if len(cameras) < 2 or None in numbers or len(set(numbers)) < len(numbers):
        return []
    return sorted(zip(numbers, cameras), key=lambda pair: pair[0])


def path_cameras(file):
    """The cameras of a path that the viewer exported, as the manifest describes cameras."""
    with open(file, encoding="utf-8") as text:
        path = json.load(text)
    frames = path.get("frames") or []
    if not frames:
        raise ValueError(file + ": frames: expected a list of cameras")
    cameras = []
    for number, frame in enumerate(frames):
        value = {**path, **frame}
        missing = [key for key in ("w", "h", "fl_x", "transform_matrix") if key not in value]
        if missing:
            raise ValueError("%s: frames[%d]: %s is missing" % (file, number, missing[0]))
        opengl = Matrix(value["transform_matrix"])
        cameras.append({
            "name": "path", "width": int(value["w"]), "height": int(value["h"]), "fx": value["fl_x"],
            "fy": value.get("fl_y", value["fl_x"]), "cx": value.get("cx", 0.5 * value["w"]),
            "cy": value.get("cy", 0.5 * value["h"]), "model": "pinhole", "distortion": [0.0] * 8,
            "world_from_camera": opengl @ blender_from_opencv_camera(),
        })
    return cameras, path.get("fps", 30)


def add_path(scene, root, file, volume):
    """An animated camera; it becomes the active one."""
    cameras, fps = path_cameras(file)
    moving = add_moving_camera(scene, root, list(enumerate(cameras, start=1)), volume)
    scene.frame_start, scene.frame_end = 1, len(cameras)
    scene.render.fps = max(1, round(fps))
    scene.frame_set(1)
    use_camera(scene, cameras[0], moving)


def add_moving_camera(scene, root, frames, volume):
    """One camera that is where each frame's camera is, with its lens."""
    moving = add_camera(scene, root, frames[0][1], volume)
    moving.rotation_mode = "QUATERNION"
    before = None
    for number, camera in frames:
        at = Matrix(camera["world_from_camera"]) @ blender_from_opencv_camera()
        turn = at.to_quaternion()
        if before is not None:
            turn.make_compatible(before)  # q and -q are one rotation, but not half-way between
        before = turn
        moving.location = at.to_translation()
        moving.rotation_quaternion = turn
        set_lens(moving.data, camera)
        moving.keyframe_insert("location", frame=number)
        moving.keyframe_insert("rotation_quaternion", frame=number)
        for name in ("lens", "shift_x", "shift_y"):
            moving.data.keyframe_insert(name, frame=number)
    return moving


def add_film_camera(scene, root, cameras, volume):
    """The capture's own way as one animated camera, where its pictures are numbered."""
    frames = numbered_frames(cameras)
    if not frames:
        return None
    moving = add_moving_camera(scene, root, frames, volume)
    moving.name = moving.data.name = "cnerf film"
    scene.frame_start, scene.frame_end = frames[0][0], frames[-1][0]
    return moving


def upright(manifest):
    """From the frame of the poses, in its units, to Blender's: Z up, metres."""
    turns = {"x": Matrix(((0, -1, 0), (0, 0, -1), (1, 0, 0))), "y": Matrix(((1, 0, 0), (0, 0, -1), (0, 1, 0))),
             "z": Matrix.Identity(3)}
    return turns[manifest.get("up_axis", "z")].to_4x4() @ Matrix.Scale(manifest.get("metres_per_unit", 1.0), 4)


def cycles_memory(volumes):
    """Bytes that Cycles takes for the grids: it makes them dense, in 32 bits, vectors with four components."""
    total = 0
    for volume in volumes:
        low, high = volume["bounds"]["min"], volume["bounds"]["max"]
        voxels = math.prod((b - a) / volume["voxel_size"] + 6.0 for a, b in zip(low, high))
        total += 4 * voxels * (1 + 4)  # density and color; the other grids are read when colours are regraded
    return total


def overview_camera(volume):
    """A camera for bakes without any: in front of the box, in the manifest's terms."""
    radius, centre = scene_radius(volume)
    rows = [[1, 0, 0, centre.x], [0, 0, 1, centre.y - 3.2 * radius], [0, -1, 0, centre.z], [0, 0, 0, 1]]
    return {"name": "overview", "width": 960, "height": 960, "fx": 1300.0, "fy": 1300.0, "cx": 480.0, "cy": 480.0,
            "distortion": [], "world_from_camera": rows}


def use_camera(scene, camera, placed):
    """Makes a camera the active one, with the size of its picture."""
    scene.camera = placed
    scene.render.resolution_x = camera["width"]
    scene.render.resolution_y = camera["height"]
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = pixel_aspect(camera)


def pick_camera(cameras, wanted):
    """By number or by name."""
    if wanted.isdigit() and int(wanted) < len(cameras):
        return int(wanted)
    names = [camera["name"] for camera in cameras]
    if wanted in names:
        return names.index(wanted)
    raise ValueError("no camera %s; there are %d, the first is %s" % (wanted, len(cameras), names[0]))


def set_world(scene, manifest, folder):
    """The sky of the capture where it has one, else black. The volume shines by itself: nothing is lit by it."""
    sky = manifest.get("sky")
    world = bpy.data.worlds.new("cnerf sky" if sky else "cnerf black")
    world.color = (0.0, 0.0, 0.0)
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = next(node for node in nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    scene.world = world
    if not sky:
        return
    place, turn, picture = (nodes.new(kind) for kind in
                            ("ShaderNodeTexCoord", "ShaderNodeMapping", "ShaderNodeTexEnvironment"))
    turn.vector_type = "VECTOR"
    turn.inputs["Rotation"].default_value = upright(manifest).to_3x3().inverted().to_euler("XYZ")
    picture.image = bpy.data.images.load(os.path.join(folder, sky["file"]))  # float: linear as it is
    links.new(place.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], background.inputs["Color"])
    for left, node in enumerate((place, turn, picture)):
        node.location = (background.location.x - 300 * (3 - left), background.location.y)


def steps_needed(volume, voxel_size, step_rate):
    low, high = volume["bounds"]["min"], volume["bounds"]["max"]
    diagonal = math.dist(low, high) / voxel_size
    return min(MAX_STEPS_OF_BLENDER, max(1024, int(1.2 * diagonal / step_rate) + 16))


def set_engine(scene, name):
    """EEVEE has had several names."""
    wanted = ["CYCLES"] if name == "cycles" else ["BLENDER_EEVEE_NEXT", "BLENDER_EEVEE"]
    for engine in wanted:
        try:
            scene.render.engine = engine
            return
        except TypeError:
            continue
    raise ValueError("this Blender has none of " + ", ".join(wanted))


def show_colors_as_they_are(scene):
    """As far as Blender's configuration of colours goes: $OCIO may name a studio's own."""
    view = scene.view_settings
    missing = []
    for settings, name, value in ((scene.display_settings, "display_device", "sRGB"),
                                  (view, "view_transform", "Standard"), (view, "look", "None")):
        try:
            setattr(settings, name, value)
        except TypeError:
            missing.append("%s %s" % (name, value))
    if missing:
        print("cnerf: the colour configuration has no %s; colours are shown by %s, %s, look %s"
              % (" and no ".join(missing), scene.display_settings.display_device, view.view_transform, view.look))
    view.exposure = 0.0
    view.gamma = 1.0


def set_up_rendering(scene, volume, voxel_size, options):
    set_engine(scene, options.engine)
    cycles = scene.cycles
    cycles.samples = options.samples
    cycles.use_denoising = False
    set_if_known(cycles, "volume_step_rate", options.step_rate)
    set_if_known(cycles, "volume_preview_step_rate", max(1.0, options.step_rate))
    set_if_known(cycles, "volume_max_steps", steps_needed(volume, voxel_size, options.step_rate))
    cycles.volume_bounces = 0
    set_if_known(cycles, "volume_biased", True)  # ray marching, where the default is null scattering
    if options.exact:
        cycles.use_adaptive_sampling = False
        cycles.pixel_filter_type = "BOX"
        cycles.filter_width = 1.0
        set_if_known(cycles, "volume_max_steps", max(4096, steps_needed(volume, voxel_size, options.step_rate)))
    scene.render.film_transparent = options.transparent or options.exact
    show_colors_as_they_are(scene)


def set_regrade(material, options):
    for node in material.node_tree.nodes:
        if node.type == "GROUP":
            for name in ("Regrade", "Exposure", "Saturation", "Hue"):
                node.inputs[name].default_value = getattr(options, name.lower())


def set_up(options):
    """Builds the scene and returns it. Where that fails, Blender shows what it did before."""
    manifest_file = find_manifest(options.manifest)
    with open(manifest_file, encoding="utf-8") as file:
        manifest = json.load(file)
    volume, mesh = manifest["volume"], manifest.get("mesh")
    if not (volume or mesh):
        raise ValueError(manifest_file + " lists neither a volume nor a mesh")
    former = None if is_alone() else bpy.context.window.scene
    scene = make_scene()
    try:
        fill_scene(scene, manifest, os.path.dirname(manifest_file), options)
    except Exception:
        if former:
            bpy.context.window.scene = former
            bpy.data.scenes.remove(scene)
        raise
    return scene


def fill_scene(scene, manifest, folder, options):
    volume, mesh = manifest["volume"], manifest.get("mesh")
    bounded = volume or mesh
    mesh_use = options.mesh or ("hidden" if volume else "shown")
    root = bpy.data.objects.new("cnerf", None)  # move, turn or scale this one: it carries everything
    root.empty_display_size = 0.1 * scene_radius(bounded)[0]
    scene.collection.objects.link(root)
    root.matrix_basis = upright(manifest)
    if volume:
        # Nested grids lie inside each other, the coarser ones empty where finer ones are.
        volumes = manifest.get("finer_volumes", []) + [volume]
        for each in volumes:
            material = make_material(each.get("density_scale", 1.0))
            set_regrade(material, options)
            add_volume(scene, root, each, folder, material).hide_render = mesh_use == "only"
        print("cnerf: Cycles will take about %.2f GiB for the grids" % (cycles_memory(volumes) / 2**30))
    if mesh and mesh_use != "none":
        add_mesh(scene, root, mesh, folder, mesh_use)
    set_world(scene, manifest, folder)
    finest = manifest["finer_volumes"][0] if manifest.get("finer_volumes") else bounded
    set_up_rendering(scene, bounded, finest["voxel_size"], options)

    cameras = manifest["cameras"] or [overview_camera(bounded)]
    placed = [add_camera(scene, root, camera, bounded) for camera in cameras]
    picked = pick_camera(cameras, options.camera)
    for camera, shown in zip(cameras, placed):
        if camera.get("plate"):
            show_plate(shown.data, os.path.join(folder, camera["plate"]))
    film = add_film_camera(scene, root, cameras, bounded)
    use_camera(scene, cameras[picked], placed[picked])
    if options.film:
        if film is None:
            raise ValueError("the capture's pictures are not numbered: there is no film to follow")
        use_camera(scene, cameras[0], film)
    if options.path:
        add_path(scene, root, options.path, bounded)
    if options.over_plate is not None:
        lay_over_plate(scene, scene.camera.data, options.over_plate)


def render(scene, file):
    """EXR: linear 32-bit RGBA, colour premultiplied by opacity. Else: an 8-bit picture through the view transform."""
    image = scene.render.image_settings
    scene.render.filepath = os.path.abspath(file)
    scene.render.use_file_extension = False
    if file.lower().endswith(".exr"):
        image.file_format = "OPEN_EXR"
        image.color_depth = "32"
        image.exr_codec = "ZIP"
    else:
        image.file_format = "PNG"
        image.color_depth = "8"
    image.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
    bpy.ops.render.render(write_still=True, scene=scene.name)


def parse_options(arguments):
    parser = argparse.ArgumentParser(prog="blender_setup.py", description="Shows a cnerf bake in Blender.")
    parser.add_argument("--manifest", default="", help="manifest.json; default: the one beside this file")
    parser.add_argument("--camera", default="0", help="number or name of the camera to look through")
    parser.add_argument("--path", default="", help="camera path (JSON) of the viewer; animates a camera")
    parser.add_argument("--film", action="store_true", help="look through the camera that follows numbered pictures")
    parser.add_argument("--regrade", type=float, default=0.0, help="1: colour from luminance and Lab, see below")
    parser.add_argument("--exposure", type=float, default=0.0, help="stops, with --regrade 1")
    parser.add_argument("--saturation", type=float, default=1.0, help="with --regrade 1; 0 is grey")
    parser.add_argument("--hue", type=float, default=0.0, help="turn of the colours in degrees, with --regrade 1")
    parser.add_argument("--render", default="", help="picture to render, .exr or .png")
    parser.add_argument("--save", default="", help=".blend file to save the scene to")
    parser.add_argument("--engine", choices=("cycles", "eevee"), default="cycles")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--step-rate", type=float, default=1.0, help="length of a volume step, in voxels")
    parser.add_argument("--mesh", choices=("hidden", "shown", "only", "holdout", "shadow", "none"), default="",
                        help="how the mesh takes part in renders; default: hidden beside a volume, else shown")
    parser.add_argument("--over-plate", type=float, metavar="OPACITY",
                        help="lay the render over the photograph of its camera: 1 hides it, 0.5 shows both")
    parser.add_argument("--transparent", action="store_true", help="opacity in the picture's alpha channel")
    parser.add_argument("--exact", action="store_true", help="box pixel filter, all samples, opacity in alpha")
    return parser.parse_args(arguments)


def main():
    arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    options = parse_options(arguments)
    scene = set_up(options)
    if options.save:
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(options.save))
    if options.render:
        render(scene, options.render)


class ImportCnerfBake(bpy.types.Operator):
    """Show a bake of cnerf in a scene of its own"""

    bl_idname = "import_scene.cnerf_bake"
    bl_label = "Import cnerf bake"
    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        try:
            set_up(parse_options(["--manifest", self.filepath]))
        except (OSError, ValueError, LookupError, RuntimeError, TypeError) as failure:
            self.report({"ERROR"}, str(failure))
            return {"CANCELLED"}
        return {"FINISHED"}


def add_menu_item(menu, context):
    menu.layout.operator(ImportCnerfBake.bl_idname, text="cnerf bake (manifest.json)")


def register():
    bpy.utils.register_class(ImportCnerfBake)
    bpy.types.TOPBAR_MT_file_import.append(add_menu_item)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(add_menu_item)
    bpy.utils.unregister_class(ImportCnerfBake)


if __name__ == "__main__":
    if not bpy.app.background:
        main()
    else:
        # Blender itself would go on and end with success.
        try:
            main()
        except Exception:
            traceback.print_exc()
            sys.exit(1)
