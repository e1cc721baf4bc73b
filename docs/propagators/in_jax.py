"""The same in JAX: arrays come as torch tensors, and may go back as JAX arrays."""

import jax
import jax.numpy as jnp
import numpy as np


class InJax:
    """The angular spectrum, padded to twice the size; its phase is formed in double precision, by NumPy."""

    def __init__(self, shape, pitch, wavelength, distance):
        self.shape, self.padded = shape, (2 * shape[0], 2 * shape[1])
        fy, fx = np.fft.fftfreq(self.padded[0], pitch)[:, None], np.fft.fftfreq(self.padded[1], pitch)
        axial = np.sqrt(np.maximum(1 / wavelength**2 - fy**2 - fx**2, 0))
        self.transfer = jnp.asarray(np.exp(2j * np.pi * distance * (axial - 1 / wavelength)))

    def propagate(self, field):
        """Propagate a JAX array ``(H, W)``."""
        spectrum = jnp.fft.fft2(field, self.padded) * self.transfer
        return jnp.fft.ifft2(spectrum)[: self.shape[0], : self.shape[1]]

    def forward(self, field):
        """Propagate a complex field ``(H, W)``."""
        return self.propagate(jnp.asarray(field.numpy()))

    def adjoint(self, field):
        """The adjoint by JAX itself, whose transpose does not conjugate."""
        given = jnp.asarray(field.numpy())
        (back,) = jax.linear_transpose(self.propagate, given)(given.conj())
        return back.conj()
