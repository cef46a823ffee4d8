// SPDX-License-Identifier: Apache-2.0
// A guide with noise of its own (ambient occlusion from few rays) averaged over 3 x 3 pixels of the
// same surface: along rows, then along columns, in one pass down the image.
//
//   likeness of neighbours p and q = exp(-(|normal_p - normal_q|^2 / N^2 + step^2) / 2)
//   step = (depth_p - depth_q) / (D min(depth_p, depth_q) + 1e-6)
//
// Neighbours with a value that is not finite do not count.
//
// Defines: those of images.h, for the guides normal (3), depth (1) and the one to smooth (1).

#include "vectors.h"
#include "sizes.h"
#include "images.h"

#define DEPTH 3
#define NOISY 4

INLINE real likeness(const real *a, const real *b, float per_normal, float depth_share)
{
    real turn = 0;
#pragma unroll
    for (int i = 0; i < DEPTH; ++i) turn += (a[i] - b[i]) * (a[i] - b[i]);
    const real nearer = MIN(a[DEPTH], b[DEPTH]);
    const real step = (a[DEPTH] - b[DEPTH]) / (depth_share * nearer + 1e-6f);
    return exp_below_0(-0.5f * (turn * per_normal * per_normal + step * step));
}

// Adds a neighbour's part to the change and to the sum of weights.
INLINE void add(real difference, real weight, real *change, real *weights)
{
    const real part = difference * weight;
    *change += 0 * part == 0 ? part : (real)0;
    *weights += weight;
}

#define BEFORE(i) (x0 + (i) > 0 ? 1.0f : 0.0f)
#define AFTER(i) (x0 + (i) < width - 1 ? 1.0f : 0.0f)

INLINE void read_all(GUIDE_PARAMETERS, long pixel, int last, real *values)
{
#pragma unroll
    for (int q = 0; q < Q; ++q)
        values[q] = last == WIDTH - 1 ? read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1)
                                      : read_guide(GUIDE_IMAGES, q, pixel, 0, last);
}

// The mean of WIDTH pixels along their row. Where there is no neighbour it weighs nothing.
#define ONE_BEFORE(i) ((i) == 0 ? left : LANE(here[q], (i) - 1))
#define ONE_AFTER(i) ((i) == WIDTH - 1 ? right : LANE(here[q], (i) + 1))
INLINE real along_row(
    GUIDE_PARAMETERS, const real *here, int x0, long pixel, int width, float per_normal,
    float depth_share)
{
    real before[Q], after[Q], change = 0, weights = 1;
    const int ends = x0 + WIDTH >= width;
#pragma unroll
    for (int q = 0; q < Q; ++q) {
        const float left = guide_value(GUIDE_IMAGES, q, pixel - (x0 > 0 ? 1 : 0));
        const float right = guide_value(GUIDE_IMAGES, q, pixel + (ends ? 0 : WIDTH));
        before[q] = LANES(real, ONE_BEFORE);
        after[q] = LANES(real, ONE_AFTER);
    }
    add(before[NOISY] - here[NOISY],
        likeness(here, before, per_normal, depth_share) * LANES(real, BEFORE), &change, &weights);
    add(after[NOISY] - here[NOISY],
        likeness(here, after, per_normal, depth_share) * LANES(real, AFTER), &change, &weights);
    return here[NOISY] + change / weights;
}

// Goes down `tall` rows, each read once. smooth: (H, W). Global size (ceil(W / WIDTH), ceil(H / tall)).
kernel void smooth(
    int width, int height, int tall, float per_normal, float depth_share, GUIDE_PARAMETERS,
    global float *smooth)
{
    const int x0 = (int)get_global_id(0) * WIDTH, top = (int)get_global_id(1) * tall;
    if (x0 >= width || top >= height) return;
    const int last = MIN(width - x0, WIDTH) - 1, bottom = MIN(top + tall, height);
    real above[Q], two_above = 0, one_above = 0, like_above = 0;
    for (int y = MAX(top - 1, 0); y <= bottom; ++y) {
        real here[Q], own = 0, like = 0;
        const long pixel = (long)y * width + x0;
        if (y < height) {
            read_all(GUIDE_IMAGES, pixel, last, here);
            own = along_row(GUIDE_IMAGES, here, x0, pixel, width, per_normal, depth_share);
            if (y > 0 && y >= top) like = likeness(above, here, per_normal, depth_share);
        }
        if (y > top) {
            real change = 0, weights = 1;
            add(two_above - one_above, like_above, &change, &weights);
            add(own - one_above, like, &change, &weights);
            const real result = one_above + change / weights;
#define WRITE_SMOOTH(i) ((i) > last ? 0 : (smooth[pixel - width + (i)] = LANE(result, i), 0))
            if (last == WIDTH - 1)
                WRITE(result, smooth + pixel - width);
            else
                (void)LANES(mask, WRITE_SMOOTH);
        }
#pragma unroll
        for (int q = 0; q < Q; ++q) above[q] = here[q];
        two_above = one_above;
        one_above = own;
        like_above = like;
    }
}
