"""C text from formulas: expressions, lines of assignments, and functions of one expression."""

import ast
import inspect
import textwrap
from collections.abc import Callable

from qpmpc.qp.expressions import FormulaError, targets_of

WIDTH = 100  # of a line of C
_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARISONS = {ast.Gt: ">", ast.Lt: "<", ast.GtE: ">=", ast.LtE: "<="}


class Writer:
    """Writes formulas as C, each name as the C code has it.

    Parameters
    ----------
    names, functions : how variables and functions are written in C
    structs : functions of several values, and the C type of what they return; its members are
        called as the names that take them
    """

    def __init__(
        self,
        names: dict[str, str],
        functions: dict[str, str],
        structs: dict[str, str] | None = None,
    ) -> None:
        self.names, self._functions, self._structs = dict(names), functions, structs or {}

    def expression(self, node: ast.expr) -> str:
        """Write an expression; a product or sum inside another is in parentheses.

        Raises
        ------
        FormulaError
            If it has a name that C does not know, or a construct that it does not have.
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
                return f"({test} ? {parts[0]} : {parts[1]})"
            case ast.Call(func=ast.Name(id=name), args=arguments) if name in self._functions:
                texts = [self.expression(a) for a in arguments if not _is_parameter_set(a)]
                return f"{self._functions[name]}({', '.join(texts)})"
        raise FormulaError(f"C has no {ast.unparse(node)!r}")

    def inner(self, node: ast.expr) -> str:
        """Write an expression that is part of another, in parentheses where it is one itself."""
        text = self.expression(node)
        compound = isinstance(node, ast.BinOp | ast.Compare | ast.UnaryOp)
        return f"({text})" if compound else text

    def lines(self, statements: list[ast.stmt], used: set[str]) -> list[str]:
        """Write assignments as constants of a function; those that nothing uses are left out."""
        written: list[str] = []
        for statement in statements:
            targets = targets_of(statement)
            if not isinstance(statement, ast.Assign) or not used & set(targets):
                continue
            value = statement.value
            match value:
                case ast.Call(func=ast.Name(id="running"), args=[argument]):
                    (target,) = targets
                    written += [f"sums->{target} += {self.expression(argument)};"]
                    self.names[target] = f"sums->{target}"
                    continue
                case ast.Call(func=ast.Name(id=name)) if name in self._structs:
                    result = f"of_{name}"
                    written += [f"const {self._structs[name]} {result} = {self.expression(value)};"]
                    self.names |= {target: f"{result}.{target}" for target in targets}
                    continue
            (target,) = targets
            written += [f"const real_t {target} = {self.expression(value)};"]
            self.names[target] = target
        return written

    def function(self, function: Callable[..., float], prefix: str) -> str:
        """Write a Python function of one expression; its first argument is the parameters."""
        match ast.parse(inspect.getsource(function)).body:
            case [ast.FunctionDef(args=given, body=[*_, ast.Return(value=ast.expr() as value)])]:
                _, *names = [argument.arg for argument in given.args]
            case _:
                raise FormulaError(f"{function.__name__} is not a function of one expression")
        body = Writer(self.names | {name: name for name in names}, self._functions)
        signature = ", ".join(f"real_t {name}" for name in names)
        return (
            f"static inline real_t {prefix}{function.__name__}({signature})\n"
            f"{{\n{wrapped(f'return {body.expression(value)};', 4)}\n}}\n"
        )


def wrapped(line: str, indent: int) -> str:
    """Return a line of C, broken where it is long, the rest further in."""
    inner = " " * indent
    return textwrap.fill(line, WIDTH, initial_indent=inner, subsequent_indent=inner + "    ")


def _is_parameter_set(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id == "th"
