"""``holoeval doctor``: what is installed, which displays and cameras answer, and what to do about what is missing; or
what the pictures of a device look like.

Imports and drivers run native code of others, so they run in a process of their own with a time limit: a library that
crashes or hangs is a finding.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import requires, version
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import typer
from rich.markup import escape
from rich.table import Table

from ..core.errors import reason
from ..core.installed import installed, installing, pinned, shipped
from .output import console

State = Literal["ok", "missing", "warning", "broken"]

IMPORTING, ASKING = 180.0, 120.0  # seconds that imports and drivers may take
LEAST_DISK = 2e9  # bytes; a full-panel study with its captures
STYLES = {"ok": "green", "missing": "yellow", "warning": "bold yellow", "broken": "bold red"}
MODULES = {
    "scikit-image": "skimage",
    "pillow": "PIL",
    "pyyaml": "yaml",
    "opencv-python-headless": "cv2",
    "markdown-it-py": "markdown_it",
}

LIBRARIES = """
import importlib, json, sys
found = {"errors": {}, "kernel": None}
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except BaseException as error:
        found["errors"][name] = f"{type(error).__name__}: {error}"[:200]
if "torch" in sys.modules:
    import torch
    found["threads"] = torch.get_num_threads()
    cuda = torch.cuda.is_available()
    try:
        import holobench_eval.optics.kernel.fused
    except Exception as error:
        found["kernel"] = f"{type(error).__name__}: {error}"[:200]
    found["gpus"] = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())] if cuda else []
print("\\n" + json.dumps(found))
"""


DRIVERS = """
import dataclasses, json
from holobench_eval.lab.drivers.catalogue import survey
print("\\n" + json.dumps([dataclasses.asdict(entry) for entry in survey()]), flush=True)
import os
os._exit(0)  # without waiting for what a driver left running
"""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    what: its name; state: ok, missing (something here does without it), warning, or broken (nothing works without it);
    found: what there is, or why it is not; remedy: what to do, one command where one is enough.
    """

    what: str
    state: State
    found: str
    remedy: str = ""


def doctor(
    devices: Annotated[
        list[str] | None,
        typer.Argument(
            help="A camera, a panel, path/to/file.py:Class, or both; or a bench file: look at their pictures."
        ),
    ] = None,
) -> None:
    """List what is installed and which devices answer: packages, panels, cameras, and what to do about the rest."""
    if devices:
        _try(devices)
    screen, findings = console(), examine()
    table = Table(title="holoeval doctor", title_justify="left")
    for heading in ("", "", "found"):
        table.add_column(heading, overflow="fold")
    for finding in findings:
        state = f"[{STYLES[finding.state]}]{finding.state}[/]"
        table.add_row(escape(finding.what), state, escape(finding.found))
    screen.print(table)
    remedies = [f"{finding.what}: {finding.remedy}" for finding in findings if finding.remedy]
    broken = [finding.what for finding in findings if finding.state == "broken"]
    last = f"broken: {', '.join(broken)}" if broken else "the core is complete; what is missing is optional"
    for line in (*remedies, last):  # never wrapped, so that commands can be copied
        screen.print(line, soft_wrap=True, markup=False)
    raise typer.Exit(1 if broken else 0)


def _try(devices: list[str]) -> NoReturn:
    """Look at what devices give, a line each."""
    from ..lab.trial import tried

    screen, faults = console(), 0
    for check in tried(devices):
        faults += not check.passed
        screen.print(f"{'' if check.passed else 'fault: '}{check.line}", soft_wrap=True, markup=False)
    raise typer.Exit(1 if faults else 0)


def examine() -> list[Finding]:
    """Look at everything; raises nothing, and comes back within a few minutes whatever hangs."""
    checks: dict[str, Callable[[], Iterator[Finding]]] = {
        "Python": _python,
        "packages": _packages,
        "OpenCV": _opencv,
        "git": _git,
        "disk": _disk,
        "weights": _weights,
        "peers": _peers,
        "drivers": _drivers,
    }
    findings: list[Finding] = []
    for name, check in checks.items():
        try:
            findings += check()
        except Exception as error:  # a check that fails says nothing about what it checks
            findings.append(Finding(name, "warning", f"could not be looked at: {reason(error)[:200]}"))
    return findings


def _either(what: str, found: str | None, otherwise: str, remedy: str, state: State = "missing") -> Finding:
    """What was found, else another state and what to do."""
    return Finding(what, "ok", found) if found else Finding(what, state, otherwise, remedy)


def _python() -> Iterator[Finding]:
    text = f"{platform.python_version()} ({sys.executable}), {platform.system()} {platform.machine()}"
    yield Finding("Python", "ok", text)


def _packages() -> Iterator[Finding]:
    names = _required()
    modules = {MODULES.get(name, name.replace("-", "_")): name for name in names}
    seen = _ask(LIBRARIES, IMPORTING, *modules)
    if isinstance(seen, str):
        yield Finding("packages", "broken", f"importing them all {seen}", installing())
        return
    for module, name in modules.items():
        wrong = seen["errors"].get(module)
        if wrong is not None:
            yield Finding(name, "broken", wrong, installing(name))
        elif name in ("torch", "numpy"):
            yield Finding(name, "ok", version(name))
    complete = len(modules) - len(seen["errors"])
    yield Finding("packages", "ok", f"{complete} of {len(modules)} that the core needs can be imported")
    yield _versions(names)
    fault = seen.get("kernel")
    why = f"by torch, at half the speed: the compiled kernel cannot be had ({fault})"
    yield _either("propagation", None if fault else "compiled for this processor", why, installing("numba"))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    yield Finding("CPU", "ok", f"{cores} cores for this process, {seen.get('threads', 'no')} torch threads")
    gpus = seen.get("gpus") or ["none that torch can use; nothing here needs one"]
    yield Finding("GPU", "ok", ", ".join(gpus))


