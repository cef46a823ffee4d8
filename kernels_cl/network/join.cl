// SPDX-License-Identifier: Apache-2.0
// What comes from a coarser scale, repeated over 2 x 2 blocks and added to a finer one's; LeakyReLU.

#include "vectors.h"
#include "grids.h"
#include "network/maps.h"

#define REPEATED(i) from[(x + (i)) / 2]
#define IN_ROW(i) ((x + (i)) < w ? 1 : 0)

// from: a map of `channels` channels, half as fine as `skip` and `to`, which have as many.
// Global size ((pitch - MARGIN) / WIDTH, channels, h + 2).
kernel void join(
    int h, int w, int pitch, int from_pitch, int channels, global const float *from,
    global const float *skip, global float *to)
{
    const int x = (int)get_global_id(0) * WIDTH, channel = get_global_id(1);
    const int y = (int)get_global_id(2) - 1;
    if (x >= pitch - MARGIN || channel >= channels || y > h) return;
    skip += MAP_AT(x, y, pitch, channels, channel);
    to += MAP_AT(x, y, pitch, channels, channel);
    if (x == 0)
        for (int i = 1; i <= MARGIN; ++i) to[-i] = 0;
    if (y < 0 || y >= h) {
        WRITE((real)0, to);
        return;
    }
    from += MAP_AT(0, y / 2, from_pitch, channels, channel);
#if WIDTH == 8
    const real coarse = READ_4(from + x / 2).s00112233;
#else
    const real coarse = LANES(real, REPEATED);
#endif
    const real value = coarse + READ(skip);
    const mask in_row = LANES(mask, IN_ROW);
    WRITE(in_row != 0 ? MAX(value, 0.1f * value) : (real)0, to);
}
