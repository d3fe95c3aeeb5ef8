"""What Croissant 1.0 asks of metadata, as its specification's tables have it; written apart from the writer.

https://docs.mlcommons.org/croissant/docs/croissant-spec.html, sections Required, FileObject, FileSet, RecordSet, Field.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator
from typing import Any

REQUIRED = ("@context", "@type", "conformsTo", "description", "license", "name", "url", "creator", "datePublished")
TYPES = {"sc:Float", "sc:Integer", "sc:Boolean", "sc:Text"}


def complaints(told: dict[str, Any]) -> Iterator[str]:
    """Everything that the specification would not have so."""
    yield from (f"{name} is missing" for name in REQUIRED if not told.get(name))
    if told["@type"] != "sc:Dataset" or told["conformsTo"] != "http://mlcommons.org/croissant/1.0":
        yield "is no data set of Croissant 1.0"
    context = told["@context"]
    if context["conformsTo"] != "dct:conformsTo" or context["dct"] != "http://purl.org/dc/terms/":
        yield "conformsTo is not that of Dublin Core"
    for term in ("recordSet", "field", "source", "extract", "column", "fileSet", "fileObject", "includes", "key"):
        if context.get(term) != f"cr:{term}":
            yield f"{term} is no term of Croissant's"
    datetime.date.fromisoformat(told["datePublished"])
    if not re.fullmatch(r"\d+\.\d+\.\d+", told["version"]):
        yield "version is not MAJOR.MINOR.PATCH"
    ids: list[str] = []
    files: dict[str, str] = {}
    for one in told["distribution"]:
        ids.append(one["@id"])
        files[one["@id"]] = one["@type"]
        if not one.get("name") or not one.get("encodingFormat"):
            yield f"{one['@id']}: has no name or format"
        if one["@type"] == "cr:FileObject":
            if not re.fullmatch(r"[0-9a-f]{64}", one["sha256"]) or not one["contentUrl"]:
                yield f"{one['@id']}: has no check sum or address"
            if not re.fullmatch(r"\d+ B", one["contentSize"]):
                yield f"{one['@id']}: has no size"
        elif one["@type"] != "cr:FileSet" or not one["includes"]:
            yield f"{one['@id']}: is neither file nor set"
    for records in told["recordSet"]:
        ids.append(records["@id"])
        fields = {field["@id"] for field in records["field"]}
        ids += fields
        if records["@type"] != "cr:RecordSet" or not {key["@id"] for key in records["key"]} <= fields:
            yield f"{records['@id']}: keys that are no fields"
        for field in records["field"]:
            if field["@type"] != "cr:Field" or field["dataType"] not in TYPES or not field["description"]:
                yield f"{field['@id']}: type or description"
            ((kind, where),) = ((k, v) for k, v in field["source"].items() if k.startswith("file"))
            if files.get(where["@id"]) != {"fileSet": "cr:FileSet", "fileObject": "cr:FileObject"}[kind]:
                yield f"{field['@id']}: from a file that is not in the distribution"
            if not field["source"]["extract"]["column"] or not field["@id"].startswith(f"{records['@id']}/"):
                yield f"{field['@id']}: no column, or another's name"
    if len(set(ids)) < len(ids):
        yield "an @id stands for two things"
