"""The gradient step by other packages, each as its documentation does it.

JAX has a pool of threads of its own, as many as there are processors to run on. In its process torch has one thread.
"""

import logging
from contextlib import chdir
from tempfile import TemporaryDirectory

import numpy as np
import torch
from scene import PITCH, WAVELENGTH
from steps import Autograd, cached_transfer


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

    Padded twice like the others; by default it adds two panels to each side, and takes five to six times as long.
    """

    def __init__(self, scene):
        import torchoptics
        from torchoptics.elements import PhaseModulator

        self.pad = [side // 2 for side in scene.panel]
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


class Jax:
    """What a careful engineer writes in JAX: a cached transfer function, twice padded, jitted with its gradient."""

    def __init__(self, scene):
        import jax
        import jax.numpy as jnp

        self.numpy, self.padded = jnp, tuple(2 * side for side in scene.panel)
        region = scene.spec.region
        rows = slice(region.top, region.top + region.height)
        columns = slice(region.left, region.left + region.width)

        def loss(phase, target, fixed):
            field = self.propagated(phase, fixed)[rows, columns]
            intensity = field.real**2 + field.imag**2
            scale = (intensity * target).sum() / (intensity**2).sum()
            return ((scale * intensity - target) ** 2).sum() / (target**2).sum()

        self.phase, self.target = (jnp.asarray(tensor[0].numpy()) for tensor in (scene.phase, scene.target))
        self.fixed = self.prepared(scene)  # an argument, too: JAX folds what a function closes over into its code
        self.gradient, self.forward = jax.jit(jax.value_and_grad(loss)), jax.jit(self.propagated)

    def prepared(self, scene):
        return self.numpy.asarray(cached_transfer(scene, self.padded).numpy())

    def light(self, phase):
        return self.numpy.cos(phase) + 1j * self.numpy.sin(phase)

    def propagated(self, phase, transfer):
        fft = self.numpy.fft
        field = fft.ifft2(fft.fft2(self.light(phase), s=self.padded) * transfer)
        return field[: phase.shape[0], : phase.shape[1]]

    def step(self):
        loss, gradient = self.gradient(self.phase, self.target, self.fixed)
        return loss.block_until_ready(), gradient.block_until_ready()

    def field(self):
        return torch.from_numpy(np.array(self.forward(self.phase, self.fixed)))


class Chromatix(Jax):
    """chromatix' documented way: ``asm_propagate`` with its band limit, twice padded; it makes the kernel in each call.

    Its package on PyPI is empty: ``pip install git+https://github.com/chromatix-team/chromatix``.
    """

    def __init__(self, scene):
        import chromatix.functional

        self.optics, self.distance = chromatix.functional, scene.distance
        super().__init__(scene)

    def prepared(self, scene):
        return None

    def source(self, phase):
        return self.optics.Field.build(self.light(phase), PITCH, WAVELENGTH)

    def propagated(self, phase, fixed):
        settings = {"pad_width": phase.shape, "mode": "same", "bandlimit": True}
        return self.optics.asm_propagate(self.source(phase), self.distance, 1.0, **settings).u.reshape(phase.shape)


class ChromatixKernel(Chromatix):
    """The same with the kernel made once."""

    def prepared(self, scene):
        functions = self.optics.propagation
        field = functions.pad(self.source(self.numpy.zeros(scene.panel)), scene.panel)
        return functions.compute_asm_propagator(field, self.distance, 1.0, bandlimit=True)

    def propagated(self, phase, kernel):
        functions = self.optics.propagation
        field = functions.kernel_propagate(functions.pad(self.source(phase), phase.shape), kernel)
        return functions.crop(field, phase.shape).u.reshape(phase.shape)


PEERS = {"odak": Odak, "torchoptics, twice padded": TorchOptics}
OF_JAX = {
    "JAX, twice padded": Jax,
    "chromatix": Chromatix,
    "chromatix, its kernel cached": ChromatixKernel,
}
