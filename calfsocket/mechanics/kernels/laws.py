"""The laws in C: FFCx's code for stresses and moduli, taken for four points at a time.

A law at a point is a function of its deformation gradient, its pressure and its parameters. FFCx
writes it for a `double`; the same lines do for a vector of them (vectors.h), which a compiler
cannot find out by itself where they stand in a loop over points.
"""

import re
from dataclasses import fields
from typing import Any

import basix.ufl
import ffcx.compiler
import ffcx.options
import numpy as np
import ufl

from calfsocket.forms import mixed

_FUNCTIONS = ("sqrt", "exp", "log", "pow")  # as vectors.h has them


def parameter_list(parameters: mixed.LawFields) -> list[Any]:
    """Return all parameters of the laws, in one order."""
    values = [getattr(parameters, field.name) for field in fields(parameters)]
    return [one for value in values for one in (value if isinstance(value, tuple) else (value,))]


def source(ogden_terms: int) -> str:
    """Write C functions of (const vector *arguments, vector *values), two for each law.

    `stresses[law]` and `moduli[law]` have their addresses, law counted as in `mixed.LAW_IDS`. The
    ARGUMENTS are F11, F12, F21, F22, the pressure unknown, and all parameters.

    Parameters
    ----------
    ogden_terms : int
        Number of terms that Ogden's law has.
    """
    domain = ufl.Mesh(basix.ufl.element("P", "triangle", 1, shape=(2,)))

    def scalars(n: int) -> list[Any]:
        return [ufl.Constant(domain) for _ in range(n)]

    F, (p_dof,) = ufl.Constant(domain, shape=(2, 2)), scalars(1)
    names = [field.name for field in fields(mixed.LawFields)]
    parameters = mixed.LawFields(
        **{
            name: tuple(scalars(ogden_terms)) if name.startswith("ogden") else scalars(1)[0]
            for name in names
        }
    )
    arguments = [F, p_dof, *parameter_list(parameters)]
    p = mixed.pressure(p_dof, parameters)
    parts = []
    for quantity in (mixed.stresses, mixed.moduli):
        table = []
        for law in mixed.LAW_IDS:
            name = f"{law}_{quantity.__name__}"
            expression = quantity(law, F, p, parameters)
            parts.append(_function(name, expression, arguments))
            table.append(name)
        parts.append(
            f"static void (*const {quantity.__name__}[])(const vector *, vector *) = "
            f"{{{', '.join(table)}}};\n"
        )
    count = sum(map(_size, arguments))
    head = f'#include "vectors.h"\n\nenum {{ ARGUMENTS = {count} }};\n'
    return "\n".join([head, *parts])


def _function(name: str, expression: Any, arguments: list[Any]) -> str:
    """Write one function, with FFCx's lines as its body."""
    _, code = ffcx.compiler.compile_ufl_objects(
        [(expression, np.array([[1 / 3, 1 / 3]]))],
        options=ffcx.options.get_options({"scalar_type": "float64"}),
    )
    match = re.search(
        r"void tabulate_tensor_expression_\w+\([^)]*\)\n(\{.*?\n\}\n\n\})\n", code, re.S
    )
    assert match is not None
    # FFCx counts only what the law needs.
    first = np.concatenate([[0], np.cumsum([_size(argument) for argument in arguments])])
    position = [
        first[arguments.index(used)] + i
        for used in ufl.algorithms.analysis.extract_constants(expression)
        for i in range(_size(used))
    ]
    body = re.sub(r"\bc\[(\d+)\]", lambda m: f"c[{position[int(m[1])]}]", match[1])
    body = re.sub(r"\bdouble\b", "vector", body)
    body = re.sub(rf"\b({'|'.join(_FUNCTIONS)})\(", r"vector_\1(", body)
    body = body.replace("] += ", "] = ")  # one point: nothing is there yet
    return f"VECTORISED static void {name}(const vector *restrict c, vector *restrict A)\n{body}\n"


def _size(constant: Any) -> int:
    return int(np.prod(constant.ufl_shape, dtype=int))
