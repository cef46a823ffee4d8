"""The deployment kernels of kernels_cl/ and their host side; pyopencl is imported on first use."""

from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.context import Context
from jflnr.opencl.devices import NoDevice, all_devices
from jflnr.opencl.flnr import flnr
from jflnr.opencl.flr import flr
from jflnr.opencl.noisy_guides import smooth_guide
