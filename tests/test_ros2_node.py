"""The ROS 2 node of docs/examples, against a stand-in for rclpy: it has the few names that the node uses, no more."""

import runpy
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from conftest import ROOT
from helpers.small_world import write_images

from placerec import DictionaryOptions, read_stream, tokenize, train_dictionary, train_lm
from placerec.model import load_recognizer

NODE = ROOT / "docs/examples/ros2_node.py"


@dataclass
class Stamp:
    sec: int
    nanosec: int


@dataclass
class Header:
    stamp: Stamp


@dataclass
class CompressedImage:
    header: Header
    data: bytes


@dataclass
class Data:
    data: Any


class String(Data):
    pass


class Float64MultiArray(Data):
    pass


@dataclass
class Graph:
    """What the node made, and what it published and said."""

    published: dict[str, list[Any]] = field(default_factory=dict)
    callbacks: dict[str, Callable[[CompressedImage], None]] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    began: list[str] = field(default_factory=list)


def stand_in(monkeypatch: pytest.MonkeyPatch, graph: Graph, messages: list[CompressedImage]) -> None:
    class Logger:
        def info(self, text: str) -> None:
            graph.said.append(text)

        warning = info

    class Publisher:
        def __init__(self, kind: type, topic: str) -> None:
            self.kind, self.topic = kind, topic

        def publish(self, message: object) -> None:
            assert type(message) is self.kind
            graph.published.setdefault(self.topic, []).append(message)

    class Node:
        def __init__(self, name: str) -> None:
            assert graph.began, "rclpy.init comes first"

        def create_publisher(self, kind: type, topic: str, qos: int) -> Publisher:
            return Publisher(kind, topic)

        def create_subscription(self, kind: type, topic: str, callback: Callable[..., None], qos: Any) -> None:
            assert (kind, qos) == (CompressedImage, {"depth": 1, "reliability": "best effort"})
            graph.callbacks[topic] = callback

        def get_logger(self) -> Logger:
            return Logger()

    def spin(node: Node) -> None:
        for message in messages:
            graph.callbacks["image/compressed"](message)
        raise KeyboardInterrupt

    class Reliability:
        BEST_EFFORT = "best effort"

    names: dict[str, dict[str, Any]] = {
        "rclpy": {"init": lambda args: graph.began.extend(args), "spin": spin},
        "rclpy.executors": {"ExternalShutdownException": type("ExternalShutdownException", (Exception,), {})},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {"QoSProfile": dict, "ReliabilityPolicy": Reliability},
        "rclpy.utilities": {"remove_ros_args": lambda args: args[: args.index("--ros-args")]},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"CompressedImage": CompressedImage},
        "std_msgs": {},
        "std_msgs.msg": {"Float64MultiArray": Float64MultiArray, "String": String},
    }
    for name, content in names.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)


def test_the_node_publishes_what_the_recognizer_believes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = write_images(tmp_path / "run")
    train_dictionary([run], tmp_path / "words.npz", options=DictionaryOptions(size=3))
    tokenize([run], tmp_path / "words.npz", tmp_path / "tokens")
    train_lm([tmp_path / "tokens/run.tsv"], tmp_path / "model", as_in_paper=True)
    messages = [
        CompressedImage(Header(Stamp(1000 + i, 500)), path.read_bytes())
        for i, path in enumerate(sorted((run / "std_cam").iterdir()))
    ]
    assert len(messages) == 12
    messages[3:3] = [CompressedImage(Header(Stamp(1002, 600)), data) for data in (b"no image", b"")]
    graph = Graph()
    stand_in(monkeypatch, graph, messages)
    monkeypatch.setattr(sys, "argv", [str(NODE), str(tmp_path / "model"), str(tmp_path / "words.npz"), "--ros-args"])
    runpy.run_path(str(NODE), run_name="__main__")
    expected = load_recognizer(tmp_path / "model").decode(read_stream(tmp_path / "tokens/run.tsv"))
    assert [message.data for message in graph.published["place"]] == list(expected.best)
    for message, belief in zip(graph.published["belief"], expected.belief, strict=True):
        assert message.data == pytest.approx(belief.tolist())
    assert graph.said[0] == "places: hall, kitchen"
    assert [said.split(":")[0] for said in graph.said] == ["places", "image left out", "image left out"]


def test_the_page_shows_the_node_as_it_is() -> None:
    (block,) = [text for text in (ROOT / "docs/live.md").read_text().split("```") if "class WhichPlace" in text]
    assert block.removeprefix("python\n") in NODE.read_text()
