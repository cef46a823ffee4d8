"""Which split a scene belongs to. Split by scene, never by frame: DESIGN.md, "Measuring"."""

from __future__ import annotations

VAL = ("veach-lamp", "dining-room")
TEST = ("sponza", "classroom", "bathroom2")
TRAIN_ROOMS = ("bathroom", "living-room", "living-room-2", "staircase")


def split_of(scene: str) -> str:
    """`val` or `test` for the scenes reserved for those, else `train`."""
    return "val" if scene in VAL else "test" if scene in TEST else "train"


def check_split(scene: str, split: str) -> None:
    """Raises ValueError where a scene is about to be rendered into another split than its own."""
    if split != split_of(scene):
        raise ValueError(
            f"scene {scene!r} belongs to the split {split_of(scene)!r} and must not be rendered "
            f"into {split!r}: frames are split by scene"
        )
