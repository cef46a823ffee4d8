// SPDX-License-Identifier: Apache-2.0
// Kernel 3: the normalised, regularised least squares of the Appendix (section 3.2), per block and
// from the blurred moments, each divided by moments[0]. See least_squares.h.
//
// A block without a single usable pixel in its window, or whose moments overflowed, gets the model 0.

#include "vectors.h"
#include "sizes.h"
#include "least_squares.h"

// One work-item per WIDTH blocks of a row: global size (pitch / WIDTH, h).
kernel void solve(
    int h, int pitch, float eps, float eps_prime, constant float *shift, global const float *moments,
    global float *model)
{
    if (get_global_id(0) * WIDTH >= pitch || get_global_id(1) >= h) return;
    const long plane = (long)h * pitch;
    const long block = (long)get_global_id(1) * pitch + get_global_id(0) * WIDTH;
    moments += block;
    model += block;
    real means[K], shifts[Q + 1], coefficients[(Q + 1) * C];
    real zero = 0;  // stays 0 unless a moment is not finite
    UNROLL
    for (int k = 0; k < K; ++k) {
        means[k] = READ(moments + k * plane);
        zero += 0 * means[k];
    }
    const mask filled = (means[0] > 1e-12f) & (zero == 0);
    const real per_pixel = filled ? 1 / means[0] : (real)0;
    UNROLL
    for (int k = 0; k < K; ++k) means[k] = filled ? means[k] * per_pixel : (real)0;
    UNROLL
    for (int q = 0; q < Q; ++q) shifts[q] = shift[q];
    least_squares(means, means + XY(0, 0), shifts, eps, eps_prime, 8 * FLT_EPSILON, coefficients);
    UNROLL
    for (int i = 0; i < (Q + 1) * C; ++i) WRITE(coefficients[i], model + i * plane);
}
