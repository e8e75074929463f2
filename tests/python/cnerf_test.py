"""The Python module.  cnerf_test.py CLASS, with CNERF_PROGRAM, CNERF_CAPTURE and CNERF_FOLDER."""

import ast
import functools
import json
import logging
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import types
import unittest

import cnerf
import numpy as np
from exr import read_exr

FOLDER = pathlib.Path(os.environ["CNERF_FOLDER"])
CAPTURE = pathlib.Path(os.environ["CNERF_CAPTURE"])
PROGRAM = os.environ["CNERF_PROGRAM"]
SOURCES = pathlib.Path(__file__).parents[2] / "src/python"
STEPS = 600  # per box
# A run of a second or two.
TINY = {
    "device": "cpu",
    "stage1.steps": 60,
    "stage1.samples_per_step": 4096,
    "stage1.checkpoint_every": 20,
    "stage1.steps_per_box": 64,
    "stage1.grid.levels": 4,
    "stage1.grid.log2_rows": 12,
    "stage1.grid.finest_resolution": 64,
    "colorizer.reference_steps": 20,
    "stage2.patches": 6,
    "stage2.patch_size": 32,
    "stage2.rays_per_patch": 256,
    "stage2.working_resolution": 32,
    "stage2.distill_steps": 60,
    "stage2.grid.levels": 4,
    "stage2.grid.log2_rows": 12,
    "stage2.grid.finest_resolution": 64,
    "stage2.purify.enabled": False,
    "bake.resolution": 32,
    "render.steps_per_box": STEPS,
}


def program(*arguments):
    words = [PROGRAM, *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, env={**os.environ, "CUDA_VISIBLE_DEVICES": ""})


def passed(alpha):
    """The light that is left before each sample."""
    return np.cumprod(np.concatenate([np.ones_like(alpha[..., :1]), 1 - alpha[..., :-1]], -1), -1)


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)


