"""Small changes of a module's code, one at a time."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from types import CodeType
from typing import Any

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
    ast.Break: ast.Continue, ast.Continue: ast.Break,
}  # fmt: skip
# Annotations and decorators, and what only words an error, a warning or a log.
UNTOUCHED = {"annotation", "returns", "decorator_list", "exc", "cause", "msg", "bases"}
WORDS = {"warn", "warning", "info", "debug", "TypeVar", "UserError", "CellError", "ValueError"}
COMPILED = {"compiled", "compiled_sums"}  # Numba may take their code from its cache

Put = Callable[[ast.AST], None]


@dataclass(frozen=True)
class Mutant:
    """function: qualified name and first line of the outermost function whose body changes, or None for what is
    executed when the module is imported; lines: of the statement; name: the function and the change."""

    function: tuple[str, int] | None
    lines: range
    name: str
    code: CodeType


@dataclass(frozen=True)
class _Site:
    function: tuple[str, int] | None
    where: str
    statement: ast.stmt
    old: ast.AST
    new: ast.AST
    put: Put


def mutants(source: str, path: str, chosen: Callable[[int], list[int]]) -> tuple[int, Iterator[Mutant]]:
    """How many mutants a module has, and those with the numbers that are ``chosen`` of them."""
    tree = ast.parse(source)
    sites = list(_sites(tree, None, "", None, lambda node: None))

    def made() -> Iterator[Mutant]:
        for number in chosen(len(sites)):
            site = sites[number]
            before = ast.unparse(tree).splitlines()
            site.put(ast.copy_location(site.new, site.old))
            code = compile(ast.fix_missing_locations(tree), path, "exec", dont_inherit=True)
            after = ast.unparse(tree).splitlines()
            site.put(site.old)
            yield Mutant(site.function, _header(site.statement), f"{site.where}: {_change(before, after)}", code)

    return len(sites), made()


def _change(before: list[str], after: list[str]) -> str:
    lines = list(difflib.unified_diff(before, after, n=0, lineterm=""))[3:]
    old, new = (" ".join(line[1:].strip() for line in lines if line[0] == sign) for sign in "-+")
    return f"`{old}` → `{new}`"


def _header(statement: ast.stmt) -> range:
    body = getattr(statement, "body", None)
    last = body[0].lineno - 1 if body else statement.end_lineno or statement.lineno
    return range(statement.lineno, max(statement.lineno, last) + 1)


def _sites(
    node: ast.AST, function: tuple[str, int] | None, where: str, statement: ast.stmt | None, put: Put
) -> Iterator[_Site]:
    statement = node if isinstance(node, ast.stmt) else statement
    if _is_words(node, function):
        return
    if statement is not None:
        for new in _changed(node):
            yield _Site(function, where or "module", statement, node, new, put)
    inner = function
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        where = f"{where}.{node.name}".removeprefix(".")
    if isinstance(node, ast.FunctionDef) and function is None:
        inner = (where, min([node.lineno, *(each.lineno for each in node.decorator_list)]))
    for field, value in ast.iter_fields(node):
        if field in UNTOUCHED or (field == "target" and isinstance(node, ast.AnnAssign)):
            continue
        within = inner if field == "body" else function
        if isinstance(value, ast.AST):
            negated = field == "test" and not _is_swapped(value)
            if negated:
                new = ast.UnaryOp(ast.Not(), value)  # type: ignore[arg-type]
                yield _Site(within, where or "module", statement, value, new, partial(setattr, node, field))  # type: ignore[arg-type]
            yield from _sites(value, within, where, statement, partial(setattr, node, field))
        elif isinstance(value, list):
            for index, item in enumerate(value):
                if isinstance(item, ast.AST):
                    yield from _sites(item, within, where, statement, partial(value.__setitem__, index))


def _is_swapped(test: ast.AST) -> bool:
    """Whether another change negates it: of its operator, or of the value of a name."""
    exact = (ast.Eq, ast.NotEq, ast.Is, ast.IsNot, ast.In, ast.NotIn)
    compared = isinstance(test, ast.Compare) and len(test.ops) == 1 and isinstance(test.ops[0], exact)
    return compared or (isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not))


def _is_words(node: ast.AST, function: tuple[str, int] | None) -> bool:
    """Whether it is for readers, for types or for Numba: there is nothing in it that a test could hold."""
    match node:
        case ast.FunctionDef(name=name, decorator_list=decorators):
            return name in ("__repr__", "__str__") or any(ast.unparse(each) in COMPILED for each in decorators)
        case ast.ClassDef(bases=bases):
            return "Protocol" in map(ast.unparse, bases)
        case ast.Expr(value=ast.Constant(value=str())) | ast.JoinedStr():
            return True
        case ast.Call(func=called):
            return ast.unparse(called).split(".")[-1] in WORDS
        case ast.Assign(targets=[ast.Name(id=name)]):
            return function is None and (name == "__all__" or (name[0].isupper() and not name.isupper()))
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
    return False


def _changed(node: ast.AST) -> Iterator[Any]:
    if type(node) in OPERATORS:
        yield OPERATORS[type(node)]()
    match node:
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            yield operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(2 * value or 1.0)
        case ast.Constant(value=str(value)) if " " not in value:
            yield ast.Constant(f"{value}x")
        case ast.Return(value=ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield ast.Return(ast.Constant(None))
        case ast.Expr() | ast.AugAssign() | ast.Raise() | ast.Assert() | ast.Delete():
            yield ast.Pass()
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
            yield ast.Pass()
