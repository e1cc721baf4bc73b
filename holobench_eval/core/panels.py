"""How the size of a panel decides what computes it; a command can ask before it loads torch."""

LARGE = 512 * 1024  # pixels


def is_small(panel: tuple[int, int] | None) -> bool:
    """Whether one thread computes a panel of (rows, columns) as well as several; not for one of unknown size.

    Transforms of small panels gain less than twofold from a second thread, and lose tenfold and more (measured) when
    another program wants the core, since the threads wait for each other after every operation.
    """
    return panel is not None and panel[0] * panel[1] < LARGE
