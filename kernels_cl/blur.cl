// SPDX-License-Identifier: Apache-2.0
// Kernel 2: the Gaussian window, a separable convolution of the moments (section 3.2).
//
//   columns[k][y][x] = sum_t taps[t] moments[k][y + t - reach][x]
//   blurred[k][y][x] = sum_t taps[t] columns[k][y][x + t - reach]
//
// with zeros outside the frame. Nothing is divided by the weight inside the frame: moments[0] is
// blurred along with the rest and the solver divides by it.
//
// `columns` has a margin of zeros on both sides, so that the second pass has no border: its rows
// are margin + pitch + margin long, margin >= reach and a multiple of WIDTH.

// `planes` is K; rows are `pitch` apart, a multiple of WIDTH, with zeros in place of what is missing.

#include "vectors.h"

// Down the columns. Global size ((pitch + 2 margin) / WIDTH, h, K).
kernel void blur_columns(
    int planes, int h, int pitch, int margin, int reach, constant float *taps,
    global const float *moments, global float *columns)
{
    const int x = (int)get_global_id(0) * WIDTH - margin, y = get_global_id(1);
    if (x >= pitch + margin || y >= h || get_global_id(2) >= planes) return;
    const long row = (long)get_global_id(2) * h + y;
    real sum = 0;
    if (x >= 0 && x < pitch) {
        const int end = MIN(reach, h - 1 - y);
        global const float *here = moments + row * pitch + x;
        for (int t = -MIN(reach, y); t <= end; ++t) sum += taps[reach + t] * READ(here + t * pitch);
    }
    WRITE(sum, columns + row * (pitch + 2 * margin) + margin + x);
}

// Along the rows. Global size (pitch / WIDTH, h, K).
kernel void blur_rows(
    int planes, int h, int pitch, int margin, int reach, constant float *taps,
    global const float *columns, global float *blurred)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h || get_global_id(2) >= planes) return;
    const long row = (long)get_global_id(2) * h + y;
    global const float *start = columns + row * (pitch + 2 * margin) + margin - reach + x;
    real sum = 0;
    for (int t = 0; t <= 2 * reach; ++t) sum += taps[t] * READ(start + t);
    WRITE(sum, blurred + row * pitch + x);
}
