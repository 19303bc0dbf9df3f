"""What the API is like, as one plain HTML page made from its OpenAPI description: no script, nothing from elsewhere."""

from __future__ import annotations

import json
from collections.abc import Iterator
from html import escape
from typing import Any

Schema = dict[str, Any]

HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>roisearch API</title>
<link rel="icon" href="/page/icon.svg" type="image/svg+xml">
<link rel="stylesheet" href="/page/docs.css"></head><body><main>
"""
EVENTS = """<section aria-labelledby="events"><h2 id="events"><code>WS /api/events</code></h2>
<p>The run as it happens, for pages. Offer the subprotocol <code>roisearch</code> and, where a token is needed,
<code>bearer.</code> followed by the command token in base64url; programs may send an <code>Authorization</code>
header instead. The first message is the scene (area, grid, regions), every further one a moment, four times a
second: the state, and of map, track, hits and POS curve what has changed. When the regions have been drawn again,
<code>{"type": "regions", "regions": {...}, "names": [...], "drawn": 1}</code> comes before the moment. Of several
aircraft <code>tracks</code> comes for <code>track</code>: a list with that of each, in the order of the state's
<code>aircraft</code>, null where it is as it was.</p>
<pre><code>{"type": "moment", "state": {"state": "SEARCHING", "pos": 0.31, ...},
 "belief": {"reference": 3, "log2_total": 0.0, "at": "base64, u32 cells", "codes": "base64, u8"},
 "pod": {"at": "...", "codes": "..."}, "track": {"from": 120, "rows": [[56.608, -4.742]]}}</code></pre>
<p>A cell's probability is 2^(reference + (code - 255) / 8 - log2_total); code 0 is not searched. Without
<code>at</code>, the codes are those of all cells, row by row. Of a replay, <code>{"at": seconds}</code> sets the
time.</p></section>
"""


def describe_api(api: Schema) -> str:
    """The page for an OpenAPI document."""
    info = api["info"]
    parts = [HEAD, f"<h1>{escape(info['title'])} API</h1><p>{escape(info.get('summary', ''))}</p>"]
    parts.append(
        "<p>Where the service listens beyond loopback, every request wants a header "
        "<code>Authorization: Bearer TOKEN</code>. The same description for programs: "
        '<a href="/openapi.json">/openapi.json</a>. The page: <a href="/">/</a>.</p>'
    )
    for path, operations in api["paths"].items():
        for method, operation in operations.items():
            parts.extend(_operation(api, path, method, operation))
    parts.append(EVENTS)
    parts.append("</main></body></html>\n")
    return "".join(parts)


def _operation(api: Schema, path: str, method: str, operation: Schema) -> Iterator[str]:
    name = operation["operationId"]
    yield f'<section aria-labelledby="{name}"><h2 id="{name}"><code>{method.upper()} {escape(path)}</code></h2>'
    yield f"<p>{escape(operation.get('summary', ''))}</p>"
    given = operation.get("parameters", [])
    if given:
        rows = ((each["name"], each["schema"], each.get("description", "")) for each in given)
        yield _table(rows)
    body = operation.get("requestBody", {}).get("content", {}).get("application/json")
    example = _example(body) if body else None
    if body:
        for schema in _models(api, body["schema"]):
            yield f"<h3>{escape(schema['title'])}</h3><p>{escape(schema.get('description', ''))}</p>"
            rows = ((key, value, value.get("description", "")) for key, value in schema["properties"].items())
            yield _table(rows)
    yield f"<pre><code>{escape(_curl(method, path, example))}</code></pre>"
    answer = operation["responses"].get("200", {}).get("content", {}).get("application/json", {})
    shown = _example(answer)
    if shown is not None:
        yield f"<p>answers</p><pre><code>{escape(_pretty(shown))}</code></pre>"
    refused = [(code, said) for code, said in operation["responses"].items() if code != "200"]
    why = "".join(
        f'<tr><th scope="row">{code}</th><td>{escape(said["description"])}</td></tr>'
        for code, said in refused
    )
    head = '<tr><th scope="col">status</th><th scope="col">why</th></tr>'
    yield f"<table><thead>{head}</thead><tbody>{why}</tbody></table>"
    yield "</section>"


def _table(rows: Iterator[tuple[str, Schema, str]]) -> str:
    cells = "".join(
        f'<tr><th scope="row"><code>{escape(name)}</code></th><td>{escape(_kind(schema))}</td>'
        f"<td>{escape(about)}</td></tr>"
        for name, schema, about in rows
    )
    head = '<tr><th scope="col">name</th><th scope="col">kind</th><th scope="col">meaning</th></tr>'
    return f"<table><thead>{head}</thead><tbody>{cells}</tbody></table>"


def _kind(schema: Schema) -> str:
    """A schema in a few words."""
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[-1]
    if "anyOf" in schema:
        return " or ".join(_kind(each) for each in schema["anyOf"])
    if "enum" in schema:
        return " | ".join(str(each) for each in schema["enum"])
    if schema.get("type") == "array":
        return f"list of {_kind(schema.get('items', {}))}"
    limits = [f"{sign} {schema[key]}" for key, sign in (("minimum", "≥"), ("maximum", "≤")) if key in schema]
    default = [f"default {json.dumps(schema['default'])}"] if "default" in schema else []
    return ", ".join([str(schema.get("type", "anything")), *limits, *default])


def _models(api: Schema, schema: Schema) -> Iterator[Schema]:
    """The models that a schema names, and those that they name, each once."""
    models, waiting, seen = api.get("components", {}).get("schemas", {}), [schema], set()
    while waiting:
        node = waiting.pop(0)
        name = str(node.get("$ref", "")).rsplit("/", 1)[-1]
        if name and name not in seen and name in models:
            seen.add(name)
            yield models[name]
            waiting.extend(models[name].get("properties", {}).values())
        waiting.extend([*node.get("anyOf", []), *([node["items"]] if "items" in node else [])])


def _example(content: Schema) -> Any:
    """The first example of a request or an answer, or None."""
    for named in content.get("examples", {}).values():
        return named["value"]
    return content.get("example")


def _curl(method: str, path: str, body: Any) -> str:
    url = f"http://127.0.0.1:8080{path}"
    if method == "get":
        return f"curl {url}"
    return f"curl {url} -H 'Content-Type: application/json' -d '{json.dumps(body)}'"


def _pretty(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False)
