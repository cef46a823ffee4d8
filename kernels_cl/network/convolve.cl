// SPDX-License-Identifier: Apache-2.0
// A layer of the network (jflnr/network/unet.py): convolution, bias, LeakyReLU.
//
// Defines beside WIDTH: SIDE of the kernel in blocks, 1 or 3; STRIDE, 1 or 2; TOGETHER, the outputs of
// one work-item, VECTORS, how many WIDTH neighbours it has of each: TOGETHER x VECTORS sums stay in
// registers, and every input that is read serves TOGETHER times, every weight VECTORS times; LEAKY,
// if negative outputs are divided by 10.

#include "vectors.h"
#include "grids.h"
#include "network/maps.h"

#define PIXELS (VECTORS * WIDTH)

// WIDTH values, STRIDE apart.
#if STRIDE == 1
#define READ_STRIDED(p) READ(p)
#elif WIDTH == 1
#define READ_STRIDED(p) (p)[0]
#elif WIDTH == 4
typedef float8 strided_t __attribute__((aligned(4)));
#define READ_STRIDED(p) (*(global const strided_t *)(p)).even
#else
typedef float16 strided_t __attribute__((aligned(4)));
#define READ_STRIDED(p) (*(global const strided_t *)(p)).even
#endif

#define INSIDE(i) ((x + (i)) < w ? 1 : 0)

// from, to: maps, see maps.h; of `inputs` and `to_count` channels, of which the first `outputs` are
// written. The sizes h, w and pitch are those of `to`.
// weights: (outputs / TOGETHER, SIDE, inputs, SIDE, TOGETHER), bias: (outputs), both with zeros up to
// a multiple of TOGETHER. Global size ((pitch - MARGIN) / PIXELS, outputs / TOGETHER, h + 2).
kernel void convolve(
    int h, int w, int pitch, int from_pitch, int inputs, int to_count, int outputs,
    global const float *weights, global const float *bias, global const float *from,
    global float *to)
{
    const int start = (int)get_global_id(0) * PIXELS, first = (int)get_global_id(1) * TOGETHER;
    const int y = (int)get_global_id(2) - 1;
    if (start >= pitch - MARGIN || first >= outputs || y > h) return;

    real sums[TOGETHER * VECTORS];
    const int inside = y >= 0 && y < h && start < w;
    if (inside) {
#pragma unroll
        for (int o = 0; o < TOGETHER; ++o)
#pragma unroll
            for (int v = 0; v < VECTORS; ++v) sums[o * VECTORS + v] = bias[first + o];
        weights += (long)first * SIDE * SIDE * inputs;
        const int x = start * STRIDE - SIDE / 2, row = y * STRIDE - SIDE / 2;
        from += MAP_AT(x, row, from_pitch, inputs, 0);
        for (int dy = 0; dy < SIDE; ++dy)
            for (int i = 0; i < inputs; ++i, from += from_pitch) {
#pragma unroll
                for (int dx = 0; dx < SIDE; ++dx, weights += TOGETHER) {
                    real values[VECTORS];
#pragma unroll
                    for (int v = 0; v < VECTORS; ++v)
                        values[v] = READ_STRIDED(from + dx + v * WIDTH * STRIDE);
#pragma unroll
                    for (int o = 0; o < TOGETHER; ++o)
#pragma unroll
                        for (int v = 0; v < VECTORS; ++v)
                            sums[o * VECTORS + v] += weights[o] * values[v];
                }
            }
    }

    to += MAP_AT(start, y, pitch, to_count, first);
#pragma unroll
    for (int o = 0; o < TOGETHER; ++o) {
        if (first + o < outputs) {
            global float *row = to + (long)o * pitch;
            if (start == 0)
                for (int i = 1; i <= MARGIN; ++i) row[-i] = 0;
#pragma unroll
            for (int v = 0; v < VECTORS; ++v) {
                const int x = start + v * WIDTH;
                real value = sums[o * VECTORS + v];
#ifdef LEAKY
                value = MAX(value, 0.1f * value);
#endif
                const mask in_row = LANES(mask, INSIDE);
                WRITE(inside && in_row != 0 ? value : (real)0, row + v * WIDTH);
            }
        }
    }
}
