"""The ONNX adapter over real streams, a file and a folder, with a tiny real model."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from service.adapters.decode import decode, layout_of
from service.adapters.door import Door
from service.adapters.folder import taken_at
from service.adapters.model import Model, Wishes
from service.commands.detector import main
from service.errors import BadInput

from .stage import Taking, picture, taking, write_model
from .streams import Scene, mjpeg, rtsp

RED = (64, 32)
WHERE = (0.5, 0.25, 0.625, 0.375)
"""RED's square in parts of a picture of 128 x 128."""


def is_there(report: dict) -> bool:  # type: ignore[type-arg]
    """Whether a report has the red square where it is, and nothing else."""
    return len(report["detections"]) == 1 and np.allclose(report["detections"][0]["box"], WHERE, atol=0.05)


def words(taker: Taking, model: Path, *more: str) -> list[str]:
    return ["onnx", "--service", taker.url, "--model", str(model), "--threshold", "0.5", *more]


@pytest.mark.parametrize("serve", [rtsp, mjpeg])
def test_a_red_square_in_a_stream_is_reported_and_so_is_that_it_is_gone(
    serve: Callable[[Scene], AbstractContextManager[str]], tmp_path: Path
) -> None:
    shown: list[tuple[int, int] | None] = [RED]
    model = write_model(tmp_path / "red.onnx")
    with taking() as taker, serve(lambda: picture(red_at=shown[0])) as url:
        code: list[int] = []
        flags = words(taker, model, "--video", url, "--rate", "20", "--frames", "30", "--source", "cam7")
        adapter = threading.Thread(target=lambda: code.append(main(flags)))
        adapter.start()
        began = time.time()
        first = taker.wait_for(lambda reports: any(is_there(each) for each in reports))
        shown[0] = None
        taker.wait_for(lambda reports: len(reports) > len(first) and not reports[-1]["detections"])
        adapter.join()
    assert code == [0]
    seen = next(each for each in first if is_there(each))
    assert seen["detections"][0]["class"] == "person"
    assert seen["source"] == "cam7"
    assert seen["threshold"] == 0.5
    assert abs(seen["captured_at"] - began) < 60.0


def test_a_file_is_played_as_though_it_were_live(tmp_path: Path) -> None:
    file = tmp_path / "flight.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (128, 128))
    for number in range(80):  # four seconds, of which a busy machine sees some frames too
        writer.write(picture(red_at=RED if number >= 20 else None))
    writer.release()
    with taking() as taker:
        flags = words(taker, write_model(tmp_path / "red.onnx"), "--video", str(file), "--rate", "100")
        assert main(flags) == 0
    assert len(taker.reports) > 5
    assert not taker.reports[0]["detections"]
    assert is_there(taker.reports[-1])
    times = [each["captured_at"] for each in taker.reports]
    assert times == sorted(set(times))
    assert len({each["id"] for each in taker.reports}) == len(times)


def test_the_services_own_time_is_asked_for_where_the_clocks_differ(tmp_path: Path) -> None:
    file = tmp_path / "flight.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (128, 128))
    writer.write(picture())
    writer.release()
    with taking() as taker:
        model = write_model(tmp_path / "red.onnx")
        assert main(words(taker, model, "--video", str(file), "--clock", "service")) == 0
    (report,) = taker.reports
    assert report["clock"] == "service"
    assert report["captured_at"] > time.time() + 900.0


def test_a_frames_age_counts_on_the_services_clock_however_fast_that_runs() -> None:
    with taking() as taker, Door(taker.url, source="cam0") as door:
        assert door.at(time.time() - 100.0) == pytest.approx(time.time(), abs=100.0)


def test_pictures_that_appear_in_a_folder_are_looked_at_once_with_their_own_time(tmp_path: Path) -> None:
    folder = tmp_path / "DCIM"
    folder.mkdir()
    image = Image.fromarray(picture(red_at=RED)[:, :, ::-1])
    exif = image.getexif()
    exif.get_ifd(0x8825).update({29: "2026:05:01", 7: (14.0, 3.0, 12.5)})
    image.save(folder / "a.jpg", exif=exif, quality=95)
    (folder / "b.jpg").write_bytes(b"no picture at all")
    (folder / "notes.txt").write_text("not looked at")
    with taking() as taker:
        model = write_model(tmp_path / "red.onnx")
        flags = ["folder", *words(taker, model)[1:], "--folder", str(folder), "--all", "--idle", "1.5"]
        assert main(flags) == 0
    first, second = taker.reports
    assert is_there(first)
    assert first["captured_at"] == 1777644192.5
    assert first["frame_id"] == "a.jpg"
    assert second["usable"] is False


