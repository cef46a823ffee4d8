// SPDX-License-Identifier: Apache-2.0
// BMFR, phase II: least squares in every block by augmented Householder QR (Koskela et al. 2019, 3.4).
//
//   [T + N, z] = Q R,   R_kk alpha = r,   T = 1, guides and squares scaled to [-1, 1] in the block
//
// N is uniform noise in [-noise, noise), z the light. A pixel without surface, or without light so far,
// is a row of N alone. The frame is mirrored at its borders. Q is never formed. One pass over the
// matrix per column: with v = a_k - pivot e_k, the products v . a_j follow from a_k . a_j, and those
// of the next column are summed while the matrix is updated.
//
// One work-group per block: WORKERS work-items share its pixels. The only kernels here with local
// memory and barriers; the order of every sum depends on WORKERS and WIDTH alone.
//
// Defines beside those of the headers: WORKERS, a power of two, the size of the work-group;
// SCRATCH_GLOBAL, if the matrix of M + C columns does not fit into local memory.

#include "vectors.h"
#include "sizes.h"
#include "images.h"
#include "bmfr/blocks.h"
#include "bmfr/pixels.h"
#include "bmfr/hash.h"

#define PIXELS (BLOCK * BLOCK)
#define COLUMNS (M + C)
#define FOR_PIXELS(p) for (int p = worker * WIDTH; p < PIXELS; p += WORKERS * WIDTH)

#ifdef SCRATCH_GLOBAL
#define SCRATCH global
#define FENCE (CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#else
#define SCRATCH local
#define FENCE CLK_LOCAL_MEM_FENCE
#endif
// Column j at the pixels p to p + WIDTH - 1, and one number of it.
#define A(j, p) (*(SCRATCH real *)(a + (j) * PIXELS + (p)))
#define ENTRY(j, p) a[(j) * PIXELS + (p)]

#if WORKERS > 1
#define MEET barrier(FENCE)
#else
#define MEET
#endif

// Sums, or the largest, of `count` values over the work-group, which gets them all.
INLINE void combine(float *values, int count, int sum, int worker, local float *partial)
{
#if WORKERS > 1
    for (int i = 0; i < count; ++i) partial[i * WORKERS + worker] = values[i];
    for (int half_of = WORKERS / 2; half_of > 0; half_of /= 2) {
        MEET;
        if (worker < half_of)
            for (int i = 0; i < count; ++i) {
                const float one = partial[i * WORKERS + worker];
                const float other = partial[i * WORKERS + worker + half_of];
                partial[i * WORKERS + worker] = sum ? one + other : MAX(one, other);
            }
    }
    MEET;
    for (int i = 0; i < count; ++i) values[i] = partial[i * WORKERS];
    MEET;
#endif
}

INLINE float lane_max(real v)
{
    float most = LANE(v, 0);
#pragma unroll
    for (int i = 1; i < WIDTH; ++i) most = MAX(most, LANE(v, i));
    return most;
}

// Halves of the lowest value of every scaled feature in the block, and of how far up it reaches.
typedef struct {
    float low[RANGES], spread[RANGES];
} Ranges;

// From -lowest and highest values of `count` features, those of each work-item, to the block's. What
// varies by no more than `least` is constant.
INLINE void find_ranges(
    const real *reach, int first, int count, float least, int worker, local float *partial,
    Ranges *ranges)
{
    float ends[2 * Q];
    for (int i = 0; i < 2 * count; ++i) ends[i] = lane_max(reach[i]);
    combine(ends, 2 * count, 0, worker, partial);
    for (int i = 0; i < count; ++i) {
        const float low = -ends[2 * i] / 2, high = ends[2 * i + 1] / 2;
        ranges->low[first + i] = low;
        ranges->spread[first + i] = high - low > least / 2 ? high - low : 0;
    }
}

