"""What reads bytes from outside, each with inputs to begin with; bad input is a `UserError` or a `CellError`."""

import hashlib
import io
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.core.hashing import digest
from holobench_eval.datasets.images import decode
from holobench_eval.display.simulated.maps import MapFile, load_maps
from holobench_eval.display.simulated.profile import load_profile
from holobench_eval.lab.bench_file import load_bench_file
from holobench_eval.lab.raw import read_raw
from holobench_eval.lab.session.manifest import FILE as MANIFEST
from holobench_eval.lab.session.manifest import capture_of, file_of, read_manifest
from holobench_eval.methods.files.arrays import read_array
from holobench_eval.report.compare import read_run
from holobench_eval.study.artifacts import read_tensors
from holobench_eval.study.config import load_study
from holobench_eval.study.isolation.messages import Channel
from holobench_eval.study.running.provenance import read as read_provenance
from holobench_eval.study.store import SCHEMA, Record, Store
from tests.support.bayer import bayer_dng

ROOT = Path(__file__).parents[2]
REFUSALS = (UserError, CellError)


@dataclass(frozen=True)
class Target:
    """run: what is fuzzed, with the bytes and a folder of its own; begin: valid inputs."""

    run: Callable[[bytes, Path], object]
    begin: Callable[[], list[bytes]]


