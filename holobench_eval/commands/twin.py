"""``holoeval twin``: photographs of a display become a profile that anyone can run, and a report on its limits."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import UserError
from .options import ARTIFACTS, PANEL, RETRAIN, Learned
from .run import resumable, run

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
    from ..core.device import find
    from ..core.io import file_name
    from ..report.twin import answer, tried, write_twin
    from ..study import twin as twins
    from ..study.network_display import predictor

    name = output.resolve().name
    if file_name(name) != name:
        raise UserError(f"{output}: the folder names the display; expected {NAME}")
    if Path(display).is_dir():
        source = twins.of_session(Path(display))
        if (panel, pictures, network, retrain) != (None, None, None, False):
            options = "--panel, --pictures, --network and --retrain"
            raise UserError(f"{display}: {options} are not for a session, which has its study")
        twins.refuse(name, source, output)
    else:
        if display.endswith((".yaml", ".yml")) and not Path(display).is_file():
            raise UserError(f"{display}: no such file")
        if panel and twins.is_bench(Path(display)):
            raise UserError(f"{display}: a bench has the panel that its file says; leave out --panel")
        twins.refuse_fourier(display)
        if network:
            predictor(network, {})
        config = _config(
            output, twins.study_text(display, panel or PANEL_SIZE, pictures or PICTURES, network), artifacts
        )
        run(config, output=output / twins.WORK / twins.PHOTOGRAPHS, artifacts=artifacts, retrain=retrain)
        source = twins.in_folder(output, artifacts)
    print(f"{output}: photographs are there; the twin is tried on the same holograms")
    with resumable():
        displays = twins.write_trial(source, name, output)
        found = tried(source, displays, find("auto"))
    path = twins.publish(replace(displays[0], twin=found.trust()), source, output)
    report = write_twin(output, source, found, path)
    for sentence in answer(found):
        print(f"- {sentence}")
    print(f"{path}\n{report}")


def _config(output: Path, text: str, artifacts: Path) -> Path:
    """Write the config of the photographs. UserError, with nothing written: the folder holds another one, or the
    display can have no twin."""
    from ..core.io import write_atomically
    from ..study import twin as twins

    config = output / twins.WORK / f"{twins.PHOTOGRAPHS}.yaml"
    is_new = not config.exists()
    if not is_new and config.read_text(encoding="utf-8") != text:
        raise UserError(f"{output}: holds the twin of another display or of other settings; choose another --output")
    write_atomically(config, text.encode())
    try:
        twins.refuse(output.resolve().name, twins.in_folder(output, artifacts), output)
    except UserError as error:
        if is_new:
            config.unlink()
            with suppress(OSError):  # where it was made for this
                config.parent.rmdir()
                output.rmdir()
        raise UserError(re.sub(rf"^{re.escape(str(config))}(:\d+)*: ", "", str(error))) from None
    return config
