// SPDX-License-Identifier: Apache-2.0
// A guide with noise of its own (ambient occlusion from few rays) averaged over 3 x 3 pixels of the
// same surface: along rows, then along columns.
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

INLINE void read_all(GUIDE_PARAMETERS, long pixel, int first, int last, real *values)
{
#pragma unroll
    for (int q = 0; q < Q; ++q)
        values[q] = first == 0 && last == WIDTH - 1
                        ? read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1)
                        : read_guide(GUIDE_IMAGES, q, pixel, first, last);
}

// Both kernels: global size (ceil(W / WIDTH), H). rows, smooth: (H, W).
kernel void smooth_rows(
    int width, int height, float per_normal, float depth_share, GUIDE_PARAMETERS, global float *rows)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    const long pixel = (long)y * width + x0;
    const int last = MIN(width - x0, WIDTH) - 1;
    real here[Q], before[Q], after[Q], change = 0, weights = 1;
    read_all(GUIDE_IMAGES, pixel, 0, last, here);
    read_all(GUIDE_IMAGES, pixel - 1, x0 == 0, last, before);
    read_all(GUIDE_IMAGES, pixel + 1, 0, MIN(width - 2 - x0, WIDTH - 1), after);
    add(before[NOISY] - here[NOISY],
        likeness(here, before, per_normal, depth_share) * LANES(real, BEFORE), &change, &weights);
    add(after[NOISY] - here[NOISY],
        likeness(here, after, per_normal, depth_share) * LANES(real, AFTER), &change, &weights);
    const real smooth = here[NOISY] + change / weights;
#define WRITE_ROWS(i) ((i) > last ? 0 : (rows[pixel + (i)] = LANE(smooth, i), 0))
    if (last == WIDTH - 1)
        WRITE(smooth, rows + pixel);
    else
        (void)LANES(mask, WRITE_ROWS);
}

kernel void smooth_columns(
    int width, int height, float per_normal, float depth_share, GUIDE_PARAMETERS,
    global const float *rows, global float *smooth)
{
    const int x0 = (int)get_global_id(0) * WIDTH, y = get_global_id(1);
    if (x0 >= width || y >= height) return;
    const long pixel = (long)y * width + x0;
    const int last = MIN(width - x0, WIDTH) - 1;
#define ROW_LANES(i) at[MIN(i, last)]
    real here[Q], change = 0, weights = 1;
    read_all(GUIDE_IMAGES, pixel, 0, last, here);
    global const float *at = rows + pixel;
    const real own = last == WIDTH - 1 ? READ(at) : LANES(real, ROW_LANES);
    for (int row = MAX(y - 1, 0); row <= MIN(y + 1, height - 1); ++row) {
        if (row == y) continue;
        real other[Q];
        const long moved = (long)(row - y) * width;
        at = rows + pixel + moved;
        read_all(GUIDE_IMAGES, pixel + moved, 0, last, other);
        const real noisy = last == WIDTH - 1 ? READ(at) : LANES(real, ROW_LANES);
        add(noisy - own, likeness(here, other, per_normal, depth_share), &change, &weights);
    }
    const real result = own + change / weights;
#define WRITE_SMOOTH(i) ((i) > last ? 0 : (smooth[pixel + (i)] = LANE(result, i), 0))
    if (last == WIDTH - 1)
        WRITE(result, smooth + pixel);
    else
        (void)LANES(mask, WRITE_SMOOTH);
}
