"""Everything that is timed, by group; versions in a group do the same work and are compared with each other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from peers import OF_JAX, PEERS
from scene import SHRINK, THREADS, Scene
from steps import BARE, OURS, STEPS

from holobench_eval.core import plugins
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods.common import unit_field
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.learned.weights import seeded
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.catalogue import catalogue
from holobench_eval.study import plan
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Serial
from holobench_eval.study.running.progress import watching
from holobench_eval.study.running.run import run
from tests.support.open_loop import Bench

PAPER = (1080, 1920)
ONE_PASS = ("tensor_holography", "unet_phase", "holonet", "ccnn")
DISTANCES = (0.02, 0.1, 0.2)
COMPARED = [Scene(PAPER, distance) for distance in DISTANCES]
SIZES = [Scene(panel, distance) for panel in ((256, 256), (540, 960), PAPER, (2160, 3840)) for distance in DISTANCES]
STEP, PROPAGATION, SSIM = "gradient step", "propagation", "SSIM, one channel"
STUDY = """
title: benchmark
seed: 1
display: {{profiles: [{profile}], panel: [{side}, {side}]}}
targets: {{dataset: photographs, params: {{names: [astronaut]}}}}
methods: [{{name: {method}, params: {{iterations: {iterations}}}}}]
repeats: {repeats}
"""
TRIVIAL = """
from dataclasses import dataclass

import torch


@dataclass(frozen=True)
class Trivial:
    iterations: int = 1

    def solve(self, target, bench):
        return torch.zeros(1, target.shape[1], *bench.spec.shape)
"""


@dataclass(frozen=True)
class CellStudy:
    """A study of one target, in three colours."""

    profile: str
    side: int
    method: str
    iterations: int = 1
    repeats: int = 1

    def shrunk(self):
        return replace(self, iterations=1 + self.iterations // SHRINK, repeats=1 + self.repeats // SHRINK)


@dataclass
class Work:
    """call: what is timed; facts: what is to be known of it beside its time, by name."""

    call: Callable[[], object]
    facts: Callable[[], dict[str, Any]] = dict


@dataclass(frozen=True)
class Case:
    """group: the same work; version: who does it. make: prepares it for a scene or a study. threads: of torch."""

    group: str
    version: str
    make: Callable[..., Work]
    scene: Scene | CellStudy
    threads: int = THREADS

    @property
    def name(self):
        return f"{self.group} | {self.version}"

    def work(self):
        return self.make(self.scene)

    def shrunk(self):
        """The same at an eighth of the size: does it run?"""
        return replace(self, scene=self.scene.shrunk())


def of_scenes(kind, scenes, makers, **settings):
    """A case for every scene and version; makers: what prepares the work, by version."""
    return [
        Case(f"{kind}, {scene.name}", version, make, scene, **settings)
        for scene in scenes
        for version, make in makers.items()
    ]


def gradient_step(version):
    def make(scene):
        work = version(scene)

        def facts():
            padded = {"padded": list(work.padded)}
            if scene.panel[0] > PAPER[0] or not hasattr(work, "field"):
                return padded
            with torch.no_grad():
                return padded | {"error": scene.error(work.field())}

        return Work(work.step, facts)

    return make


def gradient_steps(versions):
    return {name: gradient_step(version) for name, version in versions.items()}


def propagation(scene, spec=None):
    """By the ideal model of a display, without one of the scene's."""
    model, light = (spec or scene.spec).propagator(0), unit_field(scene.phase)
    return Work(lambda: model.forward(light), lambda: {"padded": list(model.padded_shape)})


def two_transforms(scene):
    padded = scene.spec.propagator(0).padded_shape
    fields = torch.randn(padded, dtype=torch.complex64)
    return Work(lambda: torch.fft.ifft2(torch.fft.fft2(fields)), lambda: {"padded": list(padded)})


def capture(samples):
    def make(scene):
        bench = SimulatedBench(replace(load_profile("leto-aged"), sampling=samples).scaled(scene.panel))
        session, phase = bench.session("benchmark", exposure=(4000.0,)), scene.phase
        return Work(torch.no_grad()(lambda: session.capture(phase)))

    return make


def its_propagation(scene):
    return propagation(scene, load_profile("leto-aged").scaled(scene.panel).spec())


def pictures(scene, channels=3):
    draw = torch.Generator().manual_seed(1)
    target = torch.nn.functional.interpolate(torch.rand(1, channels, 34, 60, generator=draw), scene.panel)[0].double()
    noise = 0.1 * torch.randn(target.shape, generator=draw, dtype=torch.float64)
    return (target + noise).clamp(0, 1), target