def _file(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def _maps() -> list[bytes]:
    content = io.BytesIO()
    np.savez(content, **{"lut.gain": np.ones((3, 2, 2), np.float32), "sensor.ambient": np.ones(3, np.float32)})
    return [content.getvalue()]


def _read_maps(content: bytes, folder: Path) -> object:
    said = MapFile(_file(folder, "maps.npz", content).name, len(content), hashlib.sha256(content).hexdigest())
    return load_maps(said, folder, {"colours": 3, "levels": 256, "rows": 64, "columns": 64})


ARRAYS = (".npy", ".npz")  # the first byte of an input says which of them follows; .mat is read in a process of its own


def _phases() -> list[bytes]:
    buffers = [io.BytesIO() for _ in ARRAYS]
    phases = np.arange(12, dtype=np.float32).reshape(3, 2, 2)
    np.save(buffers[0], phases)
    np.savez(buffers[1], phases)
    return [bytes([number]) + buffer.getvalue() for number, buffer in enumerate(buffers)]


def _read_phases(content: bytes, folder: Path) -> object:
    suffix = ARRAYS[content[0] % len(ARRAYS)] if content else ARRAYS[0]
    return read_array(_file(folder, f"phases{suffix}", content[1:]))


def _configs() -> list[bytes]:
    return [(ROOT / "configs" / f"{name}.yaml").read_bytes() for name in ("quick", "lens", "table3", "family")]


def _profiles() -> list[bytes]:
    folder = ROOT / "holobench_eval/display/simulated/profiles"
    return [(folder / f"{name}.yaml").read_bytes() for name in ("ideal", "leto-mild", "leto-2020")]


def _benches() -> list[bytes]:
    page = (ROOT / "docs/real-bench.md").read_text()
    return [page.partition("```yaml\n# my-bench.yaml\n")[2].partition("```")[0].encode()]


def _pictures() -> list[bytes]:
    pixels = np.arange(8 * 6 * 3, dtype=np.uint8).reshape(8, 6, 3)
    modes = [Image.fromarray(pixels), Image.fromarray(pixels[..., 0]), Image.fromarray(pixels).convert("P")]
    modes.append(Image.fromarray(pixels[..., 0].astype(np.uint16) * 99))
    written = []
    for image in modes:
        for kind in ("PNG", "JPEG", "TIFF", "BMP"):
            buffer = io.BytesIO()
            try:
                image.save(buffer, kind)
            except OSError:  # a format that has no such pixels
                continue
            written.append(buffer.getvalue())
    return written


def _photographs() -> list[bytes]:
    mosaic = np.arange(32 * 32, dtype=np.uint16).reshape(32, 32) * 15
    return [bayer_dng(mosaic), bayer_dng(mosaic, pattern=bytes([2, 1, 1, 0]))]


def _tensors() -> list[bytes]:
    buffer = io.BytesIO()
    torch.save({"format": 1, "state": {"w": torch.ones(2, 3), "n": 3, "s": [1.5, "a"]}}, buffer)
    return [buffer.getvalue()]


RECORD = Record(
    {"phase": {"code": "Wirtinger 1", "params": {"iterations": 5}}, "noise": [0, "astronaut", 0]},
    "done",
    "wirtinger",
    scores={"psnr": {"version": "v2, 1", "values": {"psnr_linear": 19.5}}},
    seconds=1.5,
    captures=3,
)


def _records() -> list[bytes]:
    content = {**asdict(RECORD), "schema": SCHEMA}
    return [json.dumps({**content, "sha256": digest(content)}).encode(), json.dumps(asdict(RECORD)).encode()]


def _read_record(content: bytes, folder: Path) -> object:
    store = Store(folder)
    store.folder.mkdir(parents=True, exist_ok=True)
    store.path(RECORD.id).write_bytes(content)
    return store.read(RECORD.id)


def _read_message(content: bytes, _: Path) -> object:
    ours, theirs = Pipe()
    for part in content.split(b"\n\n")[:8]:  # a header and the bytes of its tensors
        ours.send_bytes(part[:30_000])  # more than the pipe holds would wait for a reader
    ours.close()
    try:
        return Channel(theirs).receive()
    except EOFError:
        return None
    finally:
        theirs.close()


def _manifests() -> list[bytes]:
    pattern = {
        **{"round": 1, "number": 1, "role": "dark", "colour": 0, "exposure": 1.0, "key": "0" * 64, "sha256": "0" * 64},
        **{"file": file_of(1, 1), "capture": capture_of(1, 1)},
    }
    phase = {"sign": 1, "origin": 0.0, "two_pi_level": 256, "flip_horizontal": False, "flip_vertical": False}
    session = {
        **{"format": 1, "session": "0" * 64, "study_sha256": "0" * 64, "bench_sha256": "0" * 64, "display": "mine"},
        **{"panel": [128, 160], "wavelengths": [5.2e-7], "phase": phase, "fixed_exposure": True},
    }
    return [json.dumps({**session, "patterns": [pattern]}).encode()]


def _csv() -> list[bytes]:
    lines = (ROOT / "reports/depth/records.csv").read_bytes().splitlines(keepends=True)
    return [b"".join(lines[:4]), lines[0]]


TARGETS = {
    "study": Target(lambda content, folder: load_study(_file(folder, "study.yaml", content)), _configs),
    "profile": Target(lambda content, folder: load_profile(str(_file(folder, "mine.yaml", content))), _profiles),
    "bench": Target(lambda content, folder: load_bench_file(_file(folder, "bench.yaml", content)), _benches),
    "picture": Target(lambda content, folder: decode(content, "picture"), _pictures),
    "raw": Target(lambda content, _: read_raw(content, "picture"), _photographs),
    "phases": Target(_read_phases, _phases),
    "tensors": Target(lambda content, folder: read_tensors(_file(folder, "learned.pt", content)), _tensors),
    "record": Target(_read_record, _records),
    "maps": Target(_read_maps, _maps),
    "provenance": Target(
        lambda content, folder: read_provenance(_file(folder, "provenance.json", content).parent),
        lambda: [(ROOT / "reports/depth/provenance.json").read_bytes()[:4000], b'{"earlier": [{}]}'],
    ),
    "manifest": Target(lambda content, folder: read_manifest(_file(folder, MANIFEST, content).parent), _manifests),
    "message": Target(
        _read_message,
        lambda: [
            b'["dict", ["result", ["tensor", "float32", [1, 2]]]]\n\n12345678',
            b'["dict", ["ask", "capture"], ["args", ["tuple", ["class", "Capture", ["dict", ["dark", 0.5]]]]]]',
        ],
    ),
    "records.csv": Target(lambda content, folder: read_run(_file(folder, "records.csv", content).parent), _csv),
}
