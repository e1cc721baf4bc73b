"""odak and torchoptics as methods: their conventions are those of this package, their side effects stay inside."""

import logging
import sys
from pathlib import Path

import pytest
import torch
from torch import Tensor

from holobench_eval.commands.list_ import KINDS
from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.methods.peers.loading import load

ODAK, OPTICS = "odak_sgd", "torchoptics_adam"
PEERS = [
    pytest.param(name, marks=pytest.mark.skipif(reason is not None, reason=str(reason)))
    for name in (ODAK, OPTICS)
    for reason in [plugins.build("methods", name, {}).available()]
]
odak, optics = (pytest.mark.skipif(param.marks[0].args[0], reason=param.marks[0].kwargs["reason"]) for param in PEERS)


@pytest.mark.parametrize("name", PEERS)
def test_the_global_random_numbers_are_left_as_they_were(name, bench, scene):
    torch.manual_seed(1)
    before = torch.get_rng_state()
    plugins.build("methods", name, {"iterations": 2}).solve(scene(), bench)
    assert torch.equal(torch.get_rng_state(), before)


@odak
def test_odak_improves_the_image_of_this_packages_model(bench, scene, linear_psnr):
    """By little, for its image lies between the pixels, but neither the conjugate phase nor a mirror image has it."""
    target = scene()
    early, late = (plugins.build("methods", ODAK, {"iterations": n}).solve(target, bench) for n in (1, 60))
    reached = linear_psnr(late, target, bench)
    assert reached > linear_psnr(early, target, bench) + 2
    assert reached > linear_psnr(-late, target, bench) + 2
    assert reached > linear_psnr(late, target.flip(-1), bench) + 2


@odak
def test_odak_propagates_as_this_package_does_but_for_half_a_sample_of_frequency(bench):
    from odak.learn.wave import propagate_beam, wavenumber

    spec, wavelength = bench.spec, bench.spec.wavelengths[0]
    light = smooth_light(spec.shape)
    theirs = propagate_beam(light.to(torch.complex64), wavenumber(wavelength), spec.distance, spec.pitch, wavelength)
    ours = spec.propagator(0, dtype=torch.complex128).forward(light)
    moved = [wavelength * spec.distance / (4 * side * spec.pitch**2) for side in spec.shape]
    assert overlap(theirs, ours) < 0.99
    assert overlap(theirs, shifted(ours, moved)) > 0.999


@odak
def test_another_cell_starts_odak_from_another_random_phase(bench, scene):
    method, target = plugins.build("methods", ODAK, {"iterations": 2}), scene()
    here = method.solve(target, bench)
    bench.cell = "another cell"
    assert not torch.allclose(here, method.solve(target, bench), atol=0.1)


@odak
def test_odak_leaves_neither_a_file_nor_a_line(bench, scene, tmp_path, monkeypatch, capfd):
    from holobench_eval.methods.peers.odak_sgd import _odak

    monkeypatch.chdir(tmp_path)
    for name in [name for name in sys.modules if name.partition(".")[0] == "odak"]:
        monkeypatch.delitem(sys.modules, name)
    _odak.cache_clear()  # it is imported anew
    plugins.build("methods", ODAK, {"iterations": 2}).solve(scene(), bench)
    assert list(tmp_path.iterdir()) == []
    assert Path.cwd() == tmp_path
    assert "".join(capfd.readouterr()) == ""
    assert logging.getLogger("odak").handlers == []


@optics
def test_torchoptics_finds_the_phase_of_wirtinger(bench, scene, linear_psnr):
    """The same loss, start and step: only the propagation differs, by less than the images can show."""
    target = scene()
    theirs = plugins.build("methods", OPTICS, {"iterations": 40}).solve(target, bench)
    ours = plugins.build("methods", "wirtinger", {"iterations": 40, "offset": "none"}).solve(target, bench)
    assert linear_psnr(theirs, target, bench) == pytest.approx(linear_psnr(ours, target, bench), abs=0.5)
    agreement = torch.exp(1j * (theirs - ours).double()).mean().abs()
    assert agreement > 0.99


@optics
def test_torchoptics_propagates_as_this_package_does(bench):
    from torchoptics import Field

    spec = bench.spec
    light = smooth_light(spec.shape)
    theirs = Field(light, wavelength=spec.wavelengths[0], spacing=spec.pitch).propagate_to_z(
        spec.distance, propagation_method="ASM", asm_pad=[side // 2 for side in spec.shape]
    )
    assert overlap(theirs.data, spec.propagator(0, dtype=torch.complex128).forward(light)) > 0.9999


def smooth_light(shape: tuple[int, int]) -> Tensor:
    """A field ``(H, W)`` that is dark at the rim and has no frequency above 0.15 cycles/pixel; nothing of it is cut."""
    noise = torch.randn(shape, dtype=torch.complex128, generator=torch.Generator().manual_seed(2))
    fy, fx = frequencies(shape)
    y, x = (torch.linspace(-2.5, 2.5, side, dtype=torch.float64) for side in shape)
    envelope = torch.exp(-(y[:, None] ** 2) - x**2)
    return torch.fft.ifft2(torch.fft.fft2(noise) * (torch.hypot(fy, fx) < 0.15)) * envelope


def shifted(field: Tensor, pixels: list[float]) -> Tensor:
    """The field moved down and to the right by a part of a pixel."""
    fy, fx = frequencies((field.shape[0], field.shape[1]))
    ramp = torch.exp(-2j * torch.pi * (fy * pixels[0] + fx * pixels[1]))
    return torch.fft.ifft2(torch.fft.fft2(field) * ramp)


def frequencies(shape: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """Spatial frequencies [cycles/pixel] of a transform, ``(H, 1)`` and ``(1, W)``."""
    fy, fx = (torch.fft.fftfreq(side, dtype=torch.float64) for side in shape)
    return fy[:, None], fx[None, :]


def overlap(a: Tensor, b: Tensor) -> float:
    """1 for fields that are equal up to a complex factor."""
    a, b = a.to(torch.complex128), b.to(torch.complex128)
    return float((a * b.conj()).sum().abs() / (a.norm() * b.norm()))


def hide(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every import of a package fail as it does where it is not installed."""

    class Absent:
        def find_spec(self, name: str, path: object = None, target: object = None) -> None:
            if name.partition(".")[0] == package:
                raise ModuleNotFoundError(f"No module named '{name}'", name=package)

    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])


@pytest.mark.parametrize(("name", "package"), [("odak_sgd", "odak"), ("torchoptics_adam", "torchoptics")])
def test_it_is_listed_and_built_and_says_in_one_line_what_to_install(name, package, monkeypatch, bench, scene):
    from holobench_eval.methods.peers import odak_sgd

    odak_sgd._odak.cache_clear()
    hide(package, monkeypatch)
    assert "needs the extra 'peers'" in dict(KINDS["methods"][0]())[name]
    method = plugins.build("methods", name, {})
    why = method.available()
    assert why.startswith(f"{package} is not installed; pip install -c ")
    assert why.endswith("[peers]'")
    with pytest.raises(UserError, match="is not installed"):
        method.solve(scene(), bench)


def test_a_package_that_lacks_one_of_its_own_says_which(tmp_path, monkeypatch):
    (tmp_path / "halfpeer.py").write_text("import nothing_of_this_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UserError, match=r"^halfpeer cannot be imported: No module named 'nothing_of_this_name'$"):
        load("halfpeer")
