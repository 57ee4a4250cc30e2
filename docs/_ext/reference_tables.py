"""Tables of the file formats, made from the package's own models when the site is built.

Pages include them from `_generated/`. Descriptions are those of the models: of a field, or of the
section "Attributes" in the docstring of its class.
"""

import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numpydoc.docscrape import NumpyDocString
from sphinx.application import Sphinx

from calfsocket.io.schema import Strict
from calfsocket.meshes.socket import Socket
from calfsocket.simulation.record import CaseRecord, Checks, StudyRecord
from calfsocket.study.document import Document

FOLDER = Path(__file__).parents[1] / "_generated"

Schema = dict[str, Any]


def main(_app: Sphinx) -> None:
    """Write the tables before the pages are read."""
    pages = {
        "study.md": "\n".join(sections(Document.model_json_schema())),
        "study_record.md": attributes_table(StudyRecord),
        "case_record.md": attributes_table(CaseRecord),
        "checks.md": attributes_table(Checks),
    }
    FOLDER.mkdir(exist_ok=True)
    for name, text in pages.items():
        path = FOLDER / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


# ----- keys of TOML files, from a JSON schema


def sections(schema: Schema) -> Iterator[str]:
    """Yield a section for each table of a file: heading, what it is, its keys."""
    definitions = schema["$defs"]
    for name, entry in schema["properties"].items():
        if name == "laws":  # the same tables as in a material set
            yield f"## `[laws.TISSUE]`\n\n{entry['description']}\n"
            continue
        for heading, table in tables_at(name, entry, definitions):
            yield f"## {heading}\n"
            yield from section(table, definitions)


def tables_at(name: str, entry: Schema, definitions: Schema) -> Iterator[tuple[str, Schema]]:
    """Yield the tables that a key of the file may hold, with their headings."""
    if "items" in entry:
        yield from ((f"`[[{name}]]`", t) for t in tables_in(entry["items"], definitions))
        return
    for table in tables_in(entry, definitions):
        yield f"`[{name}]`", table
    named = entry.get("additionalProperties") or next(
        iter(entry.get("patternProperties", {}).values()), {}
    )
    for table in tables_in(named, definitions):
        yield f"`[{name}.NAME]`{kind(table)}", table
        extra = table.get("additionalProperties")
        for law in tables_in(extra, definitions) if extra else ():
            yield f"`[{name}.NAME.TISSUE]`{kind(law)}", law


def tables_in(entry: Schema, definitions: Schema) -> list[Schema]:
    """Return the tables that an entry is or refers to, alternatives one by one."""
    if "$ref" in entry:
        return tables_in(definitions[entry["$ref"].rsplit("/", 1)[1]], definitions)
    if "properties" in entry:
        return [entry]
    return [
        table
        for way in entry.get("oneOf", entry.get("anyOf", ()))
        for table in tables_in(way, definitions)
    ]


def kind(table: Schema) -> str:
    """Return what distinguishes a table from its alternatives: ``law = "ogden"``, or a key."""
    for key, entry in table["properties"].items():
        if "const" in entry:
            return f' with `{key} = "{entry["const"]}"`'
    distinct = [key for key in table.get("required", ()) if key in ("file", "outline", "like")]
    return f" with `{distinct[0]}`" if distinct else ""


def section(table: Schema, definitions: Schema) -> Iterator[str]:
    """Yield a table's description and the rows of its keys."""
    text = NumpyDocString(table.get("description", ""))
    for paragraph in (text["Summary"], text["Extended Summary"]):
        if any(paragraph):
            yield "\n".join(paragraph) + "\n"
    described = descriptions(table)
    rows = [
        f"| `{key}` | {value(entry, definitions)} | {default(key, entry, table)} "
        f"| {described.get(key, '')} |"
        for key, entry in table["properties"].items()
        if not is_table(entry)
    ]
    if rows:
        yield "| key | value | default | |\n|---|---|---|---|\n" + "\n".join(rows) + "\n"


def is_table(entry: Schema) -> bool:
    """Return whether a key is described in a section of its own."""
    return "$ref" in entry or "properties" in entry


