"""What is kept between frames on one device: queue, programs, buffers, and the times of kernels."""

import contextlib
import functools
import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from jflnr.opencl import devices, kept

# A file of kernels_cl, and what is defined for it.
Program = tuple[str, dict[str, Any]]


class Launch(NamedTuple):
    """One execution of a kernel: its event, the bytes it must at least read and write, and how it
    was launched; `size`: work-items that are needed, `group`: in x of a work-group."""

    kernel: str
    event: Any
    bytes: int
    file: str
    defines: dict[str, int]
    size: tuple[int, ...]
    group: int
    arguments: tuple[Any, ...]


class Context:
    """A device, its queue, compiled programs, a pool of buffers and, on request, a profile.

    Threads may share one: their kernels run one after another. A forked process may not.

    device: a `pyopencl.Device`, its number or a part of its name (see `jflnr doctor`), or None
    for the best one. work_group: number of work-items in x of a work-group; results do not depend
    on it. Raises `NoDevice` or `ValueError`.
    """

    def __init__(self, device: Any = None, *, work_group: int | None = None) -> None:
        cl = self.cl
        named = device is None or isinstance(device, str | int)
        self.device = devices.choose(device) if named else device
        # A processor shares its memory with numpy: arrays are used where they lie.
        self.on_cpu = bool(self.device.type & cl.device_type.CPU)
        self.context = cl.Context([self.device])
        self.queue = cl.CommandQueue(
            self.context, properties=cl.command_queue_properties.PROFILING_ENABLE
        )
        self.pool = cl.tools.MemoryPool(cl.tools.ImmediateAllocator(self.queue))
        self.work_group = work_group or (32 if self.on_cpu else 64)
        self._programs: dict[tuple[Any, ...], Any] = {}
        self._kernels: dict[tuple[Any, ...], Any] = {}
        self._to_keep: dict[Path, Any] = {}  # programs that are not on disk yet
        self.ahead = False  # whether other processes compile for this one
        self._lock = threading.Lock()  # from setting a kernel's arguments until it is enqueued
        # What a thread has given to kernels that may not be through, and what it has launched, or
        # only says that it would launch.
        self._in_use: dict[int, list[np.ndarray]] = {}
        self._launches: dict[int, list[Launch]] = {}
        self._rehearsed: dict[int, list[Program]] = {}

    @property
    def cl(self) -> ModuleType:
        """The module pyopencl. Raises `NoDevice` in a process in which it cannot be used."""
        return devices.pyopencl()

    @property
    def compiles(self) -> bool:
        """Whether programs are compiled that no earlier run had left on disk."""
        return self.ahead or bool(self._to_keep)

    def width(self, block: int | None = None, across: bool = False) -> int:
        """Neighbours per work-item (WIDTH of kernels_cl/vectors.h), dividing `block` if given.

        across: they may also be several whole blocks.
        """
        if not self.on_cpu:
            return 1
        fits = lambda n: block is None or block % n == 0 or (across and n % block == 0)
        return next(n for n in (8, 4, 1) if fits(n))

    def run(
        self,
        name: str,
        file: str,
        defines: dict[str, int],
        size: Sequence[int],
        arguments: Sequence[Any],
        moved: int | None = None,
        alone: bool = False,
        group: int | None = None,
    ) -> None:
        """Enqueue kernel `name` of kernels_cl/`file`; `size` is padded to whole work-groups.

        arguments: ints and floats are passed as int and float, arrays as their buffers. moved: the
        bytes that must be read and written, for the profile; by default those of all arrays. alone:
        on a processor, every work-item is a work-group: PoCL otherwise keeps the private arrays of
        all the group's at once, which for large ones does not fit into the cache. group:
        work-items in x of a work-group, for a kernel that is written for one number of them.
        """
        if (programs := self._rehearsed.get(threading.get_ident())) is not None:
            if (file, defines) not in programs:
                programs.append((file, defines))
            return
        group = group or (1 if alone and self.on_cpu else self.work_group)
        local = (group, *(1 for _ in size[1:]))
        padded = tuple(math.ceil(n / m) * m for n, m in zip(size, local, strict=True))
        with self._lock:
            event = self._kernel(name, file, defines, arguments)(
                self.queue, padded, local, *map(_argument, arguments)
            )
        if (launches := self._launches.get(threading.get_ident())) is not None:
            arrays = {id(a): a.nbytes for a in arguments if hasattr(a, "nbytes")}
            moved = sum(arrays.values()) if moved is None else moved
            told = file, defines, tuple(size), group, tuple(arguments)
            launches.append(Launch(name, event, moved, *told))

    def recorded(self) -> AbstractContextManager[list[Launch]]:
        """What this thread launches meanwhile."""
        return _noted(self._launches)

    def rehearsed(self) -> AbstractContextManager[list[Program]]:
        """The programs that this thread launches meanwhile, none of which run."""
        return _noted(self._rehearsed)

    def scale(self, output: Any, factor: np.float32) -> None:
        """Multiply a device array in place: pyopencl has one kernel for that in all threads."""
        with self._lock:
            output *= factor

    def empty(self, shape: Sequence[int], dtype: Any = np.float32) -> Any:
        """An uninitialised device array, from memory that earlier frames have given back."""
        return self.cl.array.empty(self.queue, tuple(shape), dtype, allocator=self.pool)

    def array(self, values: Any, writable: bool = False) -> Any:
        """A device array of a numpy array, in C order; on a processor it is the same memory.

        Device arrays are passed through.
        """
        if is_device_array(values):
            return values
        if not self.on_cpu:
            return self.cl.array.to_device(self.queue, values, allocator=self.pool)
        self._in_use.setdefault(threading.get_ident(), []).append(values)
        flags = self.cl.mem_flags
        access = flags.READ_WRITE if writable else flags.READ_ONLY
        buffer = self.cl.Buffer(self.context, access | flags.USE_HOST_PTR, hostbuf=values)
        return self.cl.array.Array(self.queue, values.shape, values.dtype, data=buffer)

    def to_fill(self, result: np.ndarray) -> Any:
        """A device array that `finish` makes readable as `result`."""
        return self.array(result, writable=True) if self.on_cpu else self.empty(result.shape)

    def finish(self, output: Any, result: Any) -> Any:
        """Make the device array `output` readable as `result`, a numpy array or `output` itself."""
        if self.on_cpu:
            self.queue.finish()
            self._in_use.pop(threading.get_ident(), None)
            self._keep_programs()
        if output is not result and not self.on_cpu:
            output.get(ary=result)
        elif output is not result:
            # The same memory; a map tells OpenCL that the host is going to look at it.
            access = self.cl.map_flags.READ
            mapped, _ = self.cl.enqueue_map_buffer(
                self.queue, output.base_data, access, 0, output.shape, output.dtype
            )
            mapped.base.release(self.queue)
        return result

    def _kernel(
        self, name: str, file: str, defines: dict[str, int], arguments: Sequence[Any]
    ) -> Any:
        program = (file, *sorted(defines.items()))
        key = (name, *program)
        if program not in self._programs:
            self._programs[program] = self._program(file, defines)
        if key not in self._kernels:
            self._kernels[key] = kernel = self.cl.Kernel(self._programs[program], name)
            # Told the types of numbers, pyopencl raises no C++ exception to find each of them out:
            # one takes milliseconds in a process in which JAX has compiled many programs.
            kernel.set_scalar_arg_dtypes([_type(value) for value in arguments])
        return self._kernels[key]

    def place_of(self, file: str, defines: dict[str, int]) -> Path | None:
        """Where a program is kept, if anywhere."""
        if not self.on_cpu:
            return None
        return kept.place_of(self.device, source(file), _options(defines))

    def compile(self, file: str, defines: dict[str, int]) -> None:
        """Compile a program, and keep it where `place_of` says."""
        self._program(file, defines)
        self._keep_programs()

    def _program(self, file: str, defines: dict[str, int]) -> Any:
        place = self.place_of(file, defines)
        if place is not None and (binary := kept.read(place)) is not None:
            # One that another driver left is as good as none.
            with contextlib.suppress(self.cl.Error):
                return self.cl.Program(self.context, [self.device], [binary]).build()
        program = self._build(file, defines)
        if place is not None:
            self._to_keep[place] = program
        return program

    def _build(self, file: str, defines: dict[str, int]) -> Any:
        return self.cl.Program(self.context, source(file)).build(_options(defines))

    def _keep_programs(self) -> None:
        """Write new programs to disk: once their kernels have run, they hold their code."""
        with self._lock:
            new, self._to_keep = self._to_keep, {}
        for place, program in new.items():
            kept.write(place, program.get_info(self.cl.program_info.BINARIES)[0])


