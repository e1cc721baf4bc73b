"""A method that Python holds as an object: an instance, its class, a function of target and bench, a partial of it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from functools import partial
from typing import Any

from ..core import plugins
from ..core.errors import UserError

EXPECTED = (
    "expected a name, path/to/file.py:Name, a function of target and bench, or a method's dataclass or an instance"
)


class Function:
    """A function as a method; what it declares (``camera = True``) is set on the function.

    Parameters
    ----------
    function
        Called with target, bench and the parameters.
    params
        By their names.
    """

    def __init__(self, function: Callable[..., Any], params: Mapping[str, Any]) -> None:
        declaring = [function.func, function] if isinstance(function, partial) else [function]
        for declares in declaring:
            vars(self).update(getattr(declares, "__dict__", {}))
        self._function, self._params = function, params

    def solve(self, target: Any, bench: Any) -> Any:
        """What the function returns."""
        return self._function(target, bench, **self._params)


def method_of(given: object, params: Mapping[str, Any]) -> tuple[Any, str]:
    """A method with its parameters, and its name in messages.

    Parameters
    ----------
    given
        An instance of a method, which has its parameters; a dataclass of it; a function ``solve(target, bench, ...)``
        or another object that can be called so; a ``functools.partial`` of a function or of a class.
    params
        Further parameters by their names.

    Raises
    ------
    UserError
        It is no method, or has not these parameters.
    """
    if isinstance(given, partial) and isinstance(given.func, type):
        if given.args:
            raise UserError(f"a partial of '{given.func.__name__}' with positional parameters; name each of them")
        params = {**given.keywords, **params}
        given = given.func
    plugins.refuse_swapped(given, f"method '{getattr(given, '__name__', type(given).__name__)}'")
    if isinstance(given, type):
        if not (is_dataclass(given) and callable(getattr(given, "solve", None))):
            raise UserError(f"class '{given.__name__}' is not a dataclass with a method 'solve'; {EXPECTED}")
        return plugins.made(given, f"method '{given.__name__}'", dict(params)), given.__name__
    if callable(getattr(given, "solve", None)):
        name = type(given).__name__
        if params:
            raise UserError(
                f"{name} has its parameters already; '{min(params)}' is given where it is made: {name}(...)"
            )
        return given, name
    if not callable(given):
        raise UserError(f"a method of type '{type(given).__name__}'; {EXPECTED}")
    function = Function(given, params)
    inner = given.func if isinstance(given, partial) else given
    name = getattr(inner, "__name__", type(inner).__name__)
    if isinstance(given, partial):
        given, params = partial(given.func, *given.args), {**given.keywords, **params}
    _refuse_other_parameters(given, name, params)
    return function, name


def _refuse_other_parameters(function: Callable[..., Any], name: str, params: Mapping[str, Any]) -> None:
    """UserError for a function that cannot be called with target, bench and the parameters."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # one of C, which does not tell
        return
    try:
        signature.bind(None, None, **params)
    except TypeError as error:
        called, known = ", ".join(("target", "bench", *params)), ", ".join(signature.parameters)
        raise UserError(f"{name}({known}) cannot be called with {called}: {error}") from None