def _versions(names: list[str]) -> Finding:
    """Whether the packages that the core needs are those that the committed results were made with."""
    wanted = pinned()
    if not wanted:
        return Finding("versions", "warning", f"cannot be compared: {shipped() / 'constraints.txt'} names none")
    there = {name: found.partition("+")[0] for name in names if (found := installed(name))}
    other = {name: found for name, found in there.items() if found != wanted.get(name, found)}
    told = ", ".join(f"{name} {found} (not {wanted[name]})" for name, found in other.items())
    return _either("versions", None if other else "those of the committed results", told, installing(), "warning")


def _required() -> list[str]:
    """Names of the packages that the core needs, from what was installed; it does without the compiler."""
    lines = [line for line in requires("holobench_eval") or () if "extra ==" not in line]
    names = [match[0].lower() for line in lines if (match := re.match(r"[A-Za-z0-9._-]+", line))]
    return [name for name in names if name != "numba"]


def _opencv() -> Iterator[Finding]:
    """The wheels of OpenCV write into one folder, so that the one installed last is the one that is used."""
    wheels = ("opencv-python-headless", "opencv-python", "opencv-contrib-python", "opencv-contrib-python-headless")
    there = {name: found for name in wheels if (found := installed(name))}
    text = ", ".join(f"{name} {found}" for name, found in there.items())
    if list(there) == ["opencv-python-headless"]:
        yield Finding("OpenCV", "ok", text)
    elif there:
        why = f"{text}: not the headless wheel alone, which the results are tested with"
        remedy = f"pip uninstall -y {' '.join(there)} && {installing('opencv-python-headless')}"
        yield Finding("OpenCV", "warning", why, remedy)


def _git() -> Iterator[Finding]:
    program = shutil.which("git")
    if program is None:
        remedy = "install git (Debian: apt install git); reports then name the revision they were made with"
        yield Finding("git", "missing", "not on the path", remedy)
        return
    done = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=20)
    yield Finding("git", "ok" if done.returncode == 0 else "warning", done.stdout.strip() or done.stderr.strip()[:200])


def _disk() -> Iterator[Finding]:
    free = shutil.disk_usage(Path()).free
    text = f"{free / 1e9:.1f} GB free in {Path().resolve()}"
    remedy = f"free some, or write elsewhere with --output; {LEAST_DISK / 1e9:.0f} GB do for most studies"
    yield _either("disk", text if free >= LEAST_DISK else None, text, remedy, "warning")


def _weights() -> Iterator[Finding]:
    import torch

    from ..methods.hil.perceptual import URL
    from ..methods.hil.perceptual import find_weights as vgg19
    from ..metrics.lpips import _TRUNKS, find_weights

    for name, file, url, without in (
        ("LPIPS weights (AlexNet)", find_weights("alex"), _TRUNKS["alex"].url, "no column lpips_alex"),
        ("LPIPS weights (VGG-16)", find_weights("vgg"), _TRUNKS["vgg"].url, "no column lpips_vgg"),
        ("perceptual loss (VGG-19)", vgg19(), URL, "fixed filters in their place, and reports say so"),
    ):
        target = Path(torch.hub.get_dir()) / "checkpoints" / url.rpartition("/")[2]
        command = f"curl -L --create-dirs -o {shlex.quote(str(target))} {url}"
        yield _either(name, None if file is None else str(file), without, command)


def _peers() -> Iterator[Finding]:
    for name in ("odak", "torchoptics"):
        yield _either(f"peer {name}", installed(name), "not installed", installing(extra="peers"))


def _drivers() -> Iterator[Finding]:
    raw = installed("rawpy")
    remedy = installing(extra="raw")
    yield _either("camera RAW files", raw and f"rawpy {raw}", "rawpy: not installed", remedy)
    seen = _ask(DRIVERS, ASKING)
    if isinstance(seen, str):
        remedy = "unplug devices one by one and try again"
        yield Finding("drivers", "warning", f"asking panels and cameras {seen}", remedy)
        return
    for device in seen:
        what = f"{'panels' if device['kind'] == 'slm' else 'cameras'}: {device['driver']}"
        found = ", ".join(device["devices"]) or "no device answers"
        text = "not installed" if device["version"] is None else f"{device['version']}; {found}"
        yield Finding(what, "ok" if device["devices"] else "missing", text, device["why"])


def _ask(code: str, seconds: float, *arguments: str) -> Any:
    """Run Python code in a process of its own: the JSON of its last line, or a text that says what went wrong."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=seconds,
        )
    except subprocess.TimeoutExpired:
        return f"takes longer than {seconds:g} s"
    except OSError as error:
        return f"fails: {error}"
    try:
        return json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        last = (done.stderr.strip() or "without a word").splitlines()[-1][:200]
        return f"ends with {done.returncode}: {last}"
