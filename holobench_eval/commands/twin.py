"""``holoeval twin``: photographs of a display become a profile that anyone can run, and a report on its limits."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import UserError
from .options import ARTIFACTS, PANEL, RETRAIN, Learned, thread_count
from .output import console
from .run import open_displays, resumable, run

if TYPE_CHECKING:
    from ..study.twin import Photographed

NAME = "a-z, A-Z, 0-9, . - and _"
PANEL_SIZE, PICTURES = (256, 256), 8  # the defaults of a display that is a profile


def twin(
    display: Annotated[
        str, typer.Argument(help="A display profile, the file of a bench, or the folder of a finished session.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the twin, which is named like it.")],
    panel: Annotated[tuple[int, int] | None, PANEL] = None,
    pictures: Annotated[
        int | None, typer.Option(min=3, max=11, help="So many pictures try the twin. [default: 8]")
    ] = None,
    network: Annotated[
        str | None,
        typer.Option(help="This method learns the display, in the place of a twin: for one outside the twin's form."),
    ] = None,
    artifacts: Learned = ARTIFACTS,
    retrain: Annotated[bool, RETRAIN] = False,
) -> None:
    """Learn the twin of a display from photographs: a profile with maps, tried on pictures that it has not seen.

    It takes 45 to 57 photographs to learn from, as many as help, and ten of each picture to be tried on. A stopped one
    goes on with the same command.
    """
    from ..core.io import file_name
    from ..report.twin import answer, tried, write_twin
    from ..study import twin as twins

    name = output.resolve().name
    if file_name(name) != name:
        raise UserError(f"{output}: the folder names the display; expected {NAME}")
    source = _photographs(display, output, panel, pictures, network, artifacts, retrain)
    print(f"{output}: photographs are there; the twin is tried on the same holograms")
    profile = twins.write_trial(source, name, output)
    _show_on_twin(output, artifacts)
    trial = twins.in_folder(output, artifacts, twins.TRIAL)
    found = tried(source, trial, name)
    path = twins.publish(replace(profile, twin=found.trust()), source, output)
    report = write_twin(output, source, trial, found, path)
    for sentence in answer(found):
        print(f"- {sentence}")
    print(f"{path}\n{report}")


def _photographs(
    display: str,
    output: Path,
    panel: tuple[int, int] | None,
    pictures: int | None,
    network: str | None,
    artifacts: Path,
    retrain: bool,
) -> Photographed:
    """The photographs of a session, or those that are taken now."""
    from ..core.io import write_atomically
    from ..lab.session.manifest import FILE as MANIFEST
    from ..study import twin as twins
    from ..study.network_display import predictor
    from ..study.twin import PHOTOGRAPHS, WORK

    name = output.resolve().name
    if Path(display).is_dir():
        if not (Path(display) / MANIFEST).is_file():
            own = Path(display, f"{Path(display).resolve().name}.yaml")
            hint = f"; the twin there is {own}" * own.is_file()
            raise UserError(f"{display}: a folder without {MANIFEST}; give that of a session, or a display{hint}")
        if (panel, pictures, network, retrain) != (None, None, None, False):
            options = "--panel, --pictures, --network and --retrain"
            raise UserError(f"{display}: {options} are not for a session, which has its study")
        source = twins.of_session(Path(display))
        twins.refuse(name, source, output)
        return source
    if display.endswith((".yaml", ".yml")) and not Path(display).is_file():
        raise UserError(f"{display}: no such file")
    if panel and twins.is_bench(Path(display)):
        raise UserError(f"{display}: a bench has the panel that its file says; leave out --panel")
    twins.refuse_fourier(display)
    if network:
        predictor(network, {})
    text = twins.study_text(display, panel or PANEL_SIZE, pictures or PICTURES, network)
    config = output / WORK / f"{PHOTOGRAPHS}.yaml"
    is_new = not config.exists()
    if not is_new and config.read_text(encoding="utf-8") != text:
        raise UserError(f"{output}: holds the twin of another display or of other settings; choose another --output")
    write_atomically(config, text.encode())
    try:
        twins.refuse(name, twins.in_folder(output, artifacts), output)
    except UserError as error:
        if is_new:
            config.unlink()
            with suppress(OSError):  # where it was made for this
                output.joinpath(WORK).rmdir()
                output.rmdir()
        raise UserError(re.sub(rf"^{re.escape(str(config))}(:\d+)*: ", "", str(error))) from None
    run(config, output=output / WORK / PHOTOGRAPHS, artifacts=artifacts, retrain=retrain)
    return twins.in_folder(output, artifacts)


def _show_on_twin(output: Path, artifacts: Path) -> None:
    """Capture the holograms on the twin and those it has to be better than. The report of the twin has what counts."""
    from ..core.device import find
    from ..study.config import load_study
    from ..study.executors import Serial
    from ..study.plan import plan
    from ..study.running.progress import watching
    from ..study.running.run import run as compute
    from ..study.twin import TRIAL, WORK

    work = output / WORK
    study = load_study(work / f"{TRIAL}.yaml")
    open_displays(study)
    threads, device = thread_count(None, 1, study), str(find("auto"))
    with resumable(), watching(console()) as watch:
        compute(study, plan(study), work / TRIAL, Serial(), watch, threads, artifacts, device=device)
