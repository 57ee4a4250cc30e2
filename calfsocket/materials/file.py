"""Material files: the law of one tissue as TOML, with units and where it comes from.

    law = "ogden"
    mu = ["12 kPa"]
    alpha = [14.0]
    nu = 0.495            # or d1 = "1.67e-6 1/Pa"

    [provenance]
    source = "Table 1 of the paper"

Laws and their keys are those of the classes `Ogden`, `Yeoh` and `Hencky`, and of the notations that
become one of these: ``mooney-rivlin``, ``neo-hookean`` and ``linear-elastic``
(`materials.notations`). Files that are written have the law as it is used, and below it, in a table
``given``, as it was written where that was in another way. The provenance is for people: any keys
with texts and numbers.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from pydantic import RootModel

import calfsocket
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.schema import checked, read_toml
from calfsocket.materials.laws import IN_FILES, AnyLaw, Law

Provenance = Mapping[str, str | bool | int | float | Sequence[str | int | float]]


def read_material(path: Path) -> Law:
    """Read a material file.

    Raises
    ------
    InputError
        When it cannot be read or holds no law, naming the file, the key and what is allowed.
    """
    path = Path(path)
    return law_in(path, read_toml(path))


def law_in(path: Path, content: Mapping[str, Any]) -> Law:
    """Law of a material file's content; the path is for messages.

    Raises
    ------
    InputError
        As of `read_material`.
    """
    provenance = content.get("provenance", {})
    if not isinstance(provenance, dict):
        raise InputError(f"{path}: provenance: is {provenance!r}; it must be a table")
    table = {key: value for key, value in content.items() if key != "provenance"}
    if "law" not in table:
        raise InputError(f"{path}: law is missing; add one of {', '.join(IN_FILES)}")
    return cast(Law, checked(path, table, RootModel[AnyLaw]).root)


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
    law_keys = law.texts()
    tables = {
        "given": law_keys.pop("given", None),
        "provenance": {"calfsocket": calfsocket.__version__, **provenance},
    }
    lines = [f"{key} = {_toml(value)}" for key, value in law_keys.items()]
    for name, table in tables.items():
        if table:
            lines += ["", f"[{name}]"]
            lines += [f"{_key(key)} = {_toml(value)}" for key, value in table.items()]
    with replacing(Path(path)) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml(name)


def _toml(value: Any) -> str:
    """Write a text, a number or a list of them as TOML, of which JSON's notation is a part."""
    # JSON leaves DEL alone, which TOML wants escaped.
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
