// SPDX-License-Identifier: Apache-2.0
// Averages of the previous frame where its pixels are now: host side in jflnr/opencl/temporal.py, twin
// in jflnr/temporal/reproject.py.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "bmfr/taps.h"
#include "temporal/surface.h"

// What an average holds there: its mean and its number of samples, less for the `noise`
// that it takes on.
INLINE real move(
    global const float *mean, global const float *samples, const Taps *taps, real noise, long pixel,
    global float *moved_mean, global float *moved_samples, real *found)
{
#pragma unroll
    for (int c = 0; c < 3; ++c) found[c] = gather(mean, 3, c, taps);
    write_pixels(moved_mean + pixel * 3, found, 0, WIDTH - 1);
    const real before = gather(samples, 1, 0, taps), count = before / (1 + noise * before);
    WRITE(count, moved_samples + pixel);
    return count;
}

// Squared length of the change of an image (H, W, 3).
INLINE real change(
    global const float *now, global const float *before, const Taps *taps, long pixel)
{
    real sum = 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const real part = OWN(now, 3, c) - gather(before, 3, c, taps);
        sum += part * part;
    }
    return sum;
}

// Twin of `own_turn` in jflnr/temporal/reproject.py. Without a tap it may be anything.
INLINE real own_turn(const Taps *taps, long pixel, int width, SURFACE_PARAMETERS)
{
    real turn = change(normal, before_normal, taps, pixel);
#ifndef DEPTHS
    const real one = READ(depth + pixel) / width, gone = change(position, before_position, taps, pixel);
    turn *= CLAMP(4 * gone / (one * one) - 1, (real)0, (real)3) / 3;
#endif
    return 0 * turn == 0 ? MIN(turn, (real)4) : (real)0;
}

// Global size (W / WIDTH, H). Guides (H, W, Q), averaged with the light; means, normals and positions
// (H, W, 3), motion (H, W, 2), all others (H, W). surface: above 0 where samples count. expected:
// brightness of the image there. known: 1 where samples count and there is a history, else 0. turned,
// image_turned: noise that the averages take on by the square of a turn.
kernel void reproject(
    int width, int height, SURFACE_PARAMETERS, float turned, float image_turned,
    global const float *surface, global const float *light, global const float *light_samples,
    global const float *guides, global const float *image, global const float *image_samples,
    global float *moved_light, global float *moved_light_samples, global float *moved_guides,
    global float *moved_image, global float *moved_image_samples, global float *expected,
    global float *known)
{
    const int x = FIRST_PIXEL(width), y = get_global_id(1);
    if ((int)get_global_id(0) * WIDTH >= width || y >= height) return;
    const long pixel = (long)y * width + x;
    Taps taps = surface_taps(x, y, width, height, SURFACES);
    normalise(&taps);

    const real turn = own_turn(&taps, pixel, width, SURFACES);
    real found[3], brightness = 0;
    const real count = move(
        light, light_samples, &taps, turned * turn, pixel, moved_light, moved_light_samples, found);
    move(
        image, image_samples, &taps, image_turned * turn, pixel, moved_image, moved_image_samples,
        found);
#if Q > 0
    real mean[Q];
#pragma unroll
    for (int q = 0; q < Q; ++q) mean[q] = gather(guides, Q, q, &taps);
    write_guides(moved_guides + pixel * Q, mean);
#endif
#pragma unroll
    for (int c = 0; c < 3; ++c) brightness += BRIGHTNESS(c) * found[c];
    WRITE(brightness, expected + pixel);
    const mask counts = (count > 0) & (READ(surface + pixel) > 0);
    WRITE(counts ? (real)1 : (real)0, known + pixel);
}
