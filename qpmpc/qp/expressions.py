"""Formulas written once as text and turned into numpy and C: a subset common to both.

Names, numbers, + - * /, calls of functions, and comparisons inside `where`. Anything else is
refused, so that numpy and C compute the same.
"""

import ast
from collections.abc import Collection, Iterator
from types import CodeType

from qpmpc.errors import QpmpcError

_ALLOWED = (
    ast.Module,
    ast.Assign,
    ast.Tuple,
    ast.Expr,
    ast.BinOp,
    ast.UnaryOp,
    ast.Compare,
    ast.Call,
    ast.Name,
    ast.Constant,
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.USub,
    ast.Eq,
    ast.Lt,
    ast.LtE,
    ast.Gt,
    ast.GtE,
    ast.expr_context,
)


class FormulaError(QpmpcError):
    """A formula is outside the subset common to numpy and C, or uses an unknown name."""


def parsed(text: str) -> list[ast.stmt]:
    """Parse lines of assignments, or one expression.

    Raises
    ------
    FormulaError
        If it is not Python, or outside the subset common to numpy and C.
    """
    try:
        tree = ast.parse(text)
    except SyntaxError as error:
        raise FormulaError(f"no formula: {error.text!r}") from error
    for node in ast.walk(tree):
        number = not isinstance(node, ast.Constant) or isinstance(node.value, float)
        if not isinstance(node, _ALLOWED) or not number:
            raise FormulaError(f"{type(node).__name__} is not for formulas: {text.strip()[:80]!r}")
    return tree.body


def expression(text: str) -> ast.expr:
    """Parse one expression."""
    (statement,) = parsed(text)
    if not isinstance(statement, ast.Expr):
        raise FormulaError(f"an assignment is not an expression: {text!r}")
    return statement.value


def names_in(node: ast.AST) -> Iterator[str]:
    """Names that a formula reads, including functions."""
    for part in ast.walk(node):
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load):
            yield part.id


def targets_of(statement: ast.stmt) -> list[str]:
    """Names that a line assigns to."""
    if not isinstance(statement, ast.Assign):
        raise FormulaError(f"not an assignment: {ast.unparse(statement)!r}")
    (target,) = statement.targets
    parts = target.elts if isinstance(target, ast.Tuple) else [target]
    return [part.id for part in parts if isinstance(part, ast.Name)]


def is_number(node: ast.expr, value: float) -> bool:
    """Whether an expression is this number, literally."""
    return isinstance(node, ast.Constant) and node.value == value


def code_of(part: ast.expr | list[ast.stmt]) -> CodeType:
    """Compile an expression, for eval, or lines, for exec."""
    if isinstance(part, ast.expr):
        return compile(ast.fix_missing_locations(ast.Expression(part)), "<formula>", "eval")
    return compile(ast.fix_missing_locations(ast.Module(part, [])), "<formula>", "exec")


def terms_of(node: ast.expr, variables: Collection[str]) -> dict[str, ast.expr]:
    """Coefficient of each variable in a sum of `coefficient * variable`, in the order written.

    Raises
    ------
    FormulaError
        If it is not such a sum.
    """
    match node:
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            found = terms_of(left, variables)
            for name, coefficient in terms_of(right, variables).items():
                if name in found:
                    raise FormulaError(f"{name} stands twice in {ast.unparse(node)!r}")
                minus = isinstance(node.op, ast.Sub)
                found[name] = ast.UnaryOp(ast.USub(), coefficient) if minus else coefficient
            return found
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            terms = terms_of(operand, variables)
            return {name: ast.UnaryOp(ast.USub(), factor) for name, factor in terms.items()}
        case ast.BinOp(left=factor, op=ast.Mult(), right=ast.Name(id=name)) if name in variables:
            if not set(variables).isdisjoint(names_in(factor)):
                raise FormulaError(f"not linear: {ast.unparse(node)!r}")
            return {name: factor}
        case ast.Name(id=name) if name in variables:
            return {name: ast.Constant(1.0)}
    raise FormulaError(f"not a coefficient times a variable: {ast.unparse(node)!r}")
