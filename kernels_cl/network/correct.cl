// SPDX-License-Identifier: Apache-2.0
// The light by what the network says of it (jflnr/network/features.py, picture.py).
//
// Defines beside those of the headers, with Q = 0: SAID, how many values it says of a pixel; LARGEST,
// the logarithm of the largest factor. For light COUNTS, the channels of the map of what was read,
// and PIXEL of them for each pixel, whose number MASK is 1 where it counts; for whole pictures
// PICTURE, DARK, as in features.cl, LEAST_LIGHT, the luminance that is too little to be lent, and
// LEAST_ALBEDO and MOST_TEXTURE, as in jflnr/network/picture.py.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "planes.h"
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

INLINE real bent(real said)
{
    const real size = said < 0 ? -said : said, e = exp_below_0(-2 * size);
    const real most = (1 - e) / (1 + e);
    return said < 0 ? -most : most;
}

INLINE real factor(real said)
{
    return exp_below_0(LARGEST * (bent(said / LARGEST) - 1)) * exp(LARGEST);
}

#ifdef PICTURE
#define OTHERS                                                                                      \
    global const float *alpha, global const float *samples, global const float *own,               \
        global const float *albedo, global const float *albedo_left, global const float *left,      \
        global const float *around, global const float *shining
#else
#define OTHERS global const float *read
#endif

// said: a map of 4 SAID channels over h x w blocks of 2 x 2 pixels, read: that of what was read, as
// wide. light, output, own, albedo, albedo_left: (H, W, C) in float, alpha, samples: (H, W), left,
// around: (3, H, W), shining: (4, H, W), as left.cl wrote it, blurred. Global size
// ((pitch - MARGIN) / WIDTH, h).
kernel void correct(
    int width, int height, int h, int w, int pitch, global const float *said, OTHERS,
    global const float *light, global float *output)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= w || y >= h || 2 * y >= height) return;
    said += MAP_AT(x, y, pitch, 4 * SAID, 0);
#ifndef PICTURE
    read += MAP_AT(x, y, pitch, COUNTS, MASK);
#endif
    for (int dy = 0; dy < 2 && 2 * y + dy < height; ++dy) {
        real even[SAID], odd[SAID];
#ifndef PICTURE
        const real even_counts = READ(read + (long)(2 * dy) * PIXEL * pitch);
        const real odd_counts = READ(read + (long)(2 * dy + 1) * PIXEL * pitch);
#endif
#pragma unroll
        for (int c = 0; c < SAID; ++c) {
            even[c] = READ(said + (long)(2 * dy * SAID + c) * pitch);
            odd[c] = READ(said + (long)((2 * dy + 1) * SAID + c) * pitch);
            even[c] = c < 3 ? factor(even[c]) : bent(even[c]);
            odd[c] = c < 3 ? factor(odd[c]) : bent(odd[c]);
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
#ifdef PICTURE
            real shares[SAID];
#pragma unroll
            for (int c = 3; c < SAID; ++c)
                shares[c] = part == 0 ? FIRST_OF(even[c], odd[c]) : SECOND_OF(even[c], odd[c]);
            const real dark = DARK * guide_lanes(alpha + pixel, 1, 0, 0, last);
            const long plane = (long)height * width, row = (long)(2 * y + dy) * width;
            const real bright = lanes_at(shining + 3 * plane + row, width, x0) + LEAST_LIGHT;
            const real many = MAX(guide_lanes(samples + pixel, 1, 0, 0, last), 1);
            const real lent = shares[5] / bright / many;
#endif
#pragma unroll
            for (int c = 0; c < C; ++c) {
                const real gain = part == 0 ? FIRST_OF(even[c % 3], odd[c % 3])
                                            : SECOND_OF(even[c % 3], odd[c % 3]);
                const real before = guide_lanes(light + pixel * C, C, c, 0, last);
#ifdef PICTURE
                const long here = c * plane + row;
                const real colour = guide_lanes(albedo + pixel * C, C, c, 0, last);
                const real texture = guide_lanes(albedo_left + pixel * C, C, c, 0, last);
                const real lit = MAX(before - guide_lanes(own + pixel * C, C, c, 0, last), 0);
                const real lacks =
                    lit * CLAMP(texture / MAX(colour, LEAST_ALBEDO), -1, MOST_TEXTURE);
                const real taken = shares[3] * lanes_at(left + here, width, x0) +
                                   shares[4] * lanes_at(around + here, width, x0) +
                                   lent * lanes_at(shining + here, width, x0) + shares[6] * lacks;
                values[c] = MAX((before + dark) * gain - dark + taken, 0);
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
