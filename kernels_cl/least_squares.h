// SPDX-License-Identifier: Apache-2.0
// The normalised, regularised least squares of the Appendix, for WIDTH blocks at a time. Comes after
// sizes.h. Define G, the number of guides, if it is not Q.
//
//   W = cov(X, X) + eps (mu mu^T + diag(mu^2)) + eps' I                         (Eq. 18)
//   S = diag(W)^-1/2,   R = S W S + eps' I                                      (Eq. 19-22)
//   slopes = S R^-1 S cov(X, Y),   value = mean(Y) - slopes . mean(X - shift)
//
// mu is the mean of X itself; the covariance does not depend on the shift. R is solved by Cholesky
// in private memory. A guide that the earlier ones explain up to rounding gets slope 0.

#ifndef G
#define G Q
#endif

// Unrolled, the matrices live in registers; large ones would only take long to compile. There the sums
// of all channels go side by side, since each waits for its last term.
#define EACH(c) _Pragma("unroll") for (int c = 0; c < C; ++c)
#define RANGE(k, first, end) UNROLL for (int k = first; k < end; ++k)
#if G <= 8
#define UNROLL _Pragma("unroll")
#define SUMS(c, k, first, end) EACH(c) RANGE(k, first, end)
#else
#define UNROLL _Pragma("unroll 1")
#define SUMS(c, k, first, end) RANGE(k, first, end) EACH(c)
#endif
#define LOWER(i, j) ((i) * ((i) + 1) / 2 + (j))

// xx, xy: means of [1, X - shift] [1, X - shift]^T (lower triangle) and [1, X - shift] Y^T (row by
// row). rounding: relative error of a second moment, of which no more of a variance is known. model: the
// G + 1 rows of C coefficients are written.
INLINE void least_squares(
    const real *xx, const real *xy, const real *shift, real eps, real eps_prime, float rounding,
    real *model)
{
    // Row by row: W, scaled to R, then factored in place, R = L L^T; b becomes L^-1 S cov(X, Y).
    real scale[G + 1], l[LOWER(G, 0) + 1], inverse_diagonal[G + 1], b[G * C + 1], value[C];
    EACH(c) value[c] = xy[c];
    UNROLL
    for (int i = 0; i < G; ++i) {
        const real mean = xx[XX(i + 1, 0)], mu = mean + shift[i];
        // Rounding can leave a flat guide's variance just below zero.
        const real variance = MAX(xx[XX(i + 1, i + 1)] - mean * mean, 0);
        const real ridge = 2 * eps * mu * mu + eps_prime + rounding * (variance + mean * mean);
        scale[i] = rsqrt(variance + ridge);
        real pivot = 1 + eps_prime;
        UNROLL
        for (int j = 0; j < i; ++j) {
            const real mean_j = xx[XX(j + 1, 0)];
            const real covariance = xx[XX(i + 1, j + 1)] - mean * mean_j;
            real entry = (covariance + eps * mu * (mean_j + shift[j])) * scale[i] * scale[j];
            UNROLL
            for (int k = 0; k < j; ++k) entry -= l[LOWER(i, k)] * l[LOWER(j, k)];
            entry *= inverse_diagonal[j];
            l[LOWER(i, j)] = entry;
            pivot -= entry * entry;
        }
        inverse_diagonal[i] = pivot > 8 * FLT_EPSILON ? rsqrt(pivot) : (real)0;
        real row[C];
        EACH(c) row[c] = (xy[(i + 1) * C + c] - mean * xy[c]) * scale[i];
        SUMS(c, k, 0, i) row[c] -= l[LOWER(i, k)] * b[k * C + c];
        EACH(c) b[i * C + c] = row[c] * inverse_diagonal[i];
    }
    UNROLL
    for (int i = G - 1; i >= 0; --i) {
        real row[C];
        EACH(c) row[c] = b[i * C + c];
        SUMS(c, k, i + 1, G) row[c] -= l[LOWER(k, i)] * b[k * C + c];
        EACH(c)
        {
            b[i * C + c] = row[c] * inverse_diagonal[i];
            const real slope = b[i * C + c] * scale[i];
            value[c] -= xx[XX(i + 1, 0)] * slope;
            model[(i + 1) * C + c] = slope;
        }
    }
    EACH(c) model[c] = value[c];
}
