"""Says, where the renderer's tests cannot run, why not; and what a user is told there."""

from __future__ import annotations

import sys

import pytest

from experiments.rendering import backend
from experiments.rendering.splits import check_split, split_of


def test_mitsuba_is_there() -> None:
    pytest.importorskip(
        "mitsuba", reason="the renderer's tests need Mitsuba 3: pip install mitsuba"
    )
    if backend.find_llvm() is None:
        pytest.skip("the renderer's tests need libLLVM 16 or later (Debian: libllvm19)")


def test_a_missing_mitsuba_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    backend.start.cache_clear()
    with pytest.raises(ValueError, match="pip install mitsuba"):
        backend.start(None, "llvm_ad_rgb")


def test_an_unusable_llvm_named_in_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    assert backend.find_llvm() is None


@pytest.mark.parametrize("scene", ["sponza", "classroom", "bathroom2", "veach-lamp", "dining-room"])
def test_reserved_scenes_never_become_training_data(scene: str) -> None:
    with pytest.raises(ValueError, match="split by scene"):
        check_split(scene, "train")
    check_split(scene, split_of(scene))
