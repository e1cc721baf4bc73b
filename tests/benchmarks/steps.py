"""One gradient step of the squared intensity error, by this package and by anybody. All compute the same gradient.

Each version is made for a scene, with whatever it can prepare; ``step()`` gives loss and gradient, and ``field()`` the
field at the image plane, for its accuracy. ``peers`` has the versions of other packages.
"""

import torch
from scene import PITCH, THREADS, WAVELENGTH

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
        self.fields, self.spectrum, self.fields_again = torch.randn(3, *self.padded, dtype=torch.complex64)

    def step(self):
        for _ in range(2):
            torch.fft.ifft2(torch.fft.fft2(self.fields))


class FourPreallocated(FourTransforms):
    """Into arrays that are there, by torch; it copies the result into them."""

    def step(self):
        for _ in range(2):
            torch.fft.ifft2(torch.fft.fft2(self.fields, out=self.spectrum), out=self.fields_again)


class FourOfDucc(FourTransforms):
    """Into arrays that are there, by ducc0, the successor of pocketfft (GPL: not even an optional dependency)."""

    def __init__(self, scene):
        import ducc0

        super().__init__(scene)
        self.c2c = ducc0.fft.c2c
        self.arrays = self.fields.numpy(), self.spectrum.numpy()

    def step(self):
        fields, spectrum = self.arrays
        for _ in range(2):
            self.c2c(fields, axes=(0, 1), out=spectrum, nthreads=THREADS)
            self.c2c(spectrum, axes=(0, 1), forward=False, inorm=2, out=spectrum, nthreads=THREADS)


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
        self.transfer = cached_transfer(scene, self.padded)

    def field(self):
        rows, columns = self.phase.shape[-2:]
        light = torch.polar(torch.ones_like(self.phase), self.phase)
        return torch.fft.ifft2(torch.fft.fft2(light, s=self.padded) * self.transfer)[..., :rows, :columns]


def cached_transfer(scene, padded):
    """The angular spectrum's transfer function, complex64, of a padded shape."""
    fy, fx = frequencies(padded, PITCH)
    phase = angular_spectrum_phase(fy**2 + fx**2, WAVELENGTH, scene.distance)
    return torch.polar(torch.ones_like(phase), phase).to(torch.complex64)


BARE, OURS = "four bare transforms", "holobench_eval"
STEPS = {
    BARE: FourTransforms,
    "four preallocated transforms": FourPreallocated,
    "four preallocated transforms, ducc0": FourOfDucc,
    OURS: ThisPackage,
    "autograd, twice padded": GoodEngineer,
}
