"""What adapters are tested with: a door that checks each report by the public schema, a tiny detector, pictures."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

PATIENCE_S = 30.0
SCHEMA = json.loads((Path(__file__).parents[3] / "config" / "report.schema.json").read_text(encoding="utf-8"))
SIDE, CELL = 64, 8


class Taking:
    """Reports that came in, in order. `fail` says what to answer instead, for as many requests."""

    def __init__(self) -> None:
        self.reports: list[dict[str, Any]] = []
        self.tokens: list[str | None] = []
        self.fail: list[int] = []
        self.refuse = ""
        self.url = ""
        self._came = threading.Condition()

    def take(self, report: dict[str, Any], token: str | None) -> tuple[int, Any]:
        """What the door answers."""
        with self._came:
            self.tokens.append(token)
            if self.fail:
                return self.fail.pop(0), {"detail": "not now"}
            jsonschema.validate(report, SCHEMA)
            self.reports.append(report)
            self._came.notify_all()
        status = "refused" if self.refuse else "accepted"
        hits = len(report["detections"])
        return 200, [{"id": report["id"], "status": status, "reason": self.refuse, "looks": 1, "hits": hits}]

    def wait_for(self, enough: Callable[[list[dict[str, Any]]], bool]) -> list[dict[str, Any]]:
        """The reports, once there are enough."""
        with self._came:
            assert self._came.wait_for(lambda: enough(self.reports), PATIENCE_S), self.reports[-3:]
            return list(self.reports)


@contextmanager
def taking() -> Iterator[Taking]:
    """A door on a real socket."""
    taker = Taking()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            self._answer(*taker.take(json.loads(body), self.headers.get("authorization")))

        def do_GET(self) -> None:
            self._answer(200, {"time": time.time() + 1000.0, "speedup": 10.0})

        def _answer(self, code: int, value: Any) -> None:
            body = json.dumps(value).encode()
            self.send_response(code)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_words: Any) -> None:
            """Nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        taker.url = f"http://127.0.0.1:{server.server_address[1]}"
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield taker
        server.shutdown()


def write_model(file: Path) -> Path:
    """A detector of red things: an image of 64 x 64 in cells of 8, each with how red it is on the mean as its score.

    Its one output is [1, 5, 64]: cx, cy, width, height and the score of the only class, `person`.
    """
    cells = SIDE // CELL
    weights = np.zeros((1, 3, CELL, CELL), np.float32)
    weights[0, 0], weights[0, 1] = 1.0 / CELL**2, -1.0 / CELL**2  # red less green
    middle = (np.indices((cells, cells), dtype=np.float32).reshape(2, -1) + 0.5) * CELL
    boxes = np.stack([middle[1], middle[0], *([np.full(cells**2, CELL, np.float32)] * 2)])[None]
    nodes = [
        helper.make_node("Conv", ["image", "weights"], ["red"], strides=[CELL, CELL]),
        helper.make_node("Relu", ["red"], ["scores"]),
        helper.make_node("Reshape", ["scores", "row"], ["flat"]),
        helper.make_node("Concat", ["boxes", "flat"], ["found"], axis=1),
    ]
    graph = helper.make_graph(
        nodes,
        "red",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, SIDE, SIDE])],
        [helper.make_tensor_value_info("found", TensorProto.FLOAT, [1, 5, cells**2])],
        [
            numpy_helper.from_array(weights, "weights"),
            numpy_helper.from_array(boxes.astype(np.float32), "boxes"),
            numpy_helper.from_array(np.array([1, 1, cells**2]), "row"),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, {"names": "{0: 'person'}"})
    onnx.checker.check_model(model)
    onnx.save(model, str(file))
    return file


def picture(width: int = 128, height: int = 128, red_at: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """A green field, blue first, with a red square of 16 pixels whose top left corner is at (x, y)."""
    field = np.full((height, width, 3), (40, 120, 40), np.uint8)
    if red_at is not None:
        x, y = red_at
        field[y : y + 16, x : x + 16] = (0, 0, 255)
    return field
