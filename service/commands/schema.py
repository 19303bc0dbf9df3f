"""`roisearch-service schema`: the JSON Schema of a detector report, its receipt, or news from the field."""

from __future__ import annotations

from service.errors import Parser


def main(arguments: list[str]) -> int:
    """Print it."""
    parser = Parser(prog="roisearch-service schema", description=__doc__)
    parser.add_argument("of", nargs="?", choices=("report", "receipt", "news"), default="report")
    of = parser.parse_args(arguments).of
    from service.evidence.reports import receipt_schema, report_schema, schema_text
    from service.news.request import news_schema

    schemas = {"report": report_schema, "receipt": receipt_schema, "news": news_schema}
    print(schema_text(schemas[of]()), end="")
    return 0
