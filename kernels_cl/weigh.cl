// SPDX-License-Identifier: Apache-2.0
// Method auto: what every block counts, from its own brightness by the first fit.

#include "vectors.h"
#include "sizes.h"
#include "grids.h"

#define BLOCK_PLANES (K + 2)

// Moments of the brightness alone, (XX(Q + 1, 0) + Q + 1, h, pitch), on blocks twice as large as those of
// block_moments.cl, (fine_h, fine_pitch / GROUP, BLOCK_PLANES, GROUP). Global size (pitch / WIDTH, h).
kernel void light_moments(
    int h, int pitch, int fine_h, int fine_pitch, global const float *blocks, global float *light)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const int next = 2 * x + WIDTH, below = 2 * y + 1 < fine_h, there = next < fine_pitch;
    const long second = COLUMN(next, BLOCK_PLANES) - COLUMN(2 * x, BLOCK_PLANES), row = (long)fine_pitch * (BLOCK_PLANES);
    blocks += AT(2 * x, 2 * y, fine_pitch, BLOCK_PLANES);
    light += (long)y * pitch + x;
    const long plane = (long)h * pitch;
    if (2 * x >= fine_pitch) {
        for (int k = 0; k <= XY(0, 0) + Q; ++k) WRITE((real)0, light + k * plane);
        return;
    }
#define SUMS(p) (pair_sums(p, (p) + second, there) + (below ? pair_sums((p) + row, (p) + row + second, there) : (real)0))
    for (int k = 0; k < XY(0, 0); ++k) WRITE(0.25f * SUMS(blocks + k * GROUP), light + k * plane);
    for (int q = 0; q <= Q; ++q) {
        real sum = 0;
        for (int c = 0; c < C; ++c) sum += BRIGHTNESS(c) * SUMS(blocks + XY(q, c) * GROUP);
        WRITE(0.25f * sum, light + (XY(0, 0) + q) * plane);
    }
}

// The pilot's models of one channel on a grid twice as fine. Global size (pitch / WIDTH, h).
#define PILOT_PLANES (2 * (Q + 1) + 1)
kernel void double_pilot(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, global const float *coarse,
    global float *pilot)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const coarse_t at = coarse_at(coarse, PILOT_PLANES, coarse_h, coarse_w, coarse_pitch, x, y);
    pilot += AT(x, y, pitch, PILOT_PLANES);
    for (int q = 0; q <= Q; ++q) WRITE(doubled(&at, q), pilot + q * GROUP);
}

// Moments of each block by its weight, (h, pitch / GROUP, K + 1, GROUP), the last plane being the noise:
//
//   weight^2 mean((brightness - pilot)^2),   the mean from moments: yy - 2 a.xy + a.xx.a
//
// times what the pixels weigh already. pilot: on a grid half as fine. Global size (pitch / WIDTH, h).
kernel void weigh(
    int h, int pitch, int coarse_h, int coarse_w, int coarse_pitch, float exponent, float offset,
    global const float *mean, global const float *pilot, global const float *blocks,
    global float *moments)
{
    const int x = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x >= pitch || y >= h) return;
    const coarse_t at = coarse_at(pilot, PILOT_PLANES, coarse_h, coarse_w, coarse_pitch, x, y);
    blocks += AT(x, y, pitch, BLOCK_PLANES);
    moments += AT(x, y, pitch, K + 1);
    real a[Q + 1], expected = doubled(&at, 0), square = READ(blocks + K * GROUP);
    const real n = READ(blocks), per_pixel = n > 1e-12f ? 1 / n : (real)0;
    a[0] = expected;
    for (int q = 1; q <= Q; ++q) {
        a[q] = doubled(&at, q);
        expected += a[q] * per_pixel * READ(blocks + XX(q, 0) * GROUP);
    }
    for (int i = 0; i <= Q; ++i) {
        real fitted = -READ(blocks + XX(i, i) * GROUP) * a[i], light = 0;
        for (int j = 0; j <= i; ++j) fitted += 2 * READ(blocks + XX(i, j) * GROUP) * a[j];
        for (int c = 0; c < C; ++c) light += BRIGHTNESS(c) * READ(blocks + XY(i, c) * GROUP);
        square += a[i] * (fitted - 2 * light);
    }
    const real relative = MAX(expected / mean[0], 1e-6f);
    const real weight = 1 / ((exponent == 1 ? relative : pow(relative, (real)exponent)) + offset);
    for (int k = 0; k < K; ++k)
        WRITE(weight * READ(blocks + k * GROUP), moments + k * GROUP);
    const real own = READ(blocks + (K + 1) * GROUP) * per_pixel;
    WRITE(weight * weight * own * MAX(square, 0), moments + K * GROUP);
}
