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
from typing import Any

import calfsocket
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.schema import checked, read_toml
from calfsocket.io.units import COMPLIANCE, STRESS
from calfsocket.materials.entry import entry_of
from calfsocket.materials.laws import Hencky, Law, Ogden, Yeoh
from calfsocket.materials.tissues import MaterialSet, materials_of

Provenance = Mapping[str, str | bool | int | float | Sequence[str | int | float]]


def read_material(path: Path) -> Law:
    """Read a material file.

    Raises
    ------
    InputError
        When it cannot be read or holds no law, naming the file, the key and what is allowed.
    """
    path = Path(path)
    content = read_toml(path)
    try:
        model = entry_of(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return checked(path, content, model).to_law()


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
