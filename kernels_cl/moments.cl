// Kernel 1: outer products of [1, X, Y], averaged over blocks (section 3.2).
//
//   moments[k] = 1/BLOCK^2  sum over the pixels p of the block  weight(p) u_k(p) v_k(p)
//
// u_k v_k being the k-th product of [1, X - shift, Y] (see sizes.h). A pixel with any value that
// is not finite is left out, and so is one whose weight is not above 0. Blocks may hang over the
// border; moments[0] then says how much of the block there was.
//
// Defines beside those of the headers: BLOCK, side of a block in pixels; WEIGHTED, if there is an
// image of weights.

#include "vectors.h"
#include "sizes.h"
#include "images.h"

#if !defined(BLOCK) || BLOCK < 1
#error "BLOCK, the side of a block in pixels, must be at least 1"
#endif

#ifdef MASKED
typedef uchar weight_t;
#define WEIGHT_AT(i) (weight[pixel + MIN(i, last)] ? 1.0f : 0.0f)
#else
typedef float weight_t;
#define WEIGHT_AT(i) weight[pixel + MIN(i, last)]
#endif
#define INSIDE(i) ((i) <= last ? 1.0f : 0.0f)

// One work-item per block: global size (pitch, h). Every pixel is read once.
kernel void moments(
    int width, int height, int h, int pitch, global const target_t *target, GUIDE_PARAMETERS,
    global const weight_t *weight, constant float *shift, global float *moments)
{
    const int bx = get_global_id(0), by = get_global_id(1);
    if (bx >= pitch || by >= h) return;

    real sums[K];
#pragma unroll
    for (int k = 0; k < K; ++k) sums[k] = 0;

    const int top = by * BLOCK, bottom = MIN(top + BLOCK, height);
    const int left = bx * BLOCK, right = MIN(left + BLOCK, width);
    for (int y = top; y < bottom; ++y) {
        for (int x0 = left; x0 < left + BLOCK; x0 += WIDTH) {
            const long pixel = (long)y * width + x0;
            real one, x[Q + 1], y_[C];
            if (x0 + WIDTH <= right) {
                one = 1;
                EXPECT(target, (pixel + AHEAD) * C);
                EXPECT(guides_0, (pixel + AHEAD) * PART_0);
                EXPECT(guides_1, (pixel + AHEAD) * PART_1);
                EXPECT(guides_2, (pixel + AHEAD) * PART_2);
#pragma unroll
                for (int q = 0; q < Q; ++q) x[q] = read_guide(GUIDE_IMAGES, q, pixel, 0, WIDTH - 1);
#pragma unroll
                for (int c = 0; c < C; ++c)
                    y_[c] = target_lanes(target + pixel * C, C, c, 0, WIDTH - 1);
            } else {
                const int last = right - 1 - x0;
                one = LANES(real, INSIDE);
#pragma unroll
                for (int q = 0; q < Q; ++q) x[q] = read_guide(GUIDE_IMAGES, q, pixel, 0, last);
#pragma unroll
                for (int c = 0; c < C; ++c) y_[c] = target_lanes(target + pixel * C, C, c, 0, last);
            }
            real zero = 0;  // stays 0 unless a value is not finite: 0 Inf and 0 NaN are NaN
#pragma unroll
            for (int q = 0; q < Q; ++q) zero += 0 * x[q];
#pragma unroll
            for (int c = 0; c < C; ++c) zero += 0 * y_[c];
#ifdef WEIGHTED
            const int last = MIN(right - x0, WIDTH) - 1;
            const real w = LANES(real, WEIGHT_AT);
            zero += 0 * w;
            one = w > 0 ? w * one : (real)0;
#endif
            one = zero == 0 ? one : (real)0;
#pragma unroll
            for (int q = 0; q < Q; ++q) x[q] = one > 0 ? from_shift(x[q], shift[q]) : (real)0;
            // Divided before they are summed: radiance near the largest float must not overflow.
#pragma unroll
            for (int c = 0; c < C; ++c) y_[c] = one > 0 ? y_[c] * (1.0f / (BLOCK * BLOCK)) : (real)0;

#ifdef WEIGHTED
#define WEIGHTED_BY_ONE(v) (one * (v))
#else
#define WEIGHTED_BY_ONE(v) (v)
#endif
            sums[0] += one;
#pragma unroll
            for (int c = 0; c < C; ++c) sums[XY(0, c)] += WEIGHTED_BY_ONE(y_[c]);
#pragma unroll
            for (int i = 0; i < Q; ++i) {
                const real u = WEIGHTED_BY_ONE(x[i]);
                sums[XX(i + 1, 0)] += u;
#pragma unroll
                for (int j = 0; j <= i; ++j) sums[XX(i + 1, j + 1)] += u * x[j];
#pragma unroll
                for (int c = 0; c < C; ++c) sums[XY(i + 1, c)] += u * y_[c];
            }
        }
    }
#pragma unroll
    for (int k = 0; k < K; ++k)
        moments[((long)k * h + by) * pitch + bx] =
            lane_sum(sums[k]) * (k < XY(0, 0) ? 1.0f / (BLOCK * BLOCK) : 1);
}

// The typical values `shift` about which the moments are taken, since in float the variance of a
// guide far from zero would drown in the square of its mean: the mean over every step_y-th row and
// step_x-th column, of what is there and less than FARTHEST. Any other value gives the same model.

// One work-item per sampled row: sum and count of each guide go to partial (rows, Q, 2).
kernel void centre_rows(
    int width, int rows, int step_x, int step_y, GUIDE_PARAMETERS, global const weight_t *weight,
    global float *partial)
{
    const int row = get_global_id(0);
    if (row >= rows) return;
    for (int q = 0; q < Q; ++q) {
        float sum = 0, count = 0;
        for (int x = 0; x < width; x += step_x) {
            const long pixel = (long)row * step_y * width + x;
            const float value = guide_value(GUIDE_IMAGES, q, pixel);
            int counts = value < FARTHEST && value > -FARTHEST;
#ifdef WEIGHTED
            counts = counts && weight[pixel] > 0;
#endif
            sum += counts ? value : 0;
            count += counts;
        }
        partial[(row * Q + q) * 2] = sum;
        partial[(row * Q + q) * 2 + 1] = count;
    }
}

// One work-item per guide.
kernel void centre(int rows, global const float *partial, global float *shift)
{
    const int q = get_global_id(0);
    if (q >= Q) return;
    float sum = 0, count = 0;
    for (int row = 0; row < rows; ++row) {
        sum += partial[(row * Q + q) * 2];
        count += partial[(row * Q + q) * 2 + 1];
    }
    shift[q] = sum / MAX(count, 1);
}
