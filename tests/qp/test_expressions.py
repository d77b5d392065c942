"""Formulas: what numpy and C compute alike is taken, anything else is one line."""

import pytest

from qpmpc.qp.expressions import FormulaError, code_of, expression, parsed, terms_of


@pytest.mark.parametrize(
    "text",
    [
        "a ** 2.0", "a // b", "a % b", "a @ b", "a << b", "a >> b", "a & b", "a | b", "a ^ b",
        "where(a is b, a, b)", "where(a in b, a, b)", "where(a != b, a, b)", "a if b else a",
        "a.b", "a[0]", "2 * a", "True", "'a'", "lambda: a", "a and b", "not a", "+",
    ],
)  # fmt: skip
def test_what_c_would_compute_otherwise_is_refused(text: str) -> None:
    with pytest.raises(FormulaError) as refusal:
        parsed(text)
    assert "\n" not in str(refusal.value)


def test_a_formula_computes_what_it_says() -> None:
    value = eval(code_of(expression("-(a + 2.0 * b) / (a - b)")), {"a": 3.0, "b": 1.0})
    assert value == -2.5


def test_terms_of_a_sum_and_what_is_none() -> None:
    terms = terms_of(expression("h * x - y - (p + q) * z"), ("x", "y", "z"))
    values = {"h": 2.0, "p": 3.0, "q": 4.0}
    assert {name: eval(code_of(term), values) for name, term in terms.items()} == {
        "x": 2.0,
        "y": -1.0,
        "z": -7.0,
    }
    for wrong in ("x * y", "x + x", "h", "x / h"):
        with pytest.raises(FormulaError):
            terms_of(expression(wrong), ("x", "y", "z"))
