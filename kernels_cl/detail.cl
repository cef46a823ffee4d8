// SPDX-License-Identifier: Apache-2.0
// What a fitted picture lacks of the noisy one's detail, before and after the filter along edges
// (edges.cl), and the picture that it makes.
//
//   noisy = max(target, 0) surface + own     fitted = max(light, 0) surface + own
//   left = (noisy - fitted) / s              s = mean of fitted + `dark`
//
// Images are (H, W, 3), planes (planes, H, W).
//
// Defines: those of images.h, for C = 3 and no guides; BLOCK, side in pixels of what signal is told
// from noise on; FEWEST.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "planes.h"

// NaN stays NaN.
#define NOT_BELOW(value, least) ((value) < (least) ? (least) : (value))

INLINE void put(
    global const float *light, global const float *surface, global const float *own, long pixel,
    int last, real *values)
{
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const real value = guide_lanes(light + pixel * C, C, c, 0, last);
        values[c] = NOT_BELOW(value, 0) * guide_lanes(surface + pixel * C, C, c, 0, last) +
                    guide_lanes(own + pixel * C, C, c, 0, last);
    }
}

// steer: (3, H, W), logarithms. follow: (4, H, W), what is left, and its mean square. usable: (H, W).
// weight: (H, W). Global size (ceil(W / WIDTH), H).
kernel void left(
    int width, int height, float unit, float dark, global const float *target,
    global const float *light, global const float *surface, global const float *own,
    global const float *weight, global float *steer, global float *follow, global float *usable)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    const long size = (long)height * width, pixel = (long)y * width + x0;
    const int last = MIN(width - x0, WIDTH) - 1;
    real noisy[C], fitted[C], finite = 1, square = 0;
    put(target, surface, own, pixel, last, noisy);
    put(light, surface, own, pixel, last, fitted);
    const real scale = (fitted[0] + fitted[1] + fitted[2]) / 3 + dark;
    const real counts = lanes_at(weight + (long)y * width, width, x0);
#pragma unroll
    for (int c = 0; c < C; ++c) {
        noisy[c] = (noisy[c] - fitted[c]) / scale;
        finite = 0 * noisy[c] == 0 ? finite : (real)0;
    }
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const real value = finite > 0 ? noisy[c] * counts : (real)0;
        const real above = 1 + fitted[c] / unit;
        square += value * value / 3;
        write_lanes(follow + c * size + pixel, width, x0, value);
        write_lanes(
            steer + c * size + pixel, width, x0, finite > 0 ? log_above_0(above) : (real)0);
    }
    write_lanes(follow + C * size + pixel, width, x0, square);
    write_lanes(usable + pixel, width, x0, finite);
}

// share: (h, w), how much of what is left is signal, on blocks. number, averages: as of `average` of
// edges.cl. Global size (w, h).
#define COUNTED(i) (x + (i) < right ? 1.0f : 0.0f)
kernel void shares(
    int width, int height, int w, int h, global const float *number, global const float *averages,
    global float *share)
{
    const int x0 = (int)get_global_id(0) * BLOCK, y0 = (int)get_global_id(1) * BLOCK;
    if (get_global_id(0) >= w || get_global_id(1) >= h) return;
    const long size = (long)height * width;
    const int right = MIN(x0 + BLOCK, width);
    real found = 0, sure = 0;
    for (int y = y0; y < MIN(y0 + BLOCK, height); ++y) {
        const long line = (long)y * width;
        for (int x = x0; x < right; x += WIDTH) {
            real signal = 0;
#pragma unroll
            for (int c = 0; c < C; ++c) {
                const real value = lanes_at(averages + c * size + line, width, x);
                signal += value * value / 3;
            }
            const real square = lanes_at(averages + C * size + line, width, x);
            const real others = lanes_at(number + line, width, x) - 1, counted = LANES(real, COUNTED);
            const real noise = MAX(square - signal, 0) / MAX(others, FEWEST);
            found += counted * signal;
            sure += counted * (signal - noise);
        }
    }
    const float all = lane_sum(found), part = lane_sum(sure);
    share[(long)get_global_id(1) * w + get_global_id(0)] = MAX(part, 0) / MAX(all, 1e-30f);
}

// Between the middles of blocks: the one before, and how far towards the next.
INLINE int before(int place, int count, float *towards)
{
    const float at = CLAMP((place + 0.5f) / BLOCK - 0.5f, 0, count - 1);
    const int first = MIN((int)at, MAX(count - 2, 0));
    *towards = at - first;
    return first;
}

// The picture, nowhere darker than what is its own. Global size (ceil(W / WIDTH), H).
kernel void composed(
    int width, int height, int w, int h, float dark, global const float *light,
    global const float *surface, global const float *own, global const float *averages,
    global const float *share, global float *output)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    const long size = (long)height * width, line = (long)y * width, pixel = line + x0;
    const int last = MIN(width - x0, WIDTH) - 1;
    float down, across[WIDTH], shares[WIDTH];
    const int row = before(y, h, &down), below = MIN(row + 1, h - 1);
    for (int i = 0; i < WIDTH; ++i) {
        const int column = before(MIN(x0 + i, width - 1), w, across + i);
        const int next = MIN(column + 1, w - 1);
        const float left = share[(long)row * w + column], right = share[(long)row * w + next];
        const float left_below = share[(long)below * w + column];
        const float right_below = share[(long)below * w + next];
        const float first = left + down * (left_below - left);
        const float second = right + down * (right_below - right);
        shares[i] = first + across[i] * (second - first);
    }
#define SHARE(i) shares[i]
    const real part = LANES(real, SHARE);
    real values[C];
    put(light, surface, own, pixel, last, values);
    const real scale = (values[0] + values[1] + values[2]) / 3 + dark;
#pragma unroll
    for (int c = 0; c < C; ++c) {
        const real least = guide_lanes(own + pixel * C, C, c, 0, last);
        values[c] += part * lanes_at(averages + c * size + line, width, x0) * scale;
        values[c] = NOT_BELOW(values[c], least);
    }
    write_pixels(output + pixel * C, values, 0, last);
}
