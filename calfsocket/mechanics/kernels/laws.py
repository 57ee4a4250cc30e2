"""A law in C: FFCx's code for its stresses and moduli, taken for four points at a time.

A law at a point is a function of its deformation gradient, its pressure and its parameters. FFCx
writes it for a `double`; the same lines do for a vector of them (vectors.h), which a compiler
cannot find out by itself where they stand in a loop over points.
"""

import inspect
import re
from typing import Any

import basix.ufl
import ffcx.naming
import numpy as np
import ufl

from calfsocket.forms import kinematics, mixed
from calfsocket.io import fenics
from calfsocket.materials.fields import Kind

_FUNCTIONS = ("sqrt", "exp", "log", "pow")  # as vectors.h has them
_POINT = np.array([[1 / 3, 1 / 3]])
_DERIVING = (kinematics, mixed, fenics)  # modules by which an energy becomes code


def parameter_list(material: mixed.Material) -> list[Any]:
    """All parameters of a material, in the order in which the functions in C take them."""
    return [*material.coefficients, material.inverse_bulk, material.pressure_scale]


def signature(kind: Kind) -> str:
    """Hash of all that the C of a kind of law follows from, the same in every process.

    That is the energy, with what its form calls, and how the rest is derived from it: expressions
    of stresses and moduli are a hundred times as large, and take UFL half a second.
    """
    form, size = kind
    domain = _domain()
    x, J, *coefficients = (ufl.Constant(domain) for _ in range(size + 2))
    energy = form(x, J, tuple(coefficients))
    # All arguments are in it, since UFL numbers those that it finds.
    whole = ufl.as_vector([x, J, *coefficients, energy.value, energy.first, energy.second])
    derived_by = [inspect.getsource(module) for module in _DERIVING]
    tag = "".join([ufl.__version__, *derived_by])
    return ffcx.naming.compute_signature([(whole, _POINT)], tag)


class LawKernel:
    """The functions of a law in UFL and in C.

    Parameters
    ----------
    kind : Kind
        Its form and the number of its coefficients.
    """

    def __init__(self, kind: Kind) -> None:
        form, size = kind
        F = ufl.Constant(_domain(), shape=(2, 2))
        p_dof, *parameters = (ufl.Constant(F.ufl_domain()) for _ in range(size + 3))
        material = mixed.Material(form, tuple(parameters[:size]), *parameters[size:])
        self._arguments = [F, p_dof, *parameter_list(material)]
        p = mixed.pressure(p_dof, material.pressure_scale)
        self._functions = {
            function.__name__: function(material, F, p)
            for function in (mixed.stresses, mixed.moduli)
        }

    def source(self) -> str:
        """Write `stresses` and `moduli`, C functions of (const vector *arguments, vector *values).

        The ARGUMENTS are F11, F12, F21, F22, the pressure unknown, and all parameters.
        """
        count = sum(map(_size, self._arguments))
        head = f'#include "vectors.h"\n\nenum {{ ARGUMENTS = {count} }};\n'
        functions = self._functions.items()
        return "\n".join([head, *(self._function(name, each) for name, each in functions)])

    def _function(self, name: str, expression: Any) -> str:
        """Write one function, with FFCx's lines as its body."""
        code = fenics.expression_code(expression, _POINT)
        match = re.search(
            r"void tabulate_tensor_expression_\w+\([^)]*\)\n(\{.*?\n\}\n\n\})\n", code, re.S
        )
        assert match is not None
        # FFCx counts only what the law needs.
        first = np.concatenate([[0], np.cumsum([_size(each) for each in self._arguments])])
        position = [
            first[self._arguments.index(used)] + i
            for used in ufl.algorithms.analysis.extract_constants(expression)
            for i in range(_size(used))
        ]
        body = re.sub(r"\bc\[(\d+)\]", lambda m: f"c[{position[int(m[1])]}]", match[1])
        body = re.sub(r"\bdouble\b", "vector", body)
        body = re.sub(rf"\b({'|'.join(_FUNCTIONS)})\(", r"vector_\1(", body)
        body = body.replace("] += ", "] = ")  # one point: nothing is there yet
        return (
            f"VECTORISED static void {name}(const vector *restrict c, vector *restrict A)\n{body}\n"
        )


def _domain() -> ufl.Mesh:
    return ufl.Mesh(basix.ufl.element("P", "triangle", 1, shape=(2,)))


def _size(constant: Any) -> int:
    return int(np.prod(constant.ufl_shape, dtype=int))