def test_a_cameras_clock_counts_only_with_its_offset(tmp_path: Path) -> None:
    image = Image.fromarray(picture())
    exif = image.getexif()
    exif.get_ifd(0x8769).update({0x9003: "2026:05:01 16:03:12"})
    image.save(tmp_path / "without.jpg", exif=exif)
    assert taken_at(tmp_path / "without.jpg") is None
    exif.get_ifd(0x8769).update({0x9011: "+02:00", 0x9291: "25"})
    image.save(tmp_path / "with.jpg", exif=exif)
    assert taken_at(tmp_path / "with.jpg") == 1777644192.25


def test_each_layout_of_outputs_means_the_same_boxes() -> None:
    one = np.zeros((1, 5, 40), np.float32)
    one[0, :, 3] = (20.0, 30.0, 10.0, 8.0, 0.9)
    rows = np.zeros((1, 40, 7), np.float32)
    rows[0, 3] = (20.0, 30.0, 10.0, 8.0, 0.9, 0.2, 1.0)
    ends = np.array([[[15.0, 26.0, 25.0, 34.0, 0.9, 1.0]]], np.float32)
    lists = [ends[0, :, :4], np.array([1]), ends[0, :, 4]]
    for outputs, layout, kind in (
        ([one], "columns", 0),
        ([rows], "rows", 1),
        ([ends], "ends", 1),
        (lists, "lists", 1),
    ):
        assert layout_of([each.shape for each in outputs]) == layout
        raw = decode(outputs, layout)
        best = int(raw.scores.argmax())
        np.testing.assert_allclose(raw.boxes[best], [15.0, 26.0, 25.0, 34.0])
        assert raw.scores[best] == pytest.approx(0.9)
        assert raw.classes[best] == kind


def test_an_image_without_anything_is_no_fault_of_the_layout() -> None:
    """Most frames of a search are; the detector ended at the first one."""
    raw = decode([np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int64)], "lists")
    assert (raw.boxes.shape, raw.scores.size, raw.classes.size) == ((0, 4), 0, 0)
    with pytest.raises(BadInput, match="not of the layout 'lists'"):
        decode([np.zeros((2, 4), np.float32), np.zeros(2, np.float32)], "lists")


def test_a_box_is_placed_in_a_picture_of_other_proportions_than_the_networks(tmp_path: Path) -> None:
    model = Model(write_model(tmp_path / "red.onnx"), wishes=Wishes(threshold=0.5))
    (seen,) = model.look(picture(128, 64, red_at=(64, 16)).repeat(2, axis=0).repeat(2, axis=1))
    np.testing.assert_allclose(seen.box, (0.5, 0.25, 0.625, 0.5), atol=0.01)


def test_what_is_no_model_no_video_or_no_layout_is_told_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = write_model(tmp_path / "red.onnx")
    (tmp_path / "none.onnx").write_bytes(b"no model")
    with taking() as taker:
        for flags, said in (
            (words(taker, tmp_path / "missing.onnx", "--video", "0"), "there is no such model"),
            (words(taker, tmp_path / "none.onnx", "--video", "0"), "no ONNX model"),
            (words(taker, model, "--video", str(tmp_path / "nothing.mp4")), "cannot be opened"),
            (["onx"], "did you mean 'onnx'"),
        ):
            with pytest.raises(BadInput, match=said):
                main(flags)
        monkeypatch.setitem(sys.modules, "onnxruntime", None)
        with pytest.raises(BadInput, match=r"roisearch\[onnx\]"):
            main(words(taker, model, "--video", "0"))
    with pytest.raises(BadInput, match="no known layout"):
        layout_of([(3, 4)])
    with pytest.raises(BadInput, match="not of the layout 'rows'"):
        decode([np.zeros((2, 3))], "rows")