@contextlib.contextmanager
def _noted(notes: dict[int, list[Any]]) -> Iterator[list[Any]]:
    """A list for what this thread does meanwhile, in `notes` by thread."""
    found = notes[threading.get_ident()] = []
    try:
        yield found
    finally:
        del notes[threading.get_ident()]


def _options(defines: dict[str, int]) -> list[str]:
    return [f"-D{define}={value}" for define, value in sorted(defines.items())]


def is_device_array(values: Any) -> bool:
    """True for a `pyopencl.array.Array`, without a need for pyopencl to be there."""
    return hasattr(values, "base_data")


def _type(argument: Any) -> Any:
    """What a kernel gets for a number, int or float; None for an array."""
    if isinstance(argument, int):
        return np.int32
    return np.float32 if isinstance(argument, float) else None


def _argument(value: Any) -> Any:
    return value if value is None or isinstance(value, int | float) else value.data


@functools.cache
def source(file: str) -> str:
    """The text of a kernel file with its headers in place, so that no include path is needed."""
    lines = (_folder() / file).read_text().splitlines()
    include = "#include "
    return "\n".join(
        source(line.removeprefix(include).strip('"')) if line.startswith(include) else line
        for line in lines
    )


def _folder() -> Any:
    """`jflnr/kernels_cl` where the package is installed, `kernels_cl` in the repository."""
    installed = resources.files("jflnr") / "kernels_cl"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "kernels_cl"


def default_context() -> Context:
    """The best device, set up once."""
    devices.pyopencl()  # in a forked process the lock may be held for ever
    with _setting_up:
        return _default_context()


_setting_up = threading.Lock()
_default_context = functools.cache(Context)
