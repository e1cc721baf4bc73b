"""One gradient step of the squared intensity error, by this package and by others. All compute the same gradient.

Each version is made for a scene, with whatever it can prepare; ``step()`` gives loss and gradient, and ``field()`` the
field at the image plane, for its accuracy.
"""

import logging
from contextlib import chdir
from tempfile import TemporaryDirectory

import torch
from scene import PITCH, WAVELENGTH

from holobench_eval.methods.common import unit_field
from holobench_eval.methods.losses import intensity_l2
from holobench_eval.methods.wirtinger import Objective
from holobench_eval.optics.angular_spectrum import angular_spectrum_phase
from holobench_eval.optics.convolution import frequencies


class ThisPackage:
    """The step of ``wirtinger``, at the default accuracy."""

    def __init__(self, scene):
        spec = scene.spec
        self.phase, self.model = scene.phase, spec.propagator(0)
        self.objective = Objective(self.model, spec.region, scene.target, intensity_l2)

    @property
    def padded(self):
        return self.model.padded_shape

    def field(self):
        return self.model.forward(unit_field(self.phase))

    def step(self):
        return self.objective.evaluate(self.phase)


class FourTransforms:
    """What any step has to do: four bare Fourier transforms of this package's padded size."""

    def __init__(self, scene):
        self.padded = scene.spec.propagator(0).padded_shape
        self.fields = torch.randn(self.padded, dtype=torch.complex64)

    def step(self):
        for _ in range(2):
            torch.fft.ifft2(torch.fft.fft2(self.fields))


class Autograd:
    """A step by autograd through ``field()``, which each version defines."""

    def __init__(self, scene, padded):
        self.padded, self.phase = tuple(padded), scene.phase.clone().requires_grad_()
        self.target, self.region, self.leaf = scene.target, scene.spec.region, self.phase

    def step(self):
        intensity = self.region.crop(self.field().abs().square())
        scale = (intensity * self.target).sum() / intensity.square().sum()
        loss = (scale * intensity - self.target).square().sum() / self.target.square().sum()
        return loss, torch.autograd.grad(loss, self.leaf)[0]


class GoodEngineer(Autograd):
    """What a careful engineer writes in ten lines: a cached transfer function, twice padded, and autograd."""

    def __init__(self, scene):
        super().__init__(scene, (2 * side for side in scene.panel))
        fy, fx = frequencies(self.padded, PITCH)
        phase = angular_spectrum_phase(fy**2 + fx**2, WAVELENGTH, scene.distance)
        self.transfer = torch.polar(torch.ones_like(phase), phase).to(torch.complex64)

    def field(self):
        rows, columns = self.phase.shape[-2:]
        light = torch.polar(torch.ones_like(self.phase), self.phase)
        return torch.fft.ifft2(torch.fft.fft2(light, s=self.padded) * self.transfer)[..., :rows, :columns]


class Odak(Autograd):
    """odak's documented way: ``propagate_beam`` with its band-limited angular spectrum, twice padded."""

    def __init__(self, scene):
        super().__init__(scene, (2 * side for side in scene.panel))
        with TemporaryDirectory() as folder, chdir(folder):  # its import opens a log in the working directory
            import odak.learn.wave as wave
        log = logging.getLogger("odak")
        for handler in tuple(log.handlers):
            log.removeHandler(handler)
            handler.close()
        log.setLevel(logging.ERROR)
        self.wave, self.distance, self.number = wave, scene.distance, wave.wavenumber(WAVELENGTH)

    def field(self):
        light = self.wave.generate_complex_field(torch.ones_like(self.phase[0]), self.phase[0])
        return self.wave.propagate_beam(
            light,
            self.number,
            self.distance,
            PITCH,
            WAVELENGTH,
            propagation_type="Bandlimited Angular Spectrum",
            zero_padding=[True, False, True],
        )[None]


class TorchOptics(Autograd):
    """torchoptics' documented way: a system of one phase modulator; double precision, as is its default.

    padding: added to each side, in panels; 0.5 pads twice, and 2 is torchoptics' own default.
    """

    def __init__(self, scene, padding):
        import torchoptics
        from torchoptics.elements import PhaseModulator

        self.pad = [round(padding * side) for side in scene.panel]
        super().__init__(scene, (side + 2 * pad for side, pad in zip(scene.panel, self.pad, strict=True)))
        modulator = PhaseModulator(torch.nn.Parameter(scene.phase[0].clone()), z=0, spacing=PITCH)
        self.system, self.distance = torchoptics.System(modulator), scene.distance
        (self.leaf,) = self.system.parameters()
        even = torch.ones(scene.panel, dtype=torch.complex128)
        self.light = torchoptics.Field(even, wavelength=WAVELENGTH, z=0, spacing=PITCH)
        self.target = scene.target.double()

    def field(self):
        field = self.system.measure_at_z(self.light, self.distance, propagation_method="ASM", asm_pad=self.pad)
        return field.data[None]


BARE, OURS, AUTOGRAD = "four bare transforms", "holobench_eval", "autograd, twice padded"
STEPS = {
    BARE: FourTransforms,
    OURS: ThisPackage,
    AUTOGRAD: GoodEngineer,
    "odak": Odak,
    "torchoptics, twice padded": lambda scene: TorchOptics(scene, 0.5),
    "torchoptics, its default": lambda scene: TorchOptics(scene, 2.0),
}