def metric(measure):
    def make(scene):
        rows, columns = scene.panel
        pair = pictures(replace(scene, panel=(max(rows, measure.smallest), max(columns, measure.smallest))))
        return Work(torch.no_grad()(lambda: measure.function(*pair)))

    return make


def ssim_here(scene):
    from holobench_eval.metrics.ssim import ssim

    pair = pictures(scene, 1)
    return Work(lambda: ssim(*pair))


def ssim_of_scikit_image(scene):
    from skimage.metrics import structural_similarity

    image, target = (picture[0].numpy() for picture in pictures(scene, 1))

    def call():
        return structural_similarity(
            image, target, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0
        )

    return Work(call)


def network(backward):
    def make(scene):
        torch.manual_seed(1)
        model = Network().generator(3, 3)
        ideal = torch.rand(1, 3, *scene.panel)

        def call():
            predicted = model(ideal)
            if backward:
                predicted.square().mean().backward()

        return Work(call if backward else torch.no_grad()(call))

    return make


def colours(scene):
    """The nominal optics of a display in three colours, and a target ``(C, h, w)``."""
    spec = load_profile("ideal").scaled(scene.panel).spec()
    return spec, torch.rand(3, *spec.region.shape, generator=torch.Generator().manual_seed(1))


def one_pass(method):
    def make(scene):
        spec, target = colours(scene)
        with seeded("benchmark", 1):
            model = method.network(spec)
        return Work(torch.no_grad()(lambda: method._phase(model, spec, target)))

    return make


def steps(count):
    def make(scene):
        spec, target = colours(scene)
        method = Wirtinger(iterations=count, initial_phase="dpe", step=0.03)
        return Work(lambda: method.solve(target[None], Bench(spec)))

    return make


def study(scene):
    """A study, from its plan to its last record, in a folder of its own each time."""
    from rich.console import Console

    kept = TemporaryDirectory(ignore_cleanup_errors=True)
    folder = Path(kept.name)
    (folder / "trivial.py").write_text(TRIVIAL)
    (folder / "study.yaml").write_text(STUDY.format(**vars(scene)))
    loaded = load_study(folder / "study.yaml")

    def call():
        with watching(Console(quiet=True)) as watch, TemporaryDirectory(dir=kept.name) as output:
            run(loaded, plan.plan(loaded), Path(output), Serial(), watch, torch.get_num_threads(), folder / "artifacts")

    return Work(call)


STUDIES = {
    "one cell: Wirtinger, 100 iterations, 192x192, three colours": CellStudy("leto-aged", 192, "wirtinger", 100),
    "one cell: Wirtinger, 20 iterations, 118x118, three colours": CellStudy("leto-aged", 118, "wirtinger", 20),
    "50 trivial cells, 118x118": CellStudy("ideal", 118, "trivial.py:Trivial", repeats=50),
}
AT_100_MM = [Scene(PAPER, 0.1)]
CASES = [
    *of_scenes(STEP, COMPARED, gradient_steps(STEPS | PEERS)),
    *of_scenes(STEP, COMPARED, gradient_steps(OF_JAX), threads=1),
    *of_scenes(
        STEP,
        [scene for scene in SIZES if scene not in COMPARED],
        gradient_steps({version: STEPS[version] for version in (BARE, OURS)}),
    ),
    *of_scenes(PROPAGATION, SIZES, {"two bare transforms": two_transforms, OURS: propagation}),
    *of_scenes(
        "capture",
        AT_100_MM,
        {"ideal propagation": its_propagation, "1 sub-sample": capture(1), "3 sub-samples": capture(3)},
    ),
    *of_scenes(SSIM, AT_100_MM, {"scikit-image, one thread": ssim_of_scikit_image}, threads=1),
    *of_scenes(SSIM, AT_100_MM, {f"{OURS}, one thread": ssim_here}, threads=1),
    *of_scenes(SSIM, AT_100_MM, {f"{OURS}, two threads": ssim_here}),
    *of_scenes(
        "metric, three channels",
        AT_100_MM,
        {measure.name: metric(measure) for measure in catalogue() if measure.available() is None},
    ),
    *of_scenes(
        "approximator, preset small",
        [Scene((256, 256), 0.1)],
        {"forward": network(False), "forward and backward": network(True)},
    ),
    *of_scenes(
        "hologram in three colours",
        AT_100_MM,
        {name: one_pass(plugins.build("methods", name, {})) for name in ONE_PASS}
        | {f"{count} steps from a double phase": steps(count) for count in (5, 20)},
    ),
    *(Case("study", name, study, scene) for name, scene in STUDIES.items()),
]
