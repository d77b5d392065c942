"""C text from formulas: expressions, lines of assignments, and functions of one expression."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterable
from typing import Any

from qpmpc.qp.expressions import FormulaError, targets_of

WIDTH = 100  # of a line of C
_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARISONS = {ast.Gt: ">", ast.Lt: "<", ast.GtE: ">=", ast.LtE: "<="}
# Functions that are 1 where a comparison holds, and whether its sides change places in them.
_FLAGS = {
    ast.Gt: ("above", False),
    ast.Lt: ("above", True),
    ast.GtE: ("not_below", False),
    ast.LtE: ("not_below", True),
}


class Writer:
    """Writes formulas as C, each name as in the C code.

    Parameters
    ----------
    names, functions : variables and functions in C; those of the calibration are members of `cal`

    Attributes
    ----------
    calibrated : functions that need the calibration, their first argument in C
    """

    def __init__(self, names: dict[str, str], functions: dict[str, str]) -> None:
        self.names, self._functions = dict(names), functions
        self.calibrated: set[str] = set()

    def expression(self, node: ast.expr) -> str:
        """Write an expression; a product or sum inside another is in parentheses.

        Raises
        ------
        FormulaError
            If it has a name or a construct that is not available in C.
        """
        match node:
            case ast.Constant(value=float(value)):
                return f"REAL({value!r})"
            case ast.Name(id=name) if name in self.names:
                return self.names[name]
            case ast.Attribute(attr=name) if name in self.names:  # th.name of a function
                return self.names[name]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"-{self.inner(operand)}"
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return f"{self.inner(left)} {_OPERATORS[type(op)]} {self.inner(right)}"
            case ast.Compare(left, [op], [right]) if type(op) in _COMPARISONS:
                return f"{self.inner(left)} {_COMPARISONS[type(op)]} {self.inner(right)}"
            case ast.Call(func=ast.Name(id="where"), args=[condition, yes, no]):
                test, *parts = [self.inner(part) for part in (condition, yes, no)]
                return f"{test} ? {parts[0]} : {parts[1]}"
            case ast.Call(func=ast.Name(id=name), args=arguments) if name in self._functions:
                texts = [self.expression(a) for a in arguments if not _is_parameter_set(a)]
                texts[:0] = ["cal"] if name in self.calibrated else []
                return f"{self._functions[name]}({', '.join(texts)})"
        raise FormulaError(f"C has no {ast.unparse(node)!r}")

    def inner(self, node: ast.expr) -> str:
        """Write an expression that is part of another, in parentheses if it is compound."""
        text = self.expression(node)
        compound = isinstance(node, ast.BinOp | ast.Compare | ast.UnaryOp) or " ? " in text
        return f"({text})" if compound else text

    def lines(self, statements: Iterable[ast.stmt]) -> list[str]:
        """Write assignments as constants of a function."""
        written: list[str] = []
        for statement in statements:
            targets = targets_of(statement)
            match statement:
                case ast.Assign(value=ast.Call(func=ast.Name(id="running"), args=[argument])):
                    (target,) = targets
                    written += [f"sums->{target} += {self.expression(argument)};"]
                    self.names[target] = f"sums->{target}"
                case ast.Assign(value=ast.Call(func=ast.Name(id=name)) as call) if targets[1:]:
                    written += [f"const {name}_result of_{name} = {self.expression(call)};"]
                    self.names |= {target: f"of_{name}.{target}" for target in targets}
                case ast.Assign(value=value):
                    (target,) = targets
                    written += [f"const mpc_real {target} = {self.expression(value)};"]
                    self.names[target] = target
        return written

    def function(self, function: Callable[..., Any]) -> str:
        """Write a Python function: assignments, and one value or a tuple of them returned.

        Its first argument, `th`, is the set of parameters. Several values are returned as a
        structure whose members have the names in the tuple.
        """
        name = function.__name__
        match ast.parse(inspect.getsource(function)).body:
            case [
                ast.FunctionDef(args=given, body=[_, *body, ast.Return(value=ast.expr() as value)])
            ]:
                _, *arguments = [argument.arg for argument in given.args]
            case _:
                raise FormulaError(f"{name} does not end with a return")
        inner = type(self)(
            self.names | {argument: argument for argument in arguments}, self._functions
        )
        inner.calibrated = self.calibrated
        lines, kind, before = inner.lines(body), "mpc_real", ""
        if isinstance(value, ast.Tuple):
            parts = [part.id for part in value.elts if isinstance(part, ast.Name)]
            kind = f"{name}_result"
            before = f"typedef struct {{\n{_body(f'mpc_real {p};' for p in parts)}\n}} {kind};\n\n"
            lines += [f"const {kind} result = {{{', '.join(parts)}}};", "return result;"]
        else:
            lines.append(f"return {inner.expression(value)};")
        given_in_c = [f"mpc_real {argument}" for argument in arguments]
        if any(re.search(r"\bcal\b", line) for line in lines):
            given_in_c.insert(0, "const mpc_calibration *cal")
            self.calibrated.add(name)
        signature = ", ".join(given_in_c) or "void"
        start = f"{before}static inline {kind} {self._functions[name]}({signature})\n"
        return f"{start}{{\n{_body(lines)}\n}}\n"


class ArithmeticWriter(Writer):
    """Writes `where` as arithmetic of both its values, so that no compiler makes a branch of it."""

    def expression(self, node: ast.expr) -> str:
        """Write an expression; see `Writer`."""
        match node:
            case ast.Call(func=ast.Name(id="where"), args=arguments):
                return f"blend({', '.join(self.expression(part) for part in arguments)})"
            case ast.Compare(left, [op], [right]) if type(op) in _FLAGS:
                name, is_turned = _FLAGS[type(op)]
                sides = [self.expression(side) for side in (left, right)]
                return f"{name}({', '.join(sides[::-1] if is_turned else sides)})"
        return super().expression(node)


def _body(lines: Iterable[str]) -> str:
    return "\n".join(wrapped(line, 4) for line in lines)


def wrapped(line: str, indent: int) -> str:
    """Return a line of C, broken if it is long, with the rest indented."""
    inner = " " * indent
    return textwrap.fill(line, WIDTH, initial_indent=inner, subsequent_indent=inner + "    ")


def _is_parameter_set(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id == "th"
