// An average that follows the light, with one more frame in it: host side in jflnr/opencl/temporal.py,
// twin in jflnr/temporal/accumulate.py.

#include "vectors.h"
#include "sizes.h"
#include "images.h"

#define OWN(image, c) target_lanes((image) + pixel * 3, 3, c, 0, WIDTH - 1)

// Global size (ceil(pixels / WIDTH)); pixels is at least WIDTH. before, signal, image, mean: (pixels, 3).
// before_samples, noise, surface, samples: (pixels). signal: in units. least: of a new frame. weight:
// (pixels), the samples times surface, where that is above 0, else 0.
kernel void accumulate(
    int pixels, float least, global const float *unit, global const float *before,
    global const float *before_samples, global const float *signal, global const float *noise,
    global const float *image, global const float *surface, global float *mean,
    global float *samples, global float *weight)
{
    if ((long)get_global_id(0) * WIDTH >= pixels) return;
    const long pixel = MIN((long)get_global_id(0) * WIDTH, (long)pixels - WIDTH);
    const real old = READ(before_samples + pixel);
    const real n = old / (1 + READ(noise + pixel) * old), equal = 1 / (n + 1);
    const real share = MAX(equal, least);
    real own[3], mixed[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) own[c] = OWN(image, c);
    const mask good = 0 * own[0] + 0 * own[1] + 0 * own[2] == 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const real kept = OWN(before, c) + unit[0] * OWN(signal, c);
        mixed[c] = n > 0 ? kept : (real)0;
        mixed[c] += good ? share * (own[c] - mixed[c]) : (real)0;
    }
    const real divisor = n > 0 ? n : (real)1;
    const real kept = n > 0 ? (1 - share) * (1 - share) / divisor : (real)0;
    const real count = good ? 1 / (kept + share * share) : n;
    write_pixels(mean + pixel * 3, mixed, 0, WIDTH - 1);
    WRITE(count, samples + pixel);
    const real counts = READ(surface + pixel);
    WRITE(counts > 0 ? count * counts : (real)0, weight + pixel);
}
