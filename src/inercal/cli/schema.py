"""``inercal schema``."""

from __future__ import annotations

from inercal.cli import show
from inercal.cli.options import FileOutput


def schema(*, output: FileOutput = FileOutput()) -> None:  # noqa: B008  (frozen)
    """Print the JSON Schema of study files."""
    import json

    from inercal._files import write_text
    from inercal.studies.schema import json_schema

    output.check((".json",))
    document = json_schema()
    if output.out is not None:
        write_text(output.out, json.dumps(document, indent=1) + "\n")
    if output.json or output.out is None:
        show(json.dumps(document, indent=1))
    if output.out is not None:
        output.say_now(f"schema: {output.out}")