// The guides as they are into columns 1 to Q, the light into the last ones; column 0 counts: 0 without
// a surface, 1 without light, 2.
INLINE void load(
    global const float *light, global const float *count, global const float *surface,
    GUIDE_PARAMETERS, int x0, int y0, int width, int height, int worker, local float *partial,
    SCRATCH float *a, Ranges *ranges)
{
    real reach[2 * Q];
#pragma unroll
    for (int i = 0; i < 2 * Q; ++i) reach[i] = -INFINITY;
    FOR_PIXELS(p) {
        const Pixels here = read_pixels(
            light, count, surface, GUIDE_IMAGES, x0 + p % BLOCK, y0 + p / BLOCK, width, height);
        A(0, p) = (here.there ? (real)1 : (real)0) + (here.used ? (real)1 : (real)0);
#pragma unroll
        for (int q = 0; q < Q; ++q) {
            const real x = here.x[q];
            A(1 + q, p) = x;
            reach[2 * q] = here.there ? MAX(reach[2 * q], -x) : reach[2 * q];
            reach[2 * q + 1] = here.there ? MAX(reach[2 * q + 1], x) : reach[2 * q + 1];
        }
#pragma unroll
        for (int c = 0; c < C; ++c) A(M + c, p) = here.used ? LESS * here.z[c] : (real)0;
    }
    find_ranges(reach, 0, Q, 0, worker, partial, ranges);
}

INLINE void range_of_squares(
    float flat, int worker, local float *partial, SCRATCH const float *a, Ranges *ranges)
{
    real reach[2 * SQUARES];
#pragma unroll
    for (int i = 0; i < 2 * SQUARES; ++i) reach[i] = -INFINITY;
    FOR_PIXELS(p) {
        const mask there = A(0, p) > 0;
#pragma unroll
        for (int i = 0; i < SQUARES; ++i) {
            const int q = Q - SQUARES + i;
            const real t = to_unit(A(1 + q, p), ranges->low[q], ranges->spread[q]);
            reach[2 * i] = there ? MAX(reach[2 * i], -t * t) : reach[2 * i];
            reach[2 * i + 1] = there ? MAX(reach[2 * i + 1], t * t) : reach[2 * i + 1];
        }
    }
    find_ranges(reach, Q, SQUARES, flat, worker, partial, ranges);
}

// [T + N, z], and a_0 . a_j of this work-item's pixels. counter: of the block's first number.
INLINE void scale_and_jitter(
    uint counter, uint number, float noise, const Ranges *ranges, int worker, SCRATCH float *a,
    real *products)
{
    const bits key = pcg((bits)(number));
#pragma unroll
    for (int j = 0; j < COLUMNS; ++j) products[j] = 0;
    FOR_PIXELS(p) {
        const mask used = A(0, p) > 1;
        const bits next = counter + M * ((uint)p + LANES(bits, LANE_NUMBER));
        real t[M];
        t[0] = 1;
#pragma unroll
        for (int q = 0; q < Q; ++q)
            t[1 + q] = to_unit(A(1 + q, p), ranges->low[q], ranges->spread[q]);
#pragma unroll
        for (int i = 0; i < SQUARES; ++i) {
            const real root = t[1 + Q - SQUARES + i];
            t[1 + Q + i] = to_unit(root * root, ranges->low[Q + i], ranges->spread[Q + i]);
        }
#pragma unroll
        for (int m = 0; m < M; ++m) {
            t[m] = (used ? t[m] : (real)0) + noise * uniform(next + m, key);
            A(m, p) = t[m];
            products[m] += t[0] * t[m];
        }
#pragma unroll
        for (int c = 0; c < C; ++c) products[M + c] += t[0] * A(M + c, p);
    }
}

