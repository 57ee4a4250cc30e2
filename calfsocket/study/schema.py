"""The JSON schema of study files, which editors complete and check them by."""

import json

from calfsocket.study.document import Document

SCHEMA_FILE = "study.schema.json"


def schema_text() -> str:
    """Return the schema as JSON; `SCHEMA_FILE` among the package's studies holds the same."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **Document.model_json_schema(),
        "title": "calfsocket study",
    }
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
