"""The deployment kernels of kernels_cl/ and their host side; pyopencl is imported on first use."""

from jflnr.opencl.context import Context
from jflnr.opencl.devices import NoDevice, all_devices
