"""What of Foxglove's schemas stands in an MCAP file: transforms, scenes, poses and a log, as JSON, and their JSON schemas.

Foxglove knows them by their names (https://docs.foxglove.dev/docs/sdk/schemas); a message has every field of its schema.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from typing import Any

Json = Mapping[str, Any]
Rgba = tuple[float, float, float, float]

_UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_NS = 1_000_000_000
_LINE_LIST = 2
_AXES = "xyz"


class Level(IntEnum):
    """How grave a line of the log is."""

    INFO = 2
    WARNING = 3
    ERROR = 4


def transforms(ns: int, frames: Iterable[tuple[str, Sequence[float]]]) -> Json:
    """Where frames are in the world, by their names."""
    return {
        "transforms": [
            {
                "timestamp": _time(ns),
                "parent_frame_id": "world",
                "child_frame_id": name,
                "translation": _vector(place),
                "rotation": _UPRIGHT,
            }
            for name, place in frames
        ]
    }


def poses(ns: int, places: Iterable[Sequence[float]]) -> Json:
    """Places in the world."""
    return {"timestamp": _time(ns), "frame_id": "world", "poses": [_pose(place) for place in places]}


def log(ns: int, level: Level, says: str) -> Json:
    """A line of the log."""
    return {"timestamp": _time(ns), "level": int(level), "message": says, "name": "affinet", "file": "", "line": 0}


def scene(entities: Sequence[Json]) -> Json:
    """Entities that take the place of those with their names."""
    return {"deletions": [], "entities": entities}


def ball(ns: int, frame: str, radius: float, colour: Rgba) -> Json:
    """A ball that goes with a frame, called by its name."""
    size = dict.fromkeys(_AXES, 2.0 * radius)
    sphere = {"pose": _pose(()), "size": size, "color": _colour(colour)}
    text = {
        "pose": _pose((0.0, 2.0 * radius)),
        "billboard": True,
        "font_size": 2.0 * radius,
        "scale_invariant": False,
        "color": _colour(colour),
        "text": frame.rpartition("_")[2],
    }
    return _entity(ns, frame, frame) | {"spheres": [sphere], "texts": [text]}


def lines(ns: int, name: str, width: float, ends: Sequence[Sequence[float]], colours: Sequence[Rgba]) -> Json:
    """Lines in the world, each from one end to the next, with a colour for each."""
    line = {
        "type": _LINE_LIST,
        "pose": _pose(()),
        "thickness": width,
        "scale_invariant": False,
        "points": [_vector(end) for end in ends],
        "color": _colour((1.0, 1.0, 1.0, 1.0)),
        "colors": [_colour(one) for one in colours for _ in range(2)],
        "indices": [],
    }
    return _entity(ns, name, "world") | {"lines": [line]}


def _entity(ns: int, name: str, frame: str) -> dict[str, Any]:
    nothing: dict[str, Any] = {what: [] for what in ("metadata", *_PRIMITIVES)}
    return {
        "timestamp": _time(ns),
        "frame_id": frame,
        "id": name,
        "lifetime": _time(0),
        "frame_locked": True,
        **nothing,
    }


def _time(ns: int) -> Json:
    return {"sec": ns // _NS, "nsec": ns % _NS}


def _vector(place: Sequence[float]) -> Json:
    return {**dict.fromkeys(_AXES, 0.0), **dict(zip(_AXES, place, strict=False))}


def _pose(place: Sequence[float]) -> Json:
    return {"position": _vector(place), "orientation": _UPRIGHT}


def _colour(rgba: Rgba) -> Json:
    return dict(zip("rgba", rgba, strict=True))


def _table(title: str = "", **properties: Json) -> Json:
    named = {"title": title} if title else {}
    return {**named, "type": "object", "properties": properties, "required": list(properties)}


def _list(items: Json) -> Json:
    return {"type": "array", "items": items}


_NUMBER, _WHOLE, _TEXT, _TRUTH = ({"type": name} for name in ("number", "integer", "string", "boolean"))
_PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
_TIME = _table("time", sec=_WHOLE, nsec=_WHOLE)
_DURATION = _table("duration", sec=_WHOLE, nsec=_WHOLE)
_VECTOR = _table("foxglove.Vector3", **dict.fromkeys(_AXES, _NUMBER))
_POINT = _table("foxglove.Point3", **dict.fromkeys(_AXES, _NUMBER))
_QUATERNION = _table("foxglove.Quaternion", **dict.fromkeys("xyzw", _NUMBER))
_COLOUR = _table("foxglove.Color", **dict.fromkeys("rgba", _NUMBER))
_POSE = _table("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_SPHERE = _table("foxglove.SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOUR)
_LINE = _table(
    "foxglove.LinePrimitive",
    type=_WHOLE,
    pose=_POSE,
    thickness=_NUMBER,
    scale_invariant=_TRUTH,
    points=_list(_POINT),
    color=_COLOUR,
    colors=_list(_COLOUR),
    indices=_list(_WHOLE),
)
_LABEL = _table(
    "foxglove.TextPrimitive",
    pose=_POSE,
    billboard=_TRUTH,
    font_size=_NUMBER,
    scale_invariant=_TRUTH,
    color=_COLOUR,
    text=_TEXT,
)
_OF_PRIMITIVES = {"spheres": _SPHERE, "lines": _LINE, "texts": _LABEL}
_ENTITY = _table(
    "foxglove.SceneEntity",
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked=_TRUTH,
    metadata=_list(_table("foxglove.KeyValuePair", key=_TEXT, value=_TEXT)),
    **{name: _list(_OF_PRIMITIVES.get(name, {"type": "object"})) for name in _PRIMITIVES},
)
_TRANSFORM = _table(
    "foxglove.FrameTransform",
    timestamp=_TIME,
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_VECTOR,
    rotation=_QUATERNION,
)
_DELETION = _table("foxglove.SceneEntityDeletion", timestamp=_TIME, type=_WHOLE, id=_TEXT)

TRANSFORMS, SCENE = "foxglove.FrameTransforms", "foxglove.SceneUpdate"
POSES, LOG = "foxglove.PosesInFrame", "foxglove.Log"
SCHEMAS: Mapping[str, Json] = {
    TRANSFORMS: _table(TRANSFORMS, transforms=_list(_TRANSFORM)),
    SCENE: _table(SCENE, deletions=_list(_DELETION), entities=_list(_ENTITY)),
    POSES: _table(POSES, timestamp=_TIME, frame_id=_TEXT, poses=_list(_POSE)),
    LOG: _table(LOG, timestamp=_TIME, level=_WHOLE, message=_TEXT, name=_TEXT, file=_TEXT, line=_WHOLE),
}