// Reflects column k onto its first entry, all others with it, and writes row k of R. products: on entry
// a_k . a_j over the rows from k on, on return a_(k + 1) . a_j over those below.
INLINE void reflect(
    int k, int worker, local float *partial, SCRATCH float *a, real *products, local float *r)
{
    float dot[COLUMNS], along[COLUMNS];
#pragma unroll
    for (int j = k; j < COLUMNS; ++j) dot[j] = lane_sum(products[j]);
    combine(dot + k, COLUMNS - k, 1, worker, partial);
    const float first = ENTRY(k, k), norm = sqrt(dot[k]);
    const float pivot = first < 0 ? norm : -norm;
    // |v|^2 / 2, v = a_k - pivot e_k
    const float scale = 1 / MAX(dot[k] - first * pivot, 5e-31f);
#pragma unroll
    for (int j = k + 1; j < COLUMNS; ++j) {
        along[j] = (dot[j] - pivot * ENTRY(j, k)) * scale;
        if (worker == 0) r[k * COLUMNS + j] = ENTRY(j, k) - (first - pivot) * along[j];
    }
    if (worker == 0) r[k * COLUMNS + k] = pivot;
    if (k == M - 1) return;
    MEET;
    // Row k is done with: as zeros it leaves the sums alone.
    if (worker == k / WIDTH % WORKERS)
#pragma unroll
        for (int j = k; j < COLUMNS; ++j) ENTRY(j, k) = 0;
#pragma unroll
    for (int j = k + 1; j < COLUMNS; ++j) products[j] = 0;
    FOR_PIXELS(p) {
        const real v = A(k, p), next = A(k + 1, p) - v * along[k + 1];
        A(k + 1, p) = next;
        products[k + 1] += next * next;
#pragma unroll
        for (int j = k + 2; j < COLUMNS; ++j) {
            const real entry = A(j, p) - v * along[j];
            A(j, p) = entry;
            products[j] += next * entry;
        }
    }
}

// R alpha = r (Eq. 5), channel by channel. alpha: (M, C).
INLINE void substitute(int worker, local const float *r, global float *alpha)
{
    for (int c = worker; c < C; c += WORKERS) {
        float solved[M];
        for (int i = M - 1; i >= 0; --i) {
            float rest = r[i * COLUMNS + M + c];
            for (int j = i + 1; j < M; ++j) rest -= r[i * COLUMNS + j] * solved[j];
            solved[i] = rest / r[i * COLUMNS + i];
            alpha[i * C + c] = solved[i];
        }
    }
}

// Global size (WORKERS w, h), local size (WORKERS, 1). number: of the frame. light: (H, W, C), of
// `count` (H, W) samples. surface: (H, W), above 0 where there is one. scratch: (h, w, COLUMNS, PIXELS).
// flat: squares that vary by no more are constant. reached: (h, w, RANGES, 2), see blocks.h. alpha:
// (h, w, M, C).
kernel __attribute__((reqd_work_group_size(WORKERS, 1, 1))) void fit(
    int width, int height, uint number, int offset_x, int offset_y, float noise, float flat,
    global const float *light, global const float *count, global const float *surface,
    GUIDE_PARAMETERS,
#ifdef SCRATCH_GLOBAL
    global float *scratch,
#endif
    global float *reached, global float *alpha)
{
    local float partial[COLUMNS * WORKERS], r[M * COLUMNS];
    const int bx = get_group_id(0), by = get_group_id(1), worker = get_local_id(0);
    const long block = (long)by * get_num_groups(0) + bx;
#ifdef SCRATCH_GLOBAL
    SCRATCH float *a = scratch + block * COLUMNS * PIXELS;
#else
    local float a[COLUMNS * PIXELS] __attribute__((aligned(64)));
#endif
    Ranges ranges;
    load(
        light, count, surface, GUIDE_IMAGES, bx * BLOCK - offset_x, by * BLOCK - offset_y, width,
        height, worker, partial, a, &ranges);
    range_of_squares(flat, worker, partial, a, &ranges);

    real products[COLUMNS];
    const uint across = (width + BLOCK - 1) / BLOCK + 1;
    const uint counter = (by * across + bx) * (PIXELS * M);
    scale_and_jitter(counter, number, noise, &ranges, worker, a, products);
#pragma unroll
    for (int k = 0; k < M; ++k) reflect(k, worker, partial, a, products, r);
    MEET;
    substitute(worker, r, alpha + block * M * C);
    if (worker == 0)
#pragma unroll
        for (int i = 0; i < RANGES; ++i) {
            reached[block * ONE_BLOCK + 2 * i] = ranges.low[i];
            reached[block * ONE_BLOCK + 2 * i + 1] = ranges.spread[i];
        }
}
