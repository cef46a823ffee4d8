// SPDX-License-Identifier: Apache-2.0
// The light times the factors that the network gives (jflnr/network/flnr.py, picture.py).
//
// Defines beside those of the headers, with Q = 0: LARGEST, the logarithm of the largest factor. For
// light COUNTS, the channels of the map of what was read, and PIXEL of them for each pixel, whose
// number MASK is 1 where it counts; for whole pictures PICTURE, and DARK, as in features.cl.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "grids.h"
#include "network/maps.h"

// Of what belongs to even and to odd x, the first and the second WIDTH neighbours.
#if WIDTH == 1
#define FIRST_OF(even, odd) (even)
#define SECOND_OF(even, odd) (odd)
#elif WIDTH == 4
#define FIRST_OF(even, odd) ((real)((even).s0, (odd).s0, (even).s1, (odd).s1))
#define SECOND_OF(even, odd) ((real)((even).s2, (odd).s2, (even).s3, (odd).s3))
#else
#define FIRST_OF(a, b) ((real)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3))
#define SECOND_OF(a, b) ((real)(a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7, b.s7))
#endif

INLINE real factor(real said)
{
    const real size = said < 0 ? -said : said, e = exp_below_0(-2 / LARGEST * size);
    const real bent = LARGEST * (1 - e) / (1 + e), exponent = said < 0 ? -bent : bent;
    return exp_below_0(exponent - LARGEST) * exp(LARGEST);
}

#ifdef PICTURE
#define OTHERS global const float *alpha
#else
#define OTHERS global const float *read
#endif

// said: a map of 12 channels over h x w blocks of 2 x 2 pixels, read: that of what was read, as wide.
// light, output: (H, W, C) in float, alpha: (H, W). Global size ((pitch - MARGIN) / WIDTH, h).
kernel void correct(
    int width, int height, int h, int w, int pitch, global const float *said, OTHERS,
    global const float *light, global float *output)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= w || y >= h || 2 * y >= height) return;
    said += MAP_AT(x, y, pitch, 12, 0);
#ifndef PICTURE
    read += MAP_AT(x, y, pitch, COUNTS, MASK);
#endif
    for (int dy = 0; dy < 2 && 2 * y + dy < height; ++dy) {
        real even[3], odd[3];
#ifndef PICTURE
        const real even_counts = READ(read + (long)(2 * dy) * PIXEL * pitch);
        const real odd_counts = READ(read + (long)(2 * dy + 1) * PIXEL * pitch);
#endif
#pragma unroll
        for (int c = 0; c < 3; ++c) {
            even[c] = factor(READ(said + (long)(6 * dy + c) * pitch));
            odd[c] = factor(READ(said + (long)(6 * dy + 3 + c) * pitch));
#ifndef PICTURE
            even[c] = even_counts > 0 ? even[c] : (real)1;
            odd[c] = odd_counts > 0 ? odd[c] : (real)1;
#endif
        }
        for (int part = 0; part < 2; ++part) {
            const int x0 = 2 * x + part * WIDTH, last = MIN(width - x0, WIDTH) - 1;
            if (last < 0) continue;
            const long pixel = (long)(2 * y + dy) * width + x0;
            real values[C];
#pragma unroll
            for (int c = 0; c < C; ++c) {
                const real gain = part == 0 ? FIRST_OF(even[c % 3], odd[c % 3])
                                            : SECOND_OF(even[c % 3], odd[c % 3]);
                const real before = guide_lanes(light + pixel * C, C, c, 0, last);
#ifdef PICTURE
                const real cover = guide_lanes(alpha + pixel, 1, 0, 0, last), dark = DARK * cover;
                const real part = 1 + cover * cover * (gain - 1);
                values[c] = MAX((before + dark) * part - dark, 0);
#else
                values[c] = gain * before;
#endif
            }
            if (last == WIDTH - 1)
                write_pixels(output + pixel * C, values, 0, WIDTH - 1);
            else
                write_pixels(output + pixel * C, values, 0, last);
        }
    }
}
