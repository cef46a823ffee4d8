// SPDX-License-Identifier: Apache-2.0
// No part of the method: copies floats, to see what the device's memory can do.

#include "vectors.h"

// Global size (count / WIDTH).
kernel void copy(int count, global const float *source, global float *target)
{
    const int i = (int)get_global_id(0) * WIDTH;
    if (i + WIDTH <= count) WRITE(READ(source + i), target + i);
}