def descriptions(table: Schema) -> dict[str, str]:
    """Return what the docstrings of a table's class and of its bases say of each key."""
    found: dict[str, str] = {}
    for model in models_of(table):
        found = attributes(model) | found
    return found


def models_of(table: Schema) -> list[type[Strict]]:
    """Return the class of a table and its bases; of a table that has none, all sockets.

    The class has the table's description, or the law that the table must have.
    """
    law = table["properties"].get("law", {}).get("const")
    for model in subclasses(Strict):
        if law and "law" in model.model_fields:
            found = model.model_fields["law"].default == law
        else:
            found = inspect.getdoc(model) == table.get("description")
        if found:
            return [base for base in model.__mro__ if issubclass(base, Strict)]
    return [*subclasses(Socket), Socket] if "wall_thickness" in table["properties"] else []


def subclasses(model: type[Strict]) -> list[type[Strict]]:
    """Return all classes below one, at any depth."""
    return [each for below in model.__subclasses__() for each in (below, *subclasses(below))]


def attributes(model: type) -> dict[str, str]:
    """Return what the section "Attributes" of a docstring says of each name."""
    found = {}
    for names, _type, lines in NumpyDocString(inspect.getdoc(model) or "")["Attributes"]:
        for name in names.split(","):
            found[name.strip()] = " ".join(line.strip() for line in lines)
    return found


def default(key: str, entry: Schema, table: Schema) -> str:
    """Return a key's default as it is written in a file; none is needed of most."""
    if key in table.get("required", ()):
        return "*required*"
    if entry.get("default") in (None, "", [], {}):
        return ""
    return f"`{json.dumps(entry['default'])}`"


def value(entry: Schema, definitions: Schema) -> str:
    """Return the type of a key's value in words."""
    if "const" in entry:
        return f"`{json.dumps(entry['const'])}`"
    if "enum" in entry:
        return ", ".join(f"`{json.dumps(each)}`" for each in entry["enum"])
    if ways := entry.get("anyOf", entry.get("oneOf")):
        said = [value(way, definitions) for way in ways if way.get("type") != "null"]
        return " or ".join(dict.fromkeys(said))
    if "$ref" in entry:
        return "table"
    if "pattern" in entry and "examples" in entry:
        return f'text with a unit, as `"{entry["examples"][0]}"`{limits(entry)}'
    if entry.get("type") == "array":
        return array(entry, definitions)
    words = {
        "string": "text",
        "number": "number",
        "integer": "whole number",
        "boolean": "true, false",
    }
    return words.get(entry.get("type", ""), "table") + limits(entry)


def array(entry: Schema, definitions: Schema) -> str:
    """Return the type of a list's items in words."""
    if "prefixItems" in entry:
        return f"list of {len(entry['prefixItems'])}: {value(entry['prefixItems'][0], definitions)}"
    items = entry.get("items", {})
    if "$ref" in items:
        (table,) = tables_in(items, definitions)
        return "list of tables with the keys " + ", ".join(
            f"`{key}`" for key in table["properties"]
        )
    return f"list of {value(items, definitions)}"


def limits(entry: Schema) -> str:
    """Return the range of a number."""
    signs = {
        "exclusiveMinimum": ">",
        "minimum": "≥",
        "exclusiveMaximum": "<",
        "maximum": "≤",
    }
    found = [f"{sign} {entry[key]:g}" for key, sign in signs.items() if key in entry]
    return f" {', '.join(found)}" if found else ""


# ----- attributes of records, from docstrings


def attributes_table(model: type) -> str:
    """Return the section "Attributes" of a class as a table."""
    rows = []
    for names, kind_of, lines in NumpyDocString(inspect.getdoc(model) or "")["Attributes"]:
        keys = ", ".join(f"`{name.strip()}`" for name in names.split(","))
        rows.append(f"| {keys} | {kind_of} | {' '.join(line.strip() for line in lines)} |")
    return "| key | type | |\n|---|---|---|\n" + "\n".join(rows) + "\n"


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the tables when a build begins."""
    app.connect("builder-inited", main)
    return {"parallel_read_safe": True}
