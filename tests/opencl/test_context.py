"""What surrounds the kernels: devices, reuse, determinism, results left on the device, errors."""

import sys
from pathlib import Path

import numpy as np
import pytest

from jflnr.opencl import Context, NoDevice, ahead, all_devices, kept
from jflnr.opencl import context as context_module
from jflnr.opencl.context import default_context
from jflnr.opencl.flr import flr
from tests.opencl.conftest import PARAMETERS, scene


def test_three_runs_give_equal_bits(context: Context) -> None:
    target, guides = scene(61, 203, 5, 3)
    runs = [flr(target, guides, PARAMETERS, context=context) for _ in range(3)]
    assert runs[0].tobytes() == runs[1].tobytes() == runs[2].tobytes()


@pytest.mark.parametrize("work_group", [1, 7])
def test_work_group_size_does_not_matter(context: Context, work_group: int) -> None:
    target, guides = scene(61, 203, 5, 3)
    other = Context(context.device, work_group=work_group)
    found = flr(target, guides, PARAMETERS, context=other)
    assert found.tobytes() == flr(target, guides, PARAMETERS, context=context).tobytes()


def test_result_on_the_device(context: Context) -> None:
    target, guides = scene(61, 203, 5, 3)
    right = flr(target, guides, PARAMETERS, context=context)
    there = [context.array(a) for a in (target, guides)]
    found = flr(*there, PARAMETERS, context=context, on_device=True)
    np.testing.assert_array_equal(found.get(), right)
    assert flr(*there, PARAMETERS, context=context, out=found) is found
    np.testing.assert_array_equal(found.get(), right)


def test_odd_arrays_are_read_right(context: Context) -> None:
    target, guides = scene(61, 203, 5, 3)
    right = flr(target, guides, PARAMETERS, context=context)
    wide = np.zeros((61, 203, 8))
    wide[..., 5:], wide[..., :5] = target, guides
    found = flr(wide[..., 5:], wide[..., :5], PARAMETERS, context=context)
    np.testing.assert_array_equal(found, right)
    shifted = np.zeros(target.nbytes + 2, np.uint8)[2:].view(np.float32).reshape(target.shape)
    shifted[...] = target
    target.flags.writeable = False
    found = flr(shifted, guides, PARAMETERS, context=context)
    np.testing.assert_array_equal(found, flr(target, guides, PARAMETERS, context=context))


def test_programs_are_compiled_ahead_by_several_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    context = default_context()
    if not context.on_cpu:
        pytest.skip("only processors' programs are kept")
    target, guides = scene(20, 30, 2, 1)
    call = lambda: flr(target, guides, PARAMETERS, context=context)
    right = call()
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(ahead, "cores", lambda: 2)
    with context.recorded() as nothing:
        ahead.compile_ahead(context, call)
    assert not nothing and not context.compiles
    with context.recorded() as launches:
        np.testing.assert_array_equal(call(), right)
    places = {context.place_of(launch.file, launch.defines) for launch in launches}
    assert places == set((tmp_path / "opencl").iterdir())


def test_programs_are_kept_with_the_code_of_their_kernels(
    context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not context.on_cpu:
        pytest.skip("only processors' programs are kept")
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    target, guides = scene(20, 30, 2, 1)
    again = lambda: flr(target, guides, PARAMETERS, context=Context(context.device))
    right, folder = again(), tmp_path / "opencl"
    found = sorted(folder.iterdir())
    assert found
    with monkeypatch.context() as patch:
        patch.setattr(Context, "_build", None)
        np.testing.assert_array_equal(again(), right)
    contents = [path.read_bytes() for path in found]
    middle = len(min(contents, key=len)) // 2
    for damaged in (
        lambda content: b"no program",
        lambda content: content[:middle],
        lambda content: content[:middle] + bytes(64) + content[middle + 64 :],
    ):
        for path, content in zip(found, contents, strict=True):
            path.write_bytes(damaged(content))
        np.testing.assert_array_equal(again(), right)
        assert all(len(path.read_bytes()) > middle for path in found)
    monkeypatch.setattr(kept, "MOST", 0)
    kept.write(folder / "more", b"one more")
    assert not list(folder.iterdir())
    monkeypatch.setenv("POCL_KERNEL_CACHE", "0")
    assert kept.place_of(context.device, "", []) is None


def test_wrong_arguments(context: Context) -> None:
    target, guides = scene(20, 30, 5, 3)
    with pytest.raises(ValueError, match="block"):
        flr(target, guides, PARAMETERS, context=context, block=0)
    with pytest.raises(ValueError, match="guides has 17 channels"):
        flr(target, np.zeros((20, 30, 17), np.float32), PARAMETERS, context=context)
    with pytest.raises(ValueError, match="at least one channel"):
        flr(target[..., :0], guides, PARAMETERS, context=context)
    with pytest.raises(ValueError, match="out must"):
        flr(target, guides, PARAMETERS, context=context, out=np.zeros((20, 30, 3)))
    with pytest.raises(TypeError, match="floating"):
        flr(target.astype(int), guides, PARAMETERS, context=context)


def test_kernels_refuse_what_they_cannot_do(context: Context) -> None:
    for file, defines in (
        ("moments.cl", "-DQ=17 -DC=3 -DWIDTH=1 -DBLOCK=8"),
        ("solve.cl", "-DQ=5 -DC=10 -DWIDTH=1"),
        ("apply.cl", "-DQ=5 -DC=3 -DWIDTH=3 -DSTEP=8"),
        ("apply.cl", "-DQ=5 -DC=3 -DWIDTH=1"),
    ):
        program = context.cl.Program(context.context, context_module.source(file))
        with pytest.raises(context.cl.RuntimeError, match="error"):
            program.build(defines.split())


def test_devices_are_chosen_by_number_or_name(context: Context) -> None:
    first = all_devices()[0]
    assert Context(0).device == first
    assert Context(first.name.strip()[:6].upper()).device == first
    with pytest.raises(ValueError, match="no OpenCL device 'nonesuch'"):
        Context("nonesuch")


def test_no_device_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    cl = pytest.importorskip("pyopencl")
    monkeypatch.setattr(cl, "get_platforms", lambda: [])
    with pytest.raises(NoDevice, match=r"jflnr\[opencl\]"):
        Context()


def test_no_pyopencl_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyopencl", None)
    with pytest.raises(NoDevice, match=r"jflnr\[opencl\]"):
        all_devices()