class Queries(Folder):
    """A run that Python trained, coloured and baked; see Making, which CTest runs before."""

    def setUp(self):
        super().setUp()
        self.run_ = cnerf.open_run(FOLDER / "run")
        self.camera = self.run_.cameras[0]

    def rendered(self, *options):
        poses = np.array(self.camera.world_from_camera) @ np.diag([1, -1, -1, 1])
        frame = {"file_path": "view.png", "transform_matrix": poses.tolist()}
        lens = {"w": self.camera.width, "h": self.camera.height, "fl_x": self.camera.fx, "fl_y": self.camera.fy}
        path = self.folder / "path.json"
        path.write_text(json.dumps({**lens, "cx": self.camera.cx, "cy": self.camera.cy, "frames": [frame]}))
        made = program("render", FOLDER / "run", "--path", path, "--format", "exr", "-o", self.folder, *options)
        self.assertEqual(made.returncode, 0, made.stderr)
        (picture,) = (self.folder / "path").glob("*.exr")
        exr = read_exr(picture)
        return np.stack([exr[channel] for channel in "RGB"], -1), exr["A"], exr["Z"]

    def test_a_million_points_composite_to_the_programs_render(self):
        """The march of src/render/march.h and the compositing of composite_math.h in NumPy."""
        scene = self.run_.scene()
        low, high = scene.box
        step = (high - low)[0] / STEPS
        origin, directions = self.camera.rays()
        to_low, to_high = (low - origin) / directions, (high - origin) / directions
        enter = np.maximum(np.minimum(to_low, to_high).max(-1), 0)[..., None]
        leave = np.maximum(to_low, to_high).min(-1)[..., None]
        t = enter + (np.arange(int(1.7321 * STEPS)) + 0.5) * step
        points = origin + t[..., None] * directions[:, :, None]
        self.assertGreater(points.size / 3, 1e6)
        alpha = np.where(t < leave, 1 - np.exp(-scene.density(points) * step), 0)
        weight = alpha * passed(alpha)
        color = scene.color(points, np.broadcast_to(directions[:, :, None], points.shape))
        rgb = (weight[..., None] * color).sum(2)

        shown, opacity, _ = self.rendered("--baked")
        # A ray that is opaque to 1e-3 ends and counts as opaque, half a per cent of weight is not shaded
        # (src/engine/luminance_engine.h), and the file holds halves.
        self.assertLess(np.abs(weight.sum(-1) - opacity).max(), 2e-3)
        self.assertGreater(shown.max(), 0.1)
        self.assertLess(np.abs(rgb - shown).max(), 0.01 * shown.max())
        self.assertLess(np.abs(rgb - shown).mean(), 0.001 * shown.max())

    def test_pictures_are_the_programs(self):
        for baked in (False, True):
            image = self.run_.scene().render(self.camera, baked=baked)
            shown, opacity, depth = self.rendered(*["--baked"] * baked)
            np.testing.assert_array_equal(image.rgb.astype(np.float16), shown)
            np.testing.assert_array_equal(image.opacity.astype(np.float16), opacity)
            np.testing.assert_array_equal(image.depth, depth)
            shutil.rmtree(self.folder / "path")

    def test_a_grey_scene_has_no_colours(self):
        scene = self.run_.scene("grey")
        low, high = scene.box
        points = low + np.random.default_rng(1).random((1000, 3)) * (high - low)
        color = scene.color(points, [0, 1, 0])
        self.assertEqual(scene.take, "")
        self.assertGreater(color.max(), 0)
        np.testing.assert_allclose(color[:, 0], color[:, 2], rtol=1e-6)
        self.assertGreater(np.ptp(self.run_.scene().color(points, [0, 1, 0]), axis=-1).max(), 0.01)

    def test_shapes_follow_the_points(self):
        scene = self.run_.scene()
        self.assertEqual(scene.density(np.zeros((4, 5, 3))).shape, (4, 5))
        self.assertEqual(scene.density([0, 0, 0]).shape, ())
        self.assertEqual(scene.color(np.zeros((2, 3), np.float32), [0, 0, 1]).shape, (2, 3))
        self.assertEqual(scene.density(np.zeros((0, 3))).shape, (0,))
        self.assertEqual(scene.density(np.full((1, 3), 1e30)), 0)

    def test_others_run_during_a_query(self):
        scene = self.run_.scene()
        low, high = scene.box
        points = low + np.random.default_rng(1).random((1 << 20, 3)) * (high - low)
        query = threading.Thread(target=lambda: scene.color(points, [0, 0, 1]))
        query.start()
        ticks = 0
        while query.is_alive():
            time.sleep(0.001)
            ticks += 1
        self.assertGreater(ticks, 10)

    def test_a_bake_composites_to_its_picture(self):
        bake = cnerf.open_bake(FOLDER / "bake")
        camera = bake.cameras[0]
        image = bake.render(camera, samples_per_axis=1)
        low, high = bake.box
        origin, directions = camera.rays()
        step = 0.1 * (high - low).max() / 32
        # The box with room for what interpolation brings out of it.
        far = np.linalg.norm((low + high) / 2 - origin) + np.linalg.norm(high - low)
        t = np.arange(0, far, step) + 0.5 * step
        points = origin + t[:, None] * directions[:, :, None]
        alpha = 1 - np.exp(-bake.density(points) * step)
        weight = alpha * passed(alpha)
        rgb = (weight[..., None] * bake.color(points)).sum(2)
        self.assertGreater(image.opacity.max(), 0.5)
        # Both are sums over steps: a quarter of a voxel there, a tenth here.
        self.assertLess(np.abs(weight.sum(-1) - image.opacity).max(), 0.02)
        self.assertLess(np.abs(rgb - image.rgb).max(), 0.02 * image.rgb.max())

    def test_the_example_plots_a_slice(self):
        if subprocess.run([sys.executable, "-c", "import matplotlib"], capture_output=True).returncode:
            self.skipTest("needs matplotlib")
        picture = self.folder / "slice.png"
        made = subprocess.run([sys.executable, SOURCES / "example_slice.py", FOLDER / "run", picture])
        self.assertEqual(made.returncode, 0)
        self.assertGreater(picture.stat().st_size, 10000)


class Making(unittest.TestCase):
    """Makes what Queries asks: CTest runs it first."""

    def test_a_run_is_trained_coloured_and_baked(self):
        shutil.rmtree(FOLDER, ignore_errors=True)
        FOLDER.mkdir(parents=True)
        seen, said = [], []
        handler = logging.Handler()
        handler.emit = lambda record: said.append(record.getMessage())
        logging.getLogger("cnerf").addHandler(handler)
        logging.getLogger("cnerf").setLevel(logging.INFO)
        progress = lambda task, fraction, figures: seen.append((task, fraction, figures))
        run = cnerf.train(CAPTURE, FOLDER / "run", settings=TINY, progress=progress)
        self.assertEqual(run.takes, [])
        self.assertIn("psnr", {name for _, _, figures in seen for name in figures})
        self.assertEqual(seen[-1][1], 1)
        references = ",".join(map(str, sorted((CAPTURE / "references").iterdir())))
        take = run.colorize("reference:" + references, take="warm", progress=progress)
        self.assertEqual((take, run.takes, run.current_take), ("warm", ["warm"], "warm"))
        self.assertEqual(run.bake(FOLDER / "bake", progress=progress), FOLDER / "bake")
        self.assertTrue((FOLDER / "bake/volume.vdb").exists())
        self.assertGreater(len({task for task, _, _ in seen}), 2)
        self.assertTrue(any("volume.vdb" in text for text in said), said)
        self.assertEqual(cnerf.open_bake(FOLDER / "bake").take, "warm")


