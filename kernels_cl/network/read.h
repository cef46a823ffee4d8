// SPDX-License-Identifier: Apache-2.0
// What the network reads of means (jflnr/network/features.py). Comes after vectors.h.
//
// Define: DARK, the share of the frame's mean below which light is as good as dark.

// Means that are taken: light, noisy light (3 each), the noisy one without what exceeds the denoised
// one four times, squared difference.
#define MEANS 8
#define POOLED 6

INLINE real luminance(const real *light)
{
    return 0.2126f * light[0] + 0.7152f * light[1] + 0.0722f * light[2];
}

INLINE real left(real after, real before)
{
    return log_above_0((after + 0.05f * before + DARK) / (1.05f * before + DARK));
}

// Writes POOLED channels, `pitch` apart. part: 1 over the pixels of a mean.
INLINE void write_means(const real *means, float part, int pitch, global float *to)
{
    const real light = luminance(means), noisy = luminance(means + 3);
#pragma unroll
    for (int c = 0; c < 3; ++c) WRITE(left(means[3 + c], means[c]), to + (long)c * pitch);
    WRITE(left(noisy, light), to + 3L * pitch);
    WRITE(left(means[6], light), to + 4L * pitch);
    const real dark = light + DARK;
    WRITE(0.5f * log_above_0(part * means[7] / (dark * dark) + 1e-3f), to + 5L * pitch);
}

// Of two neighbouring vectors those of even and of odd x.
#if WIDTH == 1
#define EVEN(a, b) (a)
#define ODD(a, b) (b)
#else
#define EVEN(a, b) ((real)((a).even, (b).even))
#define ODD(a, b) ((real)((a).odd, (b).odd))
#endif
