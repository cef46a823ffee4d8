// Kernel 3: the normalised, regularised least squares of the Appendix (section 3.2).
//
// Per block, from the blurred moments of X - shift, each divided by moments[0]:
//   W = cov(X, X) + eps (mu mu^T + diag(mu^2)) + eps' I                         (Eq. 18)
//   S = diag(W)^-1/2,   R = S W S + eps' I                                      (Eq. 19-22)
//   slopes = S R^-1 S cov(X, Y),   value = mean(Y) - slopes . mean(X - shift)
//
// mu is the mean of X itself; the covariance does not depend on the shift. R is solved by Cholesky
// in private memory. A block without a single usable pixel in its window, or whose moments overflowed,
// gets the model 0; a guide that the earlier ones explain up to rounding gets slope 0.

#include "vectors.h"
#include "sizes.h"

// Unrolled, the matrices live in registers; large ones would only take long to compile.
#if Q <= 8
#define UNROLL _Pragma("unroll")
#else
#define UNROLL
#endif
#define LOWER(i, j) ((i) * ((i) + 1) / 2 + (j))

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
    const real n = READ(moments);
    real zero = 0;  // stays 0 unless a moment is not finite
    for (int k = 0; k < K; ++k) zero += 0 * READ(moments + k * plane);
    const mask filled = (n > 1e-12f) & (zero == 0);
    const real per_pixel = filled ? 1 / n : (real)0;
#define MOMENT(k) (filled ? READ(moments + (k) * plane) * per_pixel : (real)0)

    // Row by row: W, scaled to R, then factored in place, R = L L^T; b becomes L^-1 S cov(X, Y).
    real mean[Q + 1], scale[Q + 1], l[LOWER(Q, 0) + 1], inverse_diagonal[Q + 1], b[Q * C + 1];
    real mean_y[C];
    UNROLL
    for (int c = 0; c < C; ++c) mean_y[c] = MOMENT(XY(0, c));
    UNROLL
    for (int i = 0; i < Q; ++i) {
        mean[i] = MOMENT(XX(i + 1, 0));
        const real mu = mean[i] + shift[i];
        // Rounding can leave a flat guide's variance just below zero.
        const real variance = MOMENT(XX(i + 1, i + 1)) - mean[i] * mean[i];
        scale[i] = rsqrt((variance > 0 ? variance : (real)0) + 2 * eps * mu * mu + eps_prime);
        real pivot = 1 + eps_prime;
        UNROLL
        for (int j = 0; j < i; ++j) {
            const real covariance = MOMENT(XX(i + 1, j + 1)) - mean[i] * mean[j];
            real entry = (covariance + eps * mu * (mean[j] + shift[j])) * scale[i] * scale[j];
            UNROLL
            for (int k = 0; k < j; ++k) entry -= l[LOWER(i, k)] * l[LOWER(j, k)];
            entry *= inverse_diagonal[j];
            l[LOWER(i, j)] = entry;
            pivot -= entry * entry;
        }
        inverse_diagonal[i] = pivot > 8 * FLT_EPSILON ? rsqrt(pivot) : (real)0;
        UNROLL
        for (int c = 0; c < C; ++c) {
            real entry = (MOMENT(XY(i + 1, c)) - mean[i] * mean_y[c]) * scale[i];
            UNROLL
            for (int k = 0; k < i; ++k) entry -= l[LOWER(i, k)] * b[k * C + c];
            b[i * C + c] = entry * inverse_diagonal[i];
        }
    }
    UNROLL
    for (int i = Q - 1; i >= 0; --i) {
        UNROLL
        for (int c = 0; c < C; ++c) {
            real entry = b[i * C + c];
            UNROLL
            for (int k = i + 1; k < Q; ++k) entry -= l[LOWER(k, i)] * b[k * C + c];
            b[i * C + c] = entry * inverse_diagonal[i];
            const real slope = b[i * C + c] * scale[i];
            mean_y[c] -= mean[i] * slope;
            WRITE(slope, model + ((i + 1) * C + c) * plane);
        }
    }
    UNROLL
    for (int c = 0; c < C; ++c) WRITE(mean_y[c], model + c * plane);
}