class Stopping(Folder):
    def interrupting(self, at):
        def progress(task, fraction, figures):
            if fraction >= at:
                os.kill(os.getpid(), signal.SIGINT)

        return progress

    def test_ctrl_c_saves_and_resume_goes_on(self):
        out = self.folder / "run"
        with self.assertRaises(KeyboardInterrupt):
            cnerf.train(CAPTURE, out, settings=TINY, progress=self.interrupting(0.4))
        with self.assertRaises(cnerf.MissingInputError):
            cnerf.open_run(out).cameras
        cnerf.train(CAPTURE, out, settings=TINY, resume=True)  # not stopped by what stopped the first
        self.assertEqual(len(cnerf.open_run(out).cameras), 9)
        with self.assertRaises(KeyboardInterrupt):  # Python's own handler is back
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)

    def test_what_a_callback_raises_comes_out(self):
        def progress(task, fraction, figures):
            raise ZeroDivisionError("of the callback")

        with self.assertRaisesRegex(ZeroDivisionError, "of the callback"):
            cnerf.train(CAPTURE, self.folder / "run", settings=TINY, progress=progress)
        shutil.copytree(FOLDER / "run", self.folder / "coloured")
        with self.assertRaisesRegex(ZeroDivisionError, "of the callback"):
            cnerf.open_run(self.folder / "coloured").bake(self.folder / "bake", progress=progress)
        self.assertFalse((self.folder / "bake/volume.vdb").exists())

    def test_what_a_callback_raises_stops_its_own_step_only(self):
        raised = []

        def failing(task, fraction, figures):
            raise ZeroDivisionError("of the callback")

        def train_and_fail():
            try:
                cnerf.train(CAPTURE, self.folder / "failing", settings=TINY, progress=failing)
            except ZeroDivisionError as error:
                raised.append(error)

        def progress(task, fraction, figures):
            if not other.ident:
                other.start()
            other.join()

        other = threading.Thread(target=train_and_fail)
        run = cnerf.train(CAPTURE, self.folder / "run", settings=TINY, progress=progress)
        self.assertEqual(len(raised), 1)
        self.assertEqual(len(run.cameras), 9)

    def test_ctrl_c_reaches_a_plug_in(self):
        """LibTorch's plug-in has a copy of its own of what remembers Ctrl-C."""
        run = cnerf.train(CAPTURE, self.folder / "run", settings=TINY)
        references = ",".join(map(str, sorted((CAPTURE / "references").iterdir())))
        threading.Timer(8, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaisesRegex(KeyboardInterrupt, "fitting the reference network"):
            run.colorize("reference:" + references, settings={"colorizer.reference_steps": 100000})


class Errors(Folder):
    def refused(self, kind, call, *arguments, **options):
        with self.assertRaises(kind) as raised:
            call(*arguments, **options)
        return raised.exception

    def test_have_types_and_exit_codes_of_the_program(self):
        error = self.refused(cnerf.MissingInputError, cnerf.open_run, self.folder / "none")
        self.assertEqual((type(error).__module__, error.exit_code), ("cnerf", 66))
        self.assertTrue(issubclass(cnerf.InputError, cnerf.Error) and issubclass(cnerf.Error, RuntimeError))
        made = program("bake", self.folder / "none")
        self.assertEqual(made.returncode, error.exit_code)
        self.assertIn(str(error), made.stderr)

    def test_settings_are_strict(self):
        settings = {**TINY, "stage1.stepz": 5}
        error = self.refused(cnerf.UsageError, cnerf.train, CAPTURE, self.folder / "run", settings=settings)
        self.assertIn("stage1.steps", str(error))  # the nearest key
        self.refused(cnerf.UsageError, cnerf.train, CAPTURE, self.folder / "run", settings={"stage1.steps": "many"})
        self.refused(cnerf.UsageError, cnerf.train, CAPTURE, self.folder / "run", preset="nothing")

    def test_input_that_cannot_be_read_is_an_input_error(self):
        (self.folder / "transforms.json").symlink_to("transforms.json")
        error = self.refused(cnerf.InputError, cnerf.train, self.folder, self.folder / "run", settings=TINY)
        self.assertIn("transforms.json: ", str(error))
        bake = cnerf.open_run(FOLDER / "run").bake
        self.refused(cnerf.OutputError, bake, self.folder / ("n" * 300))

    def test_going_on_and_overwriting_at_once_are_refused(self):
        arguments = {"settings": TINY, "resume": True, "overwrite": True}
        self.refused(cnerf.UsageError, cnerf.train, CAPTURE, self.folder / "run", **arguments)

    def test_settings_may_be_any_mapping(self):
        run = cnerf.open_run(FOLDER / "run")
        self.assertTrue(run.scene(settings=types.MappingProxyType(TINY)).colorizer)
        wrong = types.MappingProxyType({"stage1.stepz": 5})
        for call in (run.scene, run.colorize, run.bake, functools.partial(cnerf.train, CAPTURE, self.folder / "run")):
            self.assertIn("stage1.steps", str(self.refused(cnerf.UsageError, call, settings=wrong)))

    def test_damaged_bakes_are_refused(self):
        shutil.copytree(FOLDER / "bake", self.folder / "bake")
        volume = self.folder / "bake/volume.vdb"
        volume.write_bytes(volume.read_bytes()[:-100])
        self.assertIn("bytes", str(self.refused(cnerf.InputError, cnerf.open_bake, volume.parent)))

    def test_code_that_a_run_names_is_not_run(self):
        shutil.copytree(FOLDER / "run", self.folder / "run")
        config = self.folder / "run/config.toml"
        config.write_text(config.read_text().replace("spec = ''", 'spec = "exec:touch ' + str(self.folder / "ran") + '"'))
        run = cnerf.open_run(self.folder / "run")
        self.assertIn("trust=True", str(self.refused(cnerf.UsageError, run.colorize)))
        self.assertFalse((self.folder / "ran").exists())
        named = {"colorizer.spec": "exec:touch " + str(self.folder / "named")}
        self.refused(cnerf.ColorizerError, run.colorize, settings=named)  # it answers nothing
        self.assertTrue((self.folder / "named").exists())

    def test_nothing_is_replaced_unasked(self):
        run = cnerf.open_run(FOLDER / "run")
        self.refused(cnerf.UsageError, run.bake, FOLDER / "bake")
        self.refused(cnerf.UsageError, cnerf.train, CAPTURE, FOLDER / "run", settings=TINY)

    def test_arrays_are_checked(self):
        scene = cnerf.open_run(FOLDER / "run").scene()
        self.refused(cnerf.UsageError, scene.density, np.zeros((3, 2)))
        self.refused(cnerf.UsageError, scene.density, [0, 0, np.nan])
        self.refused(cnerf.UsageError, scene.color, np.zeros((5, 3)), np.ones((4, 3)))
        self.refused(cnerf.UsageError, scene.color, np.zeros((5, 3)), [0, 0, 0])
        self.refused((TypeError, ValueError), scene.density, ["a", "b", "c"])
        self.refused(cnerf.UsageError, cnerf.Camera, np.eye(4), 0, 10, 1)
        self.refused(cnerf.UsageError, cnerf.Camera, np.eye(3), 10, 10, 1)

    def test_cameras_are_checked(self):
        cnerf.Camera(np.eye(4), 10, 10, 8, cx=-3)  # of a crop
        for matrix in (np.full((4, 4), np.nan), np.zeros((4, 4)), 2 * np.eye(4), np.diag([1.0, 1, -1, 1])):
            self.refused(cnerf.UsageError, cnerf.Camera, matrix, 10, 10, 8)
        for lens in ({"fx": np.inf}, {"fx": 0}, {"fy": np.nan}, {"cx": np.inf}, {"cy": 1e300}):
            self.refused(cnerf.UsageError, cnerf.Camera, np.eye(4), 10, 10, **{"fx": 8, **lens})
        far = np.eye(4)
        far[0, 3] = 1e300  # no number in single precision
        self.refused(cnerf.UsageError, cnerf.Camera, far, 10, 10, 8)


class Stubs(unittest.TestCase):
    def test_name_what_the_module_has(self):
        tree = ast.parse((SOURCES / "package/__init__.pyi").read_text())
        declared = {}
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                names = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
                names |= {item.target.id for item in node.body if isinstance(item, ast.AnnAssign)}
                declared[node.name] = {name for name in names if not name.startswith("_")}
            elif isinstance(node, ast.FunctionDef):
                declared[node.name] = [argument.arg for argument in node.args.args + node.args.kwonlyargs]
        there = {name: getattr(cnerf, name) for name in dir(cnerf) if not name.startswith("_")}
        self.assertEqual(set(declared), set(there))
        for name, value in there.items():
            if not isinstance(value, type):
                for argument in declared[name]:
                    self.assertRegex(value.__doc__, rf"\b{argument}: ")
                continue
            if not issubclass(value, BaseException):
                self.assertEqual(declared[name], {one for one in vars(value) if not one.startswith("_")}, name)
        self.assertTrue((pathlib.Path(cnerf.__file__).parent / "py.typed").exists())

    def test_the_version_is_the_programs(self):
        self.assertEqual(program("--version").stdout, f"cnerf {cnerf.__version__}\n")


if __name__ == "__main__":
    unittest.main(verbosity=2)
