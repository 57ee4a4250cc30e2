"""Material files: the law of one tissue as TOML, with units and where it comes from.

    law = "ogden"
    mu = ["12 kPa"]
    alpha = [14.0]
    nu = 0.495            # or d1 = "1.67e-6 1/Pa"

    [provenance]
    source = "Table 1 of the paper"

Laws and their keys: ``ogden`` (mu, alpha, d1 or nu, form), ``yeoh`` (c10, c20, c30), ``hencky``
(e, nu) and ``neo-hookean`` (mu, d1 or nu), which is Ogden's with alpha = 2. Their meaning and
ranges are those of `laws`. The provenance is for people: any keys with texts and numbers.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

import calfsocket
from calfsocket.errors import InputError
from calfsocket.laws import Hencky, Law, Ogden, OgdenForm, Yeoh, d1_from_poisson, neo_hookean
from calfsocket.meshes.schema import Strict, checked, read_toml
from calfsocket.tissues import MaterialSet, materials_of
from calfsocket.units import COMPLIANCE, STRESS
from calfsocket.writers import replacing

Provenance = Mapping[str, str | bool | int | float | Sequence[str | int | float]]

_Stress = Annotated[float, BeforeValidator(STRESS.parse)]
_Compliance = Annotated[float, BeforeValidator(COMPLIANCE.parse)]


class _Material(Strict):
    provenance: dict[str, Any] = Field(default_factory=dict)


class _NearlyIncompressible(_Material):
    d1: _Compliance | None = None
    nu: float | None = None

    def d1_of(self, mu: float) -> float:
        """Return D1 as given, or by Poisson's ratio."""
        if self.d1 is not None and self.nu is None:
            return self.d1
        if self.nu is not None and self.d1 is None:
            return d1_from_poisson(mu, self.nu)
        raise InputError("give either d1 or nu")


class _Ogden(_NearlyIncompressible):
    law: Literal["ogden"]
    mu: tuple[_Stress, ...]
    alpha: tuple[float, ...]
    form: OgdenForm = "abaqus"

    def to_law(self) -> Law:
        incompressible = Ogden(self.mu, self.alpha, 0.0, self.form)
        d1 = self.d1_of(incompressible.initial_shear_modulus)
        return Ogden(self.mu, self.alpha, d1, self.form)


class _NeoHookean(_NearlyIncompressible):
    law: Literal["neo-hookean"]
    mu: _Stress

    def to_law(self) -> Law:
        return neo_hookean(self.mu, self.d1_of(self.mu))


class _Yeoh(_Material):
    law: Literal["yeoh"]
    c10: _Stress
    c20: _Stress = 0.0
    c30: _Stress = 0.0

    def to_law(self) -> Law:
        return Yeoh(self.c10, self.c20, self.c30)


class _Hencky(_Material):
    law: Literal["hencky"]
    e: _Stress
    nu: float

    def to_law(self) -> Law:
        return Hencky(self.e, self.nu)


_MODELS: dict[str, type[_Ogden | _NeoHookean | _Yeoh | _Hencky]] = {
    "ogden": _Ogden,
    "neo-hookean": _NeoHookean,
    "yeoh": _Yeoh,
    "hencky": _Hencky,
}


def read_material(path: Path) -> Law:
    """Read a material file.

    Raises
    ------
    InputError
        When it cannot be read or holds no law, naming the file, the key and what is allowed.
    """
    path = Path(path)
    content = read_toml(path)
    name = content.get("law")
    if not isinstance(name, str) or name not in _MODELS:
        what = "is missing" if name is None else f"is {name!r}"
        raise InputError(f"{path}: law {what}; use one of {', '.join(_MODELS)}")
    material = checked(path, content, _MODELS[name])
    try:
        return material.to_law()
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_materials(words: Sequence[str], sets: Iterable[MaterialSet]) -> dict[str, Law]:
    """Read the material files that take the place of Table 1's laws.

    Parameters
    ----------
    words
        ``TISSUE=FILE.toml`` each, where the tissue "combined" is muscle and fascia of that set.
    sets
        Material sets that are solved.

    Raises
    ------
    InputError
        For a word of another kind, a tissue that does not exist, stands there twice or is in none
        of the sets, or a bad file.
    """
    used = dict.fromkeys(material for name in sets for material in materials_of(name).values())
    laws: dict[str, Law] = {}
    for word in words:
        tissue, equals, file = word.partition("=")
        if not (equals and file):
            raise InputError(f"--material {word}: write TISSUE=FILE.toml")
        if tissue not in used:
            raise InputError(
                f"--material {word}: no case has a tissue {tissue!r}; use one of {', '.join(used)}"
            )
        if tissue in laws:
            raise InputError(f"--material {word}: {tissue} stands there twice; name it once")
        laws[tissue] = read_material(Path(file))
    return laws


def write_material(path: Path, law: Law, provenance: Provenance) -> None:
    """Write a material file that `read_material` reads back without loss.

    Parameters
    ----------
    path
        The file, replaced in one step.
    law
        With its parameters.
    provenance
        Where they come from, e.g. program, data, its hash; calfsocket's version is added.
    """
    lines = [f"{key} = {_toml(value)}" for key, value in _entries(law).items()]
    lines += ["", "[provenance]"]
    told = {"calfsocket": calfsocket.__version__, **provenance}
    lines += [f"{_key(key)} = {_toml(value)}" for key, value in told.items()]
    with replacing(Path(path)) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _entries(law: Law) -> dict[str, Any]:
    unit = "kPa" if law.initial_shear_modulus < 1 else "MPa"

    def stress(value: float) -> str:
        return STRESS.text(value, unit)

    entries: dict[str, Any] = {"law": law.name}
    match law:
        case Ogden():
            entries["mu"] = [stress(mu) for mu in law.mu]
            entries["alpha"] = list(law.alpha)
            entries["d1"] = COMPLIANCE.text(law.d1, "1/MPa")
            entries["form"] = law.form
        case Yeoh():
            entries |= {key: stress(getattr(law, key)) for key in ("c10", "c20", "c30")}
        case Hencky():
            entries |= {"e": stress(law.e), "nu": law.nu}
    return entries


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml(name)


def _toml(value: Any) -> str:
    """Return a text, a number or a list of them as TOML, of which JSON's notation is a part."""
    # JSON leaves DEL alone, which TOML wants escaped.
    plain = list(value) if isinstance(value, tuple) else value
    return json.dumps(plain, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
